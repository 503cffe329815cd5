"""Connections: elements that act with a force or moment between two bodies, and how they can carry a preload."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import hypot, inf
from typing import Any, ClassVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.elements.deformations import Law
from mbsvib.elements.part import Part
from mbsvib.elements.roles import BODY, point
from mbsvib.errors import ModelError
from mbsvib.linalg.rank import EPS

ZERO = (0.0,) * 6
# Roles of the bodies that a connection is between, and of the two points of one along a line.
ENDS = {"first": BODY, "second": BODY}
LINE = {"start": point("first", other="end"), "end": point("second", other="start")}


@dataclass(frozen=True, slots=True)
class Connection(Part):
    """An element between the bodies ``first`` and ``second``."""

    _engine = ("acts_along_line at_rest cross_coupling generated_names law loaded preload_form "
               "rest_wrench row_values")  # fmt: skip

    law: ClassVar[Law | None] = None  # of its force in finite motion

    first: str
    second: str

    @property
    def points(self) -> tuple[Vector, ...]:
        """Points at which it acts [m], world axes: none, one, or one on the first and one on the second body."""
        return tuple([getattr(self, key) for key in self.point_fields])

    @property
    def generated_names(self) -> tuple[str, ...]:
        """Names of the bodies, joints and springs that represent it in the equations, without its own name."""
        return tuple(self.body_positions)

    @property
    def acts_along_line(self) -> bool:
        """Whether it acts along the line through two points."""
        return len(self.point_fields) == 2

    @property
    def symbol(self) -> str:
        """Its symbol in pictures."""
        return "spring" if self.acts_along_line else "bushing"

    @property
    def reversed_axis(self) -> int:
        """Number of its axis that a mirrored copy reverses: not its line, which is z."""
        return 1 if self.acts_along_line else 2

    @property
    def loaded(self) -> bool:
        """Whether it has a force in the reference pose."""
        return any(self.rest_wrench)

    @property
    def rest_wrench(self) -> tuple[float, ...]:
        """Wrench (6,) [N, N m] on the second body in the reference pose, at the last of its points, world axes."""
        if self.law is None or self.law.energy is None:
            return ZERO
        return tuple((-self.law.at_pose(self)[0]).tolist())

    @property
    def cross_coupling(self) -> tuple[Array, Array] | None:
        """Antisymmetric parts of its stiffness and damping (6, 6) at its point, world axes; None where both are zero.
        """
        return None

    @property
    def at_rest(self) -> Connection | None:
        """The element that has the same forces at rest; None if it has none in any pose."""
        return self

    @property
    def inertance(self) -> float:
        """Force per relative acceleration of its ends [kg]."""
        return 0.0

    def row_values(self, fields: Mapping[str, Array], unit: Array) -> Mapping[str, Array]:
        """Return coefficients of its rows for values of some fields.

        Parameters
        ----------
        fields : mapping of str to array
            Values by field, with the variants on the last axis.
        unit : array, shape (rows, 6)
            Directions of the rows in its axes.

        Returns
        -------
        mapping of str to array, shape (rows, variants)
            Values of ``stiffness``, ``damping`` and ``inertance``, as far as they differ.
        """
        along = unit.argmax(axis=1)
        values = {field: fields[field] for field in ("stiffness", "damping", "inertance") if field in fields}
        return {field: np.repeat(array[None], len(along), axis=0) if array.ndim == 1 else array[along]
                for field, array in values.items()}  # fmt: skip

    def preload_form(self, size: float) -> PreloadForm | None:
        """Return how it can carry a preload.

        Parameters
        ----------
        size : float
            Size of the mechanism [m], by which moments are compared with forces.

        Returns
        -------
        PreloadForm or None
            Its wrenches; None without stiffness at rest.
        """
        return None


def check_ends(who: str, first: str, second: str) -> None:
    """Refuse a connection of a body with itself."""
    if first == second:
        raise ModelError(f"{who}: connects body '{first}' with itself; name two different bodies.",
                         element=who, field="second")  # fmt: skip


def line_between(who: str, start: Any, end: Any, hint: str) -> tuple[Vector, Vector, Vector, float]:
    """Return two points [m], the unit vector from the first to the second, and their distance [m], checked.

    ``start``, ``end`` (3,): the points, world axes. ``hint``: sentence for the message if both points coincide.
    """
    a, b = check.vector(start, who, "start"), check.vector(end, who, "end")
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    length = hypot(x, y, z)
    if not 0.0 < length < inf:
        raise check.refuse(who, "end", end, "a point other than start", hint)
    return a, b, (x / length, y / length, z / length), length


def line_force(tension: float, line: Vector) -> tuple[float, ...]:
    """Return the wrench (6,) [N] of a tension along a unit vector from the first to the second body, on the second."""
    x, y, z = line
    return (-tension * x, -tension * y, -tension * z, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class PreloadForm:
    """Wrenches on the second body that an element can carry as a preload, world axes.

    ``wrenches`` (n, 6) at ``point`` [m] are orthonormal, with moments over the size of the mechanism; ``wrench`` (6,)
    [N, N m] is the one in the reference pose. ``resolution`` [N] is the force of the smallest displacement that rounded
    positions resolve. ``arguments`` returns the arguments of the element that change with a preload wrench (6,); None:
    with no preload.
    """

    point: Vector
    wrenches: Array
    wrench: Array
    resolution: float
    arguments: Callable[[Array | None], dict[str, Any]]


def along(
    part: Any, point: Vector, direction: tuple[float, ...], stiffness: float, size: float,
    arguments: Callable[[float | None], dict[str, Any]],
) -> PreloadForm | None:  # fmt: skip
    """Return the form of a preload that is an amount of one wrench (6,), a force or a moment; None without stiffness.

    ``stiffness`` [N/m, N m/rad] is that at rest along the ``direction``, ``size`` that of the mechanism [m].
    ``arguments`` returns the changed arguments for an amount [N, N m] or None.
    """
    six, unit = np.array(direction), 1.0 if any(direction[:3]) else size
    return PreloadForm(
        point, unit * six[None], np.array(part.rest_wrench), EPS * abs(stiffness) * size / unit**2,
        lambda wrench: arguments(None if wrench is None else float(wrench @ six)),
    ) if stiffness else None  # fmt: skip
