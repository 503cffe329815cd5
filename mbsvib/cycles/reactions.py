"""Reactions in joints over a cycle: Newton's and Euler's equations of every body, solved for what joints carry.

Bodies are free here, each with a translation and a rotation of its own: the generalized forces that they lack are the
wrenches that joints, couplers and drives must supply, springs, weight and loads taken into account. A joint supplies
combinations of the derivatives of its openings. Where constraints are redundant, the wrenches are the smallest in the
sense of the sum of |force|^2 + |moment / L|^2, L the size of the mechanism.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.cycles.expressions import evaluated, statement
from mbsvib.errors import MbsvibError
from mbsvib.finite_motion.joints import openings, point_of
from mbsvib.finite_motion.rotations import axial
from mbsvib.linalg.rank import DETERMINED, REDUNDANT_LOOPS
from mbsvib.mechanism.mechanism import GROUND

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.cycles.result import CycleData
    from mbsvib.elements import Joint

# What the equations of the bodies leave over, as a share of the forces in them: rounding, and how far loops are open.
BALANCED = 1e-7


@dataclass(frozen=True)
class Reactions:
    """``wrenches`` (samples, 6) by joint, and the directions by joint that are ``undetermined``."""

    wrenches: Mapping[str, Array]
    undetermined: Mapping[str, tuple[str, ...]]


def reactions(cycle: CycleData) -> Reactions:
    """Return the wrenches that joints carry over a cycle.

    Parameters
    ----------
    cycle : Cycle
        The cycle.

    Returns
    -------
    Reactions
        What the first body does to the second, at the joint's point, world axes.
    """
    model, size = cycle.machine.model, cycle.machine.size
    names = list(model.bodies)
    lacking, rows, points = _bodies(cycle)
    drives = _drive_wrenches(cycle)
    units = np.tile([1.0, 1.0, 1.0, 1 / size, 1 / size, 1 / size], len(names))
    matrices, frames = [], []
    for joint in model.joints.values():
        onto = _onto(joint, names, cycle, points[joint.name])
        basis = _orthonormal(rows[joint.name], joint, names, cycle, points[joint.name], size)
        matrices.append(onto @ basis)
        frames.append(basis)
    for part in model.couplers.values():
        joined = [(model.joints[name.rpartition(".")[0]], value * drives[name]) for name, value in part.terms]
        pulls = [_onto(joint, names, cycle, points[joint.name]) @ wrench[:, :, None] for joint, wrench in joined]
        matrices.append(np.sum(pulls, axis=0))
    for name, torque in cycle.torques.items():
        joint = model.joints[name.rpartition(".")[0]]
        supplied = _onto(joint, names, cycle, points[joint.name]) @ drives[name][:, :, None]
        lacking = lacking - supplied[:, :, 0] * torque[:, None]
    matrix = np.concatenate(matrices, axis=2) * units[:, None]
    right = lacking * units
    inverse = np.linalg.pinv(matrix, rcond=REDUNDANT_LOOPS)
    shares = (inverse @ right[:, :, None])[:, :, 0]
    left = np.abs((matrix @ shares[:, :, None])[:, :, 0] - right).max()
    scale = max(float(np.abs(matrix * shares[:, None, :]).max(initial=0.0)), float(np.abs(right).max(initial=0.0)))
    if left > BALANCED * scale:
        raise MbsvibError(f"cycle: the reactions balance the bodies of model '{model.name}' only to {left / scale:.1e} "
                          f"of the forces in them; the cycle is too near a singular pose.")  # fmt: skip
    free = np.eye(matrix.shape[2]) - inverse @ matrix
    wrenches, undetermined, start = {}, {}, 0
    for joint, basis in zip(model.joints.values(), frames, strict=True):
        end = start + basis.shape[2]
        wrench = (basis @ shares[:, start:end, None])[:, :, 0]
        wrench.flags.writeable = False
        wrenches[joint.name] = wrench
        loose = np.linalg.norm(basis / _units(size) @ free[:, start:end], axis=2).max(axis=0, initial=0.0)
        if (loose > DETERMINED).any():
            undetermined[joint.name] = tuple([d for d, size_of in zip(DIRECTIONS, loose, strict=True)
                                              if size_of > DETERMINED])  # fmt: skip
        start = end
    return Reactions(wrenches, undetermined)


def _units(size: float) -> Array:
    return np.array([1.0, 1.0, 1.0, size, size, size])[:, None]


def _bodies(cycle: CycleData) -> tuple[Array, dict[str, Array], dict[str, Array]]:
    """Wrenches (samples, 6 bodies) that bodies lack at their centres; by joint, the derivatives (samples, rows,
    6 bodies) of its openings to translations and rotations of all bodies, and its point (samples, 3).
    """
    model = cycle.machine.model
    loose = model.with_parts(joints={}, couplers={}, inputs={}, outputs={})
    free = statement(loose, None, (), bases=True)
    kinematics = free.motion.motion
    columns = np.array([[kinematics.names.index(f"{name}.{direction}") for direction in DIRECTIONS]
                        for name in model.bodies])  # fmt: skip
    samples = len(cycle.shaking_force)
    q, qd, qdd = (np.zeros((samples, columns.size)) for _ in range(3))
    bases = np.empty((samples, 9 * len(columns)))
    for name, place in zip(model.bodies, columns, strict=True):
        body = model.bodies[name]
        q[:, place[:3]] = cycle.positions[name] - body.position
        qd[:, place], qdd[:, place] = cycle.velocities[name], cycle.body_accelerations[name]
        turned = cycle.orientations[name] @ np.array(body.orientation).T
        k = 9 * kinematics.based.index(name)
        bases[:, k : k + 9] = turned.transpose(0, 2, 1).reshape(samples, 9)
    outputs, points = [free.required], []
    for joint in model.joints.values():
        relative = kinematics.frames[joint.second].seen_from(kinematics.frames[joint.first])
        opened = [value for _, value in openings(joint, kinematics.numbers, relative)]
        outputs.append(ca.jacobian(ca.vertcat(*opened) if opened else ca.SX.zeros(0), free.q))
        points.append(kinematics.frames[joint.second].point(point_of(joint, kinematics.numbers)))
    function = ca.Function("f", [free.q, free.qd, free.qdd, kinematics.bases], [*outputs, *points])
    found = evaluated(function, q, qd, qdd, bases)
    number = len(points)
    order = columns.ravel()
    rows = {name: each.reshape(samples, -1, columns.size)[:, :, order]
            for name, each in zip(model.joints, found[1 : number + 1], strict=True)}  # fmt: skip
    return found[0][:, order], rows, dict(zip(model.joints, found[number + 1 :], strict=True))


def _orthonormal(
    rows: Array, joint: Joint, names: list[str], cycle: CycleData, point: Array, size: float
) -> Array:
    """Wrenches (samples, 6, rows) at the joint's point that it can carry, orthonormal with moments over the size."""
    end, sign = (joint.second, 1.0) if joint.second != GROUND else (joint.first, -1.0)
    k = 6 * names.index(end)
    wrench = sign * rows[:, :, k : k + 6].transpose(0, 2, 1)
    arm = cycle.positions[end] - point
    wrench = wrench.copy()
    wrench[:, 3:] += np.cross(arm[:, None, :], wrench[:, :3].transpose(0, 2, 1)).transpose(0, 2, 1)
    return np.asarray(np.linalg.qr(wrench / _units(size))[0] * _units(size))


def _onto(joint: Joint, names: list[str], cycle: CycleData, point: Array) -> Array:
    """(samples, 6 bodies, 6): wrenches at the centres of all bodies for one on the second body at the joint's point."""
    result = np.zeros((len(point), 6 * len(names), 6))
    for end, sign in ((joint.second, 1.0), (joint.first, -1.0)):
        if end == GROUND:
            continue
        k = 6 * names.index(end)
        arm = point - cycle.positions[end]
        result[:, k : k + 6] = sign * np.eye(6)
        for i, unit in enumerate(np.eye(3)):
            result[:, k + 3 : k + 6, i] = sign * np.cross(arm, unit)
    return result


def _drive_wrenches(cycle: CycleData) -> dict[str, Array]:
    """Wrenches (samples, 6) on the second body by which one unit acts along driven and coupled joint coordinates.

    Of the directions s_k in which a joint turns (or slides), those with w_j . s_k = 1 for k = j and else 0.
    """
    model, motion = cycle.machine.model, cycle.machine.solved
    expressions = cycle.machine.statement
    kinematics = expressions.motion.motion
    wanted = {*cycle.drives, *(name for part in model.couplers.values() for name, _ in part.terms)}
    result = {}
    for joint in model.joints.values():
        for turns in (False, True):
            mine = [f"{joint.name}.{direction}" for direction, _ in joint.freedom if (direction[0] == "r") is turns]
            if not wanted.intersection(mine):
                continue
            point = point_of(joint, kinematics.numbers)
            first, second = kinematics.frames[joint.first], kinematics.frames[joint.second]
            # what the second body does as seen from the first, in the axes of the first as described
            relative = second.seen_from(first)
            spin = ca.reshape(kinematics.rate(ca.vec(relative.rotation)), 3, 3) @ relative.rotation.T
            rate = axial(spin) if turns else kinematics.rate(relative.point(point))
            index = [kinematics.names.index(name) for name in mine]
            twists = ca.jacobian(first.rotation @ rate, expressions.qd)[:, index]
            found = evaluated(expressions.function(ca.densify(twists)), motion.q, motion.qd, motion.qdd,
                              cycle.machine.values(expressions), cycle.about)[0]  # fmt: skip
            dual = np.linalg.pinv(found.reshape(len(motion.q), 3, len(index))).transpose(0, 2, 1)
            for j, name in enumerate(mine):
                wrench = np.zeros((len(motion.q), 6))
                wrench[:, 3:] = dual[:, :, j] if turns else 0.0
                wrench[:, :3] = 0.0 if turns else dual[:, :, j]
                result[name] = wrench
    return result
