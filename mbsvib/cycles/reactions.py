"""Reactions in joints over a cycle: Newton's and Euler's equations of every body, solved for what joints carry.

What bodies on their own lack, joints, couplers and drives must supply. Where constraints are redundant, the wrenches
are the smallest in the sense of the sum of |force|^2 + |moment / L|^2, L the size of the mechanism.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.cycles.free_bodies import FreeBodies, free_bodies
from mbsvib.errors import MbsvibError
from mbsvib.finite_motion.evaluation import matrices
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

    Returns what the first body does to the second, at the joint's point, world axes.
    """
    model, size = cycle.machine.model, cycle.machine.size
    bodies, (unbalanced, rows, drive_wrenches, points, origins) = _evaluated(cycle)
    units = np.tile([1.0, 1.0, 1.0, 1 / size, 1 / size, 1 / size], len(bodies.first_row))
    by_joint = np.split(rows, np.cumsum(bodies.counts)[:-1], axis=1)
    at = np.split(points, len(by_joint), axis=1)
    effects, frames = [], []
    for joint, joint_rows, point in zip(model.joints.values(), by_joint, at, strict=True):
        arms = {name: point - origins[:, 3 * i : 3 * i + 3] for i, name in enumerate(bodies.first_row)}
        frames.append(_orthonormal(joint_rows, joint, bodies, arms, size))
        effects.append(_onto(joint, bodies, arms) @ frames[-1])
    drives = len(cycle.drives)
    effects.append(drive_wrenches[:, :, drives:])
    torques = np.column_stack([cycle.torques[name] for name in cycle.drives])
    unbalanced = unbalanced - (drive_wrenches[:, :, :drives] @ torques[:, :, None])[:, :, 0]
    matrix = np.concatenate(effects, axis=2) * units[:, None]
    right = unbalanced * units
    inverse = np.linalg.pinv(matrix, rcond=REDUNDANT_LOOPS)
    shares = (inverse @ right[:, :, None])[:, :, 0]
    residual = np.abs((matrix @ shares[:, :, None])[:, :, 0] - right).max()
    scale = max(float(np.abs(matrix * shares[:, None, :]).max(initial=0.0)), float(np.abs(right).max(initial=0.0)))
    if residual > BALANCED * scale:
        raise MbsvibError(f"cycle: the reactions balance the bodies of model '{model.name}' only to "
                          f"{residual / scale:.1e} of the forces in them; the cycle is too near a singular "
                          f"pose.")  # fmt: skip
    free = np.eye(matrix.shape[2]) - inverse @ matrix
    wrenches, undetermined, start = {}, {}, 0
    for joint, basis in zip(model.joints.values(), frames, strict=True):
        end = start + basis.shape[2]
        wrench = (basis @ shares[:, start:end, None])[:, :, 0]
        wrench.flags.writeable = False
        wrenches[joint.name] = wrench
        indeterminacy = np.linalg.norm(basis / _units(size) @ free[:, start:end], axis=2).max(axis=0, initial=0.0)
        if (indeterminacy > DETERMINED).any():
            undetermined[joint.name] = tuple([d for d, size_of in zip(DIRECTIONS, indeterminacy, strict=True)
                                              if size_of > DETERMINED])  # fmt: skip
        start = end
    return Reactions(wrenches, undetermined)


def _units(size: float) -> Array:
    return np.array([1.0, 1.0, 1.0, size, size, size])[:, None]


def _evaluated(cycle: CycleData) -> tuple[FreeBodies, list[Array]]:
    """The equations of bodies on their own, and at all samples what these lack (n, 6 N), rows of the joints
    (n, L, 6 N), what drives and couplers do (n, 6 N, d), points of joints (n, 3 J) and origins of bodies (n, 3 N).
    """
    plant, motion = cycle.machine, cycle.machine.solved
    expressions = plant.statement
    bodies = free_bodies(plant.model, expressions, cycle.drives)
    outputs = (bodies.required, bodies.rows, bodies.drive_wrenches, ca.vertcat(*bodies.points.values()),
               ca.vertcat(*bodies.origins.values()))  # fmt: skip
    function = expressions.compiled("free bodies", lambda: list(map(ca.densify, outputs)))
    arrays = matrices(function, motion.q, motion.qd, motion.qdd, plant.values(expressions), plant.about)
    return bodies, [arrays[0][:, :, 0], arrays[1], arrays[2], arrays[3][:, :, 0], arrays[4][:, :, 0]]


def _orthonormal(rows: Array, joint: Joint, bodies: FreeBodies, arms: Mapping[str, Array], size: float) -> Array:
    """Wrenches (samples, 6, rows) at the joint's point that it can carry, orthonormal with moments over the size."""
    end, sign = (joint.second, 1.0) if joint.second != GROUND else (joint.first, -1.0)
    k = bodies.first_row[end]
    wrench = sign * rows[:, :, k : k + 6].transpose(0, 2, 1)
    wrench[:, 3:] -= np.cross(arms[end][:, None, :], wrench[:, :3].transpose(0, 2, 1)).transpose(0, 2, 1)
    return np.asarray(np.linalg.qr(wrench / _units(size))[0] * _units(size))


def _onto(joint: Joint, bodies: FreeBodies, arms: Mapping[str, Array]) -> Array:
    """(samples, 6 N, 6): what a wrench on the second body at the joint's point does to all bodies."""
    result = np.zeros((len(next(iter(arms.values()))), 6 * len(arms), 6))
    for end, sign in ((joint.second, 1.0), (joint.first, -1.0)):
        if end == GROUND:
            continue
        k = bodies.first_row[end]
        result[:, k : k + 6] = sign * np.eye(6)
        for i, unit in enumerate(np.eye(3)):
            result[:, k + 3 : k + 6, i] = sign * np.cross(arms[end], unit)
    return result
