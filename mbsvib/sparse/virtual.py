"""Unknowns with virtual motions, along which the work of all forces is the force in a joint.

Each joint whose force is an output has six virtual coordinates before its own, translations and rotations of its second
body against its first in world axes, at its point. Bodies behind it move in all directions then, so that here all of
their displacements are unknowns. Rows over these unknowns are made by the same functions as those of the tableau, which
are the first columns. The virtual motion of a cut joint opens it: no body moves, the rows that it locks change.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics.mobility import crossed_product as cross
from mbsvib.mechanism.topology import FLOATS
from mbsvib.sparse.layout import Layout

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.rows import Rows
    from mbsvib.mechanism.topology import Topology
    from mbsvib.sparse.tree import Tree


@dataclass(frozen=True, slots=True)
class VirtualUnknowns:
    """The unknowns of a ``tree`` and ``layout`` that contain virtual motions.

    ``column`` (joints,) is the first of the six virtual coordinates of a joint, -1 for none; ``point`` (3, joints) are
    their points.
    """

    tree: Tree
    layout: Layout
    column: Index
    point: Array

    def opened(self, matrix: csr_matrix, rows: Rows, joint: Index) -> csr_matrix:
        """Return ``rows`` of relative displacement of cut joints (n,), given over the unknowns by ``matrix``, without
        the virtual motions of these joints.
        """
        from scipy.sparse import csr_matrix

        used = np.flatnonzero(self.column[joint] >= 0)
        if not len(used):
            return matrix
        force = rows.force[:, used]
        moment = rows.moment[:, used] + cross(rows.point[:, used] - self.point[:, joint[used]], force)
        wrench = np.concatenate((force, moment)).T
        which, direction = np.nonzero(wrench)
        at = used[which], self.column[joint[used[which]]] + direction
        return (matrix - csr_matrix((wrench[which, direction], at), shape=matrix.shape)).tocsr()


def virtual_unknowns(
    topology: Topology, tree: Tree, layout: Layout, joints: Sequence[int], point: Array
) -> VirtualUnknowns:
    """Return the unknowns with virtual motions of some joints, at ``point`` (3, all joints)."""
    column, n = np.full(len(topology.joints), -1), len(tree.parent)
    outer = {branch.joint: branch for branch in topology.branches if branch.joint != FLOATS}
    in_tree = [outer[k] for k in joints if k in outer]
    displacement = layout.displacement.copy()
    missing = displacement < 0
    displacement[missing] = layout.size + np.arange(np.count_nonzero(missing))
    start = layout.size + int(np.count_nonzero(missing))
    ordered = [*(branch.joint for branch in in_tree), *(k for k in joints if k not in outer)]
    column[ordered] = start + 6 * np.arange(len(ordered))
    number = np.array([branch.joint for branch in in_tree], dtype=np.intp)
    body = np.array([branch.body for branch in in_tree], dtype=np.intp).repeat(6)
    sign = np.array([branch.sign for branch in in_tree], dtype=float).repeat(6)
    six = np.tile(np.eye(6), len(in_tree))
    body_of = np.concatenate((tree.coordinate_body, body))
    order = np.argsort(body_of, kind="stable")  # the coordinates of a body follow each other, its own first
    linear, angular, points = (np.concatenate(pair, axis=1)[:, order] for pair in (
        (tree.linear, six[:3]), (tree.angular, six[3:]), (tree.point, point[:, number].repeat(6, axis=1))))  # fmt: skip
    count = np.bincount(body_of, minlength=n)
    names = (*tree.names, *[f"{topology.joints[k].name}.v{i}" for k in number.tolist() for i in range(6)])
    wide = replace(
        tree, first=np.cumsum(count) - count, count=count, names=tuple([names[k] for k in order.tolist()]),
        coordinate_body=body_of[order], linear=linear, angular=angular, point=points,
        sign=np.concatenate((tree.sign, sign))[order],
        motion=np.concatenate((tree.motion, np.zeros((len(body), 6))))[order],
        turns=np.concatenate((tree.turns, six[3:].any(axis=0)))[order],
    )  # fmt: skip
    coordinate = np.concatenate((layout.coordinate, start + np.arange(len(body))))[order]
    return VirtualUnknowns(wide, Layout(displacement, coordinate, layout.multiplier, layout.behind,
                                        start + 6 * len(ordered)), column, point)  # fmt: skip
