"""Vectors of many parts at once, (parts, 3, ...): the axes behind the first two are those of motions."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from mbsvib.common.arrays import AnyArray, Array
from mbsvib.linalg import rotations
from mbsvib.linalg.products import real_product
from mbsvib.linalg.rotations import skew

Field = AnyArray  # real or complex


# Matrices with at most so many entries are dense, as products with sparse ones cost more time.
DENSE = 16_000


def cross(a: Field, b: Field) -> Field:
    """Vector products of (k, 3, ...)."""
    return rotations.cross(a, b, 1)


def dot(a: Field, b: Field) -> Field:
    """Scalar products (k, 1, ...) of (k, 3, ...)."""
    return np.asarray((a * b).sum(axis=1, keepdims=True))


def wide(vectors: Field, like: Field) -> Field:
    """Vectors (k, 3) or numbers (k,) that broadcast against (k, 3, ...)."""
    return vectors.reshape(*vectors.shape, *[1] * (like.ndim - vectors.ndim))


def moved(motion: Field, arm: Array) -> Field:
    """Motions (k, 6, ...) of points that are at ``arm`` (k, 3) from the present ones."""
    result = motion.copy()
    result[:, :3] += cross(motion[:, 3:], wide(arm, motion))
    return result


def transformed(matrices: Array, vectors: Field) -> Field:
    """Return products of matrices (k, i, j) and vectors (k, j, ...)."""
    tail = vectors.shape[2:]
    result = real_product(matrices, vectors.reshape(*vectors.shape[:2], prod(tail)))
    return result.reshape(*result.shape[:2], *tail)


def incidence_sum(incidence: csr_array, wrench: Field) -> Field:
    """Return sums of wrenches (w, 6, n) that a matrix (rows, w) picks, (rows, 6, n)."""
    total = real_product(incidence, wrench.reshape(len(wrench), prod(wrench.shape[1:])))
    return total.reshape(incidence.shape[0], *wrench.shape[1:])


def entries_matrix(value: Any, row: Any, column: Any, shape: tuple[int, int]) -> Any:
    """Return the matrix with some entries, summed where indices coincide: dense if small, else sparse.

    ``value``, ``row``, ``column`` (n,): entries with their rows and columns.
    """
    if shape[0] * shape[1] > DENSE:
        return csr_array((value, (row, column)), shape=shape)
    result = np.zeros(shape)
    np.add.at(result, (row, column), value)
    return result


def moved_wrench(wrench: Field, arm: Array) -> Field:
    """Return wrenches (w, 6, n) about another point, from which the present one is at ``arm`` (w, 3)."""
    result = np.array(wrench)
    moves: list[bool] = np.asarray(arm.any(axis=0)).tolist()
    if all(moves):
        result[:, 3:] += real_product(skew(arm), wrench[:, :3])
        return result
    for axis, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        if moves[j]:
            result[:, 3 + axis] += arm[:, j, None] * wrench[:, k]
        if moves[k]:
            result[:, 3 + axis] -= arm[:, k, None] * wrench[:, j]
    return result


def any_nonzero(array: Field) -> bool:
    """Tell whether any entry of an array is nonzero; the first entry is checked first, which mostly suffices."""
    return bool(array.size and array.item(0)) or bool(array.any())


def inverse_root(size: Field) -> Field:
    """Return 1 / sqrt(size) of sizes that are not negative, by which equations are scaled; 1 where a size is 0."""
    return np.asarray(1.0 / np.sqrt(np.where(size > 0.0, size, 1.0)))
