"""Inerters: a force along a line in proportion to the relative acceleration of its two ends.

F = b (u_b - u_a)'' . e, with the inertance b [kg] and the line's unit vector e: kinetic energy 1/2 b (L')^2, where L is
the distance of the ends. At rest it carries no force, so that it adds to M only.

Source: Smith (2002), Synthesis of mechanical networks: the inerter, IEEE Trans. Automatic Control 47, section II.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.elements.connection import Connection, check_ends, line_between
from mbsvib.elements.element_rows import ElementRows
from mbsvib.elements.part import ParameterField, Part, derived, point
from mbsvib.elements.rows import columns

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from mbsvib.elements.placement import Placement


@dataclass(frozen=True, slots=True)
class Inerter(Connection):
    """An ``inertance`` [kg] along the line from ``start`` on ``first`` to ``end`` on ``second`` [m, world axes].

    Its force on both bodies is inertance times the second derivative of their distance along the unit vector ``line``.
    """

    stiffness = damping = tension = 0.0
    preload = free_length = None

    start: Vector
    end: Vector
    inertance: float
    line: Vector = derived((0.0, 0.0, 1.0))

    def parameter_fields(self) -> Iterator[ParameterField]:
        yield ParameterField("inertance", self.inertance, "kg")
        yield point("start", self.start)
        yield point("end", self.end)

    def with_values(self, values: Mapping[str, Any]) -> Self:
        return make(**self.arguments() | dict(values))  # type: ignore[return-value]

    def in_pose(self, pose: Placement, relaxed: bool) -> Part | dict[str, Any]:
        return self.words() | {"start": pose.point(self.first, self.start), "end": pose.point(self.second, self.end)}


def make(name: str, first: str, second: str, start: Any, end: Any, inertance: Any) -> Inerter:
    """Check the values of an inerter and build it."""
    who = f"inerter '{name}'"
    check_ends(who, first, second)
    a, b, line, _ = line_between(who, start, end, "An inerter of no length has no line to act along.")
    expected = "a positive number [kg]"
    mass = check.number(inertance, who, "inertance", expected)
    if mass <= 0.0:
        raise check.refuse(who, "inertance", inertance, expected)
    return Inerter(name, first, second, a, b, mass, line)


def rows(parts: Sequence[tuple[int, Inerter]], number: Mapping[str, int]) -> ElementRows:
    """Return the rows of inerters, the changes of their lengths.

    Parameters
    ----------
    parts : sequence of (int, Inerter)
        The inerters and their numbers among the model's connections.
    number : mapping
        Number of each body, ground included.

    Returns
    -------
    ElementRows
        One row an inerter, without stiffness and damping.
    """
    table = columns([(number[p.first], number[p.second], i, *p.start, *p.line, p.inertance) for i, p in parts], 10)
    none = np.zeros(len(parts))
    return ElementRows.along_lines(table[:3], table[3:6], table[6:9], none, none, table[9])
