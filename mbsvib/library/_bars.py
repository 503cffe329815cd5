"""Slender bars between two points: the links of linkages."""

from __future__ import annotations

from math import atan2, cos, hypot, sin
from typing import TYPE_CHECKING

from mbsvib.common import arguments as check

if TYPE_CHECKING:
    from mbsvib.api.model import Model
    from mbsvib.common.arguments import Vector

Point = tuple[float, float]
# Moment of inertia of a planar bar about its own line as a share of that across it; it has no effect in the plane.
THICKNESS = 0.01


def add_planar_bar(model: Model, name: str, start: Point, end: Point, per_length: float) -> None:
    """Add a slender bar in the x-y plane, its x along its line."""
    length = hypot(end[0] - start[0], end[1] - start[1])
    moment = per_length * length**3 / 12.0
    model.add_body(name, per_length * length, (THICKNESS * moment, moment, moment),
                   (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), 0.0),
                   (0.0, 0.0, atan2(end[1] - start[1], end[0] - start[0])))  # fmt: skip


def add_bar(model: Model, name: str, start: Vector, end: Vector, mass: float, axial_inertia: float) -> None:
    """Add a slender bar in space, its z along its line."""
    line = (end[0] - start[0], end[1] - start[1], end[2] - start[2])
    length = hypot(*line)
    moment = mass * length**2 / 12.0
    model.add_body(name, mass, (moment, moment, axial_inertia),
                   (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), 0.5 * (start[2] + end[2])),
                   check.frame_along((line[0] / length, line[1] / length, line[2] / length)))  # fmt: skip


def meeting(first: Point, first_length: float, second: Point, second_length: float, who: str, field: str) -> Point:
    """Return where two bars from two pins meet, on the left of the line from the first pin to the second."""
    x, y = second[0] - first[0], second[1] - first[1]
    distance = hypot(x, y)
    if not abs(first_length - second_length) < distance < first_length + second_length:
        raise check.refuse(who, field, None, f"lengths that meet: bars of {first_length:g} m and {second_length:g} m "
                           f"start from pins {distance:g} m apart")  # fmt: skip
    along = 0.5 * (distance**2 + first_length**2 - second_length**2) / distance
    across = (first_length**2 - along**2) ** 0.5
    return (first[0] + (along * x - across * y) / distance, first[1] + (along * y + across * x) / distance)


def turned(length: float, angle: float) -> Point:
    """Return the end of a bar from the origin, at an angle from x towards y."""
    return (length * cos(angle), length * sin(angle))
