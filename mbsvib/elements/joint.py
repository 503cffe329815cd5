"""Ideal joints: free and locked relative displacements of two bodies.

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
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, inf
from typing import TYPE_CHECKING, Any

from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS, UNIT6, Matrix3, Vector
from mbsvib.common.fast_init import fast_init
from mbsvib.elements.connection import check_ends
from mbsvib.elements.part import ParameterField, Part, derived, rotation_field, vector_field
from mbsvib.errors import ModelError, nearest

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

# What is said of kinds that no linear equations have.
OPENS = ("Joints do not open or stick; mbsvib_export.to_exudyn(model) takes the scene to exudyn, which has contact and "
         "friction.")  # fmt: skip

Six = tuple[float, ...]
Named = tuple[tuple[str, Six], ...]


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of joint: its ``free`` directions, and whether its two free rotations are ``successive``.

    Otherwise they are components of one rotation vector.
    """

    free: tuple[str, ...]
    successive: bool = False


KINDS: dict[str, Kind] = {
    "revolute": Kind(("rz",)),
    "prismatic": Kind(("z",)),
    "cylindrical": Kind(("z", "rz")),
    "screw": Kind(("rz",)),
    "universal": Kind(("rx", "ry"), successive=True),
    "homokinetic": Kind(("rx", "ry")),
    "spherical": Kind(("rx", "ry", "rz")),
    "planar": Kind(("x", "y", "rz")),
    "fixed": Kind(()),
    "free": Kind(DIRECTIONS),
    "point_on_line": Kind(("z", "rx", "ry", "rz")),
    "point_on_plane": Kind(("x", "y", "rx", "ry", "rz")),
    "distance": Kind(("x", "y", "rx", "ry", "rz")),
}
# Without a free rotation the relative displacement is the same at every point.
NEEDS_NO_POINT = frozenset({"prismatic", "fixed"})
# Smallest sine of the angle between the axes of a universal joint
PARALLEL = 1e-6


def subspaces(free: tuple[str, ...]) -> tuple[Named, Named]:
    """Return the free and the locked directions of a joint that frees some of x y z rx ry rz."""
    return (
        tuple((d, UNIT6[DIRECTIONS.index(d)]) for d in free),
        tuple((d, unit) for d, unit in zip(DIRECTIONS, UNIT6, strict=True) if d not in free),
    )


_INDEX = {direction: i for i, direction in enumerate(DIRECTIONS)}
_SUBSPACES = {name: subspaces(kind.free) for name, kind in KINDS.items()}


@fast_init
@dataclass(frozen=True, slots=True)
class Joint(Part):
    """An ideal joint between ``first`` and ``second`` at ``position`` [m], axes Q = ``axes`` (columns, world).

    ``point`` is the point of the displacements: ``position``, of a distance joint its ``end``, None if any point is
    equivalent. ``freedom`` and ``locked`` are pairs of a direction's name and its six-vector in world axes: a twist,
    or a row of the relative displacement that is zero. If ``successive``, the two free rotations follow each other in
    the order of ``freedom``.
    """

    kind: str
    first: str
    second: str
    position: Vector | None = None
    orientation: Matrix3 | None = None
    axis: Vector | None = None
    axis2: Vector | None = None
    pitch: float | None = None
    free: tuple[str, ...] | None = None
    end: Vector | None = None
    axes: Matrix3 = derived(check.IDENTITY)
    freedom: Named = derived(())
    locked: Named = derived(())
    point: Vector | None = derived()
    successive: bool = derived(False)

    def parameter_fields(self) -> Iterator[ParameterField]:
        if self.position is not None:
            yield vector_field("position", self.position)
        yield rotation_field() if self.end is None else vector_field("end", self.end)
        if self.pitch is not None:
            yield ParameterField("pitch", self.pitch, "m/rad")

    def with_values(self, values: Mapping[str, Any]) -> Joint:
        arguments = self.arguments() | dict(values)
        if "orientation" in values:
            rotation = values["orientation"]
            if self.kind == "universal" and self.axis is not None and self.axis2 is not None:
                arguments |= {"orientation": None, "axis": check.rotated(rotation, self.axis),
                              "axis2": check.rotated(rotation, self.axis2)}  # fmt: skip
            else:
                arguments |= {"orientation": check.rotated(rotation, self.axes), "axis": None}
        return make(**arguments)


def make(
    name: str, kind: Any, first: str, second: str, position: Any, orientation: Any, axis: Any, axis2: Any,
    pitch: Any, free: Any, end: Any = None,
) -> Joint:  # fmt: skip
    """Check the values of a joint and build it."""
    who = f"joint '{name}'"
    check_ends(who, first, second)
    kind, free = _kind(kind, free, who)
    if position is not None:
        position = check.vector(position, who, "position")
    elif kind not in NEEDS_NO_POINT:
        raise check.refuse(who, "position", None, "the joint's point (x, y, z) [m] in world axes")
    if axis is not None:
        if orientation is not None:
            raise ModelError(f"{who}: both orientation and axis are given; give one of them.",
                             element=who, field="axis")  # fmt: skip
        axis = check.vector(axis, who, "axis")
    if kind == "distance":
        for field, value in (("axis", axis), ("orientation", orientation)):
            if value is not None:
                raise ModelError(f"{who}: {field} is given, but the axis of a distance joint is the line from position "
                                 f"to end; leave it out.", element=who, field=field)  # fmt: skip
    elif end is not None:
        raise ModelError(f"{who}: end is for distance joints; a {kind} joint has none.", element=who, field="end")
    freedom = None
    if kind == "universal":
        axis2 = None if axis2 is None else check.vector(axis2, who, "axis2")
        axes, freedom = _universal(axis, axis2, orientation, who)
    else:
        if axis2 is not None:
            raise ModelError(f"{who}: axis2 is for universal joints; a {kind} joint has none.",
                             element=who, field="axis2")  # fmt: skip
        if kind == "distance":
            end = check.vector(end, who, "end", "the rod's point (x, y, z) on the second body [m] in world axes")
            axes = check.frame_along(_rod_direction(position, end, who))
        else:
            axes = check.orthonormal(check.orientation(orientation, who)) if axis is None else \
                check.frame_along(check.axis(axis, who, "axis"))  # fmt: skip
    if kind == "screw":
        pitch = check.number(pitch, who, "pitch", "the advance per radian [m/rad] (lead / 2 pi)")
    elif pitch is not None:
        raise ModelError(f"{who}: pitch is for screw joints; a {kind} joint has none.",
                         element=who, field="pitch")  # fmt: skip
    return _built((name, kind, first, second, position, None if orientation is None else axes, axis, axis2, pitch,
                   free, end), axes, freedom)  # fmt: skip


def _built(arguments: tuple[Any, ...], axes: Matrix3, freedom: Named | None) -> Joint:
    """A joint with its directions in world axes; ``freedom`` None: the free directions of its kind."""
    _, kind, _, _, position, _, _, _, pitch, free, end = arguments
    if free is None:
        (of_kind, locked), successive = _SUBSPACES[kind], KINDS[kind].successive
    else:
        (of_kind, locked), successive = subspaces(free), len(_rotations(free)) == 2
    if kind == "screw":
        of_kind = (("rz", (0.0, 0.0, pitch, 0.0, 0.0, 1.0)),)
        locked = tuple((d, (0.0, 0.0, 1.0, 0.0, 0.0, -pitch) if d == "z" else row) for d, row in locked)
    freedom = freedom or of_kind
    if axes is not check.IDENTITY:
        freedom, locked = _in_world(axes, freedom, locked)
    derived_fields: tuple[Any, ...] = (axes, freedom, locked, position if end is None else end, successive)
    return Joint(*arguments, *derived_fields)


def moved_joint(
    joint: Joint, position: Vector | None, end: Vector | None = None, axes: Matrix3 | None = None,
    axis: Vector | None = None, axis2: Vector | None = None,
) -> Joint:  # fmt: skip
    """Return a joint in another pose; its arguments are not checked again.

    Parameters
    ----------
    joint : Joint
        The joint in the reference pose.
    position, end : tuple of float
        Its points in the other pose [m].
    axes : tuple of tuple of float, optional
        Its axes (columns); default: along ``axis``, of a universal joint along ``axis`` and ``axis2``, or along its
        rod.
    axis, axis2 : tuple of float, optional
        Its axis, and the axis of a universal joint in the second body.

    Returns
    -------
    Joint
        The joint that ``add_joint`` makes of these values.
    """
    who, freedom, orientation = f"joint '{joint.name}'", None, None
    if axes is not None:
        axes = orientation = check.orthonormal(axes)
    elif axis2 is not None:
        axes, freedom = _universal(axis, axis2, None, who)
    elif axis is not None:
        axes = check.frame_along(check.axis(axis, who, "axis"))
    elif position is not None and end is not None:
        axes = check.frame_along(_rod_direction(position, end, who))
    return _built((joint.name, joint.kind, joint.first, joint.second, position, orientation, axis, axis2, joint.pitch,
                   joint.free, end), axes or joint.axes, freedom)  # fmt: skip


def _in_world(axes: Matrix3, *directions: Named) -> list[Named]:
    """Six-vectors in world axes, from those in the axes Q."""
    (a, b, c), (d, e, f), (g, h, i) = axes
    columns = ((a, d, g, 0.0, 0.0, 0.0), (b, e, h, 0.0, 0.0, 0.0), (c, f, i, 0.0, 0.0, 0.0),
               (0.0, 0.0, 0.0, a, d, g), (0.0, 0.0, 0.0, b, e, h), (0.0, 0.0, 0.0, c, f, i))  # fmt: skip
    return [tuple([(name, columns[_INDEX[name]] if six is UNIT6[_INDEX[name]] else _rotated(axes, six))
                   for name, six in group]) for group in directions]  # fmt: skip


def _rotated(axes: Matrix3, six: Six) -> Six:
    x, y, z, rx, ry, rz = six
    return tuple(r[0] * p + r[1] * q + r[2] * s for p, q, s in ((x, y, z), (rx, ry, rz)) for r in axes)


def _kind(kind: Any, free: Any, who: str) -> tuple[str, tuple[str, ...] | None]:
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
    rotations = _rotations(directions)
    if len(rotations) != 2 or isinstance(free, (set, frozenset)):
        rotations = tuple(sorted(rotations))
    return "custom", (*(d for d in DIRECTIONS[:3] if d in directions), *rotations)


def _rotations(free: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(d for d in free if d in DIRECTIONS[3:])


def _as_tuple(free: Any, who: str) -> tuple[Any, ...]:
    try:
        return tuple(free)
    except TypeError as error:
        raise check.refuse(who, "free", free, "directions out of x y z rx ry rz") from error


def _rod_direction(position: Vector, end: Vector, who: str) -> Vector:
    x, y, z = end[0] - position[0], end[1] - position[1], end[2] - position[2]
    length = hypot(x, y, z)
    if not 0.0 < length < inf:
        raise check.refuse(who, "end", end, f"a point other than position = {position}",
                           "A rod of no length is a spherical joint.")  # fmt: skip
    return (x / length, y / length, z / length)


def _universal(axis: Vector | None, axis2: Vector | None, orientation: Any, who: str) -> tuple[Matrix3, Named]:
    """Axes of a universal joint: x along ``axis``, ``axis2`` in the x-y plane, the locked rotation about z."""
    if axis is None:
        if axis2 is not None:
            raise check.refuse(who, "axis", None, "the axis in the first body, to go with axis2")
        return check.orthonormal(check.orientation(orientation, who)), _SUBSPACES["universal"][0]
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
