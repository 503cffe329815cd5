"""Rotors: parts of a body, or whole bodies, that spin at a constant speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.elements.part import Part
from mbsvib.elements.roles import BODY, batched, number
from mbsvib.elements.roles import axis as line


@dataclass(frozen=True, slots=True)
class Rotor(Part):
    """A constant angular momentum of ``body``: ``inertia`` [kg m^2] times ``speed`` [rad/s] about ``axis``.

    The axis is a unit vector in world axes. Without ``inertia`` the body itself spins, with its own moment of inertia.
    """

    roles = batched(body=BODY, speed=number("rad/s"), inertia=number("kg m^2", positive=True), axis=line("body"))

    body: str
    speed: float
    axis: Vector
    inertia: float | None = None

    def with_values(self, values: Mapping[str, Any]) -> Self:
        part = super(Rotor, self).with_values(values)
        return replace(part, axis=self.axis)


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
