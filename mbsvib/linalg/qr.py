"""QR factorizations: columns pivoted, rows sorted by size, or the triangle alone; orthonormal columns.

Least squares of least norm, also of many matrices at once and along complex steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import blas, lapack

from mbsvib.common.arrays import AnyArray, Array, Bools, Index
from mbsvib.linalg.rank import FULL_RANK, REDUNDANT_LOOPS, ZERO_ALONG


def pivoted_qr(a: Array) -> tuple[Array, Index, Array]:
    """Return LAPACK's packed column-pivoted QR of ``a``, the order of columns and the reflectors' factors."""
    if 0 in a.shape:
        return np.zeros(a.shape), np.arange(a.shape[1]), np.zeros(0)
    qr, order, tau, _, _ = lapack.dgeqp3(a)
    return qr, order - 1, tau


def sorted_qr(a: Array) -> tuple[Array, Index]:
    """Return R and the order of the columns from a QR of an array, its rows sorted by size and its columns pivoted."""
    qr, order, _ = pivoted_qr(a[np.argsort(-np.abs(a).max(axis=1), kind="stable")])
    return np.triu(qr[: a.shape[1]]), order


def triangle(factor: Array) -> Array:
    """Return R upper triangular with R^T R = factor^T factor, from a QR of the factor."""
    m = factor.shape[1]
    return np.triu(lapack.dgeqrf(factor)[0][:m])


def gram_solution(factor: Array, right: Array) -> Array:
    """Return (W^T W)^-1 right, from a QR of the factor W."""
    root = triangle(factor)
    return np.asarray(np.linalg.solve(root, np.linalg.solve(root.T, right)))


def extended(
    basis: AnyArray, block: AnyArray, least: float, most: int | None = None, metric: Any = None
) -> AnyArray:
    """Return orthonormal columns (n, k), and behind them what is new in a block (n, b), up to ``most`` in all.

    A column of which no more than the share ``least`` is left depends on those before it. ``metric`` (n, n): symmetric,
    positive semidefinite, may be sparse; default: the identity.
    """
    def of(column: AnyArray) -> AnyArray:
        return column if metric is None else np.asarray(metric @ column)

    def size_of(column: AnyArray) -> float:
        return float(np.linalg.norm(column) if metric is None else np.sqrt(max(0.0, float(column @ of(column)))))

    for column in block.T:
        if basis.shape[1] == most or not (size := size_of(column)):
            continue
        rest = column / size
        for _ in range(2):
            rest = rest - basis @ (basis.conj().T @ of(rest))
        if (left := size_of(rest)) > least:
            basis = np.column_stack((basis, rest / left))
    return basis


def minimum_norm_solution(a: Array, right: Any, limit: float = REDUNDANT_LOOPS) -> Any:
    """Return the least-squares solution (n,) or (n, r) of a x = right of least norm, real or complex.

    ``a`` (k, n) has rows and unknowns of like size, the largest entries about 1. ``limit``: singular values up to it,
    or this share of the largest, belong to redundant rows; as a share alone it would take rounding for equations where
    all rows are redundant.
    """
    if right.ndim == 1 and not np.iscomplexobj(right):
        packed, order, tau = pivoted_qr(a)
        n, pivots = a.shape[1], np.abs(packed.diagonal())
        if 0 < len(pivots) == n and pivots[-1] > max(FULL_RANK, 100.0 * limit) * max(1.0, pivots[0]):
            turned = lapack.dormqr("L", "T", packed, tau, right[:, None], 64)[0]
            result = np.empty(n)
            result[order] = blas.dtrsm(1.0, packed[:n], turned[:n])[:, 0]
            return result
    u, values, v = np.linalg.svd(a, full_matrices=False)
    retained = values > limit * max(1.0, float(values.max(initial=0.0)))
    return v[retained].T @ ((u[:, retained].T @ right).T / values[retained]).T


def least_norm(a: Array, b: Array, least: float) -> Array:
    """Return x = A+ b, which minimizes |A x - b| and, among these, |x|.

    The imaginary part of a complex step is the derivative at constant rank,

    dx = A+ (db - dA x) + A+ A+^T dA^T (b - A x) + (1 - A+ A) dA^T A+^T x

    ``a`` (..., n, m), ``b`` (..., n), ``least``: singular values below this share of the largest count as zero. Returns
    (..., m).

    Source: Golub, Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, equation (4.12).
    """
    left, values, right = np.linalg.svd(a.real, full_matrices=False)
    kept = values > least * values[..., :1]
    inverse = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)

    def solved(vector: Any) -> Any:
        return _times(right.swapaxes(-1, -2), inverse * _times(left.swapaxes(-1, -2), vector))

    def back(vector: Any) -> Any:
        return _times(left, inverse * _times(right, vector))

    x: Array = solved(b.real)
    if not (np.iscomplexobj(a) or np.iscomplexobj(b)):
        return x
    change, open_by = a.imag, b.real - _times(a.real, x)
    rest = _times(change.swapaxes(-1, -2), back(x))
    rest = rest - _times(right.swapaxes(-1, -2), kept * _times(right, rest))
    dx: Array = solved(b.imag - _times(change, x) + back(_times(change.swapaxes(-1, -2), open_by))) + rest
    return np.asarray(x + 1j * dx)


def rank_grows(a: Array, least: float) -> Bools:
    """Return of which matrices (..., n, m) the rank grows along their complex step; ``least`` as of ``least_norm``."""
    left, values, right = np.linalg.svd(a.real, full_matrices=False)
    kept = values > least * values[..., :1]
    along = left.swapaxes(-1, -2) @ a.imag
    along = (along - (along @ right.swapaxes(-1, -2) * kept[..., None, :]) @ right) * ~kept[..., None]
    grown, size = (np.square(array).sum(axis=(-1, -2)) for array in (along, a.imag))
    return np.asarray(grown > ZERO_ALONG**2 * size)


def _times(matrix: Array, vector: Array) -> Array:
    return np.asarray((matrix @ vector[..., None])[..., 0])
