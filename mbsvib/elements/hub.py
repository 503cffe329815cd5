"""Hubs: bodies that turn steadily with all that is on them, whose equations are those in their rotating frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.elements.body import NO_INERTIA, Body
from mbsvib.elements.roles import axis as line
from mbsvib.elements.roles import batched, number, point


@dataclass(frozen=True, slots=True)
class Hub(Body):
    """A body that turns at a constant ``speed`` [rad/s] about the line along ``axis`` through ``position``.

    The axis is a unit vector in world axes. The hub is held: its own mass does not vibrate.
    """

    symbol = "body"
    turns_steadily: ClassVar[bool] = True
    roles = batched(speed=number("rad/s"), position=point(batched=False), axis=line())

    mass: float = field(default=0.0, init=False, metadata={"derived": True})
    inertia: tuple[float, float, float, float, float, float] = field(
        default=NO_INERTIA, init=False, metadata={"derived": True})  # fmt: skip
    orientation: Matrix3 = field(default=check.IDENTITY, init=False, metadata={"derived": True})
    speed: float = 0.0
    axis: Vector = (0.0, 0.0, 1.0)

    def constructor_kwargs(self) -> dict[str, Any]:
        """Return the arguments of ``add_hub`` that make this hub; it has no speed and no axis of its own accord."""
        return {"name": self.name, "speed": self.speed, "axis": self.axis, "position": self.position}


def make(name: str, speed: Any, axis: Any, position: Any = (0.0, 0.0, 0.0)) -> Hub:
    """Check the values of a hub and build it."""
    who = f"hub '{name}'"
    return Hub(name, position=check.vector(position, who, "position"),
               speed=check.number(speed, who, "speed", "a finite number [rad/s]"),
               axis=check.axis(axis, who, "axis"))  # fmt: skip
