"""Derivatives of smooth functions by differences with Romberg extrapolation.

Each step is half of the one before; the error is a series in powers of the step, of which each extrapolation removes
one.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from mbsvib.common.arrays import Array

# Number of steps: four central differences have an error of eighth order; one-sided differences need more.
LEVELS, ONE_SIDED = 4, 7


def slope(of: Callable[[float], Array], step: float, sides: int = 0) -> tuple[Array, Array]:
    """Return the slope of a function at 0, and the change by the last extrapolation, an estimate of its error.

    ``sides``: 0: both sides; 1 or -1: arguments of this sign only.
    """
    if sides:
        start = of(0.0)
        table = [(of(sides * h) - start) / (sides * h) for h in (step * 0.5**k for k in range(ONE_SIDED))]
    else:
        table = [(of(h) - of(-h)) / (2.0 * h) for h in (step * 0.5**k for k in range(LEVELS))]
    for order in range(1, len(table)):
        factor = 2.0**order if sides else 4.0**order
        last = table[-1]
        table = [(factor * fine - coarse) / (factor - 1.0) for coarse, fine in pairwise(table)]
    return table[0], np.abs(table[0] - last)
