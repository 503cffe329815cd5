"""Loads: constant forces and torques on bodies, fixed in the world or in the body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mbsvib import _checks as check
from mbsvib._checks import Vector
from mbsvib.errors import ModelError
from mbsvib.parts._part import Part

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
