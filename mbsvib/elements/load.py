"""Loads: constant forces and torques on bodies, fixed in the world or in the body, and gravity."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.elements.part import Part, point
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from mbsvib.elements.part import ParameterField
    from mbsvib.elements.placement import Placement

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

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield point("force", self.force, "N")
        yield point("torque", self.torque, "N m")
        if self.position is not None:
            yield point("position", self.position)

    def with_values(self, values: Mapping[str, Any]) -> Self:
        return make(**self.arguments() | dict(values))  # type: ignore[return-value]

    def in_pose(self, pose: Placement, relaxed: bool) -> Part | dict[str, Any]:
        if pose.stays(self.body):
            return self
        changes: dict[str, Any] = {} if self.position is None else {"position": pose.point(self.body, self.position)}
        if self.follower:
            changes |= {key: pose.direction(self.body, getattr(self, key)) for key in ("force", "torque")}
        return replace(self, **changes)


@dataclass(frozen=True, slots=True)
class Gravity(Part):
    """The ``acceleration`` of free fall [m/s^2], world axes, as its components ``"gravity.x"`` ... are parameters."""

    acceleration: Vector

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield point("", self.acceleration, "m/s^2")

    def with_values(self, values: Mapping[str, Any]) -> Self:
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
