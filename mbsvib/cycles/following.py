"""Loops followed along a prescribed motion: tree coordinates at every sample, on the branch of the described pose."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

from mbsvib.errors import ModelError, NearSingularWarning, SingularPoseError
from mbsvib.linalg.rank import NEAR_SINGULAR, REDUNDANT_LOOPS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.cycles.prescribed import Prescribed
    from mbsvib.finite_motion.loops import Loops

# The longest step [rad, mechanism sizes] along which loops are followed, and the shortest that is still tried.
LONGEST, SHORTEST = 0.1, 1e-7
# Loops count as closed when they are open by less than this [rad, mechanism sizes]: a thousandth of what results are
# promised to.
ACCEPTED = 1e-12
# Loops open by r leave a smallest singular value s off by about r / s: refused where s is below this times sqrt(r), so
# that it is known to a percent, rates and forces to a few.
SINGULAR = 10.0
# Frames from the warning up to the call of the user.
USER = 8
# Eigenvalues with a smaller imaginary part, as a share of them, are real.
REAL = 1e-9
# A generic neighbour of the described pose, to tell a singular pose from a freedom that no drive has.
NEARBY = 0.03
NO_BASES = np.zeros(0)


@dataclass(frozen=True)
class DrivenLoops:
    """The loops of a mechanism whose tree coordinates ``names`` (n,) are prescribed where they are ``driven`` (m,).

    ``rounding`` is how far loops may be open as points are rounded relative to the origin.
    """

    names: tuple[str, ...]
    driven: NDArray[np.intp]
    loops: Loops
    rounding: float

    @property
    def dependent(self) -> NDArray[np.intp]:
        """Numbers of the other coordinates."""
        return np.setdiff1d(np.arange(len(self.names)), self.driven)

    @property
    def accepted(self) -> float:
        """Opening below which loops count as closed."""
        return max(ACCEPTED, self.rounding)

    def jacobian(self, q: Array) -> Array:
        """Return the derivative (rows, n) of the openings in units of like size."""
        return self.loops.scaled(q, NO_BASES)[1]


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
        pose, matrix = _to(loops, (pose, matrix), target, motion)
        result[i] = pose
        smallest = np.linalg.svd(matrix[:, depends], compute_uv=False)[-1]
        if smallest < SINGULAR * np.sqrt(loops.accepted):
            raise _singular(loops, motion, motion.at_sample(i), pose)
        if smallest < least:
            least, where = float(smallest), i
    if least < NEAR_SINGULAR:
        warnings.warn(f"cycle: at {motion.at_sample(where)} the mechanism is near a singular pose (smallest singular "
                      f"value of its loops {least:.1e}); rates and forces lose as many digits there.",
                      NearSingularWarning, stacklevel=USER)  # fmt: skip
    return result


def _to(loops: DrivenLoops, at: tuple[Array, Array], target: Array, motion: Prescribed) -> tuple[Array, Array]:
    """Take the driven coordinates to their values in steps along which the loops stay closed, from a pose and the
    derivative of the openings there.
    """
    (pose, matrix), depends, driven, scale = at, loops.dependent, loops.driven, loops.loops.coordinate_scale
    start, change = pose[driven], target - pose[driven]
    longest = float(np.abs(change / scale[driven]).max(initial=0.0))
    done, step = 0.0, min(1.0, LONGEST / max(longest, LONGEST))
    while done < 1.0:
        share = min(step, 1.0 - done)
        trial = pose.copy()
        trial[driven] = target if done + share >= 1.0 else start + (done + share) * change
        moved = (trial - pose)[driven] / scale[driven]
        guess = np.linalg.lstsq(matrix[:, depends], -matrix[:, driven] @ moved, rcond=None)[0]
        trial[depends] += scale[depends] * guess
        opening = np.inf
        if np.abs(guess).max(initial=0.0) < 10.0 * LONGEST:
            trial, opening = loops.loops.projected(trial, NO_BASES, depends)
        if opening < loops.accepted:
            after = loops.jacobian(trial)
            if _same_side(matrix[:, depends], after[:, depends]):
                pose, matrix, done = trial, after, done + share
                step = min(2.0 * step, LONGEST / max(longest, LONGEST))
                continue
        step = 0.5 * share
        if step * longest < SHORTEST:
            raise _singular(loops, motion, motion.words(start + done * change), pose)
    return pose, matrix


def _same_side(before: Array, after: Array) -> bool:
    """Return whether A = dPhi/dq of the dependent coordinates goes over into that of the next pose without a singular
    one in between: no real eigenvalue of A(before)^-1 A(after) has changed its sign.
    """
    rows = qr(before.T, mode="r", pivoting=True)[1][: before.shape[1]]
    try:
        values = np.linalg.eigvals(np.linalg.solve(before[rows], after[rows]))
    except np.linalg.LinAlgError:
        return False
    crossed = (np.abs(values.imag) <= REAL * np.abs(values)) & (values.real <= 0.0)
    return not bool(crossed.any())


def _check_mobility(loops: DrivenLoops, motion: Prescribed) -> None:
    """Refuse drives that do not move the mechanism, or do not determine its motion."""
    matrix = loops.jacobian(np.zeros(len(loops.names)))
    if not len(matrix) and not len(loops.dependent):
        return
    undriven = _undetermined(loops, matrix)
    if undriven:
        generic = _neighbour(loops)
        if generic is not None and not _undetermined(loops, generic):
            raise _singular(loops, motion, motion.words(np.zeros(len(motion.names))), np.zeros(len(loops.names)))
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
    q, opening = loops.loops.projected(trial, NO_BASES)
    return loops.jacobian(q) if opening < ACCEPTED and np.abs(q / scale).max() > 1e-3 * NEARBY else None


def _several(names: Sequence[str]) -> str:
    quoted = [f"'{name}'" for name in names[:6]]
    return ", ".join(quoted) + (", ..." if len(names) > 6 else "")


def _singular(loops: DrivenLoops, motion: Prescribed, where: str, pose: Array) -> SingularPoseError:
    values, vectors = np.linalg.svd(loops.jacobian(pose)[:, loops.dependent])[1:]
    most = int(np.argmax(np.abs(vectors[min(len(values), len(vectors)) - 1])))
    moves = loops.names[int(loops.dependent[most])]
    return SingularPoseError(
        f"cycle: at {where} the mechanism is in a singular pose (dead centre), and the drive "
        f"{_several(motion.names)} does not lead it through: '{moves}' could move by itself. Stay short of it, or "
        f"drive another coordinate."
    )  # fmt: skip
