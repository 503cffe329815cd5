"""Least squares of least norm, also of many matrices at once and along complex steps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.rank import ZERO_ALONG

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Bools


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
