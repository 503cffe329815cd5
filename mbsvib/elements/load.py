"""Loads: constant forces and torques on bodies, fixed in the world or in the body, and gravity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS, Vector
from mbsvib.elements.part import Numbered, Part
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

NONE: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Load(Part):
    """A constant ``force`` [N] at the point ``position`` of ``body`` and a constant ``torque`` [N m], world axes.

    ``position`` [m] is where the point of the body is in the given pose, None its centre of mass. A dead load keeps its
    direction in the world when the body turns, a ``follower`` turns with the body.
    """

    body: str
    force: Vector = NONE
    torque: Vector = NONE
    position: Vector | None = None
    follower: bool = False


@dataclass(frozen=True, slots=True)
class Gravity(Numbered):
    """The ``acceleration`` of free fall [m/s^2], world axes, as its components ``"gravity.x"`` ... are parameters."""

    acceleration: Vector

    def numbers(self) -> Iterator[tuple[str, tuple[str, ...] | None, Any]]:
        """Yield its three components, which have no other field than their direction."""
        yield "", DIRECTIONS[:3], self.acceleration

    def number(self, field: str) -> Any:
        """Return the acceleration."""
        return self.acceleration

    def with_numbers(self, values: Mapping[str, Any]) -> Self:
        """Return gravity of another acceleration."""
        expected = "an acceleration of free fall [m/s^2]"
        return type(self)(self.name, check.vector(values[""], "model", "gravity", expected))


def make(name: str, body: str, force: Any, torque: Any, position: Any, follower: Any) -> Load:
    """Check the values of a load and build it."""
    who = f"load '{name}'"
    if body == "ground":
        raise ModelError(f"{who}: body = 'ground', which no load moves; name the body that it acts on.",
                         element=who, field="body")  # fmt: skip
    force = check.vector(force, who, "force")
    torque = check.vector(torque, who, "torque")
    if not any(force) and not any(torque):
        raise ModelError(f"{who}: neither force nor torque is given; give one, or leave the load out.",
                         element=who, field="force")  # fmt: skip
    if not isinstance(follower, bool):
        raise check.refuse(who, "follower", follower, "True (turns with the body) or False (fixed in the world)")
    if position is not None:
        position = check.vector(position, who, "position")
    return Load(name, body, force, torque, position, follower)
