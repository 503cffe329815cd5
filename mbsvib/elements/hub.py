"""Hubs: bodies that turn steadily with all that is on them, whose equations are those in their rotating frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.elements.body import NO_INERTIA, Body
from mbsvib.elements.part import ParameterField, vector_field

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from mbsvib.elements.part import Part
    from mbsvib.elements.placement import Placement
    from mbsvib.elements.pose import Pose


@dataclass(frozen=True, slots=True)
class Hub(Body):
    """A body that turns at a constant ``speed`` [rad/s] about the line along ``axis`` through ``position``.

    The axis is a unit vector in world axes. The hub is held: its own mass does not vibrate.
    """

    symbol = "body"
    batched_fields = frozenset({"speed"})
    signed_fields = batched_fields
    turns_steadily: ClassVar[bool] = True

    mass: float = field(default=0.0, init=False, metadata={"derived": True})
    inertia: tuple[float, float, float, float, float, float] = field(
        default=NO_INERTIA, init=False, metadata={"derived": True})  # fmt: skip
    orientation: Matrix3 = field(default=check.IDENTITY, init=False, metadata={"derived": True})
    speed: float = 0.0
    axis: Vector = (0.0, 0.0, 1.0)

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield ParameterField("speed", self.speed, "rad/s")
        yield vector_field("position", self.position)

    def constructor_kwargs(self) -> dict[str, Any]:
        return {"name": self.name, "speed": self.speed, "axis": self.axis, "position": self.position}

    def with_values(self, values: Mapping[str, Any]) -> Hub:
        return make(**self.constructor_kwargs() | dict(values))

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        return self

    def placed(self, to: Placement) -> dict[str, Any]:
        return {"axis": to.axial(self.axis), "position": to.point(self.position)}


def make(name: str, speed: Any, axis: Any, position: Any = (0.0, 0.0, 0.0)) -> Hub:
    """Check the values of a hub and build it."""
    who = f"hub '{name}'"
    return Hub(name, position=check.vector(position, who, "position"),
               speed=check.number(speed, who, "speed", "a finite number [rad/s]"),
               axis=check.axis(axis, who, "axis"))  # fmt: skip
