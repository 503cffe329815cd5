"""What Maxwell elements are made of in a network: a node and three lines: the static spring, the spring, the damper."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import Maxwell, Spring
from mbsvib.elements.maxwell_rows import Node

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.elements import Body
    from mbsvib.elements.part import Part
    from mbsvib.sensitivities.network import Network


def maxwell_parts(parts: Sequence[Part]) -> tuple[list[Body], list[Spring]]:
    """Return the nodes and the lines of all Maxwell elements."""
    found = [part for part in parts if isinstance(part, Maxwell)]
    nodes: list[Body] = [Node(part.node, 0.0, (0.0,) * 6, part.end) for part in found]
    return nodes, [line for part in found for line in _lines(part)]


def _lines(part: Maxwell) -> tuple[Spring, Spring, Spring]:
    length = float(np.linalg.norm(np.subtract(part.end, part.start)))

    def line(which: str, first: str, second: str, stiffness: float, damping: float) -> Spring:
        return Spring(line_name(part, which), first, second, part.start, part.end, stiffness, damping, None, None,
                      part.line, length)  # fmt: skip

    return (line("static_stiffness", part.first, part.second, part.static_stiffness, 0.0),
            line("stiffness", part.first, part.node, part.stiffness, 0.0),
            line("damping", part.second, part.node, 0.0, part.damping))  # fmt: skip


def line_name(part: Maxwell, field: str) -> str:
    """Return the name of the line that one of the numbers of a Maxwell element makes."""
    return f"{part.node}.{field}"


def maxwell_lines(network: Network) -> list[tuple[str, int]]:
    """Return the name of each Maxwell element, with the number of the line between its two bodies."""
    place = {spring.name: k for k, spring in enumerate(network.springs)}
    found = [part for part in network.parts if isinstance(part, Maxwell)]
    return [(part.name, place[line_name(part, "static_stiffness")]) for part in found]
