"""Cuts: a spanning tree whose loops are short.

Small mechanisms are cut by shortest paths from ground. In a ladder these make each rail a branch, and every rung closes
a loop through ground: rows as long as the mechanism, which are nearly dependent. Sparse equations need no minimal
coordinates, so any tree is possible. If many loops are long, this one is tried: bodies are joined to their neighbours
in stars, the stars to neighbouring stars, and so on. Then most loops close within a star.

Source: Alon, Karp, Peleg & West, SIAM J. Comput. 24 (1995), trees of low average stretch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.mechanism.topology import span

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.mechanism.topology import Topology

# A loop over more joints than this is long; a few long loops are unavoidable, such as a ring.
LONG = 64
FEW = 8


def short_span(model: Mechanism, cut: Sequence[str] | None = None) -> Topology:
    """Return the spanning tree of smallest cumulative degree of freedom, or one with shorter loops.

    Joints that are to be ``cut`` leave no choice of the tree.
    """
    topology = span(model, cut)
    if cut or len(topology.cut) <= FEW:
        return topology
    long_loops = _long_loops(topology)
    if long_loops <= FEW:
        return topology
    star_tree = span(model, [topology.joints[k].name for k in _outside_stars(topology)])
    return star_tree if _long_loops(star_tree) < long_loops else topology


def _long_loops(topology: Topology) -> int:
    """Number of loops over more than LONG joints."""
    n = len(topology.bodies)
    parent, depth = [n] * (n + 1), [0] * (n + 1)
    for branch in topology.branches:
        parent[branch.body], depth[branch.body] = branch.parent, depth[branch.parent] + 1
    number = topology.body_numbers
    cut = [topology.joints[k] for k in topology.cut]
    a, b = (np.array([number[getattr(joint, side)] for joint in cut]) for side in ("first", "second"))
    up, level = np.array(parent), np.array(depth)
    for _ in range(LONG):
        different = a != b
        deeper = level[a] > level[b]
        a, b = np.where(different & deeper, up[a], a), np.where(different & ~deeper, up[b], b)
    return int(np.count_nonzero(a != b))


def _outside_stars(topology: Topology) -> list[int]:
    """Joints that are not in the tree of stars."""
    number = topology.body_numbers
    joints = topology.joints
    # joints with few freedoms first: cutting those with many gives fewer constraints
    order = sorted(range(len(joints)), key=lambda k: len(joints[k].freedom))
    edges = [(k, number[joints[k].first], number[joints[k].second]) for k in order]
    in_tree = [False] * len(joints)
    nodes = len(number)
    while edges:
        neighbours: list[list[tuple[int, int]]] = [[] for _ in range(nodes)]
        for k, a, b in edges:
            neighbours[a].append((k, b))
            neighbours[b].append((k, a))
        star, stars = [-1] * nodes, 0
        for centre in range(nodes):
            if star[centre] >= 0:
                continue
            free = [(k, neighbour) for k, neighbour in neighbours[centre] if star[neighbour] < 0]
            if free or not neighbours[centre]:
                star[centre] = stars
                stars += 1
                for k, neighbour in free:
                    if star[neighbour] < 0:
                        star[neighbour], in_tree[k] = star[centre], True
            else:  # all neighbours are in stars: join that of the first neighbour
                k, neighbour = neighbours[centre][0]
                star[centre], in_tree[k] = star[neighbour], True
        edges = [(k, star[a], star[b]) for k, a, b in edges if star[a] != star[b]]
        nodes = stars
    return [k for k, used in enumerate(in_tree) if not used]
