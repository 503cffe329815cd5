"""Massless motions, and those of them without damping: rank decisions on the factors.

Ranks are decided on rows, never on products: a mass of 1e-20 kg beside one of 1 kg is a mass, and a motion is massless
if its rows are zero to rounding of the geometry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from mbsvib.equations.unresisted_motion import null_motions
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import CERTAIN_MASS, CLOSURE_NOISE, DEPENDENT_ROWS, EPS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.inertia import SpatialInertia
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Twists


@dataclass(frozen=True, slots=True)
class Scale:
    """Reference sizes: the ``length`` [m] of the scene, the ``unit`` (m,) of each coordinate and the ``noise``.

    The unit of a rotation is 1 / length, which moves a point at this distance by one. The noise is the relative
    rounding error of the geometry.
    """

    length: float
    unit: Array
    noise: float


def scale_of(coordinates: Twists, position: Array, which: Index) -> Scale:
    """Return the reference sizes of the coordinates ``which`` of a scene with bodies at ``position`` (bodies, 3)."""
    points = np.concatenate((position, coordinates.point.T))
    low, high = points.min(axis=0), points.max(axis=0)
    length = float((high - low).max()) or 1.0
    far = max(1.0, float(np.abs(points).max()) / length)
    return Scale(length, np.where(coordinates.turns[which], 1.0 / length, 1.0), EPS * max(1, len(which)) * far)


def inertia_bounds(coordinates: Twists, reduction: Reduction, inertia: SpatialInertia, scale: Scale) -> Array:
    """Return upper bounds of the columns of W, by sums without cancellation, (m,) [sqrt kg m per unit].

    Zero if a coordinate moves no body with mass, directly or through loops.
    """
    size = np.abs(coordinates.linear).sum(axis=0), np.abs(coordinates.angular).sum(axis=0)
    path = np.abs(coordinates.path[:-1]).astype(float)
    closure = np.eye(len(size[0]))
    if reduction.matrix is not None:
        unit = np.where(coordinates.turns, 1.0 / scale.length, 1.0)
        closure = np.abs(reduction.matrix)
        small = closure * scale.unit <= CLOSURE_NOISE * unit[:, None]
        closure = np.where(small, 0.0, closure)
    translation = path @ ((size[0] + scale.length * size[1])[:, None] * closure)
    rotation = path @ (size[1][:, None] * closure)
    angular = np.sqrt(np.einsum("bij,bij->b", inertia.angular, inertia.angular))
    return np.asarray(np.sqrt((inertia.linear[:, None] * translation) ** 2 + (angular[:, None] * rotation) ** 2).sum(0))


def null_space(rows: Array, size: Array, limit: float, rank: int | None = None) -> tuple[Array, float, float]:
    """Return the null space of rows: motions that change none of them.

    ``rows`` (n, m): the rows. ``size`` (m,): upper bound of the entries of each column; zero: the column is zero.
    ``limit``: pivots of the columns over ``size`` up to this are zero. Returns the motions (m, m - rank), each
    with one in a coordinate in which the others are zero, the smallest pivot that counts as nonzero and the largest
    that counts as zero.
    """
    safe = np.where(size > 0.0, size, 1.0)
    scaled = np.where(size > 0.0, rows / safe, 0.0)
    qr, order, _ = pivoted_qr(scaled)
    pivots = np.abs(qr.diagonal())
    if rank is None:
        rank = int(np.count_nonzero(pivots > limit))
    null = null_motions(qr, order, rank) * (safe[order[rank:]] / safe[:, None])
    return null, float(pivots[rank - 1]) if rank else 1.0, float(pivots[rank]) if rank < len(pivots) else 0.0


def without_rounding(null: Array, unit: Array, noise: float) -> Array:
    """Return motions (m, n) scaled to a largest entry of one length, with zeros for rounding errors."""
    length = np.abs(null) / unit[:, None]
    largest = length.max(axis=0, initial=1e-300)
    return np.where(length > noise * largest, null / largest, 0.0)


def unresisted(parts: Sequence[Array], null: Array, unit: Array) -> tuple[Array, Index]:
    """Split motions into those that change no row, and others.

    ``parts`` have rows (n, m) of several kinds, whose lengths do not matter. ``null`` (m, k): the motions. ``unit``
    (m,): one unit of length of each coordinate. Returns motions (m, k - rank) that change no row, and numbers (rank,)
    of motions that span all of them together with these.
    """
    displacements = []
    for rows in parts:
        size = np.sqrt(((rows * unit) ** 2).sum(axis=1))
        nonzero = size > 0.0
        displacements.append((rows[nonzero] / size[nonzero, None]) @ null)
    moved = np.concatenate(displacements) if displacements else np.zeros((0, null.shape[1]))
    if not moved.any():
        return null, np.zeros(0, dtype=np.intp)
    factor, failed = lapack.dpotrf(moved.T @ moved)
    if not failed and float(factor.diagonal().min()) ** 2 > CERTAIN_MASS:
        return null[:, :0], np.arange(null.shape[1])
    inside, _, _ = null_space(moved, np.ones(null.shape[1]), DEPENDENT_ROWS)
    rank = null.shape[1] - inside.shape[1]
    return null @ inside, np.arange(rank) if not inside.shape[1] else pivoted_qr(moved)[1][:rank]


def independent_coordinates(null: Array) -> tuple[Index, Index]:
    """Return for each massless motion a coordinate that is one in it and zero in the others, and the rest."""
    single = (np.count_nonzero(null, axis=1) == 1) & (null.max(axis=1, initial=0.0) == 1.0)
    numbers = [int(np.flatnonzero(single & (motion == 1.0))[0]) for motion in null.T]
    independent = np.array(numbers, dtype=np.intp)
    return independent, np.setdiff1d(np.arange(len(null)), independent)
