"""Kinds of ideal joints: free and locked relative displacements of two bodies.

A joint's axes Q have the kind's axis along local z (universal: first axis along x, second in the x-y plane).
In these axes the free displacements are the columns of S (6 x f) and the locked ones the rows of L (6-f x 6),
with L S = 0. Displacements are those of the second body relative to the first, at the joint's point. ``Joint`` has
diag(Q, Q) S and L diag(Q, Q)^T, in world axes.

Three kinds lock translations of a point only and leave all rotations free. In any pose, with the point p_a and the axes
x, y, z fixed in the first body and the point p_b fixed in the second body, their constraints are:

- point_on_line: x . (p_b - p_a) = 0 and y . (p_b - p_a) = 0; the line through p_a along z is fixed in the first body;
- point_on_plane: z . (p_b - p_a) = 0; the plane through p_a normal to z is fixed in the first body;
- distance: |p_b - p_a| = L, with p_a = ``position`` on the first, p_b = ``end`` on the second and L from the reference
  pose: a massless rod between two ball joints. Its z is along the rod and fixed in neither body; its free directions
  are x, y (p_b normal to the rod) and rx, ry, rz (the second body about p_b).

Free rotations by q of a kind are either the components of one rotation vector, exp(sum of q e), or two successive
rotations exp(q e) exp(q' e'), the first about an axis fixed in the first body, the second about an axis fixed in the
second. The rotation vector of the latter is q e + q' e' + 1/2 q q' e x e' to second order: it has a component along
the locked axis, which adds the term 1/2 tau . (e x e') q q' of the moment tau. The former has no such term.

A homokinetic (constant-velocity) joint has a rotation vector normal to its z: both shafts rotate at the same rate at
any angle. Displaced by a rotation vector v, it is the same joint with its z rotated by v / 2, which bisects the angle
of the shafts: the product of exp(v') and exp(v) has a rotation vector normal to z if v' is normal to exp(v / 2) z.

A new kind is a row of ``KINDS``. In finite motion it follows from the number of its free rotations: axes fixed in both
bodies (one), two successive axes or a frame that bisects the angle of both bodies (two), or a free rotation (three).

The displacement that the coordinates of a kind make, and how far a cut joint is open, are functions of components (see
``linalg.components``) in the world axes of the pose as described, which turn with the first body. Rows of constraints
are first derivatives of the openings, geometric stiffness follows from second ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot, inf
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS, UNIT6, Matrix3, Vector
from mbsvib.errors import ModelError, nearest
from mbsvib.linalg import components as c
from mbsvib.linalg.components import Component, Rotation, Triple
from mbsvib.linalg.displacements import Displacement

Directions = tuple[tuple[str, Any], ...]


@dataclass(frozen=True, slots=True)
class Columns:
    """The numbers of a joint, or of many joints of one kind, as components.

    ``free`` and ``locked`` are pairs of a direction's name and its six-vector; ``point`` on the second body and
    ``start`` on the first, the same but for rods [m]; ``successive``: two free rotations that follow each other.
    """

    free: Directions
    locked: Directions
    point: Triple
    start: Triple
    successive: bool = False

    @property
    def turns(self) -> list[Triple]:
        """Axes of the free rotations."""
        return [(six[3], six[4], six[5]) for name, six in self.free if name[0] == "r"]


@dataclass(frozen=True, slots=True)
class Motion:
    """The finite motion of a kind of joint.

    ``displacement`` of the second body by the coordinates q; ``openings``, one for each locked direction, are zero
    where the joint is assembled, and equal the relative displacement to first order.
    """

    displacement: Callable[[Sequence[Component], Columns], Displacement]
    openings: Callable[[Displacement, Columns], list[Component]]


def displaced(q: Sequence[Component], j: Columns) -> Displacement:
    """Translate by the sum of q times the free directions, and turn about the joint's point."""
    return Displacement(_turned(q, j), _translated(q, j), j.point)


def displaced_on_sphere(q: Sequence[Component], j: Columns) -> Displacement:
    """Move the end of a rod on its sphere, as far along an arc as its coordinates across the rod say."""
    across, rod = _translated(q, j), c.subtract(j.point, j.start)
    square = c.dot(across, across) / c.dot(rod, rod)
    half = c.sinc(0.25 * square)
    shift = c.subtract(c.scale(c.sinc(square), across), c.scale(0.5 * square * half * half, rod))
    return Displacement(_turned(q, j), shift, j.point)


def open_by(x: Displacement, j: Columns) -> list[Component]:
    """Return the gap along locked translations, and what the axes of free rotations have come apart.

    One free rotation: its axis is fixed in both bodies. Two successive ones: the angle of both axes is constant.
    Others: components of the antisymmetric part of the relative rotation, sin(a) n; of two that bisect the angle a of
    both bodies divided by cos(a / 2), by which its slope is one along the bisected axis at any angle.
    """
    gap, turns = x.moved(j.point), j.turns
    rotates = any(name[0] == "r" for name, _ in j.locked)
    tilt = c.cross(turns[0], x.vector(turns[0])) if rotates and len(turns) == 1 else None
    opened = []
    for name, six in j.locked:
        if name[0] != "r":
            opened.append(c.dot(six[:3], gap))
        elif j.successive:
            first, second = turns
            change = c.dot(first, second) - c.dot(first, x.vector(second))
            opened.append(change / c.dot(c.cross(first, second), six[3:]))
        elif tilt is not None:
            opened.append(c.dot(six[3:], tilt))
        else:
            opened.append(c.dot(six[3:], c.axial(x.rotation)) / (half_cosine(x.rotation) if turns else 1.0))
    return opened


def half_cosine(rotation: Rotation) -> Component:
    """Return the cosine of half the angle of a rotation."""
    return 0.5 * c.sqrt(1.0 + rotation[0][0] + rotation[1][1] + rotation[2][2])


def open_along_rod(x: Displacement, j: Columns) -> list[Component]:
    """Return (r . r - L^2) / 2 L of the line r between the ends of a rod of length L."""
    rod, described = c.subtract(x.point(j.point), j.start), c.subtract(j.point, j.start)
    square = c.dot(described, described)
    return [(0.5 * c.dot(rod, rod) - 0.5 * square) / c.sqrt(square)]


def open_off_thread(x: Displacement, j: Columns) -> list[Component]:
    """Return what a screw is open; along its axis, the pitch times the sine of the angle that its advance is ahead."""
    (axis,), (_, six) = j.turns, j.free[0]
    pitch, gap = c.dot(six[:3], axis), x.moved(j.point)
    across = normals(axis)[0]
    third = c.cross(axis, across)
    sine = 0.5 * (c.dot(third, x.vector(across)) - c.dot(across, x.vector(third)))
    cosine = 0.5 * (c.dot(across, x.vector(across)) + c.dot(third, x.vector(third)))
    angle = c.dot(axis, gap) / pitch
    ahead = pitch * (c.sin(angle) * cosine - c.cos(angle) * sine)
    return [ahead if name == "z" else value for (name, _), value in zip(j.locked, open_by(x, j), strict=True)]


def normals(axis: Triple) -> tuple[Triple, Triple]:
    """Return two unit vectors across a unit vector of numbers, which complete a right-handed frame with it last."""
    x, y, z = np.broadcast_arrays(*(np.real(a) for a in axis))
    smallest = np.argmin(np.abs((x, y, z)), axis=0)
    first = c.cross((1.0 * (smallest == 0), 1.0 * (smallest == 1), 1.0 * (smallest == 2)), axis)
    first = c.scale(1.0 / c.norm(first), first)
    return first, c.cross(axis, first)


def _translated(q: Sequence[Component], j: Columns) -> Triple:
    shift: Triple = (0.0, 0.0, 0.0)
    for value, (_, six) in zip(q, j.free, strict=True):
        shift = c.add(shift, c.scale(value, six[:3]))
    return shift


def _turned(q: Sequence[Component], j: Columns) -> Rotation:
    angles = [value for value, (name, _) in zip(q, j.free, strict=True) if name[0] == "r"]
    turns = j.turns
    if len(turns) == 1:
        return c.turn(turns[0], angles[0])
    if j.successive:
        return c.product(c.turn(turns[0], angles[0]), c.turn(turns[1], angles[1]))
    if not turns:
        return c.IDENTITY
    vector: Triple = (0.0, 0.0, 0.0)
    for axis, angle in zip(turns, angles, strict=True):
        vector = c.add(vector, c.scale(angle, axis))
    return c.exponential(vector)


STRAIGHT = Motion(displaced, open_by)
SCREW = Motion(displaced, open_off_thread)
ROD = Motion(displaced_on_sphere, open_along_rod)


Six = tuple[float, ...]
Named = tuple[tuple[str, Six], ...]


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of joint: its ``free`` directions, and whether its two free rotations are ``successive``.

    Otherwise they are components of one rotation vector. ``drawn`` are the numbers of the axes that pictures show;
    ``motion`` is its finite motion, one of those of which the engines have the curvature and the axes in other poses.
    """

    free: tuple[str, ...]
    successive: bool = False
    drawn: tuple[int, ...] = ()
    motion: Motion = STRAIGHT

    def __post_init__(self) -> None:
        if self.motion not in (STRAIGHT, SCREW, ROD):
            raise ModelError(f"a kind of joint that frees {', '.join(self.free)}: motion = {self.motion!r}; expected "
                             f"STRAIGHT, SCREW or ROD, as geometric stiffness and other poses of another one are not "
                             f"stated. Make it of several joints, with a body without mass between them.",
                             field="motion")  # fmt: skip


KINDS: dict[str, Kind] = {
    "revolute": Kind(("rz",), drawn=(2,)),
    "prismatic": Kind(("z",), drawn=(2,)),
    "cylindrical": Kind(("z", "rz"), drawn=(2,)),
    "screw": Kind(("rz",), drawn=(2,), motion=SCREW),
    "universal": Kind(("rx", "ry"), successive=True, drawn=(0, 1)),
    "homokinetic": Kind(("rx", "ry"), drawn=(2,)),
    "spherical": Kind(("rx", "ry", "rz")),
    "planar": Kind(("x", "y", "rz"), drawn=(2,)),
    "fixed": Kind(()),
    "free": Kind(DIRECTIONS),
    "point_on_line": Kind(("z", "rx", "ry", "rz"), drawn=(2,)),
    "point_on_plane": Kind(("x", "y", "rx", "ry", "rz")),
    "distance": Kind(("x", "y", "rx", "ry", "rz"), motion=ROD),
}
# Without a free rotation the relative displacement is the same at every point.
NEEDS_NO_POINT = frozenset(name for name, kind in KINDS.items() if not any(d[0] == "r" for d in kind.free))


def subspaces(free: tuple[str, ...]) -> tuple[Named, Named]:
    """Return the free and the locked directions of a joint that frees some of x y z rx ry rz."""
    return (
        tuple((d, UNIT6[DIRECTIONS.index(d)]) for d in free),
        tuple((d, unit) for d, unit in zip(DIRECTIONS, UNIT6, strict=True) if d not in free),
    )


# The free and the locked directions of each kind
SUBSPACES = {name: subspaces(kind.free) for name, kind in KINDS.items()}


# What is said of kinds that no linear equations have.
OPENS = ("Joints do not open or stick; mbsvib_export.to_exudyn(model) takes the scene to exudyn, which has contact and "
         "friction.")  # fmt: skip
# Other programs' names of kinds
OTHER_NAMES = {
    "hinge": "revolute", "pin": "revolute", "continuous": "revolute", "slider": "prismatic", "slide": "prismatic",
    "translational": "prismatic", "ball": "spherical", "cardan": "universal", "hooke": "universal", "helical": "screw",
    "weld": "fixed", "rigid": "fixed", "floating": "free", "rod": "distance", "constant_velocity": "homokinetic",
}  # fmt: skip
# Smallest sine of the angle between the axes of a universal joint
PARALLEL = 1e-6


def checked_kind(kind: Any, free: Any, who: str) -> tuple[str, tuple[str, ...] | None]:
    """Return the kind of a joint and, of a custom one, its free directions."""
    if free is None:
        if isinstance(kind, str) and kind in KINDS:
            return kind, None
        expected = f"one of {', '.join(KINDS)}, or free=(directions)"
        word = str(kind).lower()
        hint = OPENS if word in ("contact", "friction") else nearest(OTHER_NAMES.get(word, str(kind)), KINDS).strip()
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
