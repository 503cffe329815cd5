"""Solutions of least norm of equations some of which may be redundant."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import blas, lapack

from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import FULL_RANK, REDUNDANT_LOOPS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


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
