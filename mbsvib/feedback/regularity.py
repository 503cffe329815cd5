"""Algebraic loops: feedthroughs of plant and controller whose product is 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array

# A singular value of 1 - D K below this share of its terms is rounding: the loop has no solution.
ALGEBRAIC = 1e-12


def regular(product: Array) -> bool:
    """Return whether 1 - D K can be inverted, for the product D K (n, n) of the feedthroughs."""
    n = len(product)
    if not n:
        return True
    smallest = np.linalg.svd(np.eye(n) - product, compute_uv=False)[-1]
    return bool(smallest > ALGEBRAIC * (1.0 + np.linalg.norm(product, 2)))
