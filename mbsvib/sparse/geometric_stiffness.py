"""Geometric stiffness of many bodies as products of rows, a number proportional to that of the bodies.

The second derivatives are those of ``core.shift_forms``: of the rotations of each body by the arms of all forces on it,
of the displacements of pairs, and of the coordinates of joints of the tree. As absolute displacements, the terms in
translations that cancel there would have a rounding that grows with the length of a chain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.core.shift_forms import duals, own_curvatures, shift_hessian, turning
from mbsvib.elements.rows import Rows
from mbsvib.linalg.groups import items_of_groups
from mbsvib.linalg.rank import ZERO_FORM
from mbsvib.sparse.rows import relative_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.core.geometric_stiffness import Pairs
    from mbsvib.elements import Joint
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.tree import Tree

_DIAGONAL = np.arange(3)


@dataclass(frozen=True, slots=True)
class Products:
    """Products of the rows ``first`` and ``second`` (n, unknowns) with ``owner`` (n,), which add first^T second and its
    transpose to K.
    """

    first: csr_matrix
    second: csr_matrix
    owner: Index

    @staticmethod
    def join(parts: Sequence[Products]) -> Products:
        """Return all products in one."""
        from scipy.sparse import vstack

        first, second = (vstack([getattr(part, key) for part in parts]).tocsr() for key in ("first", "second"))
        return Products(first, second, np.concatenate([part.owner for part in parts]))

    def squares(self) -> tuple[csr_matrix, Array, Index]:
        """Return rows with signed weights and owners, whose squares are the products; see ``squares_of_products``. A
        product of parallel rows is one square.
        """
        from scipy.sparse import diags, vstack

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
    from scipy.sparse import csr_matrix

    used = np.flatnonzero((row >= 0) & (column >= 0) & (value != 0.0))
    unknown, first, number = np.unique(row[used], return_index=True, return_inverse=True)
    n = len(unknown)
    second = csr_matrix((value[used], (number.reshape(-1), column[used])), shape=(n, layout.size))
    return Products(csr_matrix((np.ones(n), (np.arange(n), unknown)), shape=(n, layout.size)), second,
                    owner[used[first]])  # fmt: skip


def of_joints(tree: Tree, layout: Layout, joints: Sequence[tuple[Joint, int, int]], wrench: Array, owner: Index
              ) -> Products:  # fmt: skip
    """Return the products of coordinates of joints of the tree.

    ``joints``: joint, number of its first body, and first coordinate; ``wrench`` (6, j) (force, moment): on their
    second bodies, about the points of their twists; ``owner`` (j,).
    """
    first = np.array([body for _, body, _ in joints], dtype=np.intp)
    start = np.array([coordinate for _, _, coordinate in joints], dtype=np.intp)
    entry, nth = items_of_groups(np.array([len(joint.freedom) for joint, _, _ in joints], dtype=np.intp))
    at = start[entry] + nth
    turns = turning(tree.angular[:, at], tree.linear[:, at], wrench[3:, entry], wrench[:3, entry])
    rotation = np.concatenate((layout.displacement[:, 3:], np.full((1, 3), -1)))[first[entry]]
    which, direction = np.nonzero((rotation >= 0) & (turns.T != 0.0))
    parts = [(at[which], rotation[which, direction], turns[direction, which])]
    for _, numbers, curvature in own_curvatures([joint for joint, _, _ in joints]):
        f = curvature.shape[-1]
        own = start[numbers][:, None] + np.arange(f)
        value = np.einsum("in,nifg->nfg", np.roll(wrench[:, numbers], 3, axis=0), curvature)
        value = np.triu(value) * np.where(np.eye(f), 0.5, 1.0)
        of_row, column = np.broadcast_arrays(own[:, :, None], layout.coordinate[own][:, None, :])
        parts.append((of_row.reshape(-1), column.reshape(-1), value.reshape(-1)))
    row, column, value = (np.concatenate([part[i] for part in parts]) for i in range(3))
    owner_of = np.zeros(len(tree.names), dtype=np.intp)
    owner_of[at] = owner[entry]
    return _of_entries(layout.coordinate[row], column, value, owner_of[row], layout)


def of_pairs(
    tree: Tree, layout: Layout, pairs: Pairs, owner: Index, twists: Array | None = None
) -> tuple[Products, csr_matrix | None]:
    """Return the products of the displacements of pairs, and the antisymmetric matrix of those without potential.

    ``owner`` (p,). ``twists`` (p, 6, 6): columns are twists of the possible displacements, as cut joints have none
    along their locked directions. Default: all.
    """
    from scipy.sparse import csr_matrix

    p, ground = len(pairs.first), len(tree.parent)
    all_twists = np.broadcast_to(np.eye(6), (p, 6, 6)) if twists is None else twists
    dual = all_twists if twists is None else duals(twists)
    upper = np.triu(shift_hessian(pairs, twists))
    upper[:, np.arange(6), np.arange(6)] *= 0.5
    wide = [np.repeat(array, 6, axis=1) for array in (-pairs.wrench[:3], -pairs.wrench[3:])]
    columns = all_twists.transpose(1, 0, 2).reshape(6, -1)
    moments = turning(columns[:3], columns[3:], *wide).T.reshape(p, 6, 3)
    moments[pairs.first == ground] = 0.0
    antisymmetric = np.zeros((p, 6, 6))
    if pairs.torsion is not None:
        antisymmetric[: len(pairs.torsion)] = 0.5 * (pairs.torsion - pairs.torsion.swapaxes(-1, -2))
    used = upper.any(axis=-1) | upper.any(axis=-2) | moments.any(axis=-1) | antisymmetric.any(axis=-1)
    which, i = np.nonzero(used)
    number = np.full((p, 6), -1)
    number[which, i] = np.arange(len(which))
    six, first, second = dual[which, :, i].T, pairs.first[which], pairs.second[which]
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
