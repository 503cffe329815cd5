"""Motions that move no mass, and those of them that no damper feels: rank decisions on the factors.

Ranks are decided on rows, never on products: a mass of 1e-20 kg beside one of 1 kg is a mass, and a motion counts as
massless where its rows are what rounding of the geometry leaves of zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas, lapack

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
    """What counts as large: ``length`` [m] of the scene, ``unit`` (m,) of each coordinate (1 / length for rotations:
    the turn that moves a point by one at that distance) and ``noise``, the relative rounding of the geometry.
    """

    length: float
    unit: Array
    noise: float


def scale_of(coordinates: Twists, position: Array, kept: Index) -> Scale:
    """Return what counts as large among the coordinates ``kept`` of a scene with bodies at ``position`` (bodies, 3)."""
    points = np.concatenate((position, coordinates.point.T))
    low, high = points.min(axis=0), points.max(axis=0)
    length = float((high - low).max()) or 1.0
    far = max(1.0, float(np.abs(points).max()) / length)
    return Scale(length, np.where(coordinates.turns[kept], 1.0 / length, 1.0), EPS * max(1, len(kept)) * far)


def possible(coordinates: Twists, reduction: Reduction, inertia: SpatialInertia, scale: Scale) -> Array:
    """Return what each minimal coordinate could move at most, were nothing to cancel, (m,) [sqrt kg m per unit].

    Zero where no body with mass lies behind the coordinate, nor behind any that the loops tie to it.
    """
    size = np.abs(coordinates.linear).sum(axis=0), np.abs(coordinates.angular).sum(axis=0)
    path = np.abs(coordinates.path[:-1]).astype(float)
    closure = np.eye(len(size[0]))
    if reduction.matrix is not None:
        unit = np.where(coordinates.turns, 1.0 / scale.length, 1.0)
        closure = np.abs(reduction.matrix)
        small = closure * scale.unit <= CLOSURE_NOISE * unit[:, None]
        closure = np.where(small, 0.0, closure)
    moved = path @ ((size[0] + scale.length * size[1])[:, None] * closure)
    turned = path @ (size[1][:, None] * closure)
    angular = np.sqrt(np.einsum("bij,bij->b", inertia.angular, inertia.angular))
    size = np.sqrt((inertia.linear[:, None] * moved) ** 2 + (angular[:, None] * turned) ** 2)
    return np.asarray(size.sum(axis=0))


def null_space(rows: Array, size: Array, limit: float, rank: int | None = None) -> tuple[Array, float, float]:
    """Return the motions that no row feels.

    Parameters
    ----------
    rows : array, shape (n, m)
        The rows.
    size : array, shape (m,)
        What an entry of each column could be at most; zero: the column is zero.
    limit : float
        Pivots of the columns over ``size`` up to this are zero.
    rank : int, optional
        The number of independent rows where it is known.

    Returns
    -------
    tuple of array, shape (m, m - rank), float and float
        The motions, each with one coordinate of its own at one; the smallest pivot kept and the largest dropped.
    """
    m = rows.shape[1]
    safe = np.where(size > 0.0, size, 1.0)
    scaled = np.where(size > 0.0, rows / safe, 0.0)
    qr, order, _ = pivoted_qr(scaled)
    pivots = np.abs(qr.diagonal())
    if rank is None:
        rank = int(np.count_nonzero(pivots > limit))
    null = np.zeros((m, m - rank))
    null[order[rank:], np.arange(m - rank)] = 1.0
    if 0 < rank < m:
        null[order[:rank]] = blas.dtrsm(-1.0, qr[:rank, :rank], qr[:rank, rank:])
        null *= safe[order[rank:]] / safe[:, None]
    return null, float(pivots[rank - 1]) if rank else 1.0, float(pivots[rank]) if rank < len(pivots) else 0.0


def cleaned(null: Array, unit: Array, noise: float) -> Array:
    """Return motions (m, n) of largest entry one, in lengths, without entries that are rounding."""
    length = np.abs(null) / unit[:, None]
    largest = length.max(axis=0, initial=1e-300)
    return np.where(length > noise * largest, null / largest, 0.0)


def unfelt(parts: Sequence[Array], null: Array, unit: Array) -> tuple[Array, Index]:
    """Split motions by whether rows feel them.

    Parameters
    ----------
    parts : sequence of array, shape (n, m)
        Rows of several kinds; the length of a row does not count.
    null : array, shape (m, k)
        The motions.
    unit : array, shape (m,)
        One unit of length of each coordinate.

    Returns
    -------
    tuple of array, shape (m, k - rank) and array, shape (rank,)
        The motions that no row feels, and the numbers of motions that, beside these, span the others.
    """
    moved = []
    for rows in parts:
        size = np.sqrt(((rows * unit) ** 2).sum(axis=1))
        acts = size > 0.0
        moved.append((rows[acts] / size[acts, None]) @ null)
    felt = np.concatenate(moved) if moved else np.zeros((0, null.shape[1]))
    if not felt.any():
        return null, np.zeros(0, dtype=np.intp)
    factor, failed = lapack.dpotrf(felt.T @ felt)
    if not failed and float(factor.diagonal().min()) ** 2 > CERTAIN_MASS:
        return null[:, :0], np.arange(null.shape[1])
    inside, _, _ = null_space(felt, np.ones(null.shape[1]), DEPENDENT_ROWS)
    rank = null.shape[1] - inside.shape[1]
    return null @ inside, np.arange(rank) if not inside.shape[1] else pivoted_qr(felt)[1][:rank]


def own_coordinates(null: Array) -> tuple[Index, Index]:
    """Return the coordinates that are one in a massless motion of their own and zero in others, and all other ones."""
    single = (np.count_nonzero(null, axis=1) == 1) & (null.max(axis=1, initial=0.0) == 1.0)
    own = np.array([int(np.flatnonzero(single & (null[:, k] == 1.0))[0]) for k in range(null.shape[1])], dtype=np.intp)
    return own, np.setdiff1d(np.arange(len(null)), own)
