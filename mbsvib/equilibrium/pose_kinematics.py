"""Kinematics in any pose: the joint coordinates and loops of a mechanism, and its finite motion along the tree.

What follows from the mechanism as described is prepared once. All six-vectors of a joint turn with its axes, its point
goes with its second body; so a pose takes a few operations on arrays over all joints, whatever their kinds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.rows import Rows
from mbsvib.equations.scene import cut_rows
from mbsvib.equilibrium.joint_rules import in_groups
from mbsvib.equilibrium.pose import IDENTITY, start
from mbsvib.kinematics.characteristic_length import length_of
from mbsvib.kinematics.couplers import with_couplers
from mbsvib.kinematics.relative_motion import Twists, relative_motion, twists
from mbsvib.linalg.rotations import exponential
from mbsvib.mechanism.topology import FLOATS, span

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equilibrium.joint_rules import Joints, Rule
    from mbsvib.equilibrium.pose import Pose
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.mechanism.topology import Topology

ORIGIN = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class PoseKinematics:
    """What the kinematics of a mechanism need in all of its poses; ``size`` [m] is the size of the mechanism.

    ``coordinates`` and ``cuts`` are those of the pose as described. Their six-vectors (s), twists first, then locked
    rows, then what couplers measure, are ``vectors`` (s, 3, 2), each a linear and an angular part, that turn with
    ``turner`` (s,): a body, or behind the bodies a joint of ``own_axes``. They are at ``point`` (s, 3) of body
    ``holder`` (s,). ``own_axes`` are functions of the pose that return axes of joints, with the transpose of what they
    return as described; ``loops`` are the cut joints in groups of one rule.
    """

    topology: Topology
    size: float
    coordinates: Twists
    cuts: Cuts | None
    vectors: Array
    turner: Index
    point: Array
    holder: Index
    own_axes: tuple[tuple[Callable[[Pose], Array], Array], ...]
    loops: tuple[tuple[Rule, Index, Joints], ...]
    tree: Tree

    def at(self, pose: Pose) -> tuple[Twists, Cuts | None]:
        """Return the joint coordinates and the locked rows in a pose."""
        if pose.as_described:
            return self.coordinates, self.cuts
        turn = pose.turn
        if self.own_axes:
            turn = np.concatenate((turn, *(axes(pose) @ inverse for axes, inverse in self.own_axes)))
        linear, angular = np.ascontiguousarray((turn.take(self.turner, axis=0) @ self.vectors).transpose(2, 1, 0))
        point = np.ascontiguousarray(pose.points(self.holder, self.point).T)
        n, cuts = len(self.coordinates.names), self.cuts
        described = self.coordinates
        coordinates = Twists(described.names, linear[:, :n], angular[:, :n], point[:, :n], described.path,
                             described.turns, described.pitch)  # fmt: skip
        if cuts is None:
            return coordinates, None
        end = n + len(cuts.rows.first)
        rows = Rows(cuts.rows.first, cuts.rows.second, point[:, n:end], linear[:, n:end], angular[:, n:end])
        couplings = cuts.couplings
        if couplings is not None:
            measured = replace(couplings.measured, point=point[:, end:], force=linear[:, end:], moment=angular[:, end:])
            couplings = replace(couplings, measured=measured)
        return coordinates, replace(cuts, rows=rows, couplings=couplings)

    @cached_property
    def closure(self) -> Array:
        """What cut joints and couplers lock in the pose as described, (locked rows, n); see ``locked``."""
        return np.zeros((0, len(self.coordinates.names))) if self.cuts is None else locked(self.coordinates, self.cuts)

    def openings(self, pose: Pose, cuts: Cuts) -> Array:
        """Return how far cut joints are open, one value [m, rad] for each of their locked rows in this pose."""
        gap, turn = np.zeros((2, len(self.topology.cut), 3))
        for rule, which, joints in self.loops:
            gap[which] = joints.gap(pose)
            if rule.opening is not None:
                gap[which], turn[which] = rule.opening(joints, pose, gap[which])
        joint, rows = cuts.joint[: len(cuts.rows.first)], cuts.rows
        along = rows.force * gap.take(joint, axis=0).T + rows.moment * turn.take(joint, axis=0).T
        return np.asarray(along.sum(axis=0))


def locked(coordinates: Twists, cuts: Cuts) -> Array:
    """Return what cut joints and couplers lock, relative displacements [m, rad] (locked rows, n)."""
    phi = relative_motion(coordinates, cuts.rows).dense(0, len(cuts.rows.first))
    return phi if cuts.couplings is None else np.concatenate((phi, cuts.couplings.dense(coordinates)))


@dataclass(frozen=True, slots=True)
class Tree:
    """The finite motion of a spanning tree, arrays over bodies having ground last.

    Coordinates are summed up in groups from ``start`` (g,) on, one for each joint of the tree, and one more for the
    second of two successive rotations: ``group`` (j,) is the first of each joint that moves, ``body`` (j,) the body
    behind it, ``then`` (2, k) lists the joints (of these) with a second one and the number of that, ``back`` (k,) those
    whose second body is the one nearer to ground. ``rod`` (k,) and ``length`` (k, 1) list distance joints (of these),
    ``levels`` the bodies and their parents that do not hang on ground, from there outwards.
    """

    start: Index
    group: Index
    body: Index
    then: Index
    back: Index
    rod: Index
    length: Array
    levels: tuple[tuple[Index, Index], ...]

    def moved(self, pose: Pose, coordinates: Twists, q: Array) -> Pose:
        """Return the pose after finite joint motions, one coordinate after the other along the tree.

        Parameters
        ----------
        pose : Pose
            Where the motion starts; loops are not looked at.
        coordinates : Twists
            The joint coordinates there.
        q : array, shape (n,)
            Their values [m, rad].

        Returns
        -------
        Pose
            The pose after it.
        """
        here = pose.centre
        sums = np.add.reduceat(np.concatenate((coordinates.linear, coordinates.angular)) * q, self.start, axis=1).T
        rotations, shifts = exponential(sums[:, 3:]), sums.take(self.group, axis=0)[:, :3]
        own = rotations.take(self.group, axis=0)
        if self.then.size:
            own[self.then[0]] = own[self.then[0]] @ rotations[self.then[1]]
        if len(self.rod):
            shifts[self.rod] = self._swing(pose, coordinates, shifts[self.rod])
        # the second body goes from x to p + shift + rotation (x - p), the first one the other way round
        arm = here.take(self.body, axis=0) - coordinates.point.take(self.start[self.group], axis=1).T
        if len(self.back):
            arm[self.back] -= shifts[self.back]
            shifts[self.back] *= -1.0
            own[self.back] = own[self.back].swapaxes(-1, -2)
        centre, turn = here.copy(), np.empty((len(here), 3, 3))
        centre[self.body] += shifts + ((own - IDENTITY) @ arm[..., None])[..., 0]
        turn[:] = IDENTITY
        turn[self.body] = own
        for body, parent in self.levels:
            # with the parent: x goes on by how far it went, and by its rotation less 1 times the arm
            hung, before, there = turn.take(parent, axis=0), here.take(parent, axis=0), centre.take(body, axis=0)
            turn[body] = hung @ turn.take(body, axis=0)
            went = centre.take(parent, axis=0) - before
            centre[body] = there + went + ((hung - IDENTITY) @ (there - before)[..., None])[..., 0]
        return pose.moved_to(centre, turn)

    def _swing(self, pose: Pose, coordinates: Twists, across: Array) -> Array:
        """How far the ends of rods go on their spheres: as far along an arc as their coordinates across say."""
        first = self.start[self.group[self.rod]]
        x, y = coordinates.linear[:, first], coordinates.linear[:, first + 1]
        line = np.cross(x, y, axis=0).T
        angle = np.sqrt((across * across).sum(axis=1, keepdims=True)) / self.length
        back = 0.5 * self.length * angle**2 * np.sinc(0.5 * angle / np.pi) ** 2
        return np.asarray(np.sinc(angle / np.pi) * across - back * line)


def pose_kinematics(model: Mechanism, cut: Sequence[str] = ()) -> PoseKinematics:
    """Return what the kinematics of a mechanism need in all of its poses.

    Parameters
    ----------
    model : Mechanism
        The mechanism as described.
    cut : sequence of str
        Joints at which loops are to be cut.

    Returns
    -------
    PoseKinematics
        Tree, coordinates and loops.
    """
    return _prepared(model, cut) if cut else model.derived(_prepared)


def _prepared(model: Mechanism, cut: Sequence[str] = ()) -> PoseKinematics:
    topology, bodies, pose = span(model, cut), list(model.bodies.values()), start(model)
    number = dict(pose.number)
    coordinates, cuts = twists(topology, bodies), cut_rows(topology, bodies, number)
    if model.couplers:
        cuts = with_couplers(cuts, tuple(model.couplers.values()), topology, bodies, number, coordinates)
    turner, holder = _carriers(topology, number)
    own_axes: list[tuple[Callable[[Pose], Array], Array]] = []
    behind = len(number)
    for rule, which, joints in in_groups(topology.joints, number, pose.origin):
        if rule.axes is not None:
            axes = partial(rule.axes, joints)
            own_axes.append((axes, axes(pose).swapaxes(-1, -2)))
            turner[which] = np.arange(behind, behind + len(which))
            behind += len(which)
    owner = _owners(topology, cuts, model)
    loops = in_groups([topology.joints[k] for k in topology.cut], number, pose.origin)
    parts = [(coordinates.linear, coordinates.angular, coordinates.point)]
    if cuts is not None:
        rows = [cuts.rows] if cuts.couplings is None else [cuts.rows, cuts.couplings.measured]
        parts += [(part.force, part.moment, part.point) for part in rows]
    linear, angular, point = (np.concatenate([part[i] for part in parts], axis=1).T for i in range(3))
    return PoseKinematics(
        topology, size_of(model), coordinates, cuts, np.stack((linear, angular), axis=-1), turner[owner], point,
        holder[owner], tuple(own_axes), tuple(loops), _tree(topology),
    )  # fmt: skip


def _carriers(topology: Topology, number: Mapping[str, int]) -> tuple[Index, Index]:
    """The bodies with which the axes and the points of all joints go, and behind them of all floating bodies."""
    ground = len(topology.bodies)
    turner = [number[joint.first] for joint in topology.joints] + [ground] * len(topology.floating)
    # where a joint has no point, the centre of mass of one of its bodies is taken
    holder = [number[joint.second] if joint.point is not None else min(number[joint.first], number[joint.second])
              for joint in topology.joints]  # fmt: skip
    for branch in topology.branches:
        if branch.joint != FLOATS and topology.joints[branch.joint].point is None:
            holder[branch.joint] = branch.body
    return np.array(turner, dtype=np.intp), np.array(holder + list(topology.floating), dtype=np.intp)


def _owners(topology: Topology, cuts: Cuts | None, model: Mechanism) -> Index:
    """The joints of all six-vectors (s,), floating bodies counting as joints behind all others."""
    joints = topology.joints
    owner = [k for k in sorted({branch.joint for branch in topology.branches} - {FLOATS}) for _ in joints[k].freedom]
    owner += [len(joints) + k for k in range(len(topology.floating)) for _ in range(6)]
    owner += [k for k in topology.cut for _ in joints[k].locked]
    if cuts is not None and cuts.couplings is not None:
        place = {joint.name: k for k, joint in enumerate(joints)}
        names = [name.rpartition(".")[0] for part in model.couplers.values() for name, _ in part.terms]
        owner += [place[name] for name, column in zip(names, cuts.couplings.column.tolist(), strict=True) if column < 0]
    return np.array(owner, dtype=np.intp)


def _tree(topology: Topology) -> Tree:
    joints, ground = topology.joints, len(topology.bodies)
    start: list[int] = []
    group: list[int] = []
    body: list[int] = []
    then: list[tuple[int, int]] = []
    rods: list[tuple[int, float]] = []
    back: list[int] = []
    levels: dict[int, list[tuple[int, int]]] = {}
    depth = {ground: -1}
    for branch in topology.branches:
        depth[branch.body] = depth[branch.parent] + 1
        levels.setdefault(depth[branch.body], []).append((branch.body, branch.parent))
    column = 0
    floats = [branch for branch in topology.branches if branch.joint == FLOATS]
    for branch in sorted(topology.branches, key=lambda branch: branch.joint)[len(floats) :] + floats:
        joint = None if branch.joint == FLOATS else joints[branch.joint]
        count = 6 if joint is None else len(joint.freedom)
        if not count:
            continue
        back += [len(group)] if branch.sign < 0 else []
        group.append(len(start))
        body.append(branch.body)
        start.append(column)
        if joint is not None and joint.successive:
            then.append((len(group) - 1, len(start)))
            start.append(column + count - 1)
        if joint is not None and joint.kind == "distance":
            rods.append((len(group) - 1, math.dist(joint.position or ORIGIN, joint.end or ORIGIN)))
        column += count
    return Tree(
        np.array(start, dtype=np.intp), np.array(group, dtype=np.intp), np.array(body, dtype=np.intp),
        np.array(then, dtype=np.intp).reshape(-1, 2).T, np.array(back, dtype=np.intp),
        np.array([k for k, _ in rods], dtype=np.intp), np.array([[length] for _, length in rods]),
        tuple([(bodies, parents) for bodies, parents in (np.array(levels[k], dtype=np.intp).T
                                                         for k in range(1, len(levels)))]),
    )  # fmt: skip


def size_of(model: Mechanism) -> float:
    """Return the size [m] of a mechanism as described: the root mean square distance from their mean of the centres of
    mass, the points of joints and bushings, and the ends of springs; 1 m if all are one point.
    """
    points = [body.position for body in model.bodies.values()]
    points += [joint.point for joint in model.joints.values() if joint.point is not None]
    for spring in model.springs.values():
        points += spring.points
    return length_of(np.array(points).reshape(-1, 3))
