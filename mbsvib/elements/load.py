"""Loads: constant forces and torques on bodies, fixed in the world or in the body, and gravity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Self

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.elements.part import Part
from mbsvib.elements.roles import BODY, ParameterField, batched, point, vector
from mbsvib.errors import ModelError

NONE: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Load(Part):
    """A constant ``force`` [N] at the point ``position`` of ``body`` and a constant ``torque`` [N m], world axes.

    ``position`` [m] is the point in the reference pose, None the centre of mass. A dead load keeps its direction in the
    world when the body rotates; a ``follower`` rotates with the body.
    """

    roles = batched(
        body=BODY, force=vector("N", on="body", follows="follower"),
        torque=vector("N m", axial=True, on="body", follows="follower"), position=point("body"),
    )  # fmt: skip

    body: str
    force: Vector = NONE
    torque: Vector = NONE
    position: Vector | None = None
    follower: bool = False


@dataclass(frozen=True, slots=True)
class Gravity(Part):
    """The ``acceleration`` of free fall [m/s^2], world axes, with the parameters ``"gravity.x"``, ...y and ...z."""

    acceleration: Vector
    batched_fields = frozenset({""})
    signed_fields = batched_fields

    def suspects(self, values: Mapping[str, Array]) -> bool:
        return False

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield vector("m/s^2").field("", self.acceleration)

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
