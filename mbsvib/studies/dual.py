"""Dual numbers: values with their derivatives to the unknowns of a study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mbsvib.common.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class Dual:
    """Numbers ``value`` (k,) with their derivatives ``slope`` (k, n)."""

    value: Array
    slope: Array

    def __add__(self, right: Dual) -> Dual:
        return Dual(self.value + right.value, self.slope + right.slope)

    def __mul__(self, right: Dual) -> Dual:
        slope = self.value[:, None] * right.slope + right.value[:, None] * self.slope
        return Dual(self.value * right.value, slope)

    def through(self, function: Callable[[Array], Array], rate: Callable[[Array], Array]) -> Dual:
        """Return a function of each number, by its derivative."""
        with np.errstate(divide="ignore", invalid="ignore"):  # the caller refuses values that are not finite
            return Dual(function(self.value), rate(self.value)[:, None] * self.slope)


def stacked(duals: Sequence[Dual]) -> Dual:
    """Return all numbers concatenated; constants may have derivatives (k, 1)."""
    width = next((dual.slope.shape[1] for dual in duals if dual.slope.shape[1] != 1), 1)
    slopes = [np.broadcast_to(dual.slope, (len(dual.value), width)) for dual in duals]
    return Dual(np.concatenate([dual.value for dual in duals]), np.concatenate(slopes))
