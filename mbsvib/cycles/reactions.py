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

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.cycles.result import CycleData

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
    bodies, (unbalanced, rows, unit_wrenches, drive_wrenches) = _evaluated(cycle)
    units = np.tile([1.0, 1.0, 1.0, 1 / size, 1 / size, 1 / size], rows.shape[2] // 6)
    effects, frames = [], []
    for which in bodies.slices:  # wrenches that joints can carry, orthonormal with moments over the size
        orthonormal, by_multipliers = np.linalg.qr(unit_wrenches[:, :, which] / _units(size))
        frames.append(orthonormal * _units(size))
        effects.append(rows[:, which].transpose(0, 2, 1) @ np.linalg.inv(by_multipliers))
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
    (n, L, 6 N), wrenches by their multipliers (n, 6, L), and what drives and couplers do (n, 6 N, d).
    """
    plant, motion = cycle.machine, cycle.machine.solved
    expressions = plant.statement
    bodies = free_bodies(plant.model, expressions, cycle.drives)
    outputs = (bodies.required, bodies.rows, bodies.unit_wrenches, bodies.drive_wrenches)
    function = expressions.compiled("free bodies", lambda: list(map(ca.densify, outputs)))
    required, *others = matrices(function, motion.q, motion.qd, motion.qdd, plant.values(expressions), plant.about)
    return bodies, [required[:, :, 0], *others]
