"""The same model in other units: eigenvalues must not depend on them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment

if TYPE_CHECKING:
    from mbsvib.api.model import Model
    from mbsvib.common.arrays import Complex

# Numbers of a model in mm, ms and g, of which none is a power of two: all digits are rounded anew.
SCALES = {"m": 1e3, "s": 1e3, "kg": 1e3, "N": 1e3 * 1e3 / 1e3**2, "rad": 1.0, "-": 1.0, "1": 1.0}


def factor(unit: str) -> float:
    """Return the value of an SI unit in mm, ms, g; raises KeyError where it is not one of products of powers."""
    above, _, below = unit.partition("/")
    result = 1.0
    for words, sign in ((above, 1), (below, -1)):
        for word in words.split():
            base, _, power = word.partition("^")
            result *= SCALES[base] ** (sign * int(power or 1))
    return result


def restated(model: Model) -> Model:
    """Return a model with all numbers in mm, ms and g."""
    parameters = model.parameters
    return model.with_values({name: value * factor(parameters.units[name]) for name, value in parameters.items()
                              if value != 0.0 and factor(parameters.units[name]) != 1.0})  # fmt: skip


def difference(found: Complex, expected: Complex) -> float:
    """Return the largest relative difference of eigenvalues, paired so that their sum is least; inf if numbers differ.

    Eigenvalues that are expected to be 0 are left out, as double ones scatter by the root of rounding; those below 1e-3
    of the largest are compared with that, as the rounding of matrices is relative to the largest.
    """
    if len(found) != len(expected):
        return np.inf
    expected = expected[expected != 0.0]
    if not len(expected):
        return 0.0
    size = np.maximum(np.abs(expected), 1e-3 * float(np.abs(expected).max()))
    off = np.abs(np.asarray(found)[:, None] - expected[None]) / size
    return float(off[linear_sum_assignment(off)].max())
