"""Kinematics in any pose: the joint coordinates and loops of a mechanism, and its finite motion along the tree.

Arrays that follow from the reference pose are computed once. All six-vectors of a joint turn with its axes, and its
point moves with its second body; a pose, or many of them, therefore takes a few array operations over all joints.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from types import MappingProxyType

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.common.fast_init import changed
from mbsvib.elements.pose import Pose
from mbsvib.elements.rows import Rows
from mbsvib.kinematics.couplers import locked
from mbsvib.kinematics.loops import Cuts
from mbsvib.kinematics.pose import Openings, openings_of, stacked, with_own_axes
from mbsvib.kinematics.relative_motion import Twists
from mbsvib.kinematics.tree_motion import FiniteMotion, Tree, tree_of
from mbsvib.linalg.products import concatenated
from mbsvib.linalg.rank import EPS, RANK_FACTOR
from mbsvib.linalg.rotations import components_first, components_last
from mbsvib.mechanism.topology import Topology


@dataclass(frozen=True)
class PoseKinematics:
    """Kinematic data of a mechanism for all of its poses; ``size`` [m] is the size of the mechanism.

    ``coordinates`` and ``cuts`` are those of the reference pose ``described``. Their six-vectors (s), twists first,
    then locked rows, then the motions that couplers measure, are ``vectors`` (s, 3, 2), a linear and an angular part
    each. They turn with ``turner`` (s,), the number of a body, or beyond the bodies of a joint in ``own_axes``, and are
    at ``point`` (s, 3) of body ``holder`` (s,). ``own_axes`` are functions that return the axes of joints in a pose,
    with the transpose of these axes in the reference pose; those of joint k are number ``frame`` (joints,) among bodies
    and these. Vectors and points of variants have leading axes.
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
    frame: Index
    own_axes: tuple[tuple[Callable[[Pose], Array], Array], ...]

    @cached_property
    def tree(self) -> Tree:
        """The finite motion of the tree."""
        return tree_of(self.topology, self.described.number)

    @cached_property
    def motion(self) -> FiniteMotion:
        """The finite motion from the reference pose."""
        return self.tree.at(self.described, self.coordinates)

    @cached_property
    def loops(self) -> tuple[Openings, ...]:
        """The openings of cut joints."""
        cut = [] if self.cuts is None else self.topology.cut
        own = np.zeros(0) if self.cuts is None else self.cuts.joint[: len(self.cuts.rows.first)]
        return openings_of([self.topology.joints[k] for k in cut], [np.flatnonzero(own == i).tolist()
                           for i in range(len(cut))], self.described.number, self.described.origin)  # fmt: skip

    def frames(self, pose: Pose) -> Array:
        """Return the rotations (..., bodies + 1 + joints with own axes, 3, 3) with which directions turn."""
        if not self.own_axes:
            return pose.rotations
        return np.concatenate((pose.rotations, *(axes(pose) @ inverse for axes, inverse in self.own_axes)), axis=-3)

    def at(self, pose: Pose) -> tuple[Twists, Cuts | None]:
        """Return the joint coordinates and the locked rows in a pose, or in many."""
        if pose.as_described:
            return self.coordinates, self.cuts
        turned = self.frames(pose).take(self.turner, axis=-3) @ self.vectors
        linear, angular = np.ascontiguousarray([components_first(turned[..., k]) for k in (0, 1)])
        point = np.ascontiguousarray(components_first(pose.points(self.holder, self.point)))
        n, cuts = len(self.coordinates.names), self.cuts
        described = self.coordinates
        coordinates = Twists(described.names, linear[..., :n], angular[..., :n], point[..., :n], described.path,
                             described.turns, described.pitch)  # fmt: skip
        if cuts is None:
            return coordinates, None
        end = n + len(cuts.rows.first)
        rows = Rows(cuts.rows.first, cuts.rows.second, point[..., n:end], linear[..., n:end], angular[..., n:end])
        couplings = cuts.couplings
        if couplings is not None:
            of = couplings.measured
            measured = Rows(of.first, of.second, point[..., end:], linear[..., end:], angular[..., end:])
            couplings = changed(couplings, measured=measured)
        return coordinates, changed(cuts, rows=rows, couplings=couplings)

    @cached_property
    def scale(self) -> Array:
        """Units (n,) that make joint coordinates comparable: 1 rad, or the size of the mechanism [m]."""
        return np.where(self.coordinates.turns, 1.0, self.size)

    @cached_property
    def row_scale(self) -> Array:
        """Factors (locked rows,) that make openings comparable: 1 / rad, or 1 / size of the mechanism."""
        return np.zeros(0) if self.cuts is None else self.cuts.row_scale(self.size)

    @cached_property
    def closure_scale(self) -> Array:
        """Factors (locked rows, n) that make the derivatives of openings comparable."""
        return self.row_scale[:, None] * self.scale

    @cached_property
    def closure(self) -> Array:
        """The constraints of cut joints and couplers in the reference pose (rows, n); see ``locked``."""
        return np.zeros((0, len(self.coordinates.names))) if self.cuts is None else locked(self.coordinates, self.cuts)

    @cached_property
    def described_openings(self) -> Array:
        """The openings of cut joints in the reference pose, which rounded points leave."""
        return np.zeros(0) if self.cuts is None else self._openings(self.described)

    def openings(self, pose: Pose) -> Array:
        """Return the violation of the constraints of cut joints in a pose, (..., locked rows) [m, rad]."""
        return self.described_openings if pose.as_described else self._openings(pose)

    def _openings(self, pose: Pose) -> Array:
        count = 0 if self.cuts is None else len(self.cuts.rows.first)
        result = np.zeros((*pose.centre.shape[:-2], count), pose.centre.dtype)
        for group in self.loops:
            result[..., group.rows] = np.stack(group.at(pose), axis=-2)
        return result

    def rounding(self, coordinates: Twists) -> Array:
        """Return the opening of loops (...) by the rounding of points relative to the origin, in units of ``size``."""
        points = np.abs(coordinates.point).max(axis=(0, -1), initial=0.0)
        return np.asarray(RANK_FACTOR * EPS * len(coordinates.names) * points / self.size)


def pose_kinematics(
    topology: Topology, pose: Pose, coordinates: Twists, cuts: Cuts | None, size: float,
    axes: Mapping[str, Array] = MappingProxyType({}), lengths: Mapping[str, Array] = MappingProxyType({}),
) -> PoseKinematics:  # fmt: skip
    """Return the kinematic data of a mechanism for all of its poses.

    ``pose``, ``coordinates`` and ``cuts`` are those of its reference pose, ``size`` is that of the mechanism [m].
    ``axes`` (..., 3, 3) and ``lengths`` (...): of joints by name, where variants differ in them.
    """
    number = pose.number
    first, holder = _carriers(topology, number)
    frame, owner = first.copy(), _owners(topology, cuts)
    rows = [] if cuts is None else [cuts.rows] if cuts.couplings is None else [cuts.rows, cuts.couplings.measured]
    parts = [(coordinates.linear, coordinates.angular, coordinates.point),
             *((part.force, part.moment, part.point) for part in rows)]
    linear, angular, point = (concatenated([components_last(part[i]) for part in parts], -2) for i in range(3))
    own_axes: list[tuple[Callable[[Pose], Array], Array]] = []
    behind = len(number)
    for function, which in with_own_axes(topology.joints).items():
        joints = [topology.joints[k] for k in which]
        own = stacked(joints, number, pose.origin)
        if axes or lengths:
            end = point[..., [int((owner == k).argmax()) for k in which], :]
            own = own.with_axes(joints, axes, lengths, end)
        own_axes.append((partial(function, own), function(own, pose).swapaxes(-1, -2)))
        frame[which] = np.arange(behind, behind + len(which))
        behind += len(which)
    # translations are along axes of the first body, but those across rods
    straight = np.array([not joint.is_rod for joint in topology.joints] + [True] * len(topology.floating), dtype=bool)
    turns = np.asarray(angular.any(axis=(*range(angular.ndim - 2), -1)))
    turner = np.where(turns | ~straight[owner], frame[owner], first[owner])
    vectors = concatenated((linear[..., None], angular[..., None]), -1)
    return PoseKinematics(topology, size, pose, coordinates, cuts, vectors, turner, point, holder[owner], frame,
                          tuple(own_axes))  # fmt: skip


def _carriers(topology: Topology, number: Mapping[str, int]) -> tuple[Index, Index]:
    """The bodies that carry the axes and the points of all joints, followed by those of all floating bodies."""
    ground = len(topology.bodies)
    turner = [number[joint.first] for joint in topology.joints] + [ground] * len(topology.floating)
    # where a joint has no point, the centre of mass of one of its bodies is taken
    holder = [number[joint.second] if joint.point is not None else min(number[joint.first], number[joint.second])
              for joint in topology.joints]  # fmt: skip
    for joint, branch in topology.branch_of.items():
        if topology.joints[joint].point is None:
            holder[joint] = branch.body
    return np.array(turner, dtype=np.intp), np.array(holder + list(topology.floating), dtype=np.intp)


def _owners(topology: Topology, cuts: Cuts | None) -> Index:
    """The joints of all six-vectors (s,); floating bodies count as joints after all others."""
    joints = topology.joints
    owner = [k for k in sorted(topology.branch_of) for _ in joints[k].freedom]
    owner += [len(joints) + k for k in range(len(topology.floating)) for _ in range(6)]
    owner += [k for k in topology.cut for _ in joints[k].locked]
    if cuts is not None and cuts.couplings is not None:
        owner += cuts.couplings.owner.tolist()
    return np.array(owner, dtype=np.intp)
