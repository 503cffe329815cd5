"""QR factorizations: columns pivoted, rows sorted by size, or the triangle alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index


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
