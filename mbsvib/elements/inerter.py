"""Inerters: a force along a line, proportional to the relative acceleration of its two ends.

F = b (u_b - u_a)'' . e, with the inertance b [kg] and the line's unit vector e. The kinetic energy is 1/2 b (L')^2,
where L is the distance of the ends. There is no force at rest, so that an inerter contributes to M only.

Source: Smith (2002), Synthesis of mechanical networks: the inerter, IEEE Trans. Automatic Control 47, section II.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.elements.connection import ENDS, LINE, Connection, check_ends, line_between
from mbsvib.elements.deformations import Law, length
from mbsvib.elements.part import derived
from mbsvib.elements.roles import batched, number
from mbsvib.elements.rows import ElementRows, columns


@dataclass(frozen=True, slots=True)
class Inerter(Connection):
    """An ``inertance`` [kg] along the line from ``start`` on ``first`` to ``end`` on ``second`` [m, world axes].

    Its force on both bodies is inertance times the second derivative of the length, along the unit vector ``line``.
    """

    law = Law(length, inertance="inertance")
    stiffness = damping = tension = 0.0
    preload = free_length = at_rest = None
    roles = batched(**ENDS, inertance=number("kg", positive=True), **LINE)

    start: Vector
    end: Vector
    inertance: float = field()
    line: Vector = derived((0.0, 0.0, 1.0))


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

    ``parts`` are the inerters and their numbers among the model's connections.
    """
    table = columns([(number[p.first], number[p.second], i, *p.start, *p.line, p.inertance) for i, p in parts], 10)
    zero = np.zeros(len(parts))
    return ElementRows.along_lines(table[:3], table[3:6], table[6:9], zero, zero, table[9])
