"""Finite motion of bodies along a spanning tree, one joint coordinate after the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.elements.joint_kinds import Columns, displaced
from mbsvib.kinematics.pose import IDENTITY
from mbsvib.linalg.rotations import axial, components_first, components_last, exponential, jacobian
from mbsvib.mechanism.topology import FLOATS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Joint
    from mbsvib.elements.joint_kinds import Motion
    from mbsvib.kinematics.pose import Pose
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.topology import Topology

ORIGIN = (0.0, 0.0, 0.0)
DIAGONAL = np.arange(4)
# Imaginary steps are this small: their squares are far below rounding.
STEP = 2.0**-100


@dataclass(frozen=True, slots=True)
class Curved:
    """Joints (k,) of a tree, all of one form, that move by a function of their own.

    ``motion`` is theirs, ``names`` those of their coordinates in the ``columns`` (f, k). They are ``which`` (k,) of the
    joints that move; their points on the ``first`` bodies (k,) are at ``start`` (k, 3) as described [m].
    """

    motion: Motion
    names: tuple[str, ...]
    columns: Index
    which: Index
    first: Index
    start: Array

    def moved(self, pose: Pose, coordinates: Twists, q: Array) -> tuple[Array, Array]:
        """Return the rotations (..., k, 3, 3) and shifts (..., k, 3) by coordinates (..., n) from a pose."""
        at = np.concatenate((coordinates.linear, coordinates.angular))[..., self.columns]  # (6, ..., f, k)
        point = coordinates.point[..., self.columns[0]]
        start = components_first(pose.points(self.first, self.start))
        free = tuple([(name, tuple(at[..., i, :])) for i, name in enumerate(self.names)])
        j = Columns(free, (), tuple(point), tuple(start))
        x = self.motion.displacement([q[..., own] for own in self.columns], j)
        lead = q[..., self.columns[0]].shape
        rotation = [np.broadcast_to(entry, lead) for row in x.rotation for entry in row]
        shift = [np.broadcast_to(entry, lead) for entry in x.shift]
        return np.stack(rotation, axis=-1).reshape(*lead, 3, 3), np.stack(shift, axis=-1)

    def rates(self, pose: Pose, coordinates: Twists, q: Array) -> tuple[Array, Array]:
        """Return velocities and angular velocities (f, ..., k, 3) of the points per unit rate of each coordinate."""
        steps = np.repeat(q[None].astype(complex), len(self.columns), axis=0)
        for i, own in enumerate(self.columns):
            steps[i][..., own] += 1j * STEP
        rotation, shift = self.moved(pose, coordinates, steps)
        return shift.imag / STEP, axial(rotation.imag @ rotation.real.swapaxes(-1, -2)) / STEP


@dataclass(frozen=True, slots=True)
class Tree:
    """The finite motion of a spanning tree; arrays over bodies have ground last.

    Coordinates are summed in groups that begin at ``start`` (g,): one group for each joint of the tree that moves, and
    one more for the second of two successive rotations. Of these joints (j,), ``group`` (j,) is the first group and
    ``body`` (j,) the outer body. The other arrays hold numbers of joints (k,) among these: ``then`` (2, k) of those
    with a second group, and that group; ``back`` of those whose second body is the inner one. ``vectors`` (2, r) are
    the coordinates that are components of rotation vectors, and their groups; ``first`` (r,) the first bodies of their
    joints. ``curved`` are the joints with a motion of their own. ``child`` are the bodies that are not joined to
    ground, and ``parent`` the bodies that they are joined to; ``levels`` are the slices of both for one level of the
    tree each, from ground on.
    """

    start: Index
    group: Index
    body: Index
    then: Index
    back: Index
    vectors: Index
    first: Index
    curved: tuple[Curved, ...]
    child: Index
    parent: Index
    levels: tuple[slice, ...]

    @property
    def joints_by_values(self) -> list[Index]:
        """The coordinates of each joint whose values are not the sums of its steps."""
        columns, groups = self.vectors
        vectors = [columns[groups == group] for group in np.unique(groups)]
        return vectors + [own for part in self.curved for own in part.columns.T]

    def moved(self, pose: Pose, coordinates: Twists, q: Array) -> Pose:
        """Return the pose, or many, after finite joint motions, one coordinate after the other along the tree.

        Loops are not closed. ``coordinates`` are those in the ``pose`` before, ``q`` (..., n) their values [m, rad].
        """
        sums = self._sums(coordinates, q)
        rotations, shifts = exponential(sums[..., 3:]), sums.take(self.group, axis=-2)[..., :3]
        turned = rotations.take(self.group, axis=-3)
        if self.then.size:
            turned[..., self.then[0], :, :] = turned[..., self.then[0], :, :] @ rotations[..., self.then[1], :, :]
        for part in self.curved:
            turned[..., part.which, :, :], shifts[..., part.which, :] = part.moved(pose, coordinates, q)
        # the second body goes from x to p + shift + rotation (x - p), the first one the other way round
        centres, points = pose.centre, components_last(coordinates.point)
        arm = centres.take(self.body, axis=-2) - points.take(self.start[self.group], axis=-2)
        if len(self.back):
            arm = np.broadcast_to(arm, shifts.shape).astype(shifts.dtype)
            arm[..., self.back, :] -= shifts[..., self.back, :]
            shifts[..., self.back, :] *= -1.0
            turned[..., self.back, :, :] = turned[..., self.back, :, :].swapaxes(-1, -2)
        # a motion is [R - 1, u] with the translation u of the centre of mass, here first that by the body's own joint
        lead = sums.shape[:-2]
        motion = np.zeros((*lead, centres.shape[-2], 3, 4), sums.dtype)
        motion[..., self.body, :, :3] = turning = turned - IDENTITY
        motion[..., 3][..., self.body, :] = shifts + (turning @ arm[..., None])[..., 0]
        to_parent = np.zeros((*lead, len(self.child), 4, 4), sums.dtype)
        to_parent[..., :3, :] = motion.take(self.child, axis=-3)
        to_parent[..., :3, 3] += centres.take(self.child, axis=-2) - centres.take(self.parent, axis=-2)
        to_parent[..., DIAGONAL, DIAGONAL] += 1.0
        for level in self.levels:
            inner = motion.take(self.parent[level], axis=-3)
            motion[..., self.child[level], :, :] += inner @ to_parent[..., level, :, :]
        return pose.moved_by(motion)

    def _sums(self, coordinates: Twists, q: Array) -> Array:
        """The sums (..., g, 6) of all groups, translations and rotation vectors."""
        six = np.concatenate((coordinates.linear, coordinates.angular))
        if six.ndim < q.ndim + 1:
            six = six.reshape(6, *(1,) * (q.ndim - 1), -1)
        return components_last(np.add.reduceat(six * q, self.start, axis=-1))

    def by_values(self, described: Pose, before: Twists, q: Array, pose: Pose, after: Twists) -> Twists:
        """Return the twists ``after``, in a pose, per unit rate of the values q (..., n) of the coordinates.

        They are those of the coordinates there, but for components of a rotation vector w, which turn the second body
        by (1 + B [w]x + C [w]x^2) dw, B = (1 - cos a) / a^2, C = (a - sin a) / a^3, and for curved joints.
        ``before``: the twists in the pose ``described``, from which q counts.
        """
        linear, angular = after.linear, after.angular
        if len(self.first):
            columns, group = self.vectors
            w, own = self._sums(before, q)[..., group, 3:], before.angular[..., columns].T
            turned = pose.vectors(self.first, (jacobian(w) @ own[..., None])[..., 0])
            angular = angular.copy()
            angular[..., columns] = components_first(turned)
        for part in self.curved:
            linear, angular = linear.copy(), angular.copy()
            for rates, array in zip(part.rates(described, before, q), (linear, angular), strict=True):
                for own, rate in zip(part.columns, rates, strict=True):
                    array[..., own] = components_first(pose.vectors(part.first, rate))
        return replace(after, linear=linear, angular=angular)


def tree_of(topology: Topology, number: Mapping[str, int]) -> Tree:
    """Return the arrays for the finite motion of a spanning tree; ``number`` is that of each body, ground last."""
    joints, ground = topology.joints, len(topology.bodies)
    start: list[int] = []
    group: list[int] = []
    body: list[int] = []
    then: list[tuple[int, int]] = []
    back: list[int] = []
    vectors: list[tuple[int, int, int]] = []
    curved: dict[Any, list[tuple[int, int, Joint]]] = {}
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
        names = DIRECTIONS if joint is None else [name for name, _ in joint.freedom]
        if not names:
            continue
        back += [len(group)] if branch.sign < 0 else []
        group.append(len(start))
        body.append(branch.body)
        start.append(column)
        if joint is not None and joint.successive:
            then.append((len(group) - 1, len(start)))
            start.append(column + len(names) - 1)
        if joint is not None and joint.motion.displacement is not displaced:
            curved.setdefault((joint.motion, tuple(names)), []).append((len(group) - 1, column, joint))
        elif joint is None or joint.turns_by_vector:
            first = ground if joint is None else number[joint.first]
            vectors += [(column + i, group[-1], first) for i, name in enumerate(names) if name[0] == "r"]
        column += len(names)
    columns, groups, first_bodies = np.array(vectors, dtype=np.intp).reshape(-1, 3).T
    return Tree(
        np.array(start, dtype=np.intp), np.array(group, dtype=np.intp), np.array(body, dtype=np.intp),
        np.array(then, dtype=np.intp).reshape(-1, 2).T, np.array(back, dtype=np.intp), np.array((columns, groups)),
        first_bodies, tuple([_curved(motion, names, members, number) for (motion, names), members in curved.items()]),
        np.array([body for body, _ in pairs], dtype=np.intp),
        np.array([parent for _, parent in pairs], dtype=np.intp), tuple(map(slice, ends[:-1], ends[1:])),
    )  # fmt: skip


def _curved(
    motion: Motion, names: tuple[str, ...], members: list[tuple[int, int, Joint]], number: Mapping[str, int]
) -> Curved:
    which, begin = (np.array([member[i] for member in members], dtype=np.intp) for i in (0, 1))
    joints = [joint for _, _, joint in members]
    return Curved(motion, names, begin + np.arange(len(names))[:, None], which,
                  np.array([number[joint.first] for joint in joints], dtype=np.intp),
                  np.array([joint.position or joint.point or ORIGIN for joint in joints]))  # fmt: skip
