"""Unknowns of a search: scaled variables, logarithms of positive ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.errors import ModelError, nearest

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.studies.design import StudyVariables


@dataclass(frozen=True)
class Scales:
    """Unknowns x of variables p: ln(p / start) where p is positive throughout, else (p - start) / size."""

    start: Array
    low: Array
    high: Array
    size: Array
    positive: NDArray[np.bool_]

    def values(self, x: Array) -> Array:
        """Return the variables, clipped to their bounds."""
        p = np.where(self.positive, self.start * np.exp(np.where(self.positive, x, 0.0)), self.start + x * self.size)
        return np.asarray(np.clip(p, self.low, self.high))

    def rates(self, p: Array) -> Array:
        """Return dp/dx."""
        return np.where(self.positive, p, self.size)

    def bounds(self) -> tuple[Array, Array]:
        """Return bounds of the unknowns."""
        lower, upper = self._unknown(self.low), self._unknown(self.high)
        return lower, upper

    def _unknown(self, p: Array) -> Array:
        ratio = np.where(self.positive, p, 1.0) / np.where(self.positive, self.start, 1.0)
        return np.where(self.positive, np.log(ratio), (p - self.start) / self.size)


def scales(design: StudyVariables, variables: Mapping[str, Any], start: Mapping[str, float] | None) -> Scales:
    """Return the unknowns of a search.

    ``variables``: lower and upper bound of each; None: none, on that side or on both. ``start``: initial values;
    default: those of the model, 0 for linear maps.
    """
    begin = dict(start or {})
    for name in begin:
        if name not in design.variables:
            raise ModelError(f"optimize: start has '{name}', which is not one of the variables."
                             f"{nearest(str(name), design.variables)}", element=str(name), field="start")  # fmt: skip
    rows = []
    for name in design.variables:
        low, high = _bounds(name, variables[name])
        if name in begin:
            p = check.number(begin[name], f"variable '{name}'", "start")
        else:
            p = min(max(design.start[name], low), high)
            if np.isnan(design.start[name]):
                raise ModelError(f"variable '{name}': this argument of plant has no default; add one, or give "
                                 f"start = {{'{name}': ...}}.", element=name, field="start")  # fmt: skip
        if not low <= p <= high:
            raise ModelError(f"variable '{name}': start = {p:g}; expected a value from {low:g} to {high:g}.",
                             element=name, field="start")  # fmt: skip
        size = high - low if np.isfinite(high - low) else abs(p) or 1.0
        rows.append((p, low, high, size))
    values, low_, high_, size_ = np.array(rows, dtype=float).T
    return Scales(values, low_, high_, size_, low_ > 0.0)


def _bounds(name: str, bounds: Any) -> tuple[float, float]:
    pair = (None, None) if bounds is None else bounds
    try:
        low, high = pair
        least = -np.inf if low is None else float(low)
        most = np.inf if high is None else float(high)
    except (TypeError, ValueError) as error:
        raise check.refuse(f"variable '{name}'", "bounds", bounds, "a pair (lowest, highest), or None") from error
    if not least < most:
        raise check.refuse(f"variable '{name}'", "bounds", bounds, "a pair of ascending numbers")
    return least, most
