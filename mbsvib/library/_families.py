"""Common parts of chain, tree and ladder: the data of the chapter's Table 3, its joint letters, and the ports.

Source: Jiang, Chen and Luo (2011), section 5.1. Table 3 divides stiffness and damping by the number s of
spring-dampers between two bodies, so that the frequencies do not depend on s.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.elements import bushing
from mbsvib.errors import nearest

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.common.arguments import Vector

# The chapter's Table 3, of all spring-dampers of a joint together; it gives torsion per degree.
MASS = 1.0
INERTIA = (1.0, 1.0, 1.0)
STIFFNESS = (1e4, 1e4, 1e4, 1e4 * 180.0 / pi, 1e4 * 180.0 / pi, 1e4 * 180.0 / pi)
DAMPING = (10.0, 10.0, 10.0, 10.0 * 180.0 / pi, 10.0 * 180.0 / pi, 10.0 * 180.0 / pi)

LETTERS = {"R": "revolute", "P": "prismatic", "C": "cylindrical", "S": "spherical"}
X, Y, Z = UNITS = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class FamilyBuilder:
    """A chain, tree or ladder under construction: equal bodies, joined everywhere by the same joint and bushings."""

    def __init__(
        self, who: str, size: tuple[str, Any], joint: Any, axis: Any, springs: Any, *, total: bool, mass: Any,
        inertia: Any, stiffness: Any, damping: Any,
    ) -> None:  # fmt: skip
        self.size = count(size[1], who, size[0])
        self.springs = count(springs, who, "springs", least=0)
        self.kind = joint_kind(joint, who)
        self.axis = check.axis(axis, who, "axis")
        self.mass, self.inertia = mass, inertia
        sharing = self.springs if total else 1
        self.stiffness = _share(bushing.coefficients(stiffness, who, "stiffness"), sharing)
        self.damping = _share(bushing.coefficients(damping, who, "damping"), sharing)
        # as in the chapter: the family's letter, its size, the joint's letter, F and the number of spring-dampers
        self.model = Model(f"{who[0].upper()}{self.size}{self.kind[0].upper()}F{self.springs}")
        # the usual axis is the default of joints and bushings, which then need no checks of their axes
        usual = self.axis == Z
        self._joint_axes: dict[str, Any] = {} if usual else {"axis": self.axis}
        self._spring_axes: dict[str, Any] = {} if usual else {"orientation": check.frame_along(self.axis)}

    def body(self, name: str, position: Vector) -> None:
        """Add a body."""
        self.model.add_body(name, self.mass, self.inertia, position)

    def join(self, joint: str, spring: str, first: str, second: str, point: Vector) -> None:
        """Add a joint, and its spring-dampers (numbered where there are several), between two bodies."""
        model = self.model
        model.add_joint(joint, self.kind, first, second, point, **self._joint_axes)
        for i in range(1, self.springs + 1):
            name = spring if self.springs == 1 else f"{spring}.{i}"
            model.add_bushing(name, first, second, point, self.stiffness, self.damping, **self._spring_axes)

    def moves(self, *arms: Vector) -> tuple[list[str], list[str]]:
        """Return the world directions (x y z, rx ry rz) in which such joints let a body move.

        ``arms`` are the directions in which the body may lie as seen from the joints.
        """
        slides = [self.axis] if self.kind in ("prismatic", "cylindrical") else []
        turns = {"prismatic": [], "spherical": list(UNITS)}.get(self.kind, [self.axis])
        shifts = slides + [
            (a[1] * r[2] - a[2] * r[1], a[2] * r[0] - a[0] * r[2], a[0] * r[1] - a[1] * r[0])
            for a in turns for r in arms
        ]  # fmt: skip
        return _components(shifts, ("x", "y", "z")), _components(turns, ("rx", "ry", "rz"))


def count(value: Any, who: str, field: str, least: int = 1) -> int:
    """Return ``value`` if it is a whole number of at least ``least``."""
    try:
        number = value.__index__()
    except AttributeError:
        number = least - 1
    if isinstance(value, bool) or number < least:
        raise check.refuse(who, field, value, f"a whole number of at least {least}")
    return int(number)


def positive(value: Any, who: str, field: str, unit: str) -> float:
    """Return ``value`` if it is a positive number."""
    number = check.number(value, who, field, f"a positive number [{unit}]")
    if number <= 0.0:
        raise check.refuse(who, field, value, f"a positive number [{unit}]")
    return number


def joint_kind(value: Any, who: str) -> str:
    """Return the kind of joint that a word or the chapter's letter stands for."""
    kind = LETTERS.get(value, value) if isinstance(value, str) else None
    if kind not in LETTERS.values():
        known = [*LETTERS.values(), *LETTERS]
        expected = "revolute, prismatic, cylindrical or spherical, or the letter R, P, C or S"
        raise check.refuse(who, "joint", value, expected, nearest(str(value), known).strip())
    return kind  # type: ignore[return-value]


def _share(value: Any, number: int) -> Any:
    """Return the part that each of ``number`` bushings has of the six values, or of the 6x6 matrix."""
    if number <= 1:
        return value
    return tuple(_share(row, number) if isinstance(row, tuple) else row / number for row in value)


def _components(vectors: list[Vector], names: tuple[str, ...]) -> list[str]:
    return [name for k, name in enumerate(names) if any(abs(v[k]) > 1e-9 for v in vectors)]


def add_inputs(model: Model, body: str, directions: Iterable[str]) -> None:
    """Add forces Fx Fy Fz and torques Mx My Mz at a body's centre of mass."""
    for d in directions:
        model.add_input(f"M{d[1]}" if d[0] == "r" else f"F{d}", body, d)


def add_outputs(model: Model, body: str, directions: Iterable[str], prefix: str = "") -> None:
    """Add the displacements x y z rx ry rz of a body's centre of mass."""
    for d in directions:
        model.add_output(f"{prefix}{d}", body, d)
