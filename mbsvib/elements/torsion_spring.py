"""Torsion springs: a spring-damper about one axis, which is fixed in the first body.

tau = preload - k phi - c phi' is the moment on the second body about the axis e. phi is the twist of the relative
rotation since the reference pose, a rotation about an axis normal to e (swing) times one by phi about e (twist). About
the reference pose the spring is a bushing with stiffness about e only, whose moment rotates with the first body.

With the quaternion (w, x, y, z) of the relative rotation, z along e, phi = 2 atan2(z, w). After another small rotation
rho, phi changes by g . rho - 1/2 (g . rho) (h . rho), g = (a, b, 1), h = (b, -a, 0), a = (w y + z x) / (w^2 + z^2),
b = (z y - w x) / (w^2 + z^2). In a pose with swing the spring is replaced by a bushing with these derivatives.

Source: Dobrowolski (2015), Swing-twist decomposition in Clifford algebra, arXiv:1506.05481.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import atan2, degrees, sqrt
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.elements import bushing
from mbsvib.elements.connection import ENDS, Connection, PreloadForm, along, check_ends
from mbsvib.elements.deformations import Law, swing, twist
from mbsvib.elements.part import Part
from mbsvib.elements.pose import Pose
from mbsvib.elements.roles import axis as line
from mbsvib.elements.roles import batched, number
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.errors import ModelError
from mbsvib.linalg.components import arctan2
from mbsvib.linalg.rotations import quaternion

# Sine of half the swing angle below which the swing is a rounding error; squared cosine of half the largest, 3 rad.
SWING, LARGEST_SWING = 1e-12, 5e-3
NOWHERE = (0.0, 0.0, 0.0)  # a moment has no point


@dataclass(frozen=True, slots=True)
class TorsionSpring(Connection):
    """``stiffness`` [N m/rad] and ``damping`` [N m s/rad] about ``axis`` (unit vector, world axes).

    ``preload`` [N m] is the moment about the axis on the second body in the reference pose.
    """

    law = Law(twist, "stiffness", "damping", preload="preload", wrench=True, rotations=slice(0, 1), across=swing)

    roles = batched(**ENDS, stiffness=number("N m/rad"), damping=number("N m s/rad"), preload=number("N m"),
                   axis=line("first"))  # fmt: skip

    axis: Vector
    stiffness: float = 0.0
    damping: float = 0.0
    preload: float | None = None

    def replaced_fields(self, fields: Mapping[str, Array]) -> dict[str, Array]:
        return {field: np.concatenate((np.zeros((5, len(values))), values[None])) for field, values in fields.items()}

    @property
    def rest_wrench(self) -> tuple[float, ...]:
        return (*NOWHERE, *((self.preload or 0.0) * entry for entry in self.axis))

    def preload_form(self, size: float) -> PreloadForm | None:
        return along(self, NOWHERE, (*NOWHERE, *self.axis), self.stiffness, size, lambda moment: {"preload": moment})

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        return self.all_in_pose([self], pose, relaxed)[0]

    @staticmethod
    def all_in_pose(parts: Sequence[Any], pose: Pose, relaxed: bool) -> list[Part | dict[str, Any]]:
        moved = {part.name: part for part in parts
                 if not (pose.is_unmoved(part.first) and pose.is_unmoved(part.second))}  # fmt: skip
        if relaxed or not moved:
            return [_turned(part, pose) if part.name in moved else part for part in parts]
        first, second = (pose.rotations.take([pose.number[body] for body in bodies], axis=0) for bodies in (
            [part.first for part in moved.values()], [part.second for part in moved.values()]))  # fmt: skip
        axes = np.array([check.frame_along(part.axis) for part in moved.values()])
        k, c, preload = (np.array([getattr(part, field) or 0.0 for part in moved.values()])
                         for field in ("stiffness", "damping", "preload"))  # fmt: skip
        about_pose = about(list(moved.values()), k, c, preload, (first @ axes).swapaxes(-1, -2) @ (second @ axes))
        in_pose = {part.name: _twisted(part, pose, *arrays)
                   for part, *arrays in zip(moved.values(), *about_pose, strict=True)}  # fmt: skip
        return [in_pose.get(part.name, part) for part in parts]


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


def _turned(part: TorsionSpring, pose: Pose) -> dict[str, Any]:
    """The arguments with the axis turned with the first body."""
    return part.constructor_kwargs() | {"axis": pose.rotated_vector(part.first, part.axis)}


def about(
    parts: Sequence[Any], stiffness: Array, damping: Array, preload: Array, relative: Array
) -> tuple[Array, Array, Array]:
    """Return stiffness, damping (..., n, 6, 6) and preload (..., n, 6) of springs about a pose, in axes with z along
    their own on the first body.

    ``stiffness``, ``damping`` and ``preload`` (..., n) as described, ``relative`` (..., n, 3, 3) the rotations of the
    second bodies in these axes. ``parts`` (n,) are named where their angles are not unique.
    """
    w, vector = quaternion(relative)
    x, y, z = np.moveaxis(vector, -1, 0)
    square, swing = w * w + z * z, np.hypot(x.real, y.real)
    angle = 2.0 * arctan2(z, w)
    lost = np.argwhere((square < LARGEST_SWING) | (np.abs(angle) > bushing.LARGEST_ANGLE) & (stiffness != 0.0))
    if len(lost):
        at = tuple(lost[0].tolist())
        who, across = f"torsion spring '{parts[at[-1]].name}'", degrees(2.0 * atan2(swing[at], sqrt(square[at])))
        raise ModelError(f"{who}: its bodies are turned by {degrees(abs(angle[at])):.0f} degrees about its axis and by "
                         f"{across:.0f} across it, where its angle is not unique. Describe the model in a nearer "
                         f"pose.", element=who, field="stiffness")  # fmt: skip
    moment = preload - stiffness * angle
    g, h = np.zeros((2, *relative.shape[:-1]), relative.dtype)
    g[..., 2] = 1.0
    swings = swing > SWING
    tilts = (w * y + z * x, z * y - w * x)
    g[..., 0], g[..., 1] = (np.where(swings, entry, entry - entry.real) / square for entry in tilts)
    h[..., 0], h[..., 1] = g[..., 1], -g[..., 0]
    squares, mixed = (a[..., :, None] * b[..., None, :] for a, b in ((g, g), (g, h)))
    result = np.zeros((2, *np.shape(moment), 6, 6), moment.dtype)
    result[0, ..., 3:, 3:] = np.asarray(stiffness)[..., None, None] * squares
    result[0, ..., 3:, 3:] += 0.5 * moment[..., None, None] * (mixed + mixed.swapaxes(-1, -2))
    result[1, ..., 3:, 3:] = np.asarray(damping)[..., None, None] * squares
    wrench = np.concatenate((np.zeros_like(g), moment[..., None] * g), axis=-1)
    return result[0], result[1], wrench


def _twisted(part: TorsionSpring, pose: Pose, stiffness: Array, damping: Array, wrench: Array) -> Part | dict[str, Any]:
    """The spring in a pose with this stiffness and damping (6, 6) and this preload (6,): a bushing if it swings."""
    moment = float(wrench[5])
    if not wrench[3:5].any() and not stiffness[3:5].any() and not damping[3:5].any():
        return _turned(part, pose) | ({"preload": moment} if moment or part.preload is not None else {})
    return bushing.make(part.name, part.first, part.second, NOWHERE, stiffness, damping,
                        pose.rotated_axes(part.first, check.frame_along(part.axis)), wrench)  # fmt: skip


def expand(part: TorsionSpring, *_: Any) -> ExpandedPart:
    """Return the bushing of the same name about the axis; it has no force, so that its point does not matter."""
    stiffness, damping, preload = ((*NOWHERE, 0.0, 0.0, value) for value in (part.stiffness, part.damping,
                                                                             part.preload or 0.0))  # fmt: skip
    return ExpandedPart(springs={part.name: bushing.Bushing(
        part.name, part.first, part.second, NOWHERE, stiffness, damping, check.frame_along(part.axis),
        None if part.preload is None else preload)})  # fmt: skip
