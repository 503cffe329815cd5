"""Reactions: from wrenches on the bodies to the wrench in every joint.

A joint of the tree carries all that acts on what hangs behind it; the forces of the cut joints, which close the loops,
act there too. With Phi the locked rows of the cut joints and B' the motion of the bodies, both per joint coordinate,

    Phi^T lambda = -B'^T W

in the coordinates that depend on the loops. Where constraints are redundant many lambda hold the bodies, and the one of
least norm is taken (moments divided by the size of the loop); the second-order terms are the same with all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from mbsvib.mobility import crossed_product
from mbsvib.topology import FLOATS

if TYPE_CHECKING:
    from mbsvib.kinematics import Array, Index, Rows, Twists
    from mbsvib.loops import Cuts, Reduction
    from mbsvib.parts import Joint
    from mbsvib.topology import Topology


# Up to so many entries the ways from bodies to joints and back are kept as matrices.
SMALL = 40_000


@dataclass(frozen=True, slots=True)
class Carriers:
    """What topology and geometry say of the forces in joints.

    ``point`` (3, joints) [m] are the joints' points, as their second bodies carry them, ``start`` as their first do
    (another one only in rods), ``first`` and ``second`` (joints,) their bodies; ``behind`` (bodies + 1, joints) holds
    +1 or -1 where a joint of the tree lies between ground and the body; ``position`` (3, bodies + 1) are the centres of
    mass, ``joint_of`` (n,) the joint of each coordinate. ``to_joints`` (6 joints, 6 (bodies + 1)) and ``to_bodies`` are
    the matrices of the two ways, None where they would be large.
    """

    topology: Topology
    position: Array
    point: Array
    start: Array
    first: Index
    second: Index
    behind: Array
    joint_of: Index
    to_joints: Array | None = None
    to_bodies: Array | None = None

    def of_tree(self, wrench: Array) -> Array:
        """Return minus what acts behind each joint of the tree (6, joints, columns), for (6, bodies + 1, columns)."""
        if self.to_joints is not None:
            return _through(self.to_joints, wrench, self.point.shape[1])
        # arms are taken about the middle of the bodies, far from the origin as they may be
        middle = self.position[:, :-1].mean(axis=1, keepdims=True)
        force, moment = wrench[:3], wrench[3:]
        about = moment + crossed_product((self.position - middle)[..., None] + np.zeros_like(force), force)
        sums: Array = np.einsum("bj,cbk->cjk", self.behind, np.concatenate((force, about)))
        sums[3:] -= crossed_product((self.point - middle)[..., None] + np.zeros_like(sums[:3]), sums[:3])
        sums *= -1.0
        return sums

    def on_bodies(self, joints: Array) -> Array:
        """Return what wrenches in joints (6, joints, columns) do to the bodies (6, bodies + 1, columns)."""
        if self.to_bodies is not None:
            return _through(self.to_bodies, joints, self.position.shape[1])
        result = np.zeros((6, self.position.shape[1], joints.shape[2]))
        for bodies, sign in ((self.second, 1.0), (self.first, -1.0)):
            arm = (self.point - self.position[:, bodies])[..., None]
            lever = crossed_product(arm + np.zeros_like(joints[:3]), joints[:3])
            part = np.concatenate((joints[:3], joints[3:] + lever))
            place = np.zeros((len(bodies), self.position.shape[1]))
            place[np.arange(len(bodies)), bodies] = sign
            result += np.einsum("cjn,jb->cbn", part, place)
        return result

    def as_matrices(self) -> Carriers:
        """Return the same with both ways as matrices, unless these are large."""
        joints, bodies = 6 * self.point.shape[1], 6 * self.position.shape[1]
        if not 0 < joints * bodies <= SMALL:
            return self
        arm = skew(self.position[:, :, None] - self.point[:, None])
        to_joints = _moved(-self.behind, arm).transpose(0, 3, 1, 2).reshape(joints, bodies)
        every = np.arange(self.position.shape[1])[:, None]
        sign = (every == self.second).astype(float) - (every == self.first)
        to_bodies = _moved(sign, -arm).transpose(0, 2, 1, 3).reshape(bodies, joints)
        return replace(self, to_joints=to_joints, to_bodies=to_bodies)


@dataclass(frozen=True, slots=True)
class Reactions:
    """The way from body wrenches to joint wrenches: by ``carriers``, and in loops by the locked rows ``phi``."""

    carriers: Carriers
    coordinates: Twists
    cuts: Cuts | None
    reduction: Reduction
    phi: Array

    def __call__(self, wrench: Array) -> Array:
        """Return the wrenches in the joints that balance wrenches on the bodies.

        Parameters
        ----------
        wrench : array, shape (6, bodies + 1, columns)
            Forces [N] and moments about the centres of mass [N m] on the bodies, world axes, ground last.

        Returns
        -------
        array, shape (6, joints, columns)
            Force at the joint's point and moment about it, as they act on the joint's second body; its first body
            takes the opposite.
        """
        tree = self.carriers.of_tree(wrench)
        if self.cuts is None or not len(self.cuts.names):
            return tree
        return tree + self.of_multipliers(self.multipliers(tree))

    def of_multipliers(self, multipliers: Array) -> Array:
        """Return the wrenches in all joints (6, joints, columns) that multipliers (locked rows, columns) bring."""
        closing = self._closing(multipliers)
        return self.carriers.of_tree(self.carriers.on_bodies(closing)) + closing

    def _closing(self, multipliers: Array) -> Array:
        """The wrenches (6, joints, columns) in the cut joints: of what they lock, and of couplers on them."""
        assert self.cuts is not None
        rows = self.cuts.rows
        joint = np.array(self.carriers.topology.cut, dtype=np.intp)[self.cuts.joint[: len(rows.first)]]
        result = self._about_joints(rows, joint, multipliers[: len(joint)])
        coupled = self.cuts.couplings
        if coupled is not None and len(coupled.measured.first):
            terms = np.flatnonzero(coupled.column < 0)
            value = coupled.value[terms, None] * multipliers[len(joint) + coupled.row[terms]]
            result += self._about_joints(coupled.measured, self._measured(coupled.measured), value)
        return result

    def _about_joints(self, rows: Rows, joint: Index, value: Array) -> Array:
        point = self.carriers.point
        moment = rows.moment + crossed_product(rows.point - point[:, joint], rows.force)
        sums = np.zeros((point.shape[1], len(joint)))
        sums[joint, np.arange(len(joint))] = 1.0
        return sums @ (np.concatenate((rows.force, moment))[..., None] * value)

    def _measured(self, rows: Rows) -> Index:
        """The cut joint that each measured row of a coupler belongs to."""
        cut, all_joints = np.array(self.carriers.topology.cut, dtype=np.intp), self.carriers
        same = (all_joints.first[cut] == rows.first[:, None]) & (all_joints.second[cut] == rows.second[:, None])
        # two joints between the same bodies are told apart by their points
        here = (np.abs(all_joints.point[:, None, cut] - rows.point[:, :, None]).max(axis=0) == 0.0) & same
        found: Index = cut[np.argmax(same.astype(int) + here, axis=1)]
        return found

    def multipliers(self, tree: Array) -> Array:
        """Return lambda (locked rows, columns) for the wrenches in the joints of the open tree (6, joints, columns)."""
        assert self.cuts is not None
        twist, at = np.concatenate((self.coordinates.linear, self.coordinates.angular)), self.carriers.joint_of
        # what the open tree's joints lack along their own free directions; of floating bodies, last, nothing depends
        held = np.einsum("ck,ckn->kn", twist, tree[:, at])
        result = np.zeros((len(self.cuts.names), tree.shape[2]))
        dependent = np.ones(len(at), dtype=bool)
        dependent[self.reduction.independent] = False
        for group in self.reduction.groups:
            columns = group.columns[dependent[group.columns]]
            if not len(columns):
                continue
            matrix = self.phi[group.rows[:, None], columns].T
            if matrix.shape[0] == matrix.shape[1]:
                result[group.rows] = lapack.dgesv(matrix, held[columns])[2]
                continue
            scale = group.length * self.cuts.row_scale(group.length)[group.rows]
            result[group.rows] = np.linalg.lstsq(matrix * scale, held[columns], rcond=None)[0] * scale[:, None]
        return result


def skew(vectors: Array) -> Array:
    """Return [v]x (3, 3, ...) of vectors (3, ...): [v]x w = v x w."""
    result = np.zeros((3, *vectors.shape))
    x, y, z = vectors
    result[0, 1], result[0, 2], result[1, 0] = -z, y, z
    result[1, 2], result[2, 0], result[2, 1] = -x, -y, x
    return result


def _moved(sign: Array, arm: Array) -> Array:
    """Return what takes wrenches (6,) along arms [r]x (3, 3, bodies + 1, joints), with signs: (6, 6, ...)."""
    result = np.zeros((6, 6, *sign.shape))
    for k in range(6):
        result[k, k] = sign
    result[3:, :3] = sign * arm
    return result


def _through(matrix: Array, wrench: Array, places: int) -> Array:
    columns = wrench.shape[2]
    return (matrix @ wrench.reshape(matrix.shape[1], columns)).reshape(6, places, columns)


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
    joint_of: list[int] = []
    for k in sorted(branch.joint for branch in topology.branches if branch.joint != FLOATS):
        joint_of += [k] * len(topology.joints[k].freedom)
    joint_of += [FLOATS] * (6 * len(topology.floating))
    return Carriers(topology, position, point, start, first, second, behind,
                    np.array(joint_of, dtype=np.intp)).as_matrices()  # fmt: skip


def reactions(
    carriers: Carriers, coordinates: Twists, cuts: Cuts | None, reduction: Reduction, phi: Array
) -> Reactions:
    """Return the way from body wrenches to joint wrenches.

    Parameters
    ----------
    carriers : Carriers
        What topology and geometry say of it.
    coordinates : Twists
        The joint coordinates.
    cuts : Cuts or None
        Locked rows of the cut joints, and couplers.
    reduction : Reduction
        The minimal coordinates.
    phi : array, shape (locked rows, n)
        Locked rows per unit joint coordinate.

    Returns
    -------
    Reactions
        To be called with wrenches on the bodies.
    """
    return Reactions(carriers, coordinates, cuts, reduction, phi)


def place(joint: Joint, number: dict[str, int], position: Array) -> Array | tuple[float, float, float]:
    """Return a joint's point, of one that has none the centre of mass of its second body (its first, on ground)."""
    if joint.point is not None:
        return joint.point
    bodies = (number[joint.second], number[joint.first])
    return position[:, bodies[1] if bodies[0] == position.shape[1] - 1 else bodies[0]]
