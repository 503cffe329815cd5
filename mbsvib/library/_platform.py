"""Ports of a six-legged platform, and the shapes its bodies are made of."""

from __future__ import annotations

from math import cos, sin
from typing import TYPE_CHECKING, Any

from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.api.model import Model
    from mbsvib.common.arguments import Vector

GROUPS = ("platform", "legs", "base")
LEGS = ("leg1", "leg2", "leg3", "leg4", "leg5", "leg6")
LOADS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def cylinder(mass: float, radius: float, length: float) -> Vector:
    """Return the principal moments of a solid cylinder about its centre, axis along z [kg m^2]."""
    across = mass * (3.0 * radius * radius + length * length) / 12.0
    return (across, across, 0.5 * mass * radius * radius)


def rod(principal: Vector, line: Vector) -> tuple[float, ...]:
    """Return the inertia in world axes, xx yy zz xy xz yz, of a body whose axis of symmetry z lies along ``line``."""
    across, _, along = principal
    x, y, z = line
    d = along - across
    return (across + d * x * x, across + d * y * y, across + d * z * z, d * x * y, d * x * z, d * y * z)


def box(mass: float, x: float, y: float, z: float) -> Vector:
    """Return the principal moments of a solid box with these edges about its centre [kg m^2]."""
    return (mass * (y * y + z * z) / 12.0, mass * (x * x + z * z) / 12.0, mass * (x * x + y * y) / 12.0)


def circle(radius: Any, height: Any, angles: Any, who: str, ring: str) -> list[Vector]:
    """Return six points on a horizontal circle about the z axis."""
    r = check.number(radius, who, f"{ring}_radius", "a radius [m]")
    z = check.number(height, who, f"{ring}_height", "a height [m]")
    turns = check.numbers(angles, (6,), who, f"{ring}_angles", "six angles [rad]")
    return [(r * cos(a), r * sin(a), z) for a in turns]


def port_groups(ports: Any, who: str) -> tuple[str, ...]:
    """Return the requested groups of ports."""
    if ports == "all":
        return GROUPS
    if ports == "none":
        return ()
    groups = (ports,) if isinstance(ports, str) or not hasattr(ports, "__iter__") else tuple(ports)
    if all(group in GROUPS for group in groups):
        return groups
    raise check.refuse(who, "ports", ports, "'platform', 'legs' or 'base', several of them, 'all' or 'none'")


def add_ports(model: Model, groups: Sequence[str], legs: Sequence[tuple[str, str, Vector, Vector]]) -> None:
    """Add the groups of ports; a leg is (first body, second body, point, direction), its spring ``leg1.k``..."""
    if "platform" in groups:
        for load, direction in zip(LOADS, DIRECTIONS, strict=True):
            model.add_input(load, "platform", direction)
            model.add_output(direction, "platform", direction)
    if "legs" in groups:
        for leg, (first, second, point, line) in zip(LEGS, legs, strict=True):
            model.add_input(f"{leg}.f", second, line, point, relative_to=first)
            model.add_output(f"{leg}.elongation", second, line, point, relative_to=first)
            model.add_force_output(f"{leg}.force", f"{leg}.k")
    if "base" in groups:
        for direction in "xyz":
            model.add_base_motion(f"a{direction}", direction)
        for direction in DIRECTIONS:
            model.add_output(f"platform.a{direction}", "platform", direction, quantity="acceleration")
