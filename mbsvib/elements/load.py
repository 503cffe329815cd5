"""Loads: constant forces and torques on bodies, fixed in the world or in the body, and gravity."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.elements.part import ParameterField, Part, vector_field
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Mask
    from mbsvib.elements.placement import Placement
    from mbsvib.elements.pose import Pose

NONE: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Load(Part):
    """A constant ``force`` [N] at the point ``position`` of ``body`` and a constant ``torque`` [N m], world axes.

    ``position`` [m] is the point in the reference pose, None the centre of mass. A dead load keeps its direction in the
    world when the body rotates; a ``follower`` rotates with the body.
    """

    body: str
    force: Vector = NONE
    torque: Vector = NONE
    position: Vector | None = None
    follower: bool = False

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield vector_field("force", self.force, "N")
        yield vector_field("torque", self.torque, "N m")
        if self.position is not None:
            yield vector_field("position", self.position)

    def with_values(self, values: Mapping[str, Any]) -> Load:
        return make(**self._arguments_with(values))

    batched_fields = frozenset({"force", "torque", "position"})
    signed_fields = batched_fields

    def suspects(self, values: Mapping[str, Array]) -> Mask | bool:
        idle = [~np.any(values.get(field, np.array(getattr(self, field))[:, None]), axis=0)
                for field in ("force", "torque")]  # fmt: skip
        return np.asarray(idle[0] & idle[1])

    def placed(self, to: Placement) -> dict[str, Any]:
        return {"body": to.body(self.body), "force": to.vector(self.force), "torque": to.axial(self.torque),
                "position": to.point(self.position)}  # fmt: skip

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        if pose.is_unmoved(self.body):
            return self
        changes: dict[str, Any] = {} if self.position is None else {"position": pose.point(self.body, self.position)}
        if self.follower:
            changes |= {key: pose.rotated_vector(self.body, getattr(self, key)) for key in ("force", "torque")}
        return replace(self, **changes)


@dataclass(frozen=True, slots=True)
class Gravity(Part):
    """The ``acceleration`` of free fall [m/s^2], world axes, with the parameters ``"gravity.x"``, ...y and ...z."""

    acceleration: Vector
    batched_fields = frozenset({""})
    signed_fields = batched_fields

    def suspects(self, values: Mapping[str, Array]) -> Mask | bool:
        return False

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield vector_field("", self.acceleration, "m/s^2")

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
