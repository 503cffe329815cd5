"""Kinematics in any pose: the joint coordinates and loops of a mechanism, and its finite motion along the tree.

Arrays that follow from the reference pose are computed once. All six-vectors of a joint turn with its axes, and its
point moves with its second body; a pose therefore takes a few array operations over all joints of all kinds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.rows import Rows
from mbsvib.equations.scene import cut_rows
from mbsvib.equilibrium.joint_rules import in_groups
from mbsvib.equilibrium.pose import start
from mbsvib.equilibrium.tree_motion import tree_of
from mbsvib.kinematics.characteristic_length import length_of
from mbsvib.kinematics.couplers import with_couplers
from mbsvib.kinematics.relative_motion import Twists, relative_motion, twists
from mbsvib.mechanism.topology import FLOATS, span

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equilibrium.joint_rules import Joints, Rule
    from mbsvib.equilibrium.pose import Pose
    from mbsvib.equilibrium.tree_motion import Tree
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.mechanism.topology import Topology


@dataclass(frozen=True)
class PoseKinematics:
    """Kinematic data of a mechanism for all of its poses; ``size`` [m] is the size of the mechanism.

    ``coordinates`` and ``cuts`` are those of the reference pose ``described``. Their six-vectors (s), twists first,
    then locked rows, then the motions that couplers measure, are ``vectors`` (s, 3, 2), a linear and an angular part
    each. They turn with ``turner`` (s,), the number of a body, or beyond the bodies of a joint in ``own_axes``, and are
    at ``point`` (s, 3) of body ``holder`` (s,). ``own_axes`` are functions that return the axes of joints in a pose,
    with the transpose of these axes in the reference pose; ``loops`` are the cut joints in groups of one rule.
    """

    topology: Topology
    size: float
    described: Pose
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
        turn = pose.rotations
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
    def scale(self) -> Array:
        """Units (n,) that make joint coordinates comparable: 1 rad, or the size of the mechanism [m]."""
        return np.where(self.coordinates.turns, 1.0, self.size)

    @cached_property
    def row_scale(self) -> Array:
        """Factors (locked rows,) that make openings comparable: 1 / rad, or 1 / size of the mechanism."""
        return np.zeros(0) if self.cuts is None else self.cuts.row_scale(self.size)

    @cached_property
    def closure(self) -> Array:
        """The constraints of cut joints and couplers in the reference pose (rows, n); see ``locked``."""
        return np.zeros((0, len(self.coordinates.names))) if self.cuts is None else locked(self.coordinates, self.cuts)

    @cached_property
    def described_openings(self) -> Array:
        """The openings of cut joints in the reference pose, which rounded points leave."""
        return np.zeros(0) if self.cuts is None else self._openings(self.described, self.cuts)

    def openings(self, pose: Pose, cuts: Cuts) -> Array:
        """Return the violation of the constraints of cut joints in a pose, one value [m, rad] for each locked row."""
        return self.described_openings if pose.as_described else self._openings(pose, cuts)

    def _openings(self, pose: Pose, cuts: Cuts) -> Array:
        gap, turn = np.zeros((2, len(self.topology.cut), 3))
        for rule, which, joints in self.loops:
            gap[which] = joints.gap(pose)
            if rule.opening is not None:
                gap[which], turn[which] = rule.opening(joints, pose, gap[which])
        joint, rows = cuts.joint[: len(cuts.rows.first)], cuts.rows
        along = rows.force * gap.take(joint, axis=0).T + rows.moment * turn.take(joint, axis=0).T
        return np.asarray(along.sum(axis=0))


def locked(coordinates: Twists, cuts: Cuts) -> Array:
    """Return the relative displacements [m, rad] (locked rows, n) that cut joints and couplers lock."""
    phi = relative_motion(coordinates, cuts.rows).dense(0, len(cuts.rows.first))
    return phi if cuts.couplings is None else np.concatenate((phi, cuts.couplings.dense(coordinates)))


def pose_kinematics(model: Mechanism, cut: Sequence[str] = ()) -> PoseKinematics:
    """Return the kinematic data of a mechanism for all of its poses."""
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
        topology, size_of(model), pose, coordinates, cuts, np.stack((linear, angular), axis=-1), turner[owner], point,
        holder[owner], tuple(own_axes), tuple(loops), tree_of(topology),
    )  # fmt: skip


def _carriers(topology: Topology, number: Mapping[str, int]) -> tuple[Index, Index]:
    """The bodies that carry the axes and the points of all joints, followed by those of all floating bodies."""
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
    """The joints of all six-vectors (s,); floating bodies count as joints after all others."""
    joints = topology.joints
    owner = [k for k in sorted({branch.joint for branch in topology.branches} - {FLOATS}) for _ in joints[k].freedom]
    owner += [len(joints) + k for k in range(len(topology.floating)) for _ in range(6)]
    owner += [k for k in topology.cut for _ in joints[k].locked]
    if cuts is not None and cuts.couplings is not None:
        index_of = {joint.name: k for k, joint in enumerate(joints)}
        names = [name.rpartition(".")[0] for part in model.couplers.values() for name, _ in part.terms]
        owner += [index_of[name] for name, column in zip(names, cuts.couplings.column, strict=True) if column < 0]
    return np.array(owner, dtype=np.intp)


def size_of(model: Mechanism) -> float:
    """Return the size [m] of a mechanism in its reference pose, 1 m if all of its points coincide.

    It is the root mean square distance from their mean of the centres of mass, the points of joints and bushings, and
    the ends of springs.
    """
    points = [body.position for body in model.bodies.values()]
    points += [joint.point for joint in model.joints.values() if joint.point is not None]
    for spring in model.springs.values():
        points += spring.points
    return length_of(np.array(points).reshape(-1, 3))
