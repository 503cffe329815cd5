"""Motions without stiffness, damping or mass: rank decisions on rows, never on products of them.

Rows and columns are scaled by their largest entries, so that a decision depends neither on the size of a stiffness nor
on the unit of a coordinate. If only a product is known, its entries are compared with the sums of the magnitudes of
their terms, so that a row of rounding errors is not scaled up. So it is for mass: a mass of 1e-20 kg beside one of 1 kg
is a mass, and a motion is massless if its rows of the mass are zero to rounding of the geometry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas, lapack

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import CERTAIN_MASS, CLOSURE_NOISE, DEPENDENT_ROWS, EPS, LEAST_ROW, MASSLESS

if TYPE_CHECKING:
    from mbsvib.equations.equations import Equations
    from mbsvib.equations.inertia import SpatialInertia
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Twists


# Passes of scaling rows and columns by their largest terms; a third one has no significant effect.
ROUNDS = 2
# Entries below this fraction of their terms are zero.
NOTHING = EPS**2


def free_motions(*parts: Array) -> Array:
    """Return the motions (m, f) that change none of the relative displacements in some arrays (n, m) of rows."""
    rows = np.concatenate(parts)
    row, column = _scales(np.abs(rows))
    qr, order, _ = pivoted_qr(rows * row[:, None] * column)
    rank = int(np.count_nonzero(np.abs(qr.diagonal()) > DEPENDENT_ROWS))
    return np.asarray(column[:, None] * null_motions(qr, order, rank))


def null_motions(qr: Array, order: Index, rank: int) -> Array:
    """Return the null space (m, m - rank) of rows with this pivoted QR, each motion with one in another coordinate."""
    m = qr.shape[1]
    result = np.zeros((m, m - rank))
    result[order[rank:], np.arange(m - rank)] = 1.0
    if 0 < rank < m:
        result[order[:rank]] = blas.dtrsm(-1.0, qr[:rank, :rank], qr[:rank, rank:])
    return result


def coordinate_sizes(system: Equations) -> Array:
    """Return the size (m,) that each coordinate has in a motion of unit kinetic energy, 1 / sqrt(M_jj).

    A massless coordinate counts with the mass that would give it the highest frequency of a single coordinate.
    """
    k = np.square(system.elastic_rows).T @ np.abs(system.row_stiffness)
    mass = system.M.diagonal()
    massive = mass > MASSLESS * mass.max(initial=0.0)
    square = (k[massive] / mass[massive]).max(initial=0.0)
    weight = np.where(massive, mass, k / square if square > 0.0 else 0.0)
    return np.asarray(1.0 / np.sqrt(np.where(weight > 0.0, weight, mass.max(initial=1.0))))


def rounding_scale(motions: Array, size: Array) -> Array:
    """Return reference magnitudes (m, k) for rounding errors of motions (m, k): the largest entry of each motion.

    Entries are compared in units of the ``size`` (m,) of the coordinates.
    """
    return np.asarray(size[:, None] * np.abs(motions / size[:, None]).max(axis=0, initial=0.0))


def without_free_motions(rows: Array, all_rows: Array, columns: Index) -> Array:
    """Return rows (n, k) with the smallest changes of nonzero entries after which free motions do not change them.

    Free motions are those that change none of the rows ``all_rows`` (n, m), restricted to the coordinates ``columns``
    (k,). The coordinates are scaled by ``all_rows``: the scale of a column of rounding errors would amplify them.
    """
    result, pattern = rows.copy(), rows != 0.0
    if not rows.size:
        return result
    scale, motions = _scales(np.abs(all_rows))[1][columns], free_motions(all_rows)[columns]
    if not motions.shape[1]:
        return result
    motions = motions / scale[:, None]
    motions = motions / np.linalg.norm(motions, axis=0)
    for used in np.unique(pattern, axis=0):
        block = np.ix_((pattern == used).all(axis=1), used)
        u, values, _ = np.linalg.svd(motions[used], full_matrices=False)
        u = u[:, values > DEPENDENT_ROWS]
        result[block] -= ((rows[block] * scale[used]) @ u) @ u.T / scale[used]
    return result


def _scales(terms: Array) -> tuple[Array, Array]:
    """Factors of the rows and columns that scale their largest terms to about one."""
    row, column = np.ones(terms.shape[0]), np.ones(terms.shape[1])
    for _ in range(ROUNDS):
        largest = (terms * column).max(axis=1, initial=0.0)
        row = np.divide(1.0, largest, out=np.ones_like(row), where=largest > 0.0)
        largest = (terms * row[:, None]).max(axis=0, initial=0.0)
        column = np.divide(1.0, largest, out=np.ones_like(column), where=largest > 0.0)
    return row, column


def orthonormal(factor: Array, motions: Array) -> Array:
    """Return combinations of motions (m, k) that are orthonormal in the metric W^T W; leading ones keep their span."""
    if not motions.shape[1]:
        return motions
    upper = np.linalg.qr(factor @ motions, mode="r")
    return np.asarray(blas.dtrsm(1.0, upper, motions.T, trans_a=1).T)


def completed_basis(factor: Array, first: Array, motions: Array) -> Array:
    """Return motions, orthonormal in the metric W^T W, with the span of ``motions``, of which ``first`` come first."""
    first = orthonormal(factor, first)
    rows, first_rows = factor @ motions, factor @ first
    others = pivoted_qr(rows - first_rows @ (first_rows.T @ rows))[1][: motions.shape[1] - first.shape[1]]
    return orthonormal(factor, np.concatenate((first, motions[:, others]), axis=1))


def null_pair(matrix: Array, terms: Array) -> tuple[Array, Array]:
    """Return orthonormal bases of the right and left null space of a square matrix.

    ``terms`` (m, m): sums of the magnitudes of the terms of each entry. Returns right and left null vectors (m, m -
    rank).
    """
    size = matrix_scales(matrix, terms)
    scaled = np.where(np.abs(matrix) > NOTHING * terms, matrix, 0.0) / size[:, None] / size
    # zero rows and columns are split off: null vectors of the SVD have errors of eps over the smallest nonzero value
    rows = np.asarray(scaled.any(axis=1), dtype=bool)
    columns = np.asarray(scaled.any(axis=0), dtype=bool)
    u, values, v = np.linalg.svd(scaled[np.ix_(rows, columns)])
    rank = int(np.count_nonzero(values > DEPENDENT_ROWS))
    right, left = _with_unit_vectors(v[rank:].T, columns), _with_unit_vectors(u[:, rank:], rows)
    return np.linalg.qr(right / size[:, None])[0], np.linalg.qr(left / size[:, None])[0]


def _with_unit_vectors(vectors: Array, used: Bools) -> Array:
    """Unit vectors of unused coordinates, then vectors (n, k) of the n used ones, (m, m - n + k)."""
    result = np.zeros((len(used), int(np.count_nonzero(~used)) + vectors.shape[1]))
    rest = np.flatnonzero(~used)
    result[rest, np.arange(len(rest))] = 1.0
    result[np.ix_(used, np.arange(len(rest), result.shape[1]))] = vectors
    return result


def matrix_scales(matrix: Array, terms: Array | float = 0.0) -> Array:
    """Return factors that scale rows and columns of a square matrix to unit size, except those of rounding errors."""
    size = np.maximum(np.abs(matrix), LEAST_ROW * terms)
    result: Array = np.sqrt(np.maximum(size.max(axis=0, initial=0.0), size.max(axis=1, initial=0.0)))
    result[result == 0.0] = 1.0
    return result


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
    distance = float(np.abs(points).max())
    length = float((high - low).max()) or distance or 1.0
    far = max(1.0, distance / length)
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
