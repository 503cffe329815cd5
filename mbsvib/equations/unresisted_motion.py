"""Motions that springs or dampers do not resist: rank decisions on relative displacements, never on products of them.

Rows and columns are scaled by their largest entries, so that neither the size of a stiffness nor the unit of a
coordinate decides. Where only a product is known, its entries are compared with the sums of the sizes of their terms: a
row that is rounding of zero is not scaled up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas

from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import DEPENDENT_ROWS, LEAST_ROW, MASSLESS, ZERO_SUM

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations


# Rounds of scaling rows and columns by their largest terms; a third one changes nothing that counts.
ROUNDS = 2


def product(left: Array, right: Array) -> Array:
    """Return left @ right with zeros where the terms of a sum cancel to rounding."""
    result: Array = left @ right
    result[np.abs(result) <= ZERO_SUM * (np.abs(left) @ np.abs(right))] = 0.0
    return result


def free_motions(*parts: Array) -> Array:
    """Return the motions (m, f) that change none of the relative displacements in some arrays (n, m) of rows."""
    rows = np.concatenate(parts)
    row, column = _scales(np.abs(rows))
    qr, order, _ = pivoted_qr(rows * row[:, None] * column)
    m = rows.shape[1]
    rank = int(np.count_nonzero(np.abs(qr.diagonal()) > DEPENDENT_ROWS))
    free = np.zeros((m, m - rank))
    free[order[rank:], np.arange(m - rank)] = 1.0
    if 0 < rank < m:
        free[order[:rank]] = blas.dtrsm(-1.0, qr[:rank, :rank], qr[:rank, rank:])
    return column[:, None] * free


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


def largest(motions: Array, size: Array) -> Array:
    """Return the largest motions (m, k) that motions (m, k) could be, were each in every coordinate what it is in one,
    with coordinates in units of their ``size`` (m,): the rounding of motions is relative to these.
    """
    return np.asarray(size[:, None] * np.abs(motions / size[:, None]).max(axis=0, initial=0.0))


def unmoved(rows: Array, before: Array, kept: NDArray[np.intp]) -> Array:
    """Return rows (n, k) with their entries changed by as little as makes motions of no effect on them.

    The motions are those that leave the rows ``before`` (n, m) as they are, in the coordinates ``kept`` (k,). Entries
    that are zero stay so. Units are those of the rows before: columns that are rounding would make the rounding of a
    motion large.
    """
    result, pattern = rows.copy(), rows != 0.0
    if not rows.size:
        return result
    scale, motions = _scales(np.abs(before))[1][kept], free_motions(before)[kept]
    if not motions.shape[1]:
        return result
    motions = motions / scale[:, None]
    motions = motions / np.linalg.norm(motions, axis=0)
    for used in np.unique(pattern, axis=0):
        alike = np.ix_((pattern == used).all(axis=1), used)
        u, values, _ = np.linalg.svd(motions[used], full_matrices=False)
        u = u[:, values > DEPENDENT_ROWS]
        result[alike] -= ((rows[alike] * scale[used]) @ u) @ u.T / scale[used]
    return result


def _scales(terms: Array) -> tuple[Array, Array]:
    """Factors of the rows and columns that bring their largest terms to about one."""
    row, column = np.ones(terms.shape[0]), np.ones(terms.shape[1])
    for _ in range(ROUNDS):
        largest = (terms * column).max(axis=1, initial=0.0)
        row = np.divide(1.0, largest, out=np.ones_like(row), where=largest > 0.0)
        largest = (terms * row[:, None]).max(axis=0, initial=0.0)
        column = np.divide(1.0, largest, out=np.ones_like(column), where=largest > 0.0)
    return row, column


def orthonormal(factor: Array, motions: Array) -> Array:
    """Return motions (m, k) turned so that motions^T W^T W motions = 1 for a factor W; leading ones keep their span."""
    if not motions.shape[1]:
        return motions
    upper = np.linalg.qr(factor @ motions, mode="r")
    return np.asarray(blas.dtrsm(1.0, upper, motions.T, trans_a=1).T)


def completed(factor: Array, first: Array, motions: Array) -> Array:
    """Return orthonormal motions, W^T W as the metric, with the span of ``motions``, of which ``first`` come first."""
    first = orthonormal(factor, first)
    moved = factor @ motions
    rest = moved - (factor @ first) @ ((factor @ first).T @ moved)
    others = pivoted_qr(rest)[1][: motions.shape[1] - first.shape[1]]
    return orthonormal(factor, np.concatenate((first, motions[:, others]), axis=1))


def null_pair(matrix: Array, terms: Array) -> tuple[Array, Array]:
    """Return orthonormal bases of the right and left null space of a square matrix.

    Parameters
    ----------
    matrix : array, shape (m, m)
        The matrix.
    terms : array, shape (m, m)
        Sums of the sizes of the terms that each entry is the sum of.

    Returns
    -------
    tuple of array, shape (m, m - rank)
        Both.
    """
    size = sizes(matrix, terms)
    scaled = matrix / size[:, None] / size
    u, values, v = np.linalg.svd(scaled)
    rank = int(np.count_nonzero(values > DEPENDENT_ROWS))
    # null vectors by SVD are off by eps over the smallest other value; the correction is accurate relative to itself
    right = v[rank:].T - v[:rank].T @ ((u[:, :rank].T @ (scaled @ v[rank:].T)) / values[:rank, None])
    left = u[:, rank:] - u[:, :rank] @ ((v[:rank] @ (scaled.T @ u[:, rank:])) / values[:rank, None])
    return np.linalg.qr(right / size[:, None])[0], np.linalg.qr(left / size[:, None])[0]


def sizes(matrix: Array, terms: Array | float = 0.0) -> Array:
    """Return factors that bring the rows and columns of a square matrix to unit size, but not those of rounding."""
    size = np.maximum(np.abs(matrix), LEAST_ROW * terms)
    result: Array = np.sqrt(np.maximum(size.max(axis=0, initial=0.0), size.max(axis=1, initial=0.0)))
    result[result == 0.0] = 1.0
    return result
