"""Torsion springs: a spring-damper about one axis, which the first body carries.

tau = preload - k phi - c phi', the moment on the second body about the axis e. phi is the twist of the second body
against the first since the pose as described: its rotation is a swing about an axis across e after a turn by phi about
e. Equations about that pose see a bushing with stiffness about e only, whose moment turns with the first body.

With the quaternion (w, x, y, z) of the relative rotation, z along e, phi = 2 atan2(z, w). After another small rotation
rho, phi changes by g . rho - 1/2 (g . rho) (h . rho), g = (w y + z x, z y - w x, w^2 + z^2) / (w^2 + z^2) and
h = (z y - w x, -w y - z x, 0) / (w^2 + z^2): where the bodies are turned across the axis, a bushing is made of that.

Source: Dobrowolski (2015), Swing-twist decomposition in Clifford algebra, arXiv:1506.05481.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, degrees, hypot, sqrt
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.elements import bushing
from mbsvib.elements.connection import Connection, check_ends
from mbsvib.elements.part import ParameterField, Part
from mbsvib.elements.shared_rows import PlainParts
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import quaternion

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from mbsvib.elements.placement import Placement

# A swing of the bodies across the axis below this half sine is rounding.
SWING = 1e-12
# Squared cosine of half a swing of 3 rad, up to which torsion springs are followed.
FARTHEST = 5e-3


@dataclass(frozen=True, slots=True)
class TorsionSpring(Connection):
    """``stiffness`` [N m/rad] and ``damping`` [N m s/rad] about ``axis`` (unit vector, world axes).

    ``preload`` [N m] is the moment about the axis on the second body in the given pose.
    """

    axis: Vector
    stiffness: float = 0.0
    damping: float = 0.0
    preload: float | None = None

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield ParameterField("stiffness", self.stiffness, "N m/rad")
        yield ParameterField("damping", self.damping, "N m s/rad")
        if self.preload is not None:
            yield ParameterField("preload", self.preload, "N m")

    def with_values(self, values: Mapping[str, Any]) -> Self:
        return make(**self.arguments() | dict(values))  # type: ignore[return-value]

    @property
    def loaded(self) -> bool:
        """Whether it carries a force in the pose as described."""
        return bool(self.preload)

    def in_pose(self, pose: Placement, relaxed: bool) -> Part | dict[str, Any]:
        if pose.stays(self.first) and pose.stays(self.second):
            return self
        words = self.words() | {"axis": pose.direction(self.first, self.axis)}
        if relaxed:
            return words
        axes = check.frame_along(self.axis)
        w, (x, y, z) = quaternion(pose.turned(self.first, axes).T @ pose.turned(self.second, axes))
        square, angle = w * w + z * z, 2.0 * atan2(z, w)
        if square < FARTHEST or abs(angle) > bushing.FARTHEST:
            who = f"torsion spring '{self.name}'"
            raise ModelError(f"{who}: its bodies are turned by {degrees(abs(angle)):.0f} degrees about its axis and by "
                             f"{degrees(2.0 * atan2(hypot(x, y), sqrt(square))):.0f} across it, where its angle is no "
                             f"longer known. Describe the model in a pose nearer by.",
                             element=who, field="stiffness")  # fmt: skip
        moment = (self.preload or 0.0) - self.stiffness * angle
        if hypot(x, y) <= SWING:
            return words | ({"preload": moment} if moment or self.preload is not None else {})
        slope = np.array((w * y + z * x, z * y - w * x, square)) / square
        bend = np.array((z * y - w * x, -w * y - z * x, 0.0)) / square
        curve = -0.5 * (np.outer(slope, bend) + np.outer(bend, slope))
        about = np.zeros((3, 6, 6))
        about[0, 3:, 3:] = self.stiffness * np.outer(slope, slope) - moment * curve
        about[1, 3:, 3:] = self.damping * np.outer(slope, slope)
        about[2, 0, 3:] = moment * slope
        return bushing.make(self.name, self.first, self.second, (0.0, 0.0, 0.0), about[0], about[1],
                            pose.axes(self.first, axes), about[2, 0])  # fmt: skip


def make(
    name: str, first: str, second: str, axis: Any, stiffness: Any = 0.0, damping: Any = 0.0, preload: Any = None
) -> TorsionSpring:
    """Check the values of a torsion spring and build it."""
    who = f"torsion spring '{name}'"
    check_ends(who, first, second)
    k = check.number(stiffness, who, "stiffness", "a finite number [N m/rad]")
    c = check.number(damping, who, "damping", "a finite number [N m s/rad]")
    if preload is not None:
        preload = check.number(preload, who, "preload", "the moment on the second body in the given pose [N m]")
    if not (k or c or preload):
        raise ModelError(f"{who}: neither stiffness nor damping is given; give one, or leave the spring out.",
                         element=who, field="stiffness")  # fmt: skip
    return TorsionSpring(name, first, second, check.axis(axis, who, "axis"), k, c, preload)


def plain(part: TorsionSpring, *_: Any) -> PlainParts:
    """Return the bushing of the same name about the axis; where it acts does not matter, as it takes no force."""
    about = [(0.0,) * 5 + (value,) for value in (part.stiffness, part.damping, part.preload or 0.0)]
    return PlainParts(springs={part.name: bushing.make(
        part.name, part.first, part.second, (0.0, 0.0, 0.0), about[0], about[1], check.frame_along(part.axis),
        about[2] if part.preload is not None else None)})  # fmt: skip
