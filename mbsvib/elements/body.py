"""Rigid bodies: mass, inertia about the centre of mass, and the pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import acos, cos, pi, sqrt
from typing import Any, ClassVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import IDENTITY, Matrix3, Vector
from mbsvib.common.arrays import Array, Bools
from mbsvib.common.fast_init import fast_init
from mbsvib.elements import shapes
from mbsvib.elements.part import Part
from mbsvib.elements.roles import Role, axes, batched, number, point
from mbsvib.errors import ModelError

INERTIA = "3 principal moments, 6 entries (xx yy zz xy xz yz) or a symmetric 3x3 tensor [kg m^2]"
NO_INERTIA = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
# CAD programs print inertia tensors with six or seven digits; a thin plate then violates Ixx + Iyy = Izz by this much.
TRIANGLE_SLACK = 1e-6
# A tensor is certainly valid if the leading minors of E, relative to those of a sphere of equal trace, are above this.
CLEARLY_VALID = 1e-6
# Limits for many variants at once are tightened by this factor, so that rounding lets none pass unchecked.
SAFETY = 0.9


_TENSOR = np.array((0, 3, 4, 3, 1, 5, 4, 5, 2))  # xx xy xz, xy yy yz, xz yz zz out of xx yy zz xy xz yz


def tensors(entries: Array) -> Array:
    """Return the inertia tensors (..., 3, 3) that are given by their entries (..., 6)."""
    return entries.take(_TENSOR, axis=-1).reshape(*entries.shape[:-1], 3, 3)


def _is_doubtful(_: Mapping[str, Array], field: str, values: Mapping[str, Array]) -> Bools:
    """Whether no body might have these inertias (6, bodies, variants)."""
    low, middle, high = np.moveaxis(np.linalg.eigvalsh(tensors(np.moveaxis(values[field], 0, -1))), -1, 0)
    slack = SAFETY * TRIANGLE_SLACK * np.maximum(high, -low)
    # diagonal entries must not be negative, even by rounding
    return np.asarray((low < -slack) | (low + middle < high - slack) | (values[field][:3] < 0.0).any(axis=0))


@fast_init
@dataclass(frozen=True, slots=True)
class Body(Part):
    """A rigid body.

    ``inertia`` are the tensor entries (xx, yy, zz, xy, xz, yz) [kg m^2] about the centre of mass in body axes,
    ``position`` is the centre of mass [m] and ``orientation`` the body axes (columns), both in world axes.
    """

    symbol = "body"
    turns_steadily: ClassVar[bool] = False
    roles = batched(
        mass=number("kg", positive=True),
        inertia=Role("kg m^2", ("xx", "yy", "zz", "xy", "xz", "yz"), placed="inertia", signed=False,
                     doubtful=_is_doubtful),
        position=point("name"), orientation=axes("name"),
    )  # fmt: skip

    mass: float
    inertia: tuple[float, float, float, float, float, float]
    position: Vector = (0.0, 0.0, 0.0)
    orientation: Matrix3 = IDENTITY

    @property
    def body_positions(self) -> Mapping[str, Vector]:
        return {self.name: self.position}


def make(name: str, mass: Any, inertia: Any, position: Any, orientation: Any) -> Body:
    """Check the values of a body and build it."""
    who = f"body '{name}'"
    for field, value, expected in (("mass", mass, "a positive number [kg], or 0"), ("inertia", inertia, INERTIA)):
        if value is None:
            raise check.refuse(who, field, None, expected, "Give mass and inertia, or shape and density.")
    mass = check.number(mass, who, "mass", "a positive number [kg], or 0")
    if mass < 0.0:
        raise check.refuse(who, "mass", mass, "a positive number [kg], or 0")
    return Body(name, mass, _inertia(inertia, who), check.vector(position, who, "position"),
                check.orientation(orientation, who))  # fmt: skip


def of_shape(
    name: str, mass: Any, inertia: Any, position: Any, orientation: Any, shape: Any, density: Any
) -> Body:
    """Check the values of a body of a solid shape and build it; ``position`` is the origin of the shape's axes."""
    who = f"body '{name}'"
    for field, value in (("mass", mass), ("inertia", inertia)):
        if value is not None:
            raise ModelError(f"{who}: {field} = {check.shown(value)} is given beside a shape, from which it follows; "
                             f"leave one out.", element=who, field=field)  # fmt: skip
    for field, value, other in (("shape", shape, "density"), ("density", density, "shape")):
        if value is None:
            raise ModelError(f"{who}: {other} is given without {field}; give both, or mass and inertia.",
                             element=who, field=field)  # fmt: skip
    solid, axes = shapes.solid(shape, density, who), check.orientation(orientation, who)
    centre = np.array(check.vector(position, who, "position")) + np.array(axes) @ np.array(solid.centre)
    return make(name, solid.mass, solid.inertia, tuple(centre.tolist()), axes)


def _inertia(value: Any, who: str) -> tuple[float, float, float, float, float, float]:
    expected = INERTIA
    items = value.tolist() if hasattr(value, "tolist") else value
    if hasattr(items, "__len__") and len(items) == 3 and hasattr(items[0], "__len__"):
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = check.square(items, 3, who, "inertia", expected)
        if max(abs(xy - yx), abs(xz - zx), abs(yz - zy)) > 1e-12 * max(abs(xx), abs(yy), abs(zz)):
            raise check.refuse(who, "inertia", value, expected, "This one is not symmetric.")
    else:
        entries = check.numbers(items, (3, 6), who, "inertia", expected)
        xx, yy, zz, xy, xz, yz = entries if len(entries) == 6 else (*entries, 0.0, 0.0, 0.0)
    if _is_clearly_valid(xx, yy, zz, xy, xz, yz):
        return (xx, yy, zz, xy, xz, yz)
    low, middle, high = sorted((xx, yy, zz)) if not (xy or xz or yz) else principal(xx, yy, zz, xy, xz, yz)
    slack = TRIANGLE_SLACK * max(high, -low)
    if low < 0.0 and (low < -slack or not (xy or xz or yz)):
        hint = f"Its smallest principal moment is {low:.6g}; none can be negative."
        raise check.refuse(who, "inertia", value, expected, hint)
    if low + middle < high - slack:
        raise ModelError(
            f"{who}: inertia = {check.shown(value)} has principal moments {low:.6g}, {middle:.6g}, {high:.6g} "
            f"kg m^2; no body has one that exceeds the sum of the other two. Check that they are taken about "
            f"the centre of mass, and the sign of the products (tensor entries: xy = -integral of x y dm).",
            element=who, field="inertia",
        )  # fmt: skip
    return (xx, yy, zz, xy, xz, yz)


def _is_clearly_valid(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> bool:
    """Whether the leading minors of the second moments of mass E = tr(J) / 2 - J are positive, far above rounding."""
    half = 0.5 * (xx + yy + zz)
    a, b, c = half - xx, half - yy, half - zz
    limit = CLEARLY_VALID * half
    minor = a * b - xy * xy
    return a > limit and minor > limit * half and (
        c * minor - a * yz * yz - b * xz * xz - 2.0 * xy * xz * yz > limit * half * half)


def principal(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> tuple[float, float, float]:
    """Return the eigenvalues of a symmetric 3x3 matrix in ascending order (trigonometric closed form)."""
    scale = max(map(abs, (xx, yy, zz, xy, xz, yz))) or 1.0
    xx, yy, zz, xy, xz, yz = (entry / scale for entry in (xx, yy, zz, xy, xz, yz))
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    p = sqrt((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if p < 1e-100:  # a sphere, except for entries so small that their squares underflow
        return (scale * mean, scale * mean, scale * mean)
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    angle = acos(min(1.0, max(-1.0, determinant / (2.0 * p * p * p)))) / 3.0
    high = mean + 2.0 * p * cos(angle)
    low = mean + 2.0 * p * cos(angle + 2.0 * pi / 3.0)
    return (scale * low, scale * (3.0 * mean - high - low), scale * high)
