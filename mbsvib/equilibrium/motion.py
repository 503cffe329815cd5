"""Finite motion along the tree: bodies moved exactly by joint coordinates, and loops closed by Newton's method."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas, lapack, qr

from mbsvib.equilibrium.couplers import terms, travelled
from mbsvib.equilibrium.pose_kinematics import locked, pose_kinematics
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import CLOSED_EXACTLY, EPS, FULL_RANK, RANK_FACTOR, REDUNDANT_LOOPS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.equilibrium.pose import Pose
    from mbsvib.equilibrium.pose_kinematics import PoseKinematics
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.mechanism import Mechanism

CORRECTIONS = 25
# A change of norm below 1 takes no eigenvalue of 1 to 0; this leaves room for rounding.
NEARBY = 0.9
# Loops count as closed when they are open by no more than this share of their size, and get no closer.
CLOSED = 1e-13


@dataclass(frozen=True)
class Stance:
    """A model in one pose: the model as ``described``, its ``pose``, and the ``kinematics`` that move it from there.

    ``travel`` (terms,) tells how far the coordinates that couplers couple have gone, whole turns included.
    """

    described: Mechanism
    pose: Pose
    cut: tuple[str, ...]
    kinematics: PoseKinematics
    travel: Array

    @cached_property
    def _rows(self) -> tuple[Twists, Cuts | None]:
        return self.kinematics.at(self.pose)

    @property
    def coordinates(self) -> Twists:
        """The joint coordinates of the tree in this pose."""
        return self._rows[0]

    @property
    def cuts(self) -> Cuts | None:
        """What cut joints and couplers lock in this pose; None where there are none."""
        return self._rows[1]

    @property
    def size(self) -> float:
        """The size of the mechanism [m]."""
        return self.kinematics.size

    @cached_property
    def scale(self) -> Array:
        """Units (n,) in which all joint coordinates are of like size: 1 rad, or the size of the mechanism."""
        return np.where(self.kinematics.coordinates.turns, 1.0, self.size)

    @cached_property
    def rounding(self) -> float:
        """How far loops may be open as points are rounded relative to the origin, in units of ``size``."""
        points = self.coordinates.point
        return float(RANK_FACTOR * EPS * points.shape[1] * np.abs(points).max(initial=0.0) / self.size)

    @cached_property
    def closure(self) -> Array:
        """Phi (locked rows, n): what cut joints and couplers lock, in units of 1 rad and the size of the mechanism."""
        if self.cuts is None or self.pose.as_described:
            phi = self.kinematics.closure
        else:
            phi = locked(self.coordinates, self.cuts)
        return phi if self.cuts is None else phi * self.cuts.row_scale(self.size)[:, None]

    @cached_property
    def openings(self) -> Array:
        """How far loops and couplers are open, one value for each row of ``closure``, in the same units."""
        if self.cuts is None:
            return np.zeros(0)
        values, couplings = self.kinematics.openings(self.pose, self.cuts), self.cuts.couplings
        if couplings is not None:
            values = np.append(values, np.bincount(couplings.row, couplings.value * self.travel,
                                                   len(couplings.touched)))  # fmt: skip
        return np.asarray(values * self.cuts.row_scale(self.size))

    def under(self, model: Mechanism) -> Stance:
        """Return the same pose of a model with other loads."""
        return replace(self, described=model)

    def moved(self, q: Array) -> Stance:
        """Return the same model after finite joint motions (n,); loops are not looked at."""
        travel, pose = self.travel, self.kinematics.tree.moved(self.pose, self.coordinates, q)
        if self.cuts is not None and self.cuts.couplings is not None:
            travel = travelled(self.described, pose, travel + terms(self.cuts.couplings, self.coordinates) @ q)
        return Stance(self.described, pose, self.cut, self.kinematics, travel)


def stance(described: Mechanism, pose: Pose, cut: Sequence[str] = ()) -> Stance:
    """Return a model in one pose with the way to move it.

    Parameters
    ----------
    described : Mechanism
        The model as described.
    pose : Pose
        The pose.
    cut : sequence of str
        Joints at which loops are to be cut.

    Returns
    -------
    Stance
        Its tree, coordinates and loops there.
    """
    travel = travelled(described, pose, None) if described.couplers else np.zeros(0)
    return Stance(described, pose, tuple(cut), pose_kinematics(described, cut), travel)


def close(at: Stance, may_move: NDArray[np.bool_] | None = None) -> tuple[Stance, float]:
    """Close the loops by the smallest joint motions that do it, starting from a pose not far off.

    q <- q - pinv(Phi) e  with the exact openings e of cut joints and couplers

    Parameters
    ----------
    at : Stance
        Where to start from.
    may_move : array of bool, shape (n,), optional
        Joint coordinates that may be used; default: all.

    Returns
    -------
    Stance
        The stance with its loops closed, as far as they could be.
    float
        How far they are still open at most, in units of 1 rad and the size of the mechanism.
    """
    if at.cuts is None:
        return at, 0.0
    allowed = slice(None) if may_move is None else may_move
    here, best, left = at, at, np.inf
    for _ in range(CORRECTIONS):
        error = here.openings
        now = float(np.abs(error).max(initial=0.0))
        if not now < left:  # it gets no closer
            break
        best, gain, left = here, left, now
        if now <= CLOSED_EXACTLY or (now < CLOSED and now > 0.1 * gain):
            break
        scale = here.scale[allowed]
        step = np.zeros(len(here.scale))
        limit = max(REDUNDANT_LOOPS, here.rounding)
        step[allowed] = -scale * smallest(here.closure[:, allowed] * scale, error, limit)
        here = here.moved(step)
    return best, left


def smallest(a: Array, right: Array, limit: float = REDUNDANT_LOOPS) -> Array:
    """Return the smallest solution of a x = right in the sense of least squares.

    Parameters
    ----------
    a : array, shape (k, n)
        Scaled equations.
    right : array, shape (k,)
        Their right-hand side.
    limit : float
        Singular values up to it, or up to this share of the largest, are those of redundant rows.

    Returns
    -------
    array, shape (n,)
        The solution.
    """
    packed, order, tau = pivoted_qr(a)
    n, pivots = a.shape[1], np.abs(packed.diagonal())
    full = 0 < len(pivots) == n and pivots[-1] > max(FULL_RANK, 100.0 * limit) * max(1.0, pivots[0])
    if full:  # beyond doubt: there is one solution
        turned = lapack.dormqr("L", "T", packed, tau, right[:, None], 64)[0]
        result = np.empty(n)
        result[order] = blas.dtrsm(1.0, packed[:n], turned[:n])[:, 0]
        return result
    u, values, v = np.linalg.svd(a, full_matrices=False)
    kept = values > limit * max(1.0, float(values.max(initial=0.0)))
    return np.asarray((u[:, kept].T @ right / values[kept]) @ v[kept])


def same_side(here: Stance, there: Stance, depends: NDArray[np.bool_]) -> bool:
    """Return whether A = dPhi/dq of dependent coordinates goes over into that of the next pose without a dead point.

    Beyond a dead point an eigenvalue of A(here)^-1 A(there) has changed its sign; where two loops pass theirs at once
    two have, which the determinant does not tell.
    """
    if not depends.any():  # all loops are redundant
        return True
    before, after = ((stance.closure * stance.scale)[:, depends] for stance in (here, there))
    if len(before) > before.shape[1]:  # some rows are redundant
        rows = qr(before.T, mode="r", pivoting=True)[1][: before.shape[1]]
        before, after = before[rows], after[rows]
    _, _, change, failed = lapack.dgesv(before, after - before)
    if not failed and np.abs(change).sum(axis=0).max(initial=0.0) < NEARBY:
        return True  # no eigenvalue of 1 + change is anywhere near 0
    alpha, _, beta, *_, info = lapack.dggev(after, before, compute_vl=0, compute_vr=0)
    return info == 0 and bool((alpha * beta > 0.0).all())
