"""Force paths: the points and bodies of joints, and the joints of the tree between each body and ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics.mobility import crossed_product
from mbsvib.linalg.products import product_with_zeros
from mbsvib.mechanism.topology import FLOATS, Topology

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Joint
    from mbsvib.elements.rows import Rows
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.mechanism.mechanism import Mechanism


@dataclass(frozen=True, slots=True)
class ForcePaths:
    """Joints and the paths of forces from bodies through the tree to ground.

    ``point`` (3, joints) [m] are the joints' points on their second bodies, ``start`` those on their first (different
    only for rods), ``first`` and ``second`` (joints,) their bodies, ``carrier`` (joints,) the body with which the point
    moves; ``path_sign`` (bodies + 1, joints) is +1 or -1 where a joint of the tree lies between ground and the body,
    else 0; ``position`` (3, bodies + 1) are the centres of mass, ``joint_of`` (n,) the joint of each coordinate.
    """

    topology: Topology
    position: Array
    point: Array
    start: Array
    first: Index
    second: Index
    carrier: Index
    path_sign: Array
    joint_of: Index

    def of_tree(self, wrench: Array) -> Array:
        """Return minus the sum of the wrenches behind each joint of the tree (6, joints, columns), from those on the
        bodies (6, bodies + 1, columns).
        """
        # moments about one of the bodies: about a distant origin they would lose digits
        reference = self.position[:, :1]
        force, moment = wrench[:3], wrench[3:]
        moments = moment + crossed_product((self.position - reference)[..., None], force)
        sums: Array = self.path_sign.T @ np.concatenate((force, moments))
        sums[3:] -= crossed_product((self.point - reference)[..., None], sums[:3])
        sums *= -1.0
        return sums

    def of_locked(self, cuts: Cuts | None) -> Array:
        """Return the wrenches in all joints (6 joints, locked rows) per unit of each multiplier.

        A locked row acts on its two bodies, so by the path rule only joints of the tree between these transmit it, and
        the cut joint itself; couplers act on all joints that they measure.
        """
        if cuts is None or not len(cuts.names):
            return np.empty((6 * len(self.first), 0))
        cut = np.array(self.topology.cut, dtype=np.intp)
        result = self._of_rows(cuts.rows, cut[cuts.joint[: len(cuts.rows.first)]])
        if cuts.couplings is None:
            return result
        measured, couplings = cuts.couplings.measured, np.flatnonzero(cuts.couplings.column < 0)
        coefficients = np.zeros((len(couplings), len(cuts.names) - result.shape[1]))
        coefficients[np.arange(len(couplings)), cuts.couplings.row[couplings]] = cuts.couplings.value[couplings]
        return np.concatenate((result, self._of_rows(measured, self.measured(measured)) @ coefficients), axis=1)

    def _of_rows(self, rows: Rows, cut_joint: Index) -> Array:
        """Wrenches in all joints (6 joints, n) of unit forces along rows (n,) of cut joints."""
        sign = (self.path_sign[rows.first] - self.path_sign[rows.second]).T
        sign[cut_joint, np.arange(len(cut_joint))] = 1.0
        result = np.empty((6, *sign.shape))
        result[:3] = rows.force[:, None]
        result[3:] = crossed_product(rows.point[:, None] - self.point[:, :, None], rows.force[:, None])
        result[3:] += rows.moment[:, None]
        result *= sign
        return result.reshape(6 * len(self.first), len(cut_joint))

    def measured(self, rows: Rows) -> Index:
        """Return the cut joint that each measured row of a coupler belongs to."""
        cut = np.array(self.topology.cut, dtype=np.intp)
        if not len(rows.first):
            return cut[:0]
        same_bodies = (self.first[cut] == rows.first[:, None]) & (self.second[cut] == rows.second[:, None])
        # joints between the same bodies differ in their points
        same_point = (np.abs(self.point[:, None, cut] - rows.point[:, :, None]).max(axis=0) == 0.0) & same_bodies
        result: Index = cut[np.argmax(same_bodies.astype(int) + same_point, axis=1)]
        return result


def force_paths(topology: Topology, position: Array) -> ForcePaths:
    """Return joints and the paths of forces through the tree.

    ``position`` (3, bodies + 1): centres of mass [m], the origin for ground.
    """
    first, second, start, point, carrier = joint_ends(topology, position)
    path_sign = np.zeros((position.shape[1], len(topology.joints)))
    for branch in topology.branches:
        path_sign[branch.body] = path_sign[branch.parent]
        if branch.joint != FLOATS:
            path_sign[branch.body, branch.joint] = branch.sign
    joint_of: list[int] = []
    for k in sorted(branch.joint for branch in topology.branches if branch.joint != FLOATS):
        joint_of += [k] * len(topology.joints[k].freedom)
    joint_of += [FLOATS] * (6 * len(topology.floating))
    joints = np.array(joint_of, dtype=np.intp)
    return ForcePaths(topology, position, point, start, first, second, carrier, path_sign, joints)


def joint_ends(topology: Topology, position: Array) -> tuple[Index, Index, Array, Array, Index]:
    """Return the bodies and points of joints.

    ``position`` (3, bodies + 1): centres of mass [m], the origin for ground. Returns ``first, second`` (joints,):
    numbers of their bodies; ``start, point`` (3, joints): points of the first and of the second body [m], which differ
    for rods; ``carrier`` (joints,): numbers of the bodies with which these points move.
    """
    number, joints = topology.body_numbers, topology.joints
    first, second, carrier = (np.array(bodies, dtype=np.intp) for bodies in (
        [number[joint.first] for joint in joints], [number[joint.second] for joint in joints],
        [carrier_of(joint, number) for joint in joints]))  # fmt: skip
    point = np.array([point_of(joint, number, position) for joint in joints]).reshape(-1, 3).T
    start = point.copy()
    for k, joint in enumerate(joints):
        if joint.is_rod:
            start[:, k] = joint.position
    return first, second, start, point, carrier


def carrier_of(joint: Joint, number: Mapping[str, int]) -> int:
    """Return the body with which a joint's point moves: its second body, or its first where the second is ground and
    the point is a centre of mass.
    """
    return number[joint.first if joint.point is None and joint.second == "ground" else joint.second]


def point_of(joint: Joint, number: Mapping[str, int], position: Array) -> Array | tuple[float, float, float]:
    """Return a joint's point; by default the centre of mass of its second body (of its first, where that is ground)."""
    if joint.point is not None:
        return joint.point
    bodies = (number[joint.second], number[joint.first])
    return position[:, bodies[1] if bodies[0] == position.shape[1] - 1 else bodies[0]]


def carries_nothing(joint: Joint, direction: Array, model: Mechanism, loaded: bool) -> bool:
    """Return whether a component of the wrench in a joint is zero in every motion, along its free directions.

    ``direction`` (6,): of the component, world axes. Under load, the free rotations must be about axes that the first
    body carries, or about all; couplers act along free directions.
    """
    if (loaded and len(joint.rotation_axes) == 2) or any(
            name.rpartition(".")[0] == joint.name for part in model.couplers.values() for name, _ in part.terms):
        return False
    return not product_with_zeros(np.array([row for _, row in joint.locked]).reshape(-1, 6), direction).any()
