"""Loops followed along a prescribed motion: tree coordinates at every sample, on the branch of the described pose."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ModelError, NearSingularWarning, SingularPoseError
from mbsvib.linalg.dead_points import is_unknown
from mbsvib.linalg.rank import NEAR_SINGULAR, REDUNDANT_LOOPS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.cycles.prescribed import Prescribed
    from mbsvib.finite_motion.following import DrivenLoops

# Loops count as closed when they are open by less than this [rad, mechanism sizes]: a thousandth of what results are
# promised to.
ACCEPTED = 1e-12
# Frames from the warning up to the call of the user.
USER = 8
# A generic neighbour of the described pose, to tell a singular pose from a freedom that no drive has.
NEARBY = 0.03


def followed(loops: DrivenLoops, motion: Prescribed) -> Array:
    """Return the tree coordinates (samples, n) [rad, m] at every sample."""
    pose, depends = np.zeros(len(loops.names)), loops.dependent
    _check_mobility(loops, motion)
    result: Array = np.zeros((len(motion.values), len(pose)))
    if not len(depends):
        result[:, loops.driven] = motion.values
        return result
    least, where, matrix = np.inf, 0, loops.jacobian(pose)
    for i, target in enumerate(motion.values):
        start = pose[loops.driven]
        (pose, matrix), done = loops.followed((pose, matrix), target)
        if done < 1.0:
            raise _singular(loops, motion, start + done * (target - start), matrix)
        result[i] = pose
        smallest = loops.smallest(matrix)
        if is_unknown(smallest, loops.closed):
            raise _singular(loops, motion, target, matrix)
        if smallest < least:
            least, where = smallest, i
    if least < NEAR_SINGULAR:
        warnings.warn(f"cycle: at {motion.at_sample(where)} the mechanism is near a singular pose (smallest singular "
                      f"value of its loops {least:.1e}); rates and forces lose as many digits there.",
                      NearSingularWarning, stacklevel=USER)  # fmt: skip
    return result


def _check_mobility(loops: DrivenLoops, motion: Prescribed) -> None:
    """Refuse drives that do not move the mechanism, or do not determine its motion."""
    matrix = loops.jacobian(np.zeros(len(loops.names)))
    if not len(matrix) and not len(loops.dependent):
        return
    undriven = _undetermined(loops, matrix)
    if undriven:
        generic = _neighbour(loops)
        if generic is not None and not _undetermined(loops, generic):
            raise _singular(loops, motion, np.zeros(len(motion.names)), matrix)
        raise ModelError(
            f"cycle: the drive {_several(motion.names)} does not determine the motion of {_several(undriven)}; drive "
            f"{'that' if len(undriven) == 1 else 'one of these'} too by motion={{...}}, or lock it by another joint.",
            element=undriven[0], field="drive",
        )  # fmt: skip
    motions = _motions(matrix)[loops.driven]
    for name, row in zip(motion.names, motions, strict=True):
        if np.linalg.norm(row) < REDUNDANT_LOOPS:
            raise ModelError(f"cycle: the drive '{name}' does not move the mechanism: its loops hold that coordinate. "
                             f"Drive one of {', '.join(_moving(loops, matrix)) or 'none, it is fully locked'}.",
                             element=name, field="drive")  # fmt: skip
    rank = np.linalg.matrix_rank(motions, tol=REDUNDANT_LOOPS)
    if rank < len(motion.names):
        raise ModelError(
            f"cycle: the loops tie the drives {_several(motion.names)} to each other: the mechanism has {rank} degrees "
            f"of freedom for {len(motion.names)} drives; leave out {len(motion.names) - rank}.",
            element=motion.names[-1], field="motion",
        )  # fmt: skip


def _motions(matrix: Array) -> Array:
    """Basis (n, dof) of the motions that loops allow."""
    if not len(matrix):
        return np.eye(matrix.shape[1])
    _, values, v = np.linalg.svd(matrix, full_matrices=True)
    rank = int((values > REDUNDANT_LOOPS * max(1.0, float(values.max(initial=0.0)))).sum())
    return np.asarray(v[rank:].T)


def _moving(loops: DrivenLoops, matrix: Array) -> list[str]:
    """Coordinates that move in some motion that changes none of the rows."""
    motions = _motions(matrix)
    return [name for name, row in zip(loops.names, motions, strict=True) if np.linalg.norm(row) > REDUNDANT_LOOPS]


def _undetermined(loops: DrivenLoops, matrix: Array) -> list[str]:
    """Coordinates that move while the driven ones stand still."""
    return _moving(loops, np.vstack([matrix, np.eye(len(loops.names))[loops.driven]]))


def _neighbour(loops: DrivenLoops) -> Array | None:
    """The derivative of the openings at a generic pose near the described one, where loops close; None: not found."""
    scale = loops.loops.coordinate_scale
    trial = NEARBY * scale * np.random.default_rng(0).uniform(-1.0, 1.0, len(scale))
    q, opening = loops.loops.projected(trial, loops.bases)
    return loops.jacobian(q) if opening < ACCEPTED and np.abs(q / scale).max() > 1e-3 * NEARBY else None


def _several(names: Sequence[str]) -> str:
    quoted = [f"'{name}'" for name in names[:6]]
    return ", ".join(quoted) + (", ..." if len(names) > 6 else "")


def _singular(loops: DrivenLoops, motion: Prescribed, values: Array, matrix: Array) -> SingularPoseError:
    return SingularPoseError(
        f"cycle: at {motion.words(values)} the mechanism is in a singular pose (dead centre), and the drive "
        f"{_several(motion.names)} does not lead it through: '{loops.loose(matrix)}' could move by itself. Stay short "
        f"of it, or drive another coordinate."
    )  # fmt: skip
