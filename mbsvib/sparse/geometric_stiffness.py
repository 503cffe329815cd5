"""Geometric stiffness of many bodies as products of rows, a number proportional to that of the bodies.

The second derivatives are those of ``core.shift_forms``: of the rotations of each body by the arms of all forces on it,
of the displacements of pairs, and of the coordinates of joints of the tree. As absolute displacements, the terms in
translations that cancel there would have a rounding that grows with the length of a chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix, diags, vstack

from mbsvib.common.arrays import Array, Index
from mbsvib.core.geometric_stiffness import Pairs
from mbsvib.core.pairs import duals, own_curvatures, shift_hessian, turning, twists_of
from mbsvib.elements.rows import Rows, columns
from mbsvib.equations.load_stiffness import applied_pairs
from mbsvib.equations.wrenches import AppliedWrenches
from mbsvib.linalg.groups import items_of_groups
from mbsvib.linalg.rank import ZERO_FORM
from mbsvib.mechanism.topology import Topology
from mbsvib.sparse.layout import Layout, VirtualUnknowns, relative_rows
from mbsvib.sparse.tree import Tree

_DIAGONAL = np.arange(3)


@dataclass(frozen=True, slots=True)
class Products:
    """Products of rows ``first`` and ``second`` (n, unknowns) of ``owner`` (n,), added to K with the transpose."""

    first: csr_matrix
    second: csr_matrix
    owner: Index

    @staticmethod
    def join(parts: Sequence[Products]) -> Products:
        """Return all products in one."""
        first, second = (vstack([getattr(part, key) for part in parts]).tocsr() for key in ("first", "second"))
        return Products(first, second, np.concatenate([part.owner for part in parts]))

    def times(self, z: Array) -> Array:
        """Return K z of a motion z (unknowns,)."""
        return np.asarray(self.first.T @ (self.second @ z) + self.second.T @ (self.first @ z))

    def squares(self) -> tuple[csr_matrix, Array, Index]:
        """Return rows with signed weights and owners, whose squares are the products; see ``squares_of_products``. A
        product of parallel rows is one square.
        """
        sizes = [_dots(part, part) for part in (self.first, self.second)]
        used = np.flatnonzero(sizes[0] * sizes[1])
        first, second, owner = self.first[used], self.second[used], self.owner[used]
        size, ratio = sizes[1][used], _dots(first, second) / sizes[0][used]
        rest = second - diags(ratio) @ first
        parallel = _dots(rest, rest) <= ZERO_FORM**2 * size
        squares, others = np.flatnonzero(parallel), np.flatnonzero(~parallel)
        scale = np.sqrt(np.sqrt(size[others] / sizes[0][used[others]]))
        a, b = diags(scale) @ first[others], diags(1.0 / scale) @ second[others]
        rows = vstack((first[squares], a + b, a - b)).tocsr()
        half = np.full(len(others), 0.5)
        value = np.concatenate((2.0 * ratio[squares], half, -half))
        return rows, value, np.concatenate((owner[squares], owner[others], owner[others]))


def _dots(first: csr_matrix, second: csr_matrix) -> Array:
    """Dot products of the rows of two matrices (n, unknowns), shape (n,)."""
    return np.asarray(first.multiply(second).sum(axis=1)).reshape(-1)


def of_bodies(tree: Tree, layout: Layout, forces: Sequence[tuple[Index, Array, Array]], owner: int) -> Products:
    """Return the products of the rotations of each body by the arms of all ``forces`` on it.

    ``forces``: bodies (n,), points (3, n) and forces (3, n); none on ground counts. ``owner``: the number of the first
    body.
    """
    ground = len(tree.parent)
    sums, bound = np.zeros((9, ground)), np.zeros((9, ground))
    for body, point, force in forces:
        mine = np.flatnonzero((body < ground) & force.any(axis=0))
        arm = point[:, mine] - tree.position[body[mine]].T
        terms = (force[:, None, mine] * arm).reshape(9, -1)
        for total, part in ((sums, terms), (bound, np.abs(terms))):
            total += [np.bincount(body[mine], term, ground) for term in part]
    s = sums.T.reshape(-1, 3, 3)
    form = -0.5 * (s + s.swapaxes(1, 2))
    form[:, _DIAGONAL, _DIAGONAL] += np.trace(s, axis1=1, axis2=2)[:, None]
    form[np.abs(form) <= ZERO_FORM * bound.max(axis=0)[:, None, None]] = 0.0
    body, i, j = np.nonzero(np.triu(form))
    value = form[body, i, j] * np.where(i == j, 0.5, 1.0)
    return _of_entries(layout.displacement[body, 3 + i], layout.displacement[body, 3 + j], value, owner + body, layout)


def _of_entries(row: Index, column: Index, value: Array, owner: Index, layout: Layout) -> Products:
    """Products of pairs of unknowns (n,); those of an unknown with others are one. Unknown -1 is no motion."""
    used = np.flatnonzero((row >= 0) & (column >= 0) & (value != 0.0))
    unknown, first, number = np.unique(row[used], return_index=True, return_inverse=True)
    n = len(unknown)
    second = csr_matrix((value[used], (number.reshape(-1), column[used])), shape=(n, layout.size))
    return Products(csr_matrix((np.ones(n), (np.arange(n), unknown)), shape=(n, layout.size)), second,
                    owner[used[first]])  # fmt: skip


@dataclass(frozen=True, slots=True)
class JointForms:
    """The coordinates of joints as rows ``q`` (n, unknowns), with their twists ``angular`` and ``linear`` (3, n).

    ``joint`` (n,) is the number of the joint of each; ``first`` (joints,) are their first bodies, ``fixed`` (joints,)
    is true where the point of the joint is on the first body, and so does not slide. ``curved`` are coordinates, joints
    and curvatures of ``own_curvatures``.
    """

    unknowns: VirtualUnknowns
    q: csr_matrix
    angular: Array
    linear: Array
    joint: Index
    first: Index
    fixed: Array
    curved: list[tuple[Index, Index, Array]]

    def products(self, wrench: Array, owner: int) -> Products:
        """Return the products of the coordinates of joints, and of their virtual motions.

        ``wrench`` (6, joints) (force, moment): on their second bodies, about the points of their twists. ``owner``: the
        number of the first joint.
        """
        layout, column, n = self.unknowns.layout, self.unknowns.column, len(self.joint)
        of_first = np.concatenate((layout.displacement[:, 3:], np.full((1, 3), -1)))[self.first]
        opened = np.flatnonzero(column >= 0)
        of_virtual = np.where(column[:, None] >= 0, column[:, None] + np.arange(3, 6), -1)
        # the own motion of a joint follows its virtual one; moments are about a point that slides with the second body
        force, moment = wrench[:3], wrench[3:]
        every = np.concatenate((self.joint, opened.repeat(6)))
        six = np.tile(np.eye(6), len(opened))
        angular, linear = (np.concatenate(pair, axis=1) for pair in ((self.angular, six[3:]), (self.linear, six[:3])))
        parts = []
        for which, rotation, push in ((np.arange(len(every)), of_first, force),
                                      (np.arange(n), of_virtual, force * self.fixed)):  # fmt: skip
            at = every[which]
            turns = turning(angular[:, which], linear[:, which], moment[:, at], push[:, at]).T
            row, direction = np.nonzero((rotation[at] >= 0) & (turns != 0.0))
            parts.append((row, rotation[at[row], direction], turns[row, direction]))
        row, of_column, value = (np.concatenate([part[i] for part in parts]) for i in range(3))
        second = csr_matrix((value, (row, of_column)), shape=(len(every), layout.size))
        for own, numbers, curvature in self.curved:
            f = curvature.shape[-1]
            form = np.einsum("in,nifg->nfg", np.roll(wrench[:, numbers], 3, axis=0), curvature)
            form = np.triu(form) * np.where(np.eye(f), 0.5, 1.0)
            places = [array.reshape(-1) for array in np.broadcast_arrays(own[:, :, None], own[:, None, :])]
            second = second + csr_matrix((form.reshape(-1), places), shape=(len(every), n)) @ self.q
        of_opened = (column[opened][:, None] + np.arange(6)).reshape(-1)
        unit = csr_matrix((np.ones(len(of_opened)), (np.arange(len(of_opened)), of_opened)),
                          shape=(len(of_opened), layout.size))  # fmt: skip
        return Products(vstack((self.q, unit)).tocsr(), second.tocsr(), owner + every)


def joint_forms(unknowns: VirtualUnknowns, topology: Topology, first: Index, second: Index, fixed: Array) -> JointForms:
    """Return the coordinates of all joints: unknowns in the tree, relative displacements of cut joints.

    ``first``, ``second`` (joints,): their bodies. ``fixed`` (joints,): those whose point is on the first body.
    """
    tree, layout, joints = unknowns.tree, unknowns.layout, topology.joints
    count = np.array([len(joint.freedom) for joint in joints], dtype=np.intp)
    joint, nth = items_of_groups(count)
    six = columns([row for part in joints for _, row in part.freedom], 6)
    outer, _ = topology.outer
    in_tree = np.flatnonzero(outer[joint] >= 0)
    at = layout.coordinate[tree.first[outer[joint[in_tree]]] + nth[in_tree]]
    q = csr_matrix((np.ones(len(at)), (in_tree, at)), shape=(len(joint), layout.size))
    if len(in_tree) < len(joint):
        cut = np.flatnonzero(outer[joint] < 0)
        numbers, local = np.unique(joint[cut], return_inverse=True)
        wrench = duals(twists_of([joints[k] for k in numbers.tolist()]))[local.reshape(-1), :, nth[cut]].T
        of_cut, ground = joint[cut], len(tree.parent)
        rows = Rows(first[of_cut], second[of_cut], unknowns.point[:, of_cut], wrench[3:], wrench[:3])
        by_ends = (rows.first == ground) | (rows.second == ground)
        moved = unknowns.opened(relative_rows(tree, layout, rows, by_ends), rows, of_cut)
        q = q + csr_matrix((np.ones(len(cut)), (cut, np.arange(len(cut)))), shape=(len(joint), len(cut))) @ moved
    begin = np.cumsum(count) - count
    curved = [(begin[numbers][:, None] + np.arange(curvature.shape[-1]), numbers, curvature)
              for _, numbers, curvature in own_curvatures(joints)]  # fmt: skip
    return JointForms(unknowns, q.tocsr(), six[3:], six[:3], joint, first, fixed, curved)


def of_pairs(
    tree: Tree, layout: Layout, pairs: Pairs, owner: Index
) -> tuple[Products, csr_matrix | None]:
    """Return the products of the displacements of pairs, and the antisymmetric matrix of those without potential.

    ``owner`` (p,).
    """
    p, ground = len(pairs.first), len(tree.parent)
    upper = np.triu(shift_hessian(pairs))
    upper[:, np.arange(6), np.arange(6)] *= 0.5
    wide = [np.repeat(array, 6, axis=1) for array in (-pairs.wrench[:3], -pairs.wrench[3:])]
    six = np.tile(np.eye(6), p)
    moments = turning(six[:3], six[3:], *wide).T.reshape(p, 6, 3)
    moments[pairs.first == ground] = 0.0
    antisymmetric = np.zeros((p, 6, 6))
    if pairs.torsion is not None:
        antisymmetric[: len(pairs.torsion)] = 0.5 * (pairs.torsion - pairs.torsion.swapaxes(-1, -2))
    used = upper.any(axis=-1) | upper.any(axis=-2) | moments.any(axis=-1) | antisymmetric.any(axis=-1)
    which, i = np.nonzero(used)
    number = np.full((p, 6), -1)
    number[which, i] = np.arange(len(which))
    six, first, second = np.eye(6)[i].T, pairs.first[which], pairs.second[which]
    xi = relative_rows(tree, layout, Rows(first, second, pairs.point[:, which], six[3:], six[:3]),
                       (first == ground) | (second == ground))  # fmt: skip

    def combined(entries: Array) -> csr_matrix:
        at, row, column = np.nonzero(entries)
        return csr_matrix((entries[at, row, column], (number[at, row], number[at, column])), shape=(len(which),) * 2)

    at, row, direction = np.nonzero(moments)
    column = layout.displacement[pairs.first[at], 3 + direction]
    moves = column >= 0
    rotations = csr_matrix((moments[at, row, direction][moves], (number[at, row][moves], column[moves])),
                           shape=xi.shape)  # fmt: skip
    half = xi.T @ combined(np.triu(antisymmetric)) @ xi
    return (Products(xi, (combined(upper) @ xi + rotations).tocsr(), owner[which]),
            (half - half.T).tocsr() if half.nnz else None)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Loading:
    """The forces at the pose: ``applied`` ones, and wrenches ``joints`` (6, joints) in the joints on their second
    bodies, at ``point`` (3, joints). ``names`` are those of the owners of geometric stiffness.

    ``first``, ``second`` (joints,) are the bodies of joints, ``fixed`` (joints,) those whose point is on the first one.
    """

    topology: Topology
    applied: AppliedWrenches
    joints: Array
    point: Array
    names: tuple[str, ...]
    first: Index
    second: Index
    fixed: Array

    def products(self, forms: JointForms, wrench: Array, applied: bool = True) -> tuple[Products, csr_matrix | None]:
        """Return the products of wrenches (6, joints) in joints and, if ``applied``, of loads and preloads, and the
        antisymmetric matrix of those without potential.
        """
        tree, layout, circulatory = forms.unknowns.tree, forms.unknowns.layout, None
        parts = [forms.products(wrench, len(self.applied.names))]
        forces = [(self.second, self.point, wrench[:3]), (self.first, self.point, -wrench[:3])]
        if applied and self.applied.names:
            # weights act at the centres of mass, where they have no stiffness
            pairs = applied_pairs(replace(self.applied, weight=np.zeros_like(self.applied.weight)), tree.position)
            part, circulatory = of_pairs(tree, layout, pairs, np.arange(len(self.applied.names)))
            parts.insert(0, part)
            forces += [(pairs.second, pairs.point, -pairs.wrench[3:]), (pairs.first, pairs.point, pairs.wrench[3:])]
        parts.append(of_bodies(tree, layout, forces, len(self.names) - len(tree.parent)))
        return Products.join(parts), circulatory

    def forms(self, unknowns: VirtualUnknowns) -> JointForms:
        """Return the coordinates of joints over some unknowns."""
        return joint_forms(unknowns, self.topology, self.first, self.second, self.fixed)
