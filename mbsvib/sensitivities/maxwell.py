"""Maxwell elements as parts of a network: three lines and a node, and how their numbers enter the equations.

The element lengthens by l between its points and its damper by s, the coordinate of the node: its springs see l and
l + s, its damper s. Where a point moves, l changes as that of a line spring does, and s does not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Maxwell, Spring
from mbsvib.elements.maxwell_rows import Node
from mbsvib.sensitivities.factors import along, moved_end

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body
    from mbsvib.elements.part import Part
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.factors import Rule, Terms
    from mbsvib.sensitivities.network import Network


def nodes_and_lines(parts: Sequence[Part]) -> tuple[list[Body], list[Spring]]:
    """Return the nodes of Maxwell elements, and of each the static spring, the spring and the damper."""
    found = [part for part in parts if isinstance(part, Maxwell)]
    nodes: list[Body] = [Node(part.node, 0.0, (0.0,) * 6, part.end) for part in found]
    return nodes, [line for part in found for line in _lines(part)]


def _lines(part: Maxwell) -> tuple[Spring, Spring, Spring]:
    length = float(np.linalg.norm(np.subtract(part.end, part.start)))

    def line(which: str, first: str, second: str, stiffness: float, damping: float) -> Spring:
        return Spring(name_of(part, which), first, second, part.start, part.end, stiffness, damping, None, None,
                      part.line, length)  # fmt: skip

    return (line("static_stiffness", part.first, part.second, part.static_stiffness, 0.0),
            line("stiffness", part.first, part.node, part.stiffness, 0.0),
            line("damping", part.second, part.node, 0.0, part.damping))  # fmt: skip


def name_of(part: Maxwell, field: str) -> str:
    """Return the name of the line that one of the numbers of a Maxwell element makes."""
    return f"{part.node}.{field}"


def maxwells(network: Network) -> list[tuple[str, int]]:
    """Return the name of each Maxwell element, with the number of the line between its two bodies."""
    place = {spring.name: k for k, spring in enumerate(network.springs)}
    found = [part for part in network.parts if isinstance(part, Maxwell)]
    return [(part.name, place[name_of(part, "static_stiffness")]) for part in found]


def maxwell_rule(network: Network, part: Maxwell, field: str, index: tuple[int, ...]) -> Rule:
    """Return the rule by which a number of a Maxwell element enters the equations.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    part : Maxwell
        The element.
    field : str
        A field of it.
    index : tuple of int
        The entry of the field.

    Returns
    -------
    callable
        Terms of one entry.
    """
    place = {spring.name: k for k, spring in enumerate(network.springs)}
    static, spring, _ = (place[name_of(part, each)] for each in ("static_stiffness", "stiffness", "damping"))
    line, joints = np.array([part.line]), len(network.joints)
    span = np.array([np.subtract(part.end, part.start)])

    def coefficient(found: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        own = place[name_of(part, field)]
        seen = along(line, found.strain[own : own + 1, :3])
        return [[(0.5 * (found.rate if field == "damping" else found.stiff) * seen, seen)]]

    def point(found: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        own = slice(joints + static, joints + static + 1)
        change = moved_end(line, span, found.relative[own], field == "end")
        beside = joints + spring
        tension = along(line, found.wrench[own, :3] + found.wrench[beside : beside + 1, :3])
        return [[(tension, change[:, index[0]])]]

    return point if field in ("start", "end") else coefficient
