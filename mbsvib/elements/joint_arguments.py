"""Arguments of joints, checked: kinds, free directions and axes."""

from __future__ import annotations

from math import hypot, inf
from typing import Any

from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS, UNIT6, Matrix3, Vector
from mbsvib.elements.joint_kinds import KINDS, SUBSPACES, Named
from mbsvib.errors import ModelError, nearest

# What is said of kinds that no linear equations have.
OPENS = ("Joints do not open or stick; mbsvib_export.to_exudyn(model) takes the scene to exudyn, which has contact and "
         "friction.")  # fmt: skip
# Smallest sine of the angle between the axes of a universal joint
PARALLEL = 1e-6


def checked_kind(kind: Any, free: Any, who: str) -> tuple[str, tuple[str, ...] | None]:
    """Return the kind of a joint and, of a custom one, its free directions."""
    if free is None:
        if isinstance(kind, str) and kind in KINDS:
            return kind, None
        expected = f"one of {', '.join(KINDS)}, or free=(directions)"
        hint = OPENS if str(kind).lower() in ("contact", "friction") else nearest(str(kind), KINDS).strip()
        raise check.refuse(who, "kind", kind, expected, hint)
    if kind is not None and not (isinstance(kind, str) and kind in ("custom", "free")):
        raise ModelError(
            f"{who}: kind = {kind!r} already determines the free directions; leave out free=, or give kind=None with "
            f"it.",
            element=who, field="free",
        )  # fmt: skip
    directions = (free,) if isinstance(free, str) else _as_tuple(free, who)
    for direction in directions:
        if not isinstance(direction, str) or direction not in DIRECTIONS:
            raise check.refuse(who, "free", free, "directions out of x y z rx ry rz",
                               nearest(str(direction), DIRECTIONS).strip())  # fmt: skip
    if len(set(directions)) != len(directions):
        raise check.refuse(who, "free", free, "each direction once")
    rotations = rotations_of(directions)
    if len(rotations) != 2 or isinstance(free, (set, frozenset)):
        rotations = tuple(sorted(rotations))
    return "custom", (*(d for d in DIRECTIONS[:3] if d in directions), *rotations)


def rotations_of(free: tuple[str, ...]) -> tuple[str, ...]:
    """Return the rotations among directions."""
    return tuple(d for d in free if d in DIRECTIONS[3:])


def _as_tuple(free: Any, who: str) -> tuple[Any, ...]:
    try:
        return tuple(free)
    except TypeError as error:
        raise check.refuse(who, "free", free, "directions out of x y z rx ry rz") from error


def rod_direction(position: Vector, end: Vector, who: str) -> Vector:
    """Return the unit vector from one end of a rod to the other."""
    x, y, z = end[0] - position[0], end[1] - position[1], end[2] - position[2]
    length = hypot(x, y, z)
    if not 0.0 < length < inf:
        raise check.refuse(who, "end", end, f"a point other than position = {position}",
                           "A rod of no length is a spherical joint.")  # fmt: skip
    return (x / length, y / length, z / length)


def universal_axes(axis: Vector | None, axis2: Vector | None, orientation: Any, who: str) -> tuple[Matrix3, Named]:
    """Return the axes of a universal joint: x along ``axis``, ``axis2`` in the x-y plane, the locked rotation along z.
    """
    if axis is None:
        if axis2 is not None:
            raise check.refuse(who, "axis", None, "the axis in the first body, to go with axis2")
        return check.orientation(orientation, who), SUBSPACES["universal"][0]
    a = check.axis(axis, who, "axis")
    if axis2 is None:
        raise check.refuse(who, "axis2", None, "the axis in the second body, to go with axis")
    b = check.axis(axis2, who, "axis2")
    n = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    sine = hypot(*n)
    if sine < PARALLEL:
        raise check.refuse(who, "axis2", axis2, f"an axis that is not parallel to axis = {axis}")
    z = (n[0] / sine, n[1] / sine, n[2] / sine)
    y = (z[1] * a[2] - z[2] * a[1], z[2] * a[0] - z[0] * a[2], z[0] * a[1] - z[1] * a[0])
    cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    freedom = (("rx", UNIT6[3]), ("ry", (0.0, 0.0, 0.0, cosine, sine, 0.0)))
    return ((a[0], y[0], z[0]), (a[1], y[1], z[1]), (a[2], y[2], z[2])), freedom
