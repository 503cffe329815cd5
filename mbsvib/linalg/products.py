"""Gram matrices W^T W and D^T diag(k) D, exactly symmetric, with rows that are zero skipped; other products."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np

from mbsvib.common.arrays import AnyArray, Array, Index
from mbsvib.common.memory import MANY
from mbsvib.linalg.rank import EPS, ZERO_EIGENVALUE, ZERO_SUM


def gram_matrix(factor: Array) -> Array:
    """Return W^T W; zero rows, such as those of planar mechanisms, are left out if they are many."""
    return _square(nonzero_rows(factor) if factor.ndim == 2 else factor)


def nonzero_rows(factor: Array) -> Array:
    """Return the rows of a factor (r, m) without those that are zero, if the matrix is large and they are many."""
    if factor.shape[1] < MANY:
        return factor
    moves = np.asarray(factor.any(axis=1))
    return factor[moves] if 2 * np.count_nonzero(moves) < len(moves) else factor


# Rounding of a sum of n like terms, over n EPS, seen in up to 100 000 equal ones: roundings of partial sums may all go
# one way, in each of the pieces in which products add them, and over the pieces. Up to ``COVERED`` terms, the bounds of
# two or more roundings cover it.
DRIFT, COVERED, PIECE = 0.0625, 16, 256


def drift(*factors: Array) -> float:
    """Return the relative rounding of sums of squares in the columns of factors (r, m), which may all go one way, as
    those of many equal springs do; 0 for few rows.
    """
    most = 0
    for rows in factors:
        if len(rows) > max(most, COVERED):
            most = max(most, int(np.add.reduce(rows != 0.0, dtype=np.intp).max(initial=0)))
    return DRIFT * EPS * max(0, min(most - COVERED, PIECE + most // PIECE))


def weighted_gram(rows: Array, value: Array) -> Array:
    """Return rows^T diag(value) rows, exactly symmetric; either may have an axis of variants in front."""
    if value.ndim == 1 and rows.ndim == 2:
        used = value.nonzero()[0]
        if len(used) < len(value):
            rows, value = rows.take(used, axis=0), value.take(used)
        if rows.shape[1] >= MANY:
            column = single_entries(rows)
            if column is not None:
                weights = value * rows[np.arange(len(rows)), column] ** 2
                return np.asarray(np.diag(sums_by_number(column, weights, rows.shape[1])))
    elif rows.ndim == 2:
        return _combined(rows, value)
    if np.iscomplexobj(rows) or np.iscomplexobj(value):
        return _square_sum(rows, value)
    negative = value < 0.0
    if not np.count_nonzero(negative):
        return _square(rows * np.sqrt(value)[..., None])
    half: Array = rows * np.sqrt(np.abs(value))[..., None]
    if half.ndim == 2:
        plus, minus = half[~negative], half[negative]
        return _square(plus) - _square(minus)
    return _square_sum(half, np.sign(value))


def _square_sum(rows: Array, value: Array) -> Array:
    result: Array = rows.swapaxes(-1, -2) @ (rows * value[..., None])
    return 0.5 * (result + result.swapaxes(-1, -2))


def _square(rows: Array) -> Array:
    result: Array = rows.T.dot(rows) if rows.ndim == 2 else rows.swapaxes(-1, -2) @ rows
    return result


def _combined(rows: Array, value: Array) -> Array:
    """The same rows with many sets of values (variants, rows): one product with the outer squares of the rows."""
    if len(value) == 1:
        return weighted_gram(rows, value[0])[None]
    m = rows.shape[1]
    i, j = np.triu_indices(m)
    varies = np.asarray((value != value[:1]).any(axis=0))
    result = np.empty((len(value), m, m), value.dtype)
    upper = value[:, varies] @ (rows[varies][:, i] * rows[varies][:, j])
    upper += weighted_gram(rows[~varies], value[0, ~varies])[i, j]
    result[:, i, j] = result[:, j, i] = upper
    return result


def real_product(matrix: Any, values: AnyArray) -> AnyArray:
    """Return the products of real matrices (..., i, k) and numbers (..., k, n), complex ones by their two parts."""
    if values.dtype.kind != "c":
        return np.asarray(matrix @ values)
    result = np.ascontiguousarray(matrix @ np.ascontiguousarray(values).view(float))
    return result.view(values.dtype)


def product(matrix: Array, values: AnyArray) -> AnyArray:
    """Return the product (v, ...) of a real matrix (v, k) and numbers (k, ...), complex ones by their two parts."""
    flat = values.reshape(len(values), prod(values.shape[1:]))
    return real_product(matrix, flat).reshape(len(matrix), *values.shape[1:])


def square_difference(square: Array, w: Array) -> Array:
    """Return omega^2 - w^2 of squares omega^2, which may be negative; as a product where digits would cancel."""
    root = np.sqrt(np.abs(square))
    return np.where(square >= 0.0, (root - w) * (root + w), square - w * w)


def widened(matrix: Array, *others: Array) -> Array:
    """Return a copy of a matrix with the leading axes, and of the type, that take other matrices too."""
    lead = np.broadcast_shapes(matrix.shape[:-2], *[other.shape[:-2] for other in others])
    return np.broadcast_to(matrix, (*lead, *matrix.shape[-2:])).astype(np.result_type(matrix, *others))


def sums_by_number(number: Index, values: Array, count: int) -> Array:
    """Return the sums (count,) of values (n,), also of complex steps, by their numbers (n,)."""
    # bincount of an empty array returns integers
    result: Array = np.bincount(number, values.real, count).astype(float)
    if np.iscomplexobj(values):
        result = result + 1j * np.bincount(number, values.imag, count)
    return result


def single_entries(rows: Array) -> Index | None:
    """Return the column of each row's only entry (rows,), None where a row has more or none."""
    entry = rows != 0.0
    if np.count_nonzero(entry) != len(entry) or not entry.any(axis=1).all():
        return None
    return np.asarray(entry.argmax(axis=1))


def eigenrows(matrix: Array) -> tuple[Array, Array]:
    """Return values v (..., 6) and rows U (..., 6, 6) with matrix = U^T diag(v) U.

    The matrix is scaled to a unit diagonal, so that units do not mix; values that are rounding are set to zero.
    """
    return _scaled_eigenrows(matrix, np.sqrt(np.abs(np.einsum("...ii->...i", matrix))))


def nonzero_eigenrows(matrix: Array, scale: Array) -> tuple[Array, Array]:
    """Return values v (r,) and rows U (r, n), without what is rounding, with matrix (n, n) = U^T diag(v) U.

    ``scale`` (n,): sizes by which rows and columns are divided, so that units do not mix.
    """
    values, rows = _scaled_eigenrows(matrix, scale, len(matrix) * EPS)
    nonzero = values != 0.0
    return values[nonzero], rows[nonzero]


def _scaled_eigenrows(matrix: Array, scale: Array, zero: float = ZERO_EIGENVALUE) -> tuple[Array, Array]:
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(matrix / scale[..., None] / scale[..., None, :])
    size = np.abs(values)
    values[size <= zero * size.max(axis=-1, keepdims=True, initial=0.0)] = 0.0
    return values, np.swapaxes(vectors * scale[..., None], -1, -2)


def signed_rows(matrix: Array) -> tuple[Array, Array]:
    """Return values v (..., r) and rows U (..., r, 6) with matrix = U^T diag(v) U.

    They are those of ``eigenrows``; small imaginary parts of symmetric matrices have six more. These have any diagonal,
    so that the largest entries of their rows are their scale.
    """
    value, rows = eigenrows(matrix.real)
    if not np.iscomplexobj(matrix):
        return value, rows
    imaginary, own = _scaled_eigenrows(matrix.imag, np.sqrt(np.abs(matrix.imag).max(axis=-1)))
    return np.concatenate((value, 1j * imaginary), axis=-1), np.concatenate((rows, own), axis=-2)


def concatenated(arrays: Sequence[Any], axis: int) -> Any:
    """Return arrays joined along one of their last axes, -1, -2 ..., some of which have more leading axes."""
    lead, *others = [array.shape[:axis] for array in arrays]
    if all(other == lead for other in others):
        return np.concatenate(arrays, axis)
    lead = np.broadcast_shapes(lead, *others)
    return np.concatenate([np.broadcast_to(array, (*lead, *array.shape[axis:])) for array in arrays], axis)


def product_with_zeros(left: Array, right: Array) -> Array:
    """Return left @ right, with zeros for sums whose terms cancel to rounding."""
    result: Array = left @ right
    result.real[np.abs(result) <= ZERO_SUM * (np.abs(left) @ np.abs(right))] = 0.0
    return result


def squares_of_products(first: Array, second: Array) -> tuple[Array, Array]:
    """Return rows and signed weights of squares whose sum is the sum of products of two stacks of rows.

    p q = 1/4 (s p + q/s)^2 - 1/4 (s p - q/s)^2, with s such that s p and q/s have the same size: so a symmetric form
    remains a sum of weighted squares, from which modes are computed without loss of digits.

    ``first``, ``second`` (..., n, m): factors of each product. Returns ``rows`` (..., 2 n, m): sums, then differences;
    ``value`` (..., 2 n): 1/2, then -1/2; 0 for a product that is zero.
    """
    first_size, second_size = (np.einsum("...nm,...nm->...n", rows, rows) for rows in (first, second))
    zero = first_size * second_size == 0.0
    if np.count_nonzero(zero):
        first_size, second_size = np.where(zero, 1.0, first_size), np.where(zero, 1.0, second_size)
    scale = np.sqrt(np.sqrt(second_size / first_size))[..., None]
    a, b, half = scale * first, second / scale, np.where(zero, 0.0, 0.5)
    return np.concatenate((a + b, a - b), axis=-2), np.concatenate((half, -half), axis=-1)
