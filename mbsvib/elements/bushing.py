"""Bushings: spatial spring-dampers that act at a point, in up to six directions of their own axes.

In finite motion a bushing has the potential s . k s / 2 - preload . s with s = (d, rho): d = A^T (p_b - p_a) in axes A
that turn with the first body, rho = log(A^T B). In another pose the same law is expanded to second order about that
pose, which is all that its preload and its stiffness there can say.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.elements.connection import Connection, check_ends
from mbsvib.elements.part import ParameterField, Part, point, rotation, six
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import inverse_jacobian, logarithm, second_order

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.elements.placement import Placement

    Mask = NDArray[np.bool_]

Six = tuple[float, ...]
Matrix6 = tuple[Six, ...]
Law = tuple[Six | Matrix6, Six | Matrix6, Six | None]
ZERO: Six = (0.0,) * 6
# Bushings that carry moments are followed up to this angle [rad] between their bodies.
FARTHEST = 3.0
FINITE = "values that are finite in this pose"
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
        return self.all_in_pose([self], pose, relaxed)[0]

    @staticmethod
    def all_in_pose(parts: Sequence[Any], pose: Placement, relaxed: bool) -> list[Part | dict[str, Any]]:
        moved = [part for part in parts if not (pose.stays(part.first) and pose.stays(part.second))]
        laws = [(part.stiffness, part.damping, part.preload) for part in moved] if relaxed or not moved else \
            _laws_at(moved, *deflections(moved, pose))  # fmt: skip
        there = {
            part.name: Bushing(part.name, part.first, part.second, pose.point(part.second, part.position), stiffness,
                               damping, pose.axes(part.first, part.orientation), preload)
            for part, (stiffness, damping, preload) in zip(moved, laws, strict=True)
        }  # fmt: skip
        return [there.get(part.name, part) for part in parts]


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


def deflections(bushings: Sequence[Bushing], pose: Placement) -> tuple[Array, Array]:
    """Return d [m] and rho [rad] (n, 3) of bushings since the pose in which they are described, in their axes."""
    first, second = (np.array([pose.number[body] for body in bodies]) for bodies in (
        [part.first for part in bushings], [part.second for part in bushings]))  # fmt: skip
    axes, at = np.array([part.orientation for part in bushings]), np.array([part.position for part in bushings])
    back = (pose.turn.take(first, axis=0) @ axes).swapaxes(-1, -2)
    gap = pose.points(second, at) - pose.points(first, at)
    return (back @ gap[..., None])[..., 0], logarithm(back @ (pose.turn.take(second, axis=0) @ axes))


def _laws_at(bushings: Sequence[Bushing], d: Array, rho: Array) -> list[Law]:
    """Stiffness, damping and preload of bushings about another pose."""
    k, c = (np.array([_matrix(value) for value in values]) for values in (
        [part.stiffness for part in bushings], [part.damping for part in bushings]))  # fmt: skip
    wrench = np.array([part.preload or ZERO for part in bushings])
    wrench -= (k @ np.concatenate((d, rho), axis=1)[..., None])[..., 0]
    turned = np.asarray(rho.any(axis=1))
    holds = turned & (wrench[:, 3:].any(axis=1) | k[:, 3:].any(axis=(1, 2)))
    brakes = turned & c[:, 3:].any(axis=(1, 2))
    for i in (holds & (np.square(rho).sum(axis=1) > FARTHEST**2)).nonzero()[0].tolist():
        raise _too_far(bushings[i], rho[i])
    map_ = np.tile(_SIX, (len(rho), 1, 1))
    map_[:, 3:, 3:] = inverse_jacobian(rho)
    back = map_.swapaxes(-1, -2)
    tangent = back @ k @ map_
    tangent[:, 3:, 3:] -= second_order(rho, wrench[:, 3:])
    stiffness = _symmetric(tangent, bushings, "stiffness", holds)
    damping = _symmetric(back @ c @ map_, bushings, "damping", brakes)
    return [(stiffness.get(i, part.stiffness), damping.get(i, part.damping), _preload(part, values))
            for i, (part, values) in enumerate(zip(bushings, (back @ wrench[..., None])[..., 0].tolist(), strict=True))]


def _matrix(value: Six | Matrix6) -> Array:
    """Six values or a matrix as a matrix."""
    array = np.array(value)
    return array * _SIX if array.ndim == 1 else array


def _symmetric(matrices: Array, bushings: Sequence[Bushing], field: str, which: Mask) -> dict[int, Matrix6]:
    """The symmetric parts of some of the matrices, by number."""
    numbers, some = which.nonzero()[0].tolist(), matrices[which]
    mean = 0.5 * (some + some.swapaxes(-1, -2))
    for i in np.flatnonzero(~np.isfinite(mean).all(axis=(1, 2))).tolist():
        raise check.refuse(f"bushing '{bushings[numbers[i]].name}'", field, mean[i], FINITE)
    return {i: tuple(map(tuple, rows)) for i, rows in zip(numbers, mean.tolist(), strict=True)}


def _preload(bushing: Bushing, wrench: list[float]) -> Six | None:
    if bushing.preload is None and not any(wrench):
        return None
    return check.numbers(wrench, (6,), f"bushing '{bushing.name}'", "preload", FINITE)


def _too_far(bushing: Bushing, rho: Array) -> ModelError:
    """Next to half a turn the rotation vector may as well point the other way, and so may the moment."""
    who, angle = f"bushing '{bushing.name}'", float(np.linalg.norm(rho))
    return ModelError(f"{who}: is turned by {np.degrees(angle):.0f} degrees, where its moment is no longer defined "
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
