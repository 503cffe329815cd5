"""Rotors: parts of a body, or whole bodies, that spin at a constant speed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.elements.part import ParameterField, Part

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Mask
    from mbsvib.elements.placement import Placement
    from mbsvib.elements.pose import Pose


@dataclass(frozen=True, slots=True)
class Rotor(Part):
    """A constant angular momentum of ``body``: ``inertia`` [kg m^2] times ``speed`` [rad/s] about ``axis``.

    The axis is a unit vector in world axes. Without ``inertia`` the body itself spins, with its own moment of inertia.
    """

    body: str
    speed: float
    axis: Vector
    inertia: float | None = None

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield ParameterField("speed", self.speed, "rad/s")
        if self.inertia is not None:
            yield ParameterField("inertia", self.inertia, "kg m^2")

    def with_values(self, values: Mapping[str, Any]) -> Self:
        part = make(**self._arguments_with(values))
        return replace(self, speed=part.speed, inertia=part.inertia)

    batched_fields = frozenset({"speed", "inertia"})
    signed_fields = batched_fields

    def suspects(self, values: Mapping[str, Array]) -> Mask | bool:
        return np.asarray(values.get("inertia", np.ones(1)) <= 0.0)

    def placed(self, to: Placement) -> dict[str, Any]:
        return {"body": to.body(self.body), "axis": to.axial(self.axis)}

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        return self.constructor_kwargs() | {"axis": pose.rotated_vector(self.body, self.axis)}


def make(name: str, body: str, speed: Any, axis: Any, inertia: Any) -> Rotor:
    """Check the values of a rotor and build it."""
    who = f"rotor '{name}'"
    if body == "ground":
        raise check.refuse(who, "body", body, "a body that moves",
                           "On ground it would have no effect.")  # fmt: skip
    speed = check.number(speed, who, "speed", "a finite number [rad/s]")
    if inertia is not None:
        inertia = check.number(inertia, who, "inertia", "its moment about the axis [kg m^2]")
        if inertia <= 0.0:
            raise check.refuse(who, "inertia", inertia, "a positive moment about the axis [kg m^2]",
                               "Leave it out if the body itself spins.")  # fmt: skip
    return Rotor(name, body, speed, check.axis(axis, who, "axis"), inertia)
