"""Topology: the spanning tree of a mechanism, the joints that are cut, and the bodies that float.

Bodies are nodes, joints are edges, ground is the root. A joint weighs its degrees of freedom; the shortest paths from
ground form the tree, so that the joints left over are those whose cut leaves the smallest cumulative degree of freedom
on both sides (CDOF; Chaudhary & Saha, Dynamics and Balancing of Multibody Systems, 2009, appendix B).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from heapq import heappop, heappush
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Index
from mbsvib.common.expected import names
from mbsvib.common.fast_init import fast_init
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from mbsvib.elements import Joint
    from mbsvib.mechanism.mechanism import Mechanism

FLOATS = -1  # number of the free joint by which a floating body is connected to ground
# Trees of mechanisms with up to this number of joints are cached: those of larger ones take a small share of the time
# of their equations, and their memory.
REMEMBERED = 200


NONE: frozenset[int] = frozenset()
Edge = tuple[int, int, int]


class Branch(NamedTuple):
    """A body of the tree, its parent, the joint between them, and the sign of the joint along the path from ground."""

    body: int
    parent: int
    joint: int
    sign: int


Tree = tuple[tuple[Branch, ...], tuple[int, ...], tuple[int, ...]]  # branches, cut joints, floating bodies


@fast_init
@dataclass(frozen=True, slots=True)
class Topology:
    """A spanning tree in numbers: bodies and joints are numbered in the model's order, ground is ``len(bodies)``.

    ``branches`` have parents before children; ``cut`` are the joints outside the tree, ``floating`` the bodies that an
    additional free joint connects to ground.
    """

    bodies: tuple[str, ...]
    joints: tuple[Joint, ...]
    branches: tuple[Branch, ...]
    cut: tuple[int, ...]
    floating: tuple[int, ...]

    @property
    def body_numbers(self) -> dict[str, int]:
        """Number of each body by name; the ground comes last."""
        return {name: i for i, name in enumerate((*self.bodies, "ground"))}

    @property
    def tree(self) -> tuple[str, ...]:
        """Names of the joints of the tree, from ground outwards."""
        return tuple(self.joints[branch.joint].name for branch in self.branches if branch.joint != FLOATS)

    @property
    def branch_of(self) -> dict[int, Branch]:
        """Branch of each joint of the tree, by the joint's number."""
        return {branch.joint: branch for branch in self.branches if branch.joint != FLOATS}

    @property
    def outer(self) -> tuple[Index, Index]:
        """Body behind each joint and the joint's sign, (joints,) each; -1 and 0 for joints that are cut."""
        body, sign = np.full(len(self.joints), -1), np.zeros(len(self.joints), dtype=np.intp)
        for joint, branch in self.branch_of.items():
            body[joint], sign[joint] = branch.body, branch.sign
        return body, sign

    @property
    def cut_joints(self) -> tuple[str, ...]:
        """Names of the joints that are cut."""
        return tuple(self.joints[k].name for k in self.cut)

    @property
    def cumulative(self) -> dict[str, int]:
        """Cumulative degree of freedom (CDOF) of ground and every body: that of all joints on its path from ground."""
        names = (*self.bodies, "ground")
        result = {"ground": 0}
        for branch in self.branches:
            freedom = 6 if branch.joint == FLOATS else len(self.joints[branch.joint].freedom)
            result[names[branch.body]] = result[names[branch.parent]] + freedom
        return result


def span(model: Mechanism, cut: Sequence[str] | None = None) -> Topology:
    """Return the spanning tree of smallest cumulative degree of freedom.

    ``cut``: names of joints that must not be in the tree.

    Raises ModelError if wheels roll: equations without their contacts would be wrong.

    Source: Chaudhary & Saha (2009), appendix B.
    """
    if model.rolling:
        wheel = next(iter(model.rolling))
        raise ModelError(f"model '{model.name}' has rolling wheels ('{wheel}'), which only model.linearize() takes, "
                         f"dense and one variant at a time; its result has modes, responses, loops and exports. "
                         f"Preloads of suspensions are found by model.equilibrium(preload=...). "
                         f"Vary parameters by model.with_values({{...}}).linearize().", element=wheel)  # fmt: skip
    excluded = () if cut is None else _excluded(cut, model)
    return model.derived(_spanned, excluded)


def cut_elsewhere(model: Mechanism, requested: Iterable[str]) -> tuple[tuple[str, ...], str | None]:
    """Return joints to cut so that some joints are part of the tree.

    ``requested``: names of the joints that are to be part of it. Returns names of joints to cut, and a wanted
    joint or None that closes a loop of wanted joints only, which no cut brings into the tree.
    """
    keep = set(requested)
    cut: list[str] = []
    for _ in range(len(model.joints)):
        topology = span(model, cut)
        missing = [topology.joints[k] for k in topology.cut if topology.joints[k].name in keep]
        if not missing:
            break
        other = [name for name in _loop(topology, missing[0]) if name not in keep]
        if not other:
            return tuple(cut), missing[0].name
        cut.append(max(other, key=lambda name: len(model.joints[name].freedom)))
    return tuple(cut), None


def _loop(topology: Topology, joint: Joint) -> list[str]:
    """Names of the joints of the tree that a cut joint closes a loop with."""
    up = {topology.bodies[branch.body]: branch for branch in topology.branches}
    sides: list[list[str]] = []
    for end in (joint.first, joint.second):
        body, path = end, []
        while body in up:
            branch = up[body]
            if branch.joint != FLOATS:
                path.append(topology.joints[branch.joint].name)
            body = topology.bodies[branch.parent] if branch.parent < len(topology.bodies) else "ground"
        sides.append(path)
    return [name for name in (*sides[0], *sides[1]) if (name in sides[0]) != (name in sides[1])]


def _spanned(model: Mechanism, excluded: tuple[str, ...]) -> Topology:
    """The tree without some joints."""
    if not model.bodies:
        raise ModelError(f"model '{model.name}' has no body; add one with add_body.", element=model.name)
    bodies, joints = tuple(model.bodies), tuple(model.joints.values())
    number = {name: i for i, name in enumerate(bodies)}
    number["ground"] = len(bodies)
    edges = [(len(joint.freedom), number[joint.first], number[joint.second]) for joint in joints]
    tree = _tree if len(joints) <= REMEMBERED else _tree.__wrapped__
    omitted = frozenset([k for k, joint in enumerate(joints) if joint.name in excluded]) if excluded else NONE
    branches, cut, floating = tree(len(bodies), tuple(edges), omitted)
    if excluded:
        _check_nothing_hangs(model, bodies, tree(len(bodies), tuple(edges))[2], floating, sorted(excluded))
    return Topology(bodies, joints, branches, cut, floating)


@lru_cache
def _tree(ground: int, joints: tuple[Edge, ...], omitted: frozenset[int] = NONE) -> Tree:
    """The tree of joints (weight, first body, second body) without the ``omitted`` ones, by Dijkstra's algorithm from
    ground; in each component without ground the first body is floating.

    It depends on nothing but these numbers and is cached, for mechanisms that are built again with other values.
    """
    edges: list[list[tuple[int, int, int, int]]] = [[] for _ in range(ground + 1)]
    for k, (weight, a, b) in enumerate(joints):
        if k not in omitted:
            edges[a].append((weight, k, b, 1))
            edges[b].append((weight, k, a, -1))
    branches: list[Branch] = []
    floating: list[int] = []
    reached = [False] * (ground + 1)
    reached[ground] = True
    # among equal CDOF the path of fewer joints is taken, then the joint that was added first
    heap = [(weight, 1, joint, body, ground, sign) for weight, joint, body, sign in edges[ground]]
    heap.sort()
    start = 0
    while True:
        while heap:
            cost, hops, joint, body, parent, sign = heappop(heap)
            if reached[body]:
                continue
            reached[body] = True
            branches.append(Branch(body, parent, joint, sign))
            for weight, k, neighbour, direction in edges[body]:
                if not reached[neighbour]:
                    heappush(heap, (cost + weight, hops + 1, k, neighbour, body, direction))
        while start < ground and reached[start]:
            start += 1
        if start == ground:
            used = {branch.joint for branch in branches}
            return tuple(branches), tuple([k for k in range(len(joints)) if k not in used]), tuple(floating)
        floating.append(start)
        heap = [(6, 1, FLOATS, start, ground, 1)]


def _excluded(cut: str | Sequence[str], model: Mechanism) -> tuple[str, ...]:
    requested = names(cut, "linearize", "cut", ModelError)
    for name in requested:
        check.known(name, model.joints, f"cut = {name!r} is not a joint of model '{model.name}'", "cut")
    return tuple(requested)


def _check_nothing_hangs(
    model: Mechanism, bodies: tuple[str, ...], floating_before: tuple[int, ...], floating: tuple[int, ...],
    cut: list[str],
) -> None:  # fmt: skip
    """Refuse a cut that opens more than loops, so that it disconnects bodies."""
    hanging = [bodies[i] for i in floating if i not in floating_before]
    if hanging:
        raise ModelError(
            f"cut = {cut}: disconnects part of model '{model.name}' from all other bodies, from body '{hanging[0]}' "
            f"on; cut one joint of each loop, and none outside loops.",
            element=cut[0], field="cut",
        )  # fmt: skip
