"""Rolling wheels: knife-edge wheels on a plane, and the steady forward motion in which they roll."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.elements.part import Part
from mbsvib.elements.placement import Placement
from mbsvib.elements.roles import BODY, ParameterField, number, stated, vector
from mbsvib.elements.roles import axis as line
from mbsvib.errors import ModelError

# The sine of the angle between a wheel's axis and the normal of its plane, below which the wheel lies flat.
FLAT = 1e-6


@dataclass(frozen=True, slots=True)
class Rolling(Part):
    """A wheel, ``body``, that rolls without slip on a plane with the unit vector ``normal``, world axes.

    Its edge is a circle of ``radius`` [m] about the unit vector ``axis`` through the body's centre of mass.
    """

    roles = stated(body=BODY, radius=number("m", signed=False), axis=line(axial=False),
                   normal=line(axial=False))  # fmt: skip

    body: str
    radius: float
    axis: Vector
    normal: Vector

    def with_values(self, values: Mapping[str, Any]) -> Self:
        part = super(Rolling, self).with_values(values)
        return replace(part, axis=self.axis, normal=self.normal)

    def placed(self, to: Placement) -> dict[str, Any]:
        if to.ground != "ground":
            raise ModelError(f"rolling wheel '{to.name(self.name)}': its plane would be part of body '{to.ground}'; "
                             f"wheels roll on the ground only.", element=self.name, field="body")  # fmt: skip
        there: dict[str, Any] = super(Rolling, self).placed(to)
        return there


@dataclass(frozen=True, slots=True)
class Travel(Part):
    """The ``velocity`` of steady forward motion [m/s], world axes, with the parameters ``"travel.x"``, .y and .z."""

    velocity: Vector

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield vector("m/s").field("", self.velocity)

    def with_values(self, values: Mapping[str, Any]) -> Self:
        return type(self)(self.name, check.vector(values[""], "model", "travel", "a velocity [m/s]"))


def make(name: str, body: str, radius: Any, axis: Any, normal: Any) -> Rolling:
    """Check the values of a rolling wheel and build it."""
    who = f"rolling wheel '{name}'"
    if body == "ground":
        raise check.refuse(who, "body", body, "a body that rolls on the ground")
    radius = check.number(radius, who, "radius", "the radius of the wheel [m]")
    if radius <= 0.0:
        raise check.refuse(who, "radius", radius, "a positive radius [m]")
    axis, normal = check.axis(axis, who, "axis"), check.axis(normal, who, "normal")
    if np.linalg.norm(np.cross(axis, normal)) < FLAT:
        raise check.refuse(who, "axis", axis, "an axis that is not normal to the plane", "This wheel would lie flat.")
    return Rolling(name, body, radius, axis, normal)
