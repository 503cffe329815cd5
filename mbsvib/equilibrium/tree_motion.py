"""Finite motion of bodies along a spanning tree, one joint coordinate after the other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equilibrium.pose import IDENTITY
from mbsvib.linalg.rotations import exponential
from mbsvib.mechanism.topology import FLOATS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.equilibrium.pose import Pose
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.topology import Topology

ORIGIN = (0.0, 0.0, 0.0)
DIAGONAL = np.arange(4)


@dataclass(frozen=True, slots=True)
class Tree:
    """The finite motion of a spanning tree; arrays over bodies have ground last.

    Coordinates are summed in groups that begin at ``start`` (g,): one group for each joint of the tree that moves, and
    one more for the second of two successive rotations. Of these joints (j,), ``group`` (j,) is the first group and
    ``body`` (j,) the outer body. The other arrays hold numbers of joints (k,) among these: ``then`` (2, k) of those
    with a second group, and that group; ``back`` of those whose second body is the inner one; ``rod`` of distance
    joints, with their ``length`` (k, 1). ``child`` are the bodies that are not joined to ground, and ``parent`` the
    bodies that they are joined to; ``levels`` are the slices of both for one level of the tree each, from ground on.
    """

    start: Index
    group: Index
    body: Index
    then: Index
    back: Index
    rod: Index
    length: Array
    child: Index
    parent: Index
    levels: tuple[slice, ...]

    def moved(self, pose: Pose, coordinates: Twists, q: Array) -> Pose:
        """Return the pose after finite joint motions, one coordinate after the other along the tree.

        Parameters
        ----------
        pose : Pose
            The pose before the motion; loops are not closed.
        coordinates : Twists
            The joint coordinates there.
        q : array, shape (n,)
            Their values [m, rad].

        Returns
        -------
        Pose
            The pose after it.
        """
        sums = np.add.reduceat(np.concatenate((coordinates.linear, coordinates.angular)) * q, self.start, axis=1).T
        rotations, shifts = exponential(sums[:, 3:]), sums.take(self.group, axis=0)[:, :3]
        turned = rotations.take(self.group, axis=0)
        if self.then.size:
            turned[self.then[0]] = turned[self.then[0]] @ rotations[self.then[1]]
        if len(self.rod):
            shifts[self.rod] = self._swing(pose, coordinates, shifts[self.rod])
        # the second body goes from x to p + shift + rotation (x - p), the first one the other way round
        centres = pose.centre
        arm = centres.take(self.body, axis=0) - coordinates.point.take(self.start[self.group], axis=1).T
        if len(self.back):
            arm[self.back] -= shifts[self.back]
            shifts[self.back] *= -1.0
            turned[self.back] = turned[self.back].swapaxes(-1, -2)
        # a motion is [R - 1, u] with the translation u of the centre of mass, here first that by the body's own joint
        motion = np.zeros((len(centres), 3, 4))
        motion[self.body, :, :3] = turning = turned - IDENTITY
        motion[self.body, :, 3] = shifts + (turning @ arm[..., None])[..., 0]
        to_parent = np.zeros((len(self.child), 4, 4))
        to_parent[:, :3] = motion.take(self.child, axis=0)
        to_parent[:, :3, 3] += centres.take(self.child, axis=0) - centres.take(self.parent, axis=0)
        to_parent[:, DIAGONAL, DIAGONAL] += 1.0
        for level in self.levels:
            motion[self.child[level]] += motion.take(self.parent[level], axis=0) @ to_parent[level]
        return pose.moved_by(motion)

    def _swing(self, pose: Pose, coordinates: Twists, across: Array) -> Array:
        """Displacements of the ends of rods (k, 3) along arcs whose lengths are the coordinates ``across``."""
        first = self.start[self.group[self.rod]]
        x, y = coordinates.linear[:, first], coordinates.linear[:, first + 1]
        line = np.cross(x, y, axis=0).T
        angle = np.sqrt((across * across).sum(axis=1, keepdims=True)) / self.length
        back = 0.5 * self.length * angle**2 * np.sinc(0.5 * angle / np.pi) ** 2
        return np.asarray(np.sinc(angle / np.pi) * across - back * line)


def tree_of(topology: Topology) -> Tree:
    """Return the arrays for the finite motion of a spanning tree."""
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
    pairs = [pair for k in range(1, len(levels)) for pair in levels[k]]
    ends = list(accumulate([len(levels[k]) for k in range(1, len(levels))], initial=0))
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
        if joint is not None and joint.is_rod:
            rods.append((len(group) - 1, math.dist(joint.position or ORIGIN, joint.end or ORIGIN)))
        column += count
    return Tree(
        np.array(start, dtype=np.intp), np.array(group, dtype=np.intp), np.array(body, dtype=np.intp),
        np.array(then, dtype=np.intp).reshape(-1, 2).T, np.array(back, dtype=np.intp),
        np.array([k for k, _ in rods], dtype=np.intp), np.array([[length] for _, length in rods]),
        np.array([body for body, _ in pairs], dtype=np.intp),
        np.array([parent for _, parent in pairs], dtype=np.intp), tuple(map(slice, ends[:-1], ends[1:])),
    )  # fmt: skip
