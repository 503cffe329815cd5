"""Connections: elements that act with a force or moment between two bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mbsvib.elements.part import Part
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from mbsvib.common.arguments import Vector


@dataclass(frozen=True, slots=True)
class Connection(Part):
    """An element between the bodies ``first`` and ``second``."""

    first: str
    second: str

    @property
    def points(self) -> tuple[Vector, ...]:
        """Points at which it acts [m], world axes: one, or that on the first body and that on the second."""
        return tuple([value for key in ("position", "start", "end") if (value := getattr(self, key, None)) is not None])

    @property
    def loaded(self) -> bool:
        """Whether it carries a force in the pose as described."""
        return False


def check_ends(who: str, first: str, second: str) -> None:
    """Refuse a connection of a body with itself."""
    if first == second:
        raise ModelError(f"{who}: connects body '{first}' with itself; name two different bodies.",
                         element=who, field="second")  # fmt: skip
