"""When a steady spin is steady: what joins spinning bodies lets them spin, and looks the same from all sides."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Body, Bushing, Spring
from mbsvib.elements.inerter import Inerter
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import exponential

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint
    from mbsvib.mechanism.mechanism import Mechanism


# Inertia tensors and axes come from print-outs with six or seven digits.
SLACK = 1e-6
TURN = 1.0  # what is the same after one radian is the same after any angle, but for what repeats 2 pi times a turn


def tensor(body: Body) -> Array:
    """Return the inertia tensor of a body about its centre of mass, world axes."""
    xx, yy, zz, xy, xz, yz = body.inertia
    axes = np.array(body.orientation)
    return np.asarray(axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axes.T)


def world(bushing: Bushing, value: Any) -> Array:
    """Return a bushing's 6 or 6x6 coefficients as a matrix in world axes."""
    matrix = np.array(value)
    axes = np.kron(np.eye(2), np.array(bushing.orientation))
    return np.asarray(axes @ (np.diag(matrix) if matrix.ndim == 1 else matrix) @ axes.T)


def own_spin(model: Mechanism) -> dict[str, Array]:
    """Return the angular velocities of the bodies that themselves spin, by name."""
    result: dict[str, Array] = {}
    for rotor in model.rotors.values():
        if rotor.inertia is None:
            if rotor.body in result:
                raise ModelError(f"rotor '{rotor.name}': body '{rotor.body}' spins already; add the speeds up, or give "
                                 f"the inertia of what spins on it.", element=rotor.name, field="body")  # fmt: skip
            result[rotor.body] = rotor.speed * np.array(rotor.axis)
    return result


def together(model: Mechanism, spins: Mapping[str, Array], first: str, second: str) -> bool:
    """Tell whether two bodies spin at the same speed about the same line."""
    if first not in spins or second not in spins:
        return False
    a, b = spins[first], spins[second]
    apart = np.array(model.bodies[second].position) - np.array(model.bodies[first].position)
    size = np.linalg.norm(a)
    return bool(np.linalg.norm(a - b) <= SLACK * size
                and np.linalg.norm(np.cross(a, apart)) <= SLACK * size * np.linalg.norm(apart))  # fmt: skip


def check_steady(model: Mechanism, parts: Sequence[Body], elements: Sequence[Bushing | Spring]) -> None:
    """Refuse spins that are not steady, by the name of the rotor and of what is in the way.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    parts, elements : sequence
        Its bodies and its spring-dampers, those that beams have become included.

    Raises
    ------
    ModelError
        If a spinning body is not symmetric about its axis, a joint or spring holds it or does not look the same from
        all sides, or the axis of a rotor is moved by the spin of the body that carries it.
    """
    spins = own_spin(model)
    of = {rotor.body: rotor.name for rotor in model.rotors.values() if rotor.inertia is None}
    bodies = {body.name: body for body in parts}
    flexible = frozenset() if model.expansion is None else model.expansion.nodes
    for rotor in model.rotors.values():
        body = bodies[rotor.body]
        if body.name not in flexible and not any(body.inertia):
            raise ModelError(f"rotor '{rotor.name}': body '{body.name}' has no inertia to carry it; give the body its "
                             f"inertia, that of the rotor included.", element=rotor.name, field="body")  # fmt: skip
        if rotor.inertia is None:
            _check_symmetric(rotor.name, body, np.array(rotor.axis))
        elif body.name in spins and np.linalg.norm(np.cross(rotor.axis, spins[body.name])) > SLACK * np.linalg.norm(
            spins[body.name]
        ):
            raise ModelError(f"rotor '{rotor.name}' spins about an axis that moves, as body '{body.name}' spins about "
                             f"another one (rotor '{of[body.name]}'); only axes that stay are supported.",
                             element=rotor.name, field="axis")  # fmt: skip
    if not any(spin.any() for spin in spins.values()):
        return
    for joint in model.joints.values():
        _check_joint(joint, bodies, spins, of)
    for spring in elements:
        if spring.first in spins or spring.second in spins:
            _check_spring(model, spring, bodies, spins, of)


def _check_symmetric(name: str, body: Body, axis: Array) -> None:
    inertia = tensor(body)
    rest = np.eye(3) - np.outer(axis, axis)
    across = rest @ inertia @ rest
    mean = 0.5 * np.trace(across)
    off = max(float(np.abs(rest @ inertia @ axis).max()), float(np.abs(across - mean * rest).max()))
    if off > SLACK * float(np.abs(inertia).max()):
        raise ModelError(f"rotor '{name}': body '{body.name}' spins, and its inertia is not symmetric about the axis "
                         f"(off by {off:.3g} kg m^2); what it does in axes that do not spin would vary with time. "
                         f"Check axis and tensor, or give the inertia of the part that spins.",
                         element=name, field="axis")  # fmt: skip


def _relative(point: Array, pair: tuple[str, str], bodies: Mapping[str, Body], spins: Mapping[str, Array]) -> Array:
    """Velocity of the second body against the first at a point, (v, w), from their spins."""
    result = np.zeros(6)
    for name, sign in zip(pair, (-1.0, 1.0), strict=True):
        if name in spins:
            result[:3] += sign * np.cross(spins[name], point - np.array(bodies[name].position))
            result[3:] += sign * spins[name]
    return result


def _turned(rows: Array, point: Array, center: Array, axis: Array) -> Array:
    """Covectors (f, m) at a point, after a turn of what they belong to about a line; at the same point."""
    size = np.linalg.norm(axis)
    turn = exponential(TURN * axis / size)
    moved = turn @ (point - center) - (point - center)
    force, moment = rows[:, :3] @ turn.T, rows[:, 3:] @ turn.T
    return np.concatenate((force, moment + np.cross(moved, force)), axis=1)


def _check_joint(joint: Joint, bodies: Mapping[str, Body], spins: Mapping[str, Array], of: Mapping[str, str]) -> None:
    pair = (joint.first, joint.second)
    spinning = next((name for name in pair if name in spins and spins[name].any()), None)
    locked = np.array([six for _, six in joint.locked], dtype=float).reshape(-1, 6)
    if spinning is None or not len(locked):
        return
    center, axis = np.array(bodies[spinning].position), spins[spinning]
    point = np.array(joint.point or center)
    speed, length = float(np.linalg.norm(axis)), _reach(bodies[spinning], point)
    moving = locked @ _relative(point, pair, bodies, spins)
    size = np.linalg.norm(locked[:, :3], axis=1) * length + np.linalg.norm(locked[:, 3:], axis=1)
    if (np.abs(moving) > SLACK * speed * size).any():
        raise ModelError(f"rotor '{of[spinning]}': joint '{joint.name}' does not let body '{spinning}' spin about this "
                         f"axis; turn its axis or put it on the axis, or give the inertia of what spins on the body "
                         f"(also of a disk on a shaft).", element=of[spinning], field="axis")  # fmt: skip
    locked = locked / np.linalg.norm(locked, axis=1)[:, None]
    both = np.concatenate((locked, _turned(locked, point, center, axis)))
    both[:, 3:] /= length or 1.0
    values = np.linalg.svd(both, compute_uv=False)
    if np.count_nonzero(values > SLACK * values[0]) > np.linalg.matrix_rank(locked, tol=SLACK):
        raise ModelError(f"rotor '{of[spinning]}': joint '{joint.name}' turns with body '{spinning}' and is not the "
                         f"same from all sides of its axis; the equations would vary with time, which is not "
                         f"supported.", element=of[spinning], field="axis")  # fmt: skip


def _reach(body: Body, point: Array) -> float:
    """The length [m] by which points off the axis count: how far a point, and the mass, are from the centre of mass."""
    gyration = np.sqrt(float(np.trace(tensor(body))) / (body.mass or np.inf))
    return max(float(np.linalg.norm(point - np.array(body.position))), float(gyration))


def _blocks(matrix: Array) -> Array:
    """The largest entries of the blocks of forces, moments, translations and rotations: each has a unit of its own."""
    rows, columns = (range(0, n, 3) if n > 3 else (0,) for n in matrix.shape)
    return np.array([[np.abs(matrix[i : i + 3, k : k + 3]).max() for k in columns] for i in rows])


def _check_spring(
    model: Mechanism, spring: Bushing | Spring, bodies: Mapping[str, Body], spins: Mapping[str, Array],
    of: Mapping[str, str],
) -> None:  # fmt: skip
    pair = (spring.first, spring.second)
    spinning = next((name for name in pair if name in spins and spins[name].any()), None)
    if spinning is None:
        return
    who, center, axis = of[spinning], np.array(bodies[spinning].position), spins[spinning]
    along = together(model, spins, *pair)
    refuse = f"rotor '{who}': '{spring.name}', which acts on the spinning body '{spinning}', "
    if not isinstance(spring, (Spring, Bushing)):
        what = "an inerter" if isinstance(spring, Inerter) else "a Maxwell element"
        raise ModelError(f"{refuse}is {what}, which is not supported on a spinning body.",
                         element=who, field="body")  # fmt: skip
    points = {spring.first: spring.start, spring.second: spring.end} if isinstance(spring, Spring) else dict.fromkeys(
        pair, spring.position)  # fmt: skip
    for name in pair:
        if name in spins:
            arm = np.array(points[name]) - np.array(bodies[name].position)
            off = float(np.linalg.norm(np.cross(spins[name], arm))) / float(np.linalg.norm(axis))
            if off > SLACK * _reach(bodies[name], np.array(points[name])):
                swap = name == spring.first and spring.second not in spins and not isinstance(spring, Spring)
                more = f" Where an equilibrium moved it, name '{name}' as its second body, which its point goes with."
                raise ModelError(refuse + f"does so off its axis, by {off:.3g} m: it would turn with it; put its point "
                                 f"on the axis.{more if swap else ''}", element=who, field="axis")  # fmt: skip
    if isinstance(spring, Spring):
        if spring.first in spins and spring.second in spins:
            _check_same(True, np.array([[*spring.line, 0.0, 0.0, 0.0]]), (center, axis), refuse, who)
        return
    stiffness, damping = world(spring, spring.stiffness), world(spring, spring.damping)
    if not along:
        point = np.array(spring.position)
        wound = _blocks(stiffness @ _relative(point, pair, bodies, spins)[:, None])
        size = _blocks(stiffness) @ (_reach(bodies[spinning], point), 1.0)
        if (wound[:, 0] > SLACK * float(np.linalg.norm(axis)) * size).any():
            raise ModelError(refuse + "would be wound up by the spin; give it no stiffness about the axis, or give the "
                             "inertia of what spins on the body.", element=who, field="axis")  # fmt: skip
    if spring.first in spins and spring.second in spins:
        for matrix in (stiffness, damping):
            _check_same(False, matrix, (center, axis), refuse, who)


def _check_same(line: bool, matrix: Array, about: tuple[Array, Array], refuse: str, who: str) -> None:
    """Refuse coefficients (6, 6), or a line (1, 6), that a turn about the axis changes."""
    center, axis = about
    after = _turned(matrix, center, center, axis)
    if not line:
        after = _turned(after.T, center, center, axis).T
    if (_blocks(after - matrix) > SLACK * _blocks(matrix)).any():
        raise ModelError(refuse + "turns with it and is not the same from all sides of the axis; the equations would "
                         "vary with time, which is not supported.", element=who, field="axis")  # fmt: skip
