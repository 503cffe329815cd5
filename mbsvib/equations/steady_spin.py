"""Conditions for constant equations of spinning bodies: joints allow the spin, and all parts are axisymmetric."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.elements import Body, Joint
from mbsvib.elements.connection import Connection
from mbsvib.elements.families import connection_rows
from mbsvib.elements.rows import ElementRows
from mbsvib.equations.inertia import inertia_tensor
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import exponential
from mbsvib.mechanism.mechanism import Mechanism

Fields = Mapping[str, Mapping[str, Array]]

# Inertia tensors and axes are printed with six or seven digits.
SLACK = 1e-6
# Angle [rad] of the test for symmetry: it is no fraction of a full turn, so that no discrete symmetry passes.
TURN = 1.0
# Without fields that vary.
NONE: Any = MappingProxyType({})
ORIGIN = (0.0, 0.0, 0.0)


def rows_at_point(spring: Connection) -> tuple[Array, ElementRows]:
    """Return the rows of an element on two bodies, and these as wrenches (6, rows) at its point, world axes."""
    result = connection_rows([spring], {spring.first: 0, spring.second: 1})
    rows = result.rows
    arm = rows.point - np.array(point_of(spring))[:, None]
    return np.concatenate((rows.force, rows.moment + np.cross(arm, rows.force, axis=0))), result


def point_of(spring: Connection) -> Vector:
    """Return the point of an element on its second body [m]; the origin if it has none."""
    return (ORIGIN, *spring.points)[-1]


def spin_velocities(model: Mechanism, fields: Fields = NONE) -> dict[str, Array]:
    """Return the angular velocities (..., 3) of the bodies that themselves spin, by name.

    ``fields`` has the values of variants by part and name, where they differ from those of the model.
    """
    result: dict[str, Array] = {}
    for rotor in model.rotors.values():
        if rotor.inertia is None:
            if rotor.body in result:
                raise ModelError(f"rotor '{rotor.name}': body '{rotor.body}' spins already; add the speeds up, or give "
                                 f"the inertia of the part that spins on it.",
                                 element=rotor.name, field="body")  # fmt: skip
            result[rotor.body] = np.multiply.outer(fields.get(rotor.name, NONE).get("speed", rotor.speed), rotor.axis)
    return result


def spin_together(model: Mechanism, spins: Mapping[str, Array], first: str, second: str) -> bool:
    """Return whether two bodies spin at the same speed about the same line, in all variants."""
    if first not in spins or second not in spins:
        return False
    a, b = spins[first], spins[second]
    distance = np.array(model.bodies[second].position) - np.array(model.bodies[first].position)
    size = SLACK * np.linalg.norm(a, axis=-1)
    return bool((np.linalg.norm(a - b, axis=-1) <= size).all()
                and (np.linalg.norm(np.cross(a, distance), axis=-1) <= size * np.linalg.norm(distance)).all())


def check_steady(model: Mechanism, bodies: Sequence[Body], elements: Sequence[Connection]) -> None:
    """Refuse spins that are not steady, by the names of the rotor and of the part that prevents it.

    ``bodies`` and ``elements`` are those of the expanded mechanism.
    """
    spins = spin_velocities(model)
    rotor_of = {rotor.body: rotor.name for rotor in model.rotors.values() if rotor.inertia is None}
    body_of = {body.name: body for body in bodies}
    for rotor in model.rotors.values():
        body = body_of[rotor.body]
        if rotor.inertia is None:
            if not any(body.inertia):
                raise ModelError(f"rotor '{rotor.name}': body '{body.name}' has no inertia that could spin; give the "
                                 f"rotor or the body one.", element=rotor.name, field="inertia")  # fmt: skip
            _check_symmetric(rotor.name, body, np.array(rotor.axis))
        elif body.name in spins and np.linalg.norm(np.cross(rotor.axis, spins[body.name])) > SLACK * np.linalg.norm(
            spins[body.name]
        ):
            raise ModelError(f"rotor '{rotor.name}' spins about an axis that moves, as body '{body.name}' spins about "
                             f"another one (rotor '{rotor_of[body.name]}'); only fixed axes are supported.",
                             element=rotor.name, field="axis")  # fmt: skip
    if not any(spin.any() for spin in spins.values()):
        return
    for joint in model.joints.values():
        _check_joint(joint, body_of, spins, rotor_of)
    for spring in elements:
        if spring.first in spins or spring.second in spins:
            _check_spring(model, spring, body_of, spins, rotor_of)


def _check_symmetric(name: str, body: Body, axis: Array) -> None:
    """Refuse a spinning body that is not axisymmetric."""
    inertia = inertia_tensor(body)
    projection = np.eye(3) - np.outer(axis, axis)
    transverse = projection @ inertia @ projection
    mean = 0.5 * np.trace(transverse)
    off = max(float(np.abs(projection @ inertia @ axis).max()), float(np.abs(transverse - mean * projection).max()))
    if off > SLACK * float(np.abs(inertia).max()):
        raise ModelError(f"rotor '{name}': body '{body.name}' spins, and its inertia is not symmetric about the axis "
                         f"(off by {off:.3g} kg m^2); its inertia in axes that do not spin would vary with time. "
                         f"Check axis and tensor, or give the inertia of the part that spins.",
                         element=name, field="axis")  # fmt: skip


def _relative_velocity(
    point: Array, pair: tuple[str, str], bodies: Mapping[str, Body], spins: Mapping[str, Array]
) -> Array:
    """Velocity (v, w) of the second body relative to the first at a point, by their spins."""
    result = np.zeros(6)
    for name, sign in zip(pair, (-1.0, 1.0), strict=True):
        if name in spins:
            result[:3] += sign * np.cross(spins[name], point - np.array(bodies[name].position))
            result[3:] += sign * spins[name]
    return result


def _rotated(rows: Array, point: Array, center: Array, axis: Array) -> Array:
    """Rows (force, moment) of a body at a point, after a rotation of the body about a line; at the same point."""
    rotation = exponential(TURN * axis / np.linalg.norm(axis))
    moved = rotation @ (point - center) - (point - center)
    force, moment = rows[:, :3] @ rotation.T, rows[:, 3:] @ rotation.T
    return np.concatenate((force, moment + np.cross(moved, force)), axis=1)


def _check_joint(
    joint: Joint, bodies: Mapping[str, Body], spins: Mapping[str, Array], rotor_of: Mapping[str, str]
) -> None:
    """Refuse a joint that resists the spin of a body, or is not axisymmetric."""
    pair = (joint.first, joint.second)
    spinning = next((name for name in pair if name in spins and spins[name].any()), None)
    locked = np.array([six for _, six in joint.locked], dtype=float).reshape(-1, 6)
    if spinning is None or not len(locked):
        return
    center, axis = np.array(bodies[spinning].position), spins[spinning]
    rotor, point = rotor_of[spinning], np.array(joint.point or center)
    speed, length = float(np.linalg.norm(axis)), _reference_length(bodies[spinning], point)
    velocity = locked @ _relative_velocity(point, pair, bodies, spins)
    size = np.linalg.norm(locked[:, :3], axis=1) * length + np.linalg.norm(locked[:, 3:], axis=1)
    if (np.abs(velocity) > SLACK * speed * size).any():
        raise ModelError(f"rotor '{rotor}': joint '{joint.name}' does not allow body '{spinning}' to spin about this "
                         f"axis; align the joint with the axis, or give the inertia of the part that spins on the body "
                         f"(also of a disk on a shaft).", element=rotor, field="axis")  # fmt: skip
    locked = locked / np.linalg.norm(locked, axis=1)[:, None]
    both = np.concatenate((locked, _rotated(locked, point, center, axis)))
    both[:, 3:] /= length or 1.0
    values = np.linalg.svd(both, compute_uv=False)
    if np.count_nonzero(values > SLACK * values[0]) > np.linalg.matrix_rank(locked, tol=SLACK):
        raise ModelError(f"rotor '{rotor}': joint '{joint.name}' turns with body '{spinning}' and is not axisymmetric; "
                         f"the equations would vary with time, which is not supported.",
                         element=rotor, field="axis")  # fmt: skip


def _reference_length(body: Body, point: Array) -> float:
    """Reference length [m] for errors: distance of a point from the centre of mass, or radius of gyration if larger."""
    gyration = np.sqrt(float(np.trace(inertia_tensor(body))) / (body.mass or np.inf))
    return max(float(np.linalg.norm(point - np.array(body.position))), float(gyration))


def _blocks(matrix: Array) -> Array:
    """The largest entries of the 3x3 blocks, whose units differ."""
    rows, columns = (range(0, n, 3) if n > 3 else (0,) for n in matrix.shape)
    return np.array([[np.abs(matrix[i : i + 3, k : k + 3]).max() for k in columns] for i in rows])


def _check_spring(
    model: Mechanism, spring: Connection, bodies: Mapping[str, Body], spins: Mapping[str, Array],
    rotor_of: Mapping[str, str],
) -> None:  # fmt: skip
    """Refuse an element that resists the spin of a body, rotates off the axis or is not axisymmetric."""
    pair = (spring.first, spring.second)
    spinning = next((name for name in pair if name in spins and spins[name].any()), None)
    if spinning is None:
        return
    rotor, center, axis = rotor_of[spinning], np.array(bodies[spinning].position), spins[spinning]
    subject = f"rotor '{rotor}': '{spring.name}', which acts on the spinning body '{spinning}', "
    if spring.body_positions:
        raise ModelError(f"{subject}is a {spring.family}, whose node does not spin; this is not supported.",
                         element=rotor, field="body")  # fmt: skip
    points = dict(zip(pair, 2 * spring.points, strict=False))
    for name in points:
        if name in spins:
            arm = np.array(points[name]) - np.array(bodies[name].position)
            distance = float(np.linalg.norm(np.cross(spins[name], arm))) / float(np.linalg.norm(axis))
            if distance > SLACK * _reference_length(bodies[name], np.array(points[name])):
                swap = name == spring.first and spring.second not in spins and not spring.acts_along_line
                advice = f" If an equilibrium moved it, give '{name}' as its second body, with which its point moves."
                raise ModelError(f"{subject}does so off its axis, by {distance:.3g} m: its point would move around the "
                                 f"axis; put it on the axis.{advice if swap else ''}",
                                 element=rotor, field="axis")  # fmt: skip
    both_spin = spring.first in spins and spring.second in spins
    wrenches, coefficients = rows_at_point(spring)
    if spring.acts_along_line:
        if both_spin:
            _check_axisymmetric(wrenches.T, (center, axis), subject, rotor)
        return
    stiffness, damping = ((wrenches * values) @ wrenches.T for values in (coefficients.stiffness, coefficients.damping))
    if spring.cross_coupling is not None:
        stiffness, damping = stiffness + spring.cross_coupling[0], damping + spring.cross_coupling[1]
    if spin_together(model, spins, *pair):
        if spring.cross_coupling is not None and spring.cross_coupling[1].any():
            raise ModelError(f"{subject}turns with it and has a damping matrix that is not symmetric; that is "
                             "supported only between a spinning body and one that does not spin along.",
                             element=rotor, field="axis")  # fmt: skip
    else:
        point = np.array(point_of(spring))
        force_rates = _blocks(stiffness @ _relative_velocity(point, pair, bodies, spins)[:, None])
        size = _blocks(stiffness) @ (_reference_length(bodies[spinning], point), 1.0)
        if (force_rates[:, 0] > SLACK * float(np.linalg.norm(axis)) * size).any():
            raise ModelError(f"{subject}would be wound up by the spin; give it no stiffness about the axis, or give "
                             "the inertia of the part that spins on the body.",
                             element=rotor, field="axis")  # fmt: skip
    if both_spin:
        for matrix in (stiffness, damping):
            _check_axisymmetric(matrix, (center, axis), subject, rotor)


def _check_axisymmetric(matrix: Array, line: tuple[Array, Array], subject: str, rotor: str) -> None:
    """Refuse coefficients (6, 6), or a row (1, 6), that a rotation about the axis changes."""
    center, axis = line
    after = _rotated(matrix, center, center, axis)
    if len(matrix) == 6:
        after = _rotated(after.T, center, center, axis).T
    if (_blocks(after - matrix) > SLACK * _blocks(matrix)).any():
        raise ModelError(f"{subject}turns with it and is not axisymmetric; the equations would vary with time, which "
                         "is not supported.", element=rotor, field="axis")  # fmt: skip
