"""Ideal joints between two bodies, of the kinds in ``joint_kinds``, and joints in another pose."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import DIRECTIONS, UNIT6, Matrix3, Vector
from mbsvib.common.arrays import Array
from mbsvib.common.fast_init import fast_init
from mbsvib.elements.connection import check_ends
from mbsvib.elements.joint_kinds import (
    KINDS,
    NEEDS_NO_POINT,
    STRAIGHT,
    SUBSPACES,
    Motion,
    Named,
    Six,
    checked_kind,
    rod_direction,
    rotations_of,
    subspaces,
    universal_axes,
)
from mbsvib.elements.part import Part, derived
from mbsvib.elements.placement import Placement
from mbsvib.elements.pose import Pose
from mbsvib.elements.roles import ParameterField, axes, batched, number, point
from mbsvib.errors import ModelError, NoWordsError
from mbsvib.linalg.rotations import exponential, logarithm

# Sine of the largest angle between the frame of a custom joint and the one that its locked translations need.
SKEWED = 1e-12
_INDEX = {direction: i for i, direction in enumerate(DIRECTIONS)}


@fast_init
@dataclass(frozen=True, slots=True)
class Joint(Part):
    """An ideal joint between ``first`` and ``second`` at ``position`` [m], axes Q = ``axes`` (columns, world).

    ``point`` is the point of the displacements: ``position``, of a distance joint its ``end``, None if any point is
    equivalent. ``freedom`` and ``locked`` are pairs of a direction's name and its six-vector in world axes: a twist,
    or a row of the relative displacement that is zero. If ``successive``, the two free rotations follow each other in
    the order of ``freedom``.
    """

    symbol = "joint"

    roles = batched(position=point("first", other="end"), orientation=axes("first"),
                   end=point("second", other="position"), pitch=number("m/rad"))  # fmt: skip

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

    @property
    def drawn(self) -> tuple[int, ...]:
        """Numbers of the axes that pictures show."""
        return () if self.free is not None else KINDS[self.kind].drawn

    @property
    def motion(self) -> Motion:
        """Its finite motion."""
        return STRAIGHT if self.free is not None else KINDS[self.kind].motion

    @property
    def is_rod(self) -> bool:
        """Whether it is a massless rod between two points, with axes that are fixed in neither body."""
        return self.end is not None

    @property
    def rotation_axes(self) -> tuple[Six, ...]:
        """Axes of its free rotations (3,), world axes; of two successive ones that in the first body comes first."""
        return tuple([six[3:] for name, six in self.freedom if name[0] == "r"])

    @property
    def turns_by_vector(self) -> bool:
        """Whether its free rotations are components of one rotation vector, which are no angles in finite motion."""
        return not self.successive and len(self.rotation_axes) > 1

    @property
    def bisects(self) -> bool:
        """Whether its axes bisect the angle of its bodies, as those of a homokinetic joint."""
        return self.turns_by_vector and len(self.rotation_axes) == 2

    def in_pose(self, pose: Pose, relaxed: bool) -> Joint:
        """Return the joint in another pose, with the same free relative motions of its bodies.

        Parameters
        ----------
        pose : Pose
            The pose.
        relaxed : bool
            Without effect.

        Returns
        -------
        Joint
            The joint in this pose.

        Raises
        ------
        ModelError
            If it has two successive rotations, and its locked translations are no longer along axes of one frame with
            them.
        """
        if pose.is_unmoved(self.first) and pose.is_unmoved(self.second):
            return self
        if self.position is not None and self.end is not None:
            return moved_joint(self, pose.point(self.first, self.position), pose.point(self.second, self.end))
        position = None if self.position is None else pose.point(self.second, self.position)
        if self.successive:
            axis, axis2 = map(pose.rotated_vector, (self.first, self.second), self.rotation_axes)
            if self.free is None and len(self.freedom) == 2:
                return moved_joint(self, position, axis=axis, axis2=axis2)
            axes = _as_matrix(_successive_axes(self, np.array(axis), np.array(axis2), pose))
        elif self.bisects:
            first, second = pose.rotated(self.first, self.axes), pose.rotated(self.second, self.axes)
            axes = _as_matrix(first @ exponential(0.5 * logarithm(first.T @ second)))
        else:
            axes = pose.rotated_axes(self.first, self.axes)
        return moved_joint(self, position, axes=axes)

    @property
    def reversed_axis(self) -> int:
        """Number of its axis that a mirrored copy reverses.

        It is one about which the joint does not turn, if there is one, so that all rotations change their sign, and one
        along which it does not slide, if there is one, so that translations keep theirs. That of a rod is not its line.
        """
        free = {name for name, _ in self.freedom}
        return 1 if self.is_rod else min((2, 1, 0), key=lambda k: (DIRECTIONS[k + 3] in free, DIRECTIONS[k] in free))

    def placed(self, to: Placement) -> dict[str, Any]:
        result: dict[str, Any] = {"first": to.body(self.first), "second": to.body(self.second),
                                  "position": to.point(self.position), "end": to.point(self.end)}  # fmt: skip
        if self.pitch is not None and to.mirrored:
            result["pitch"] = -self.pitch
        if not to.turns or self.is_rod:
            return result
        if self.axis is not None and self.axis2 is not None:
            return result | {"axis": to.vector(self.axis), "axis2": to.vector(self.axis2)}
        return result | {"axis": None, "orientation": to.axes(self.axes, self.reversed_axis)}

    def coordinate_sign(self, direction: str, to: Placement) -> float:
        """Return the sign by which a coordinate of its copy differs from its own.

        Parameters
        ----------
        direction : str
            The direction of the coordinate, out of x y z rx ry rz.
        to : Placement
            Names and place of the copy.

        Returns
        -------
        float
            1 or -1.

        Raises
        ------
        NoWordsError
            If the axes of a rod, of which only the line is determined, are those of the coordinate.
        """
        if self.is_rod and to.turns and direction != "rz":
            raise NoWordsError(f"joint '{self.name}': its coordinate {direction} is coupled, and its axes across the "
                               f"rod do not turn along with a copy; put the coupler on another joint, or add this part "
                               f"afterwards.", element=self.name)  # fmt: skip
        return float(to.signs(self.reversed_axis)[_INDEX[direction]])

    def parameter_fields(self) -> Iterator[ParameterField]:
        fields = super(Joint, self).parameter_fields()
        return (field for field in fields if field.name != "orientation") if self.is_rod else fields

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
    kind, free = checked_kind(kind, free, who)
    if position is not None:
        position = check.vector(position, who, "position")
    elif kind not in NEEDS_NO_POINT:
        raise check.refuse(who, "position", None, "the joint's point (x, y, z) [m] in world axes")
    if axis is not None:
        if orientation is not None:
            raise ModelError(f"{who}: both orientation and axis are given; give one of them.",
                             element=who, field="axis")  # fmt: skip
        axis = check.vector(axis, who, "axis", "a direction (x, y, z), such as (0, 0, 1)")
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
        axes, freedom = universal_axes(axis, axis2, orientation, who)
    else:
        if axis2 is not None:
            raise ModelError(f"{who}: axis2 is for universal joints; a {kind} joint has none.",
                             element=who, field="axis2")  # fmt: skip
        if kind == "distance":
            end = check.vector(end, who, "end", "the rod's point (x, y, z) on the second body [m] in world axes")
            axes = check.frame_along(rod_direction(position, end, who))
        else:
            axes = check.orientation(orientation, who) if axis is None else \
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
        (of_kind, locked), successive = SUBSPACES[kind], KINDS[kind].successive
    else:
        (of_kind, locked), successive = subspaces(free), len(rotations_of(free)) == 2
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
    """Return a joint in another pose, as ``add_joint`` makes it of these values; its arguments are not checked again.

    ``position``, ``end``: its points there [m]. ``axes``: its axes (columns); None: along ``axis``, of a universal
    joint along ``axis`` and the ``axis2`` in its second body, or along its rod.
    """
    who, freedom, orientation = f"joint '{joint.name}'", None, None
    if axes is not None:
        axes = orientation = check.orthonormal(axes)
    elif axis2 is not None:
        axes, freedom = universal_axes(axis, axis2, None, who)
    elif axis is not None:
        axes = check.frame_along(check.axis(axis, who, "axis"))
    elif position is not None and end is not None:
        axes = check.frame_along(rod_direction(position, end, who))
    return _built((joint.name, joint.kind, joint.first, joint.second, position, orientation, axis, axis2, joint.pitch,
                   joint.free, end), axes or joint.axes, freedom)  # fmt: skip


def _as_matrix(axes: Array) -> Matrix3:
    x, y, z = axes.tolist()
    return tuple(x), tuple(y), tuple(z)


def _successive_axes(joint: Joint, first_axis: Array, second_axis: Array, pose: Pose) -> Array:
    """Axes of a joint with two successive rotations and others, from the axes that are fixed in its bodies."""
    free = [DIRECTIONS.index(name) - 3 for name, _ in joint.freedom if name[0] == "r"]
    columns = [np.zeros(3)] * 3
    columns[free[0]], columns[free[1]] = first_axis, second_axis
    third = 3 - sum(free)
    columns[third] = np.cross(columns[(third + 1) % 3], columns[(third + 2) % 3])
    axes = np.array(columns).T
    axes /= np.linalg.norm(axes, axis=0)
    axes[:, free[1]] = np.cross(axes[:, (free[1] + 1) % 3], axes[:, (free[1] + 2) % 3])
    locked = [k for k in range(3) if DIRECTIONS[k] in dict(joint.locked)]
    if locked and len(locked) < 3:
        before = pose.rotated(joint.first, joint.axes)[:, locked]
        if np.abs(before - axes[:, locked] @ (axes[:, locked].T @ before)).max() > SKEWED:
            who = f"joint '{joint.name}'"
            raise NoWordsError(
                f"{who}: its free rotations have turned against its locked translations, which no joint with "
                f"free = {tuple([name for name, _ in joint.freedom])} can say in this pose. Make it of two joints with "
                f"a small body between them.",
                element=who, field="free",
            )  # fmt: skip
    return axes


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
