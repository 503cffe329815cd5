"""The largest and the smallest of many numbers; a search bounds all of them, which avoids kinks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.studies.dual import Dual, stacked
from mbsvib.studies.quantities import Quantity, quantity

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.studies.evaluation import DesignPoint


class Largest(Quantity):
    """The largest of many numbers; a search bounds all of them at once, as the maximum has kinks.

    ``members`` are the numbers; if there are infinitely many, those at the points of ``active``, which are initially
    the ``seeds`` and later include the ``tops``, the local maxima.
    """

    def at(self, point: DesignPoint) -> Dual:
        """Return the largest, or the bound that replaces it in a search."""
        return point.level(self) or self.true(point)

    def true(self, point: DesignPoint) -> Dual:
        """Return the largest itself."""
        members = self.members(point, None)
        which = [int(members.value.argmax())]
        return Dual(members.value[which], members.slope[which])

    def members(self, point: DesignPoint, active: Array | None) -> Dual:
        """Return the numbers."""
        return self.parts[0].at(point)

    def seeds(self, point: DesignPoint) -> Array | None:
        """Return the initial points; None if there are finitely many numbers."""
        return None

    def tops(self, point: DesignPoint) -> tuple[Array, Array]:
        """Return points at which numbers are largest, and these numbers."""
        return np.zeros(0), np.zeros(0)


def largest(*quantities: Any) -> Quantity:
    """Return the largest of all numbers of some quantities.

    Parameters
    ----------
    *quantities : Quantity
        What to look at; ``minimax`` objectives and bounds of it are solved without kinks.

    Returns
    -------
    Quantity
        One number.
    """
    quantity = _stacked(quantities)
    return Largest(f"largest of {quantity.label}", (quantity,), lambda a: a)


def smallest(*quantities: Any) -> Quantity:
    """Return the smallest of all numbers of some quantities.

    Parameters
    ----------
    *quantities : Quantity
        What to look at.

    Returns
    -------
    Quantity
        One number, as large as its constraints let it be where its negative is minimised.
    """
    quantity = _stacked(quantities)
    result = -Largest(f"largest of {(-quantity).label}", (-quantity,), lambda a: a)
    result.label = f"smallest of {quantity.label}"
    return result


def _stacked(quantities: tuple[Any, ...]) -> Quantity:
    parts = tuple([quantity(item) for item in quantities])
    if not parts:
        raise check.refuse("largest", "quantities", quantities, "at least one quantity")
    if len(parts) == 1:
        return parts[0]

    return Quantity(", ".join(part.label for part in parts), parts, lambda *duals: stacked(duals))
