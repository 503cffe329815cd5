"""The distance of two points, an output that mbsvib does not have: one file and one row."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mbsvib.elements.connection import ENDS, LINE, line_between
from mbsvib.elements.deformations import Law, length
from mbsvib.elements.families import Family
from mbsvib.elements.ports import Signal
from mbsvib.elements.roles import stated

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.elements import Body


@dataclass(frozen=True, slots=True)
class Distance(Signal):
    """The change of the distance of ``start`` on ``first`` from ``end`` on ``second`` [m]."""

    law = Law(length)
    roles = stated(**ENDS, **LINE)
    unit = "m"

    first: str
    second: str
    start: tuple[float, ...]
    end: tuple[float, ...]


def make(name, first, second, start, end):
    """Check the values of a distance and build it."""
    a, b, _, _ = line_between(f"distance '{name}'", start, end, "The distance of one point has no direction.")
    return Distance(name, first, second, a, b)


def add_distance(
    self, name: str, first: str | Body, second: str | Body, start: ArrayLike, end: ArrayLike,
):  # fmt: skip
    """Add the distance of two points as an output."""
    a, b = (self._body_name(body, "distance", name, key) for body, key in ((first, "first"), (second, "second")))
    return self._keep(self._outputs, make(name, a, b, start, end))


ROW = Family(Distance, "distance", "outputs", make)
