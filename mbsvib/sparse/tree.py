"""The spanning tree: a choice with short loops, and its arrays: parents, joint coordinates as twists of their outer
bodies, directions of motion.

All arrays are proportional to the number of bodies: the dense path stores a matrix (bodies, coordinates) of paths, the
sparse one only the parent of each body.

Small mechanisms are cut by shortest paths from ground. In a ladder these make each rail a branch, and every rung closes
a loop through ground: rows as long as the mechanism, which are nearly dependent. Sparse equations need no minimal
coordinates, so any tree is possible. If many loops are long, this one is tried: bodies are joined to their neighbours
in stars, the stars to neighbouring stars, and so on. Then most loops close within a star.

Source: Alon, Karp, Peleg & West, SIAM J. Comput. 24 (1995), trees of low average stretch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.elements import Body
from mbsvib.kinematics.relative_motion import in_order, largest_pitch, twists_of_branches
from mbsvib.linalg.rotations import crossed_product
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import Topology, span


@dataclass(frozen=True, slots=True)
class Tree:
    """Bodies and joint coordinates of a spanning tree.

    Over bodies: ``position`` (n, 3) [m], ``parent`` (n,) (ground is n), ``depth`` (n + 1,), ``first`` and ``count``
    (n,) of the coordinates of the joint to the parent, ``moves`` (n, 6) the world directions in which it can move.
    ``outward`` (n,) lists bodies, parents before children.

    Over coordinates: ``names``, ``coordinate_body`` (m,) the outer body of the joint, ``linear``, ``angular`` and
    ``point`` (3, m) the twist in the joint, ``sign`` (m,) -1 if the outer body is the joint's first, ``motion`` (m, 6)
    the outer body's displacement per unit, ``turns`` (m,) whether it is a rotation. ``pitch`` [m] is the largest of all
    screws, cut ones included.
    """

    position: Array
    parent: Index
    depth: Index
    first: Index
    count: Index
    moves: Bools
    outward: Index
    names: tuple[str, ...]
    coordinate_body: Index
    linear: Array
    angular: Array
    point: Array
    sign: Array
    motion: Array
    turns: Bools
    pitch: float = 0.0

    @property
    def length(self) -> float:
        """Typical length of the links [m], a power of two."""
        has_parent = self.parent < len(self.parent)
        arm = np.abs(self.position[has_parent] - self.position[self.parent[has_parent]]).max(axis=1, initial=0.0)
        arm = arm[arm > 0.0]
        return float(2.0 ** np.round(np.log2(np.median(arm)))) if len(arm) else 1.0


def tree(topology: Topology, bodies: list[Body]) -> Tree:
    """Return the tree's arrays, coordinates as in the dense path: by joint as added, those of floating bodies last."""
    n, order = len(bodies), in_order(topology.branches)
    names, entries, turns, counts = twists_of_branches(topology, bodies, order)
    linear, angular, points = entries.reshape(3, 3, -1)
    body, parent_of, sign_of = (np.array(array, dtype=np.intp) for array in zip(
        *[(branch.body, branch.parent, branch.sign) for branch in order], strict=True))  # fmt: skip
    parent, first, count = (np.zeros(n, dtype=np.intp) for _ in range(3))
    parent[body], count[body], first[body] = parent_of, counts, np.cumsum(counts) - counts
    body_of, sign = body.repeat(counts), sign_of.repeat(counts).astype(float)
    position = np.array([body.position for body in bodies])
    arm = position[body_of].T - points
    motion = np.concatenate((linear + crossed_product(angular, arm), angular)) * sign
    outward = np.array([b.body for b in topology.branches], dtype=np.intp)
    depth, moves = _directions(outward, parent, position, body_of, motion)
    return Tree(position, parent, depth, first, count, moves, outward, names, body_of, linear, angular, points, sign,
                np.ascontiguousarray(motion.T), turns, largest_pitch(topology.joints))  # fmt: skip


def _directions(outward: Index, parent: Index, position: Array, body_of: Index, motion: Array) -> tuple[Index, Bools]:
    """Depth of the bodies, and the world directions in which joints let them move, with the exact zeros of B'."""
    n = len(parent)
    in_joint = np.zeros((n, 6), dtype=bool)
    np.logical_or.at(in_joint, body_of, (motion != 0.0).T)
    bits = (in_joint @ (1 << np.arange(6))).tolist()
    ground = parent == n
    arm = position - np.concatenate((position, np.zeros((1, 3))))[parent]
    arms = np.where(ground, 0, (arm != 0.0) @ (1 << np.arange(3))).tolist()
    # translations caused by rotations about one set of axes with an arm along another set
    others = [(k, (k + 1) % 3, (k + 2) % 3) for k in range(3)]
    swept = [[sum(1 << k for k, i, j in others if (t >> i & a >> j | t >> j & a >> i) & 1) for a in range(8)]
             for t in range(8)]  # fmt: skip
    depth, reach, above = [0] * (n + 1), [0] * (n + 1), parent.tolist()
    depth[n] = -1
    for body in outward.tolist():
        p = above[body]
        depth[body] = depth[p] + 1
        reach[body] = reach[p] | bits[body] | swept[reach[p] >> 3][arms[body]]
    return np.array(depth, dtype=np.intp), (np.array(reach[:n], dtype=np.intp)[:, None] >> np.arange(6) & 1) == 1


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
