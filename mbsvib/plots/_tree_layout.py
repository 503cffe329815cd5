"""Positions of bodies in a drawing of the topology: ground at the bottom, each body above its parent."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

from mbsvib.mechanism.topology import FLOATS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.elements.part import Part
    from mbsvib.mechanism.topology import Topology


def positions(topology: Topology) -> list[tuple[float, int]]:
    """Return abscissa and level of each body, ground (level 0) last: leaves in a row, parents above their middle."""
    ground = len(topology.bodies)
    children: list[list[int]] = [[] for _ in range(ground + 1)]
    level = [0] * (ground + 1)
    for branch in topology.branches:
        children[branch.parent].append(branch.body)
        level[branch.body] = level[branch.parent] + 1
    abscissa = [0.0] * (ground + 1)
    next_column = 0
    stack = [ground]
    while stack:  # leaves in depth-first order
        body = stack.pop()
        stack += reversed(children[body])
        if not children[body]:
            abscissa[body] = next_column
            next_column += 1
    for body in [*(branch.body for branch in reversed(topology.branches)), ground]:
        below = [abscissa[child] for child in children[body]]
        if below:
            abscissa[body] = 0.5 * (min(below) + max(below))
    return list(zip(abscissa, level, strict=True))


def graph(topology: Topology, parts: Iterable[Part]) -> dict[str, Any]:
    """Return bodies and their connections: nodes [name, x, level, floats], edges [kind, name, words, first, second].

    ``parts``: what the mechanism is made of, for its springs and couplers. Returns ``nodes``, ground last, and
    ``edges`` of kind "tree", "cut", "floating", "spring" and "coupler".
    """
    points = positions(topology)
    names = (*topology.bodies, "ground")
    number = {name: i for i, name in enumerate(names)}
    cut, floating = set(topology.cut), set(topology.floating)
    nodes = [[name, x, level, i in floating] for i, (name, (x, level)) in enumerate(zip(names, points, strict=True))]
    edges = [["cut" if k in cut else "tree", joint.name, f"{joint.kind} joint", number[joint.first],
              number[joint.second]] for k, joint in enumerate(topology.joints)]  # fmt: skip
    edges += [["floating", names[branch.body], "free: no joint holds it", branch.parent, branch.body]
              for branch in topology.branches if branch.joint == FLOATS]  # fmt: skip
    elements: list[Any] = list(parts)
    generated = {name for part in elements if part.symbol == "composed" for name in part.generated_names}
    for part in elements:
        if part.symbol in ("spring", "bushing") and part.name not in generated:
            edges.append(["spring", part.name, part.family, number[part.first], number[part.second]])
        elif part.symbol == "coupler":
            coupled_bodies = list(dict.fromkeys(_moved(topology, coordinate) for coordinate, _ in part.terms))
            edges += [["coupler", part.name, part.family, number[a], number[b]]
                      for a, b in pairwise(coupled_bodies)]  # fmt: skip
    return {"nodes": nodes, "edges": edges}


def _moved(topology: Topology, coordinate: str) -> str:
    """The outer body of a coordinate, to which a gear belongs."""
    joint = next(joint for joint in topology.joints if joint.name == coordinate.rpartition(".")[0])
    return joint.first if joint.second == "ground" else joint.second
