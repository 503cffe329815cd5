"""Bushings: spatial spring-dampers that act at a point, in up to six directions of their own axes.

In finite motion a bushing has the potential s . k s / 2 - preload . s with s = (d, rho): d = A^T (p_b - p_a) in axes A
that turn with the first body, rho = log(A^T B). In another pose the same law is expanded to second order about that
pose, which is all that its preload and its stiffness there can say.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.elements.connection import Connection, check_ends
from mbsvib.elements.part import ParameterField, Part, point, rotation, six
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import inverse_jacobian, logarithm, second_order

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.elements.placement import Placement

Six = tuple[float, ...]
Matrix6 = tuple[Six, ...]
ZERO: Six = (0.0,) * 6
# Bushings that carry moments are followed up to this angle [rad] between their bodies.
FARTHEST = 3.0
_SIX = np.eye(6)


@dataclass(frozen=True, slots=True)
class Bushing(Connection):
    """A spatial spring-damper between ``first`` and ``second`` at ``position`` [m], in the axes ``orientation``.

    ``stiffness`` [N/m, N m/rad] and ``damping`` [N s/m, N m s/rad] are six values (x y z rx ry rz) or symmetric
    6x6 matrices; they act on the displacement of the second body relative to the first. ``preload`` [N, N m] is the
    wrench on the second body in the given pose, in these axes; the first body takes its reaction at the same point.
    """

    position: Vector
    stiffness: Six | Matrix6 = ZERO
    damping: Six | Matrix6 = ZERO
    orientation: Matrix3 = check.IDENTITY
    preload: Six | None = None

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield six("stiffness", self.stiffness, ("N/m", "N/rad", "N m/rad"))
        yield six("damping", self.damping, ("N s/m", "N s/rad", "N m s/rad"))
        yield point("position", self.position)
        yield rotation()
        if self.preload is not None:
            yield six("preload", self.preload, ("N", "N", "N m"))

    def with_values(self, values: Mapping[str, Any]) -> Self:
        turned = {} if "orientation" not in values else {
            "orientation": check.rotated(values["orientation"], self.orientation)}  # fmt: skip
        return make(**self.arguments() | dict(values) | turned)  # type: ignore[return-value]

    @property
    def loaded(self) -> bool:
        """Whether it carries a force in the pose as described."""
        return self.preload is not None and any(self.preload)

    def in_pose(self, pose: Placement, relaxed: bool) -> Part | dict[str, Any]:
        if pose.stays(self.first) and pose.stays(self.second):
            return self
        stiffness, damping, preload = (self.stiffness, self.damping, self.preload) if relaxed else \
            _law_at(self, *deflection(self, pose))  # fmt: skip
        return Bushing(self.name, self.first, self.second, pose.point(self.second, self.position), stiffness, damping,
                       pose.axes(self.first, self.orientation), preload)  # fmt: skip


def make(
    name: str, first: str, second: str, position: Any, stiffness: Any, damping: Any, orientation: Any,
    preload: Any = None,
) -> Bushing:  # fmt: skip
    """Check the values of a bushing and build it."""
    who = f"bushing '{name}'"
    check_ends(who, first, second)
    k = coefficients(stiffness, who, "stiffness")
    c = coefficients(damping, who, "damping")
    if preload is not None:
        expected = "the wrench on the second body: 6 values in the bushing's axes [N, N m]"
        preload = check.numbers(preload, (6,), who, "preload", expected)
    if not _acts(k) and not _acts(c) and not (preload and any(preload)):
        raise ModelError(f"{who}: neither stiffness nor damping is given; give one, or leave the bushing out.",
                         element=who, field="stiffness")  # fmt: skip
    return Bushing(name, first, second, check.vector(position, who, "position"), k, c,
                   check.orientation(orientation, who), preload)  # fmt: skip


def deflection(bushing: Bushing, pose: Placement) -> tuple[Array, Array]:
    """Return d [m] and rho [rad] of a bushing since the pose in which it is described, in its axes."""
    axes = np.array(bushing.orientation)
    first, second = pose.turned(bushing.first, axes), pose.turned(bushing.second, axes)
    a, b = pose.point(bushing.first, bushing.position), pose.point(bushing.second, bushing.position)
    gap = np.array((b[0] - a[0], b[1] - a[1], b[2] - a[2]))
    return first.T @ gap, logarithm(first.T @ second)


def _law_at(bushing: Bushing, d: Array, rho: Array) -> tuple[Six | Matrix6, Six | Matrix6, Six | None]:
    """Stiffness, damping and preload of a bushing about another pose."""
    stiffness, damping, preload = bushing.stiffness, bushing.damping, bushing.preload
    k, c = _matrix(stiffness), _matrix(damping)
    wrench = np.array(preload or ZERO) - k @ np.concatenate((d, rho))
    if np.count_nonzero(rho):
        map_ = _SIX.copy()
        map_[3:, 3:] = inverse_jacobian(rho)
        if np.count_nonzero(wrench[3:]) or np.count_nonzero(k[3:]):
            _check_turn(bushing, rho)
            tangent = map_.T @ k @ map_
            tangent[3:, 3:] -= second_order(rho, wrench[3:])
            stiffness = _symmetric(tangent, bushing, "stiffness")
        if np.count_nonzero(c[3:]):
            damping = _symmetric(map_.T @ c @ map_, bushing, "damping")
        wrench = map_.T @ wrench
    if preload is not None or np.count_nonzero(wrench):
        preload = check.numbers(wrench, (6,), f"bushing '{bushing.name}'", "preload",
                                "values that are finite in this pose")  # fmt: skip
    return stiffness, damping, preload


def _matrix(value: Six | Matrix6) -> Array:
    """Six values or a matrix as a matrix."""
    array = np.array(value)
    return array * _SIX if array.ndim == 1 else array


def _symmetric(matrix: Array, bushing: Bushing, field: str) -> Matrix6:
    """The symmetric part of a matrix."""
    mean = 0.5 * (matrix + matrix.T)
    if np.count_nonzero(np.isfinite(mean)) < mean.size:
        raise check.refuse(f"bushing '{bushing.name}'", field, mean, "values that are finite in this pose")
    return tuple(map(tuple, mean.tolist()))


def _check_turn(bushing: Bushing, rho: Array) -> None:
    """Next to half a turn the rotation vector may as well point the other way, and so may the moment."""
    angle = sqrt(float(rho @ rho))
    if angle > FARTHEST:
        who = f"bushing '{bushing.name}'"
        raise ModelError(f"{who}: is turned by {np.degrees(angle):.0f} degrees, where its moment is no longer defined "
                         f"(limit {np.degrees(FARTHEST):.0f}). Describe the model in a pose nearer by.",
                         element=who, field="stiffness")  # fmt: skip


def _acts(value: Six | Matrix6) -> bool:
    return any(map(any, value)) if isinstance(value[0], tuple) else any(value)


def coefficients(value: Any, who: str, field: str) -> Six | Matrix6:
    """Return stiffness or damping as six finite floats, or as a symmetric 6x6 matrix of them."""
    expected = "6 values (x y z rx ry rz) or a symmetric 6x6 matrix"
    items = value.tolist() if hasattr(value, "tolist") else value
    if not (hasattr(items, "__len__") and len(items) == 6 and hasattr(items[0], "__len__")):
        return check.numbers(items, (6,), who, field, expected)
    rows = check.square(items, 6, who, field, expected)
    # rounding of a matrix that was turned into other axes is allowed for; the mean of both sides is kept
    largest = max(abs(entry) for row in rows for entry in row)
    if any(abs(rows[i][j] - rows[j][i]) > 1e-9 * largest for i in range(6) for j in range(i)):
        raise check.refuse(who, field, value, expected, "This one is not symmetric.")
    return tuple(tuple(0.5 * (rows[i][j] + rows[j][i]) for j in range(6)) for i in range(6))
