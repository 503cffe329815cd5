"""Copies of all parts of a mechanism: with a prefix, in another place, and mirrored."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.elements.families import rebuild_with
from mbsvib.elements.part import Part
from mbsvib.elements.placement import Placement
from mbsvib.mechanism.mechanism import Mechanism

PLANES = ("x", "y", "z")


def placement(
    prefix: str, other: Mechanism, position: Any, orientation: Any, ground: str, mirror: Any
) -> Placement:
    """Return where the copy of a mechanism is to be, checked.

    ``prefix``: what its names begin with. ``position``, ``orientation``: origin [m] and axes of the original in world
    axes. ``ground``: the body in place of its ground. ``mirror``: axis of the original to whose plane it is reflected
    first, or None.
    """
    who = f"model '{prefix}'"
    reflection = np.ones(3)
    if mirror is not None:
        if not isinstance(mirror, str) or mirror not in PLANES:
            raise check.refuse(who, "mirror", mirror, "'x', 'y' or 'z', the normal of the plane, or None")
        reflection[PLANES.index(mirror)] = -1.0
    groups = other.groups()
    parts: dict[str, Part] = dict(other.bodies) | dict(other.joints) | dict(other.springs)
    parts |= {name: beam for beam in groups["composed"].values() for name in beam.element_names}
    turn = np.array(check.orientation(orientation, who)) * reflection
    offset = check.vector(position, who, "position", "the point (x, y, z) [m] of its origin")
    return Placement(check.name(prefix, "model"), offset, turn, mirror is not None, ground, parts)


def copies(other: Mechanism, to: Placement) -> dict[str, list[Any]]:
    """Return copies of all parts of a mechanism in their groups, in the order of the originals; a part that cannot be
    there, or has no copies, is refused.
    """
    return {key: [_copy(part, to) for part in group.values()] for key, group in other.groups().items()}


def _copy(part: Part, to: Placement) -> Part:
    new = part.placed(to)
    if isinstance(new, Part):
        return new
    return rebuild_with(part, part.constructor_kwargs() | {"name": to.name(part.name)} | new)
