"""Bushings: spatial spring-dampers that act at a point, in up to six directions of their own axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.elements.part import ParameterField, Part, point, rotation, six
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

Six = tuple[float, ...]
Matrix6 = tuple[Six, ...]
ZERO: Six = (0.0,) * 6


@dataclass(frozen=True, slots=True)
class Bushing(Part):
    """A spatial spring-damper between ``first`` and ``second`` at ``position`` [m], in the axes ``orientation``.

    ``stiffness`` [N/m, N m/rad] and ``damping`` [N s/m, N m s/rad] are six values (x y z rx ry rz) or symmetric
    6x6 matrices; they act on the displacement of the second body relative to the first. ``preload`` [N, N m] is the
    wrench on the second body in the given pose, in these axes; the first body takes its reaction at the same point.
    """

    first: str
    second: str
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


def make(
    name: str, first: str, second: str, position: Any, stiffness: Any, damping: Any, orientation: Any,
    preload: Any = None,
) -> Bushing:  # fmt: skip
    """Check the values of a bushing and build it."""
    who = f"bushing '{name}'"
    if first == second:
        raise ModelError(f"{who}: connects body '{first}' with itself; name two different bodies.",
                         element=who, field="second")  # fmt: skip
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


def _acts(value: Six | Matrix6) -> bool:
    return any(any(row) if isinstance(row, tuple) else row for row in value)


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
