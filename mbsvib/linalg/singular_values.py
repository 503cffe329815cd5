"""Singular values of matrices over frequency, without rounding of zeros."""

from __future__ import annotations

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.linalg.rank import ZERO_SUM


def singular_values(matrices: Complex) -> Array:
    """Return the singular values (k, n), descending, of matrices (rows, columns, n), 0 where they are rounding.

    sigma_k is rounding below ZERO_SUM times the larger dimension times sigma_1 of the same matrix.
    """
    sigma = np.linalg.svd(np.moveaxis(matrices, -1, 0), compute_uv=False)
    limit = ZERO_SUM * max(matrices.shape[:2]) * sigma[:, :1]
    return np.asarray(np.where(sigma > limit, sigma, 0.0).T)
