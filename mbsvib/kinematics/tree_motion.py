"""Finite motion of bodies along a spanning tree, one joint coordinate after the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array, Index
from mbsvib.elements import Joint
from mbsvib.elements.joint_kinds import Columns, Motion, displaced
from mbsvib.elements.pose import IDENTITY, Pose
from mbsvib.kinematics.relative_motion import Twists, in_order
from mbsvib.linalg.rotations import axial, components_first, components_last, exponential, jacobian
from mbsvib.mechanism.topology import FLOATS, Topology

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
    """The finite motion of a spanning tree.

    Coordinates are summed in groups that begin at ``start`` (g,): one group for each joint of the tree that moves, and
    one more for the second of two successive rotations. Of these joints (j,), ``group`` (j,) is the first group and
    ``body`` (j,) the outer body. The other arrays hold numbers of joints (k,) among these: ``then`` (2, k) of those
    with a second group, and that group; ``back`` of those whose second body is the inner one. ``vectors`` (2, r) are
    the coordinates that are components of rotation vectors, and their groups; ``first`` (r,) the first bodies of their
    joints. ``curved`` are the joints with a motion of their own. Motions are in rows: that of ground, those of bodies
    joined to it, and those of all others ``child``, level by level; ``row`` (bodies + 1,) is that of each body, of
    ground last. ``parent`` are the bodies to which ``child`` are joined; ``levels`` are their slices.
    """

    start: Index
    group: Index
    body: Index
    then: Index
    back: Index
    vectors: Index
    first: Index
    curved: tuple[Curved, ...]
    row: Index
    child: Index
    parent: Index
    levels: tuple[slice, ...]

    def at(self, pose: Pose, coordinates: Twists) -> FiniteMotion:
        """Return the finite motion from a pose, or from many, with the ``coordinates`` there."""
        centre, point = pose.centre, components_last(coordinates.point)
        to_parent = np.zeros((*centre.shape[:-2], len(self.child), 4, 4))
        to_parent[..., :3, 3] = centre.take(self.child, axis=-2) - centre.take(self.parent, axis=-2)
        to_parent[..., DIAGONAL, DIAGONAL] = 1.0
        arm = centre.take(self.body, axis=-2) - point.take(self.start[self.group], axis=-2)
        six = np.concatenate((coordinates.linear, coordinates.angular))
        return FiniteMotion(self, pose, coordinates, six, arm, to_parent)

    @property
    def joints_by_values(self) -> list[Index]:
        """The coordinates of each joint whose values are not the sums of its steps."""
        columns, groups = self.vectors
        vectors = [columns[groups == group] for group in np.unique(groups)]
        return vectors + [own for part in self.curved for own in part.columns.T]


@dataclass(frozen=True, slots=True)
class FiniteMotion:
    """The finite motion of a ``tree`` from a ``pose``, or from many, with the ``coordinates`` there.

    ``six`` (6, ..., n) are these; ``arm`` (..., j, 3) from the joints that move to the centres of the outer bodies [m];
    ``to_parent`` (..., k, 4, 4) shift the motions of bodies to those joined to them: [1, d; 0, 1] with the distance d.
    """

    tree: Tree
    pose: Pose
    coordinates: Twists
    six: Array
    arm: Array
    to_parent: Array

    def moved(self, q: Array) -> Pose:
        """Return the pose, or many, after finite joint motions q (..., n) [m, rad], one after the other along the tree.

        Loops are not closed.
        """
        tree, sums, arm = self.tree, self._sums(q), self.arm
        rotations, shifts = exponential(sums[..., 3:]), sums.take(tree.group, axis=-2)[..., :3]
        turned = rotations.take(tree.group, axis=-3)
        if tree.then.size:
            joints, groups = tree.then
            turned[..., joints, :, :] = turned.take(joints, axis=-3) @ rotations.take(groups, axis=-3)
        for part in tree.curved:
            turned[..., part.which, :, :], shifts[..., part.which, :] = part.moved(self.pose, self.coordinates, q)
        # the second body goes from x to p + shift + rotation (x - p), the first one the other way round
        if len(tree.back):
            arm = np.broadcast_to(arm, shifts.shape).astype(shifts.dtype)
            arm[..., tree.back, :] -= shifts[..., tree.back, :]
            shifts[..., tree.back, :] *= -1.0
            turned[..., tree.back, :, :] = turned[..., tree.back, :, :].swapaxes(-1, -2)
        # a motion is [R - 1, u] with the translation u of the centre of mass, here first that by the body's own joint
        turned -= IDENTITY
        own = np.concatenate((turned, turned @ arm[..., None]), axis=-1)
        own[..., 3] += shifts
        motion = np.zeros((*sums.shape[:-2], len(tree.row), 3, 4), sums.dtype)
        motion[..., tree.row.take(tree.body), :, :] = own
        if tree.levels:
            self._outwards(motion)
        return self.pose.moved_by(motion.take(tree.row, axis=-3))

    def _outwards(self, motion: Array) -> None:
        """Add the motions of inner bodies to those of outer ones, in place, level by level."""
        tree = self.tree
        inner = len(tree.row) - len(tree.child)
        to_parent = np.empty((*motion.shape[:-3], len(tree.child), 4, 4), motion.dtype)
        to_parent[:] = self.to_parent
        to_parent[..., :3, :] += motion[..., inner:, :, :]
        parent = tree.row.take(tree.parent)
        for level in tree.levels:
            rows = slice(inner + level.start, inner + level.stop)
            motion[..., rows, :, :] += motion.take(parent[level], axis=-3) @ to_parent[..., level, :, :]

    def _sums(self, q: Array) -> Array:
        """The sums (..., g, 6) of all groups, translations and rotation vectors."""
        six = self.six
        if six.ndim < q.ndim + 1:
            six = six.reshape(6, *(1,) * (q.ndim - 1), -1)
        return components_last(np.add.reduceat(six * q, self.tree.start, axis=-1))

    def by_values(self, q: Array, pose: Pose, after: Twists) -> Twists:
        """Return the twists ``after``, in a pose, per unit rate of the values q (..., n) of the coordinates.

        They are those of the coordinates there, but for components of a rotation vector w, which turn the second body
        by J(w) dw (``linalg.rotations.jacobian``), and for curved joints.
        """
        linear, angular, tree = after.linear, after.angular, self.tree
        if len(tree.first):
            columns, group = tree.vectors
            w, own = self._sums(q).take(group, axis=-2)[..., 3:], components_last(self.six[3:].take(columns, axis=-1))
            turned = pose.vectors(tree.first, (jacobian(w) @ own[..., None])[..., 0])
            angular = angular.copy()
            angular[..., columns] = components_first(turned)
        for part in tree.curved:
            linear, angular = linear.copy(), angular.copy()
            for rates, array in zip(part.rates(self.pose, self.coordinates, q), (linear, angular), strict=True):
                for own, rate in zip(part.columns, rates, strict=True):
                    array[..., own] = components_first(pose.vectors(part.first, rate))
        return Twists(after.names, linear, angular, after.point, after.path, after.turns, after.pitch)


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
    order = [ground, *(body for body, _ in levels.get(0, ())), *(body for body, _ in pairs)]
    ends = list(accumulate([len(levels[k]) for k in range(1, len(levels))], initial=0))
    column = 0
    for branch in in_order(topology.branches):
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
        np.argsort(order), np.array([body for body, _ in pairs], dtype=np.intp),
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
