"""Ideal joints: which relative displacements of two bodies are free, and which are locked.

A joint's axes Q have the kind's axis along local z (universal: first axis along x, second in the x-y plane).
In these axes the free displacements span the columns of S (6 x f) and the locked ones the rows of L (6-f x 6),
with L S = 0. Displacements are those of the second body relative to the first, at the joint's point. What a joint
hands on, diag(Q, Q) S and L diag(Q, Q)^T, is in world axes.

Three kinds lock translations of a point only and leave all rotations free. What they demand of any pose, with p_a the
point as the first body carries it, p_b as the second does, and x, y, z the axes as the first does:

- point_on_line: x . (p_b - p_a) = 0 and y . (p_b - p_a) = 0; the line through p_a along z is the first body's;
- point_on_plane: z . (p_b - p_a) = 0; the plane through p_a normal to z is the first body's;
- distance: |p_b - p_a| = L, with p_a = ``position`` on the first, p_b = ``end`` on the second and L from the given
  pose: a rod without mass on two ball joints. Its z is the rod, which neither body carries; its free directions are
  x, y (p_b across the rod) and rx, ry, rz (the second body about p_b).

Free rotations by q of a kind are either the components of one rotation vector, exp(sum of q e), or successive: of two,
exp(q e) exp(q' e'), the first about an axis that stays in the first body, the second about one that stays in the
second. The rotation vector of the latter is q e + q' e' + 1/2 q q' e x e' to second order: it has a component along
the locked axis, so that a moment 1/2 tau . (e x e') q q' comes on top. That of the former has none.

A homokinetic joint (of constant velocity) has a rotation vector normal to its z: both shafts turn at the same rate,
whatever their angle. Displaced by a rotation vector v, it is the same joint with its z turned by v / 2, which bisects
the angle of the shafts, as the product of exp(v') with exp(v) has a rotation vector normal to z where v' is normal to
exp(v / 2) z.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, inf
from typing import TYPE_CHECKING, Any, Self

from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS, UNIT6, Matrix3, Vector
from mbsvib.elements.part import ParameterField, Part, derived, point, rotation
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
    """A kind of joint: its ``free`` directions, and whether its two free rotations are ``successive`` or the components
    of one rotation vector, as the rotations of all others are.
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
# Where no rotation is free, the relative displacement is the same at every point.
NEEDS_NO_POINT = frozenset({"prismatic", "fixed"})
# sin of the angle between the axes of a universal joint, below which they count as parallel
PARALLEL = 1e-6


def subspaces(free: tuple[str, ...]) -> tuple[Named, Named]:
    """Return the free and the locked directions of a joint that frees some of x y z rx ry rz."""
    return (
        tuple((d, UNIT6[DIRECTIONS.index(d)]) for d in free),
        tuple((d, unit) for d, unit in zip(DIRECTIONS, UNIT6, strict=True) if d not in free),
    )


_PLACE = {direction: i for i, direction in enumerate(DIRECTIONS)}
_SUBSPACES = {name: subspaces(kind.free) for name, kind in KINDS.items()}


@dataclass(frozen=True, slots=True)
class Joint(Part):
    """An ideal joint between ``first`` and ``second`` at ``position`` [m], axes Q = ``axes`` (columns, world).

    ``point`` is where displacements are taken, None where any point will do: ``position``, of a distance joint its
    ``end``. ``freedom`` and ``locked`` pair each direction's name with its six-vector in world axes (twist; row of the
    relative displacement that is zero). ``successive`` tells whether two rotations are free one after the other, in the
    order of ``freedom``.
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
            yield point("position", self.position)
        yield rotation() if self.end is None else point("end", self.end)
        if self.pitch is not None:
            yield ParameterField("pitch", self.pitch, "m/rad")

    def with_values(self, values: Mapping[str, Any]) -> Self:
        words = self.arguments() | dict(values)
        if "orientation" in values:
            turn = values["orientation"]
            if self.kind == "universal" and self.axis is not None and self.axis2 is not None:
                words |= {"orientation": None, "axis": check.rotated(turn, self.axis),
                          "axis2": check.rotated(turn, self.axis2)}  # fmt: skip
            else:
                words |= {"orientation": check.rotated(turn, self.axes), "axis": None}
        return make(**words)  # type: ignore[return-value]


def make(
    name: str, kind: Any, first: str, second: str, position: Any, orientation: Any, axis: Any, axis2: Any,
    pitch: Any, free: Any, end: Any = None,
) -> Joint:  # fmt: skip
    """Check the values of a joint and build it."""
    who = f"joint '{name}'"
    if first == second:
        raise ModelError(f"{who}: connects body '{first}' with itself; name two different bodies.",
                         element=who, field="second")  # fmt: skip
    kind, free = _kind(kind, free, who)
    if position is not None:
        position = check.vector(position, who, "position")
    elif kind not in NEEDS_NO_POINT:
        raise check.refuse(who, "position", None, "the joint's point (x, y, z) [m] in world axes")
    if axis is not None:
        if orientation is not None:
            raise ModelError(f"{who}: both orientation and axis are given; they say the same, give one.",
                             element=who, field="axis")  # fmt: skip
        axis = check.vector(axis, who, "axis")
    if kind == "distance":
        for field, given in (("axis", axis), ("orientation", orientation)):
            if given is not None:
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
            axes = check.frame_along(_rod(position, end, who))
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


def _built(words: tuple[Any, ...], axes: Matrix3, freedom: Named | None) -> Joint:
    """Build a joint of its words, with its directions in world axes; ``freedom`` where these are not the kind's."""
    _, kind, _, _, position, _, _, _, pitch, free, end = words
    if free is None:
        (usual, locked), successive = _SUBSPACES[kind], KINDS[kind].successive
    else:
        (usual, locked), successive = subspaces(free), len(_rotations(free)) == 2
    if kind == "screw":
        usual = (("rz", (0.0, 0.0, pitch, 0.0, 0.0, 1.0)),)
        locked = tuple((d, (0.0, 0.0, 1.0, 0.0, 0.0, -pitch) if d == "z" else row) for d, row in locked)
    freedom = freedom or usual
    if axes is not check.IDENTITY:
        freedom, locked = _in_world(axes, freedom, locked)
    derived_fields: tuple[Any, ...] = (axes, freedom, locked, position if end is None else end, successive)
    return Joint(*words, *derived_fields)


def elsewhere(
    joint: Joint, position: Vector | None, end: Vector | None = None, axes: Matrix3 | None = None,
    axis: Vector | None = None, axis2: Vector | None = None,
) -> Joint:  # fmt: skip
    """Return a joint in another pose, where nothing of it that could be refused has changed.

    Parameters
    ----------
    joint : Joint
        The joint as described.
    position, end : tuple of float
        Its points there [m].
    axes : tuple of tuple of float, optional
        Its axes there (columns); default: along ``axis``, and of a universal joint ``axis2``, or along its rod.
    axis, axis2 : tuple of float, optional
        Its axis, and the axis of a universal joint in the second body.

    Returns
    -------
    Joint
        What ``add_joint`` would make of these values.
    """
    who, freedom, orientation = f"joint '{joint.name}'", None, None
    if axes is not None:
        axes = orientation = check.orthonormal(axes)
    elif axis2 is not None:
        axes, freedom = _universal(axis, axis2, None, who)
    elif axis is not None:
        axes = check.frame_along(check.axis(axis, who, "axis"))
    elif position is not None and end is not None:
        axes = check.frame_along(_rod(position, end, who))
    return _built((joint.name, joint.kind, joint.first, joint.second, position, orientation, axis, axis2, joint.pitch,
                   joint.free, end), axes or joint.axes, freedom)  # fmt: skip


def _in_world(axes: Matrix3, *directions: Named) -> list[Named]:
    """Turn six-vectors from the axes Q into world axes."""
    (a, b, c), (d, e, f), (g, h, i) = axes
    columns = ((a, d, g, 0.0, 0.0, 0.0), (b, e, h, 0.0, 0.0, 0.0), (c, f, i, 0.0, 0.0, 0.0),
               (0.0, 0.0, 0.0, a, d, g), (0.0, 0.0, 0.0, b, e, h), (0.0, 0.0, 0.0, c, f, i))  # fmt: skip
    return [tuple([(name, columns[_PLACE[name]] if six is UNIT6[_PLACE[name]] else _turned(axes, six))
                   for name, six in group]) for group in directions]  # fmt: skip


def _turned(axes: Matrix3, six: Six) -> Six:
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
            f"{who}: kind = {kind!r} already says what is free; leave out free=, or give kind=None with it.",
            element=who, field="free",
        )  # fmt: skip
    given = (free,) if isinstance(free, str) else _several(free, who)
    for direction in given:
        if not isinstance(direction, str) or direction not in DIRECTIONS:
            raise check.refuse(who, "free", free, "directions out of x y z rx ry rz",
                               nearest(str(direction), DIRECTIONS).strip())  # fmt: skip
    if len(set(given)) != len(given):
        raise check.refuse(who, "free", free, "each direction once")
    turns = _rotations(given)
    if len(turns) != 2 or isinstance(free, (set, frozenset)):
        turns = tuple(sorted(turns))
    return "custom", (*(d for d in DIRECTIONS[:3] if d in given), *turns)


def _rotations(free: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(d for d in free if d in DIRECTIONS[3:])


def _several(free: Any, who: str) -> tuple[Any, ...]:
    try:
        return tuple(free)
    except TypeError as error:
        raise check.refuse(who, "free", free, "directions out of x y z rx ry rz") from error


def _rod(position: Vector, end: Vector, who: str) -> Vector:
    x, y, z = end[0] - position[0], end[1] - position[1], end[2] - position[2]
    length = hypot(x, y, z)
    if not 0.0 < length < inf:
        raise check.refuse(who, "end", end, f"a point other than position = {position}",
                           "A rod of no length is a spherical joint.")  # fmt: skip
    return (x / length, y / length, z / length)


def _universal(axis: Vector | None, axis2: Vector | None, orientation: Any, who: str) -> tuple[Matrix3, Named]:
    """Axes of a universal joint: x along ``axis``, ``axis2`` in the x-y plane, the locked rotation along z."""
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
