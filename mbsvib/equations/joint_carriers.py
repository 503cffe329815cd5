"""Where the forces in joints act, which bodies carry their points, and how they pass through the tree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics.mobility import crossed_product
from mbsvib.mechanism.topology import FLOATS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Joint
    from mbsvib.elements.rows import Rows
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.mechanism.topology import Topology


@dataclass(frozen=True, slots=True)
class Carriers:
    """What topology and geometry say of the forces in joints.

    ``point`` (3, joints) [m] are the joints' points, as their second bodies carry them, ``start`` as their first do
    (another one only in rods), ``first`` and ``second`` (joints,) their bodies, ``carrier`` (joints,) the one that the
    point moves with; ``behind`` (bodies + 1, joints) holds +1 or -1 where a joint of the tree lies between ground and
    the body; ``position`` (3, bodies + 1) are the centres of mass, ``joint_of`` (n,) the joint of each coordinate.
    """

    topology: Topology
    position: Array
    point: Array
    start: Array
    first: Index
    second: Index
    carrier: Index
    behind: Array
    joint_of: Index

    def of_tree(self, wrench: Array) -> Array:
        """Return minus what acts behind each joint of the tree (6, joints, columns), for (6, bodies + 1, columns)."""
        # arms are taken about one of the bodies, far from the origin as all may be
        middle = self.position[:, :1]
        force, moment = wrench[:3], wrench[3:]
        about = moment + crossed_product((self.position - middle)[..., None], force)
        sums: Array = self.behind.T @ np.concatenate((force, about))
        sums[3:] -= crossed_product((self.point - middle)[..., None], sums[:3])
        sums *= -1.0
        return sums

    def of_locked(self, cuts: Cuts | None) -> Array:
        """Return the wrenches in all joints (6 joints, locked rows) that one unit of each multiplier brings.

        A locked row acts on its two bodies, so by the path rule only joints of the tree between these carry it, and
        the cut joint itself; couplers act on all that they measure.
        """
        if cuts is None or not len(cuts.names):
            return np.empty((6 * len(self.first), 0))
        cut = np.array(self.topology.cut, dtype=np.intp)
        result = self._of_rows(cuts.rows, cut[cuts.joint[: len(cuts.rows.first)]])
        if cuts.couplings is None:
            return result
        measured, terms = cuts.couplings.measured, np.flatnonzero(cuts.couplings.column < 0)
        shares = np.zeros((len(terms), len(cuts.names) - result.shape[1]))
        shares[np.arange(len(terms)), cuts.couplings.row[terms]] = cuts.couplings.value[terms]
        return np.concatenate((result, self._of_rows(measured, self.measured(measured)) @ shares), axis=1)

    def _of_rows(self, rows: Rows, joint: Index) -> Array:
        """What relative displacements of the bodies of cut joints (n,) bring into all joints, (6 joints, n)."""
        sign = (self.behind[rows.first] - self.behind[rows.second]).T
        sign[joint, np.arange(len(joint))] = 1.0
        result = np.empty((6, *sign.shape))
        result[:3] = rows.force[:, None]
        result[3:] = crossed_product(rows.point[:, None] - self.point[:, :, None], rows.force[:, None])
        result[3:] += rows.moment[:, None]
        result *= sign
        return result.reshape(6 * len(self.first), len(joint))

    def measured(self, rows: Rows) -> Index:
        """Return the cut joint that each measured row of a coupler belongs to."""
        cut = np.array(self.topology.cut, dtype=np.intp)
        if not len(rows.first):
            return cut[:0]
        same = (self.first[cut] == rows.first[:, None]) & (self.second[cut] == rows.second[:, None])
        # two joints between the same bodies are told apart by their points
        here = (np.abs(self.point[:, None, cut] - rows.point[:, :, None]).max(axis=0) == 0.0) & same
        found: Index = cut[np.argmax(same.astype(int) + here, axis=1)]
        return found


def carriers(topology: Topology, position: Array) -> Carriers:
    """Return what topology and geometry say of the forces in joints.

    Parameters
    ----------
    topology : Topology
        The spanning tree.
    position : array, shape (3, bodies + 1)
        Centres of mass [m], the origin for ground.

    Returns
    -------
    Carriers
        The ways from bodies to joints and back.
    """
    number = {name: i for i, name in enumerate(topology.bodies)}
    number["ground"] = len(topology.bodies)
    first = np.array([number[joint.first] for joint in topology.joints], dtype=np.intp)
    second = np.array([number[joint.second] for joint in topology.joints], dtype=np.intp)
    behind = np.zeros((len(number), len(topology.joints)))
    for branch in topology.branches:
        behind[branch.body] = behind[branch.parent]
        if branch.joint != FLOATS:
            behind[branch.body, branch.joint] = branch.sign
    point = np.array([place(joint, number, position) for joint in topology.joints]).reshape(-1, 3).T
    start = point.copy()
    for k, joint in enumerate(topology.joints):
        if joint.kind == "distance" and joint.position is not None:
            start[:, k] = joint.position
    carrier = np.array([carrier_of(joint, number) for joint in topology.joints], dtype=np.intp)
    joint_of: list[int] = []
    for k in sorted(branch.joint for branch in topology.branches if branch.joint != FLOATS):
        joint_of += [k] * len(topology.joints[k].freedom)
    joint_of += [FLOATS] * (6 * len(topology.floating))
    return Carriers(topology, position, point, start, first, second, carrier, behind, np.array(joint_of, dtype=np.intp))


def carrier_of(joint: Joint, number: Mapping[str, int]) -> int:
    """Return the body that a joint's point moves with: its second, but where the point is a centre of mass that ground
    has not.
    """
    return number[joint.first if joint.point is None and joint.second == "ground" else joint.second]


def place(joint: Joint, number: dict[str, int], position: Array) -> Array | tuple[float, float, float]:
    """Return a joint's point, of one that has none the centre of mass of its second body (its first, on ground)."""
    if joint.point is not None:
        return joint.point
    bodies = (number[joint.second], number[joint.first])
    return position[:, bodies[1] if bodies[0] == position.shape[1] - 1 else bodies[0]]
