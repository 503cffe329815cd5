"""Transmission zeros of first-order equations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.responses.finite_zeros import finite_zeros

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex


def first_order_zeros(a: Array, b: Array, c: Array, d: Array) -> Complex:
    """Return the finite s [1/s] at which [[A - s, B], [C, D]] has less than its normal rank, in ascending magnitude."""
    if not len(a) or not d.size:
        return np.zeros(0, dtype=complex)
    a, b, c = scaled_by(exponents(a, b, c), a, b, c)
    unit = float(np.linalg.norm(a, 2)) or 1.0
    # columns of B and rows of (C, D) of unit size: zeros do not depend on units of inputs and outputs
    size = np.linalg.norm(b, axis=0)
    b, d = b / np.where(size > 0.0, size, 1.0), d / np.where(size > 0.0, size, 1.0)
    d = d * unit
    size = np.linalg.norm(np.concatenate((c, d), axis=1), axis=1)
    size = np.where(size > 0.0, size, 1.0)[:, None]
    zeros = finite_zeros(a / unit, b, c / size, d / size).zeros * unit
    return np.asarray(zeros[np.lexsort((-zeros.imag, np.abs(zeros)))])
