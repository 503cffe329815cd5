"""Geometric stiffness of many bodies as products of rows, a number proportional to that of the bodies.

The second derivatives are those of ``core.geometric_stiffness``: with the displacements xi of bodies, each pair of the
bodies a and b with the wrench (m, f) on b at its point adds 1/2 (-m, -f) . [xi_b, xi_a] to what its own potential adds,
and each joint of the tree likewise, with the wrench that it transmits. The sum over the pairs and joints of a body has
no force: terms in its translation cancel, and are left out here, as their rounding grows with the length of a chain.
With rotations theta, the displacement (d, delta) of b relative to a, and arms r from the centres of mass, there remain

    1/2 theta . (tr(S) 1 - sym S) theta      of each body, S = sum of f r^T of all forces on it
    theta_a . (d x f + 1/2 delta x m)        of each pair and joint, which turn with their first bodies
    1/2 (delta, d) . H (delta, d)            of each pair, to its rotation vector and its shift
    1/2 q . ((m, f) . D) q                   of each joint of the tree, D: second derivatives of its own motion

Source: see ``core.geometric_stiffness``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.core.expansions import form_of, length_of, of_place
from mbsvib.core.pairs import displacement_curvature
from mbsvib.elements.rows import Rows
from mbsvib.kinematics.mobility import crossed_product as cross
from mbsvib.linalg.groups import items_of_groups
from mbsvib.linalg.rank import ZERO_FORM
from mbsvib.linalg.rotations import skew
from mbsvib.sparse.rows import relative_rows

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

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
    turns = _turning(tree.angular[:, at], tree.linear[:, at], wrench[3:, entry], wrench[:3, entry])
    rotation = np.concatenate((layout.displacement[:, 3:], np.full((1, 3), -1)))[first[entry]]
    which, direction = np.nonzero((rotation >= 0) & (turns.T != 0.0))
    parts = [(at[which], rotation[which, direction], turns[direction, which])]
    for alike, numbers in by_form([joint for joint, _, _ in joints]):
        if alike[0].successive or alike[0].is_rod:
            curvature, f = _shift_curvature(alike), len(alike[0].freedom)
            own = start[numbers][:, None] + np.arange(f)
            value = np.einsum("in,nifg->nfg", np.roll(wrench[:, numbers], 3, axis=0), curvature)
            value = np.triu(value) * np.where(np.eye(f), 0.5, 1.0)
            of_row, column = np.broadcast_arrays(own[:, :, None], layout.coordinate[own][:, None, :])
            parts.append((of_row.reshape(-1), column.reshape(-1), value.reshape(-1)))
    row, column, value = (np.concatenate([part[i] for part in parts]) for i in range(3))
    owner_of = np.zeros(len(tree.names), dtype=np.intp)
    owner_of[at] = owner[entry]
    return _of_entries(layout.coordinate[row], column, value, owner_of[row], layout)


def _shift_curvature(joints: Sequence[Joint]) -> Array:
    """Second derivatives (n, 6, f, f) of rotation vectors and shifts of joints of one form to their coordinates."""
    curvature = stacked(joints, displacement_curvature).copy()
    twists = twists_of(joints)[:, :, : curvature.shape[-1]]
    turned = np.einsum("nijf,njg->nifg", skew(twists[:, :3].swapaxes(1, 2)).transpose(0, 2, 3, 1), twists[:, 3:])
    curvature[:, 3:] += 0.5 * (turned + turned.swapaxes(-1, -2))
    return curvature


def _turning(turn: Array, shift: Array, moment: Array, force: Array) -> Array:
    """The moments v x f + 1/2 w x m (3, n) of twists (w, v), zero where they are rounding."""
    result = cross(shift, force) + 0.5 * cross(turn, moment)
    sizes = [np.sqrt(np.square(array).sum(axis=0)) for array in (turn, shift, moment, force)]
    result[np.abs(result) <= ZERO_FORM * (sizes[1] * sizes[3] + sizes[0] * sizes[2])] = 0.0
    return result


def of_pairs(
    tree: Tree, layout: Layout, pairs: Pairs, owner: Index, twists: Array | None = None
) -> tuple[Products, csr_matrix | None]:
    """Return the products of the displacements of pairs, and the antisymmetric matrix of those without potential.

    ``owner`` (p,). ``twists`` (p, 6, 6): columns are twists of the possible displacements, as cut joints have none
    along their locked directions. Default: all.
    """
    from scipy.sparse import csr_matrix

    p, ground = len(pairs.first), len(tree.parent)
    of_shift = np.tensordot(pairs.wrench[3:].T, of_place(), 1)
    hessian, bound = pairs.hessian - of_shift, np.abs(pairs.hessian) + np.abs(of_shift)
    torsion = np.zeros((0, 6, 6)) if pairs.torsion is None else pairs.torsion
    hessian[: len(torsion)] += 0.5 * (torsion + torsion.swapaxes(-1, -2))
    bound[: len(torsion)] += np.abs(torsion)
    largest = bound.reshape(-1, 2, 3, 2, 3).max(axis=(2, 4), initial=0.0).repeat(3, axis=1).repeat(3, axis=2)
    hessian[np.abs(hessian) <= ZERO_FORM * largest] = 0.0
    all_twists = np.broadcast_to(np.eye(6), (p, 6, 6)) if twists is None else twists
    dual = all_twists if twists is None else duals(twists)
    if twists is not None:
        hessian = twists.swapaxes(-1, -2) @ hessian @ twists
        largest = twists.swapaxes(-1, -2) @ (largest @ np.abs(twists))
        hessian[np.abs(hessian) <= ZERO_FORM * np.abs(largest)] = 0.0
    upper = np.triu(hessian)
    upper[:, np.arange(6), np.arange(6)] *= 0.5
    wide = [np.repeat(array, 6, axis=1) for array in (-pairs.wrench[:3], -pairs.wrench[3:])]
    columns = all_twists.transpose(1, 0, 2).reshape(6, -1)
    turning = _turning(columns[:3], columns[3:], *wide).T.reshape(p, 6, 3)
    turning[pairs.first == ground] = 0.0
    antisymmetric = np.zeros((p, 6, 6))
    antisymmetric[: len(torsion)] = 0.5 * (torsion - torsion.swapaxes(-1, -2))
    used = upper.any(axis=-1) | upper.any(axis=-2) | turning.any(axis=-1) | antisymmetric.any(axis=-1)
    which, i = np.nonzero(used)
    number = np.full((p, 6), -1)
    number[which, i] = np.arange(len(which))
    six, first, second = dual[which, :, i].T, pairs.first[which], pairs.second[which]
    xi = relative_rows(tree, layout, Rows(first, second, pairs.point[:, which], six[3:], six[:3]),
                       (first == ground) | (second == ground))  # fmt: skip

    def combined(entries: Array) -> csr_matrix:
        at, row, column = np.nonzero(entries)
        return csr_matrix((entries[at, row, column], (number[at, row], number[at, column])), shape=(len(which),) * 2)

    at, row, direction = np.nonzero(turning)
    column = layout.displacement[pairs.first[at], 3 + direction]
    moves = column >= 0
    rotations = csr_matrix((turning[at, row, direction][moves], (number[at, row][moves], column[moves])),
                           shape=xi.shape)  # fmt: skip
    half = xi.T @ combined(np.triu(antisymmetric)) @ xi
    return (Products(xi, (combined(upper) @ xi + rotations).tocsr(), owner[which]),
            (half - half.T).tocsr() if half.nnz else None)  # fmt: skip


def twists_of(joints: Sequence[Joint]) -> Array:
    """Return twists (n, 6, 6) (rotation, translation) along the free directions of joints, as columns, then zeros."""
    result = np.zeros((len(joints), 6, 6))
    for k, joint in enumerate(joints):
        for i, (_, six) in enumerate(joint.freedom):
            result[k, :, i] = *six[3:], *six[:3]
    return result


def duals(twists: Array) -> Array:
    """Return D (..., 6, f) with D^T S = 1 of twists S (..., 6, f); zero where a twist is zero."""
    gram = twists.swapaxes(-1, -2) @ twists
    diagonal = np.arange(twists.shape[-1])
    gram[..., diagonal, diagonal] += ~twists.any(axis=-2)
    return np.asarray(np.linalg.solve(gram, twists.swapaxes(-1, -2)).swapaxes(-1, -2))


def by_form(joints: Sequence[Joint]) -> list[tuple[list[Joint], Index]]:
    """Return joints of the same form, and their numbers."""
    groups: dict[object, list[int]] = {}
    for number, joint in enumerate(joints):
        groups.setdefault(form_of(joint), []).append(number)
    return [([joints[i] for i in numbers], np.array(numbers)) for numbers in groups.values()]


def stacked(joints: Sequence[Joint], function: Callable[[Joint, Array, Array], Array]) -> Array:
    """Return a function of a joint, axes (n, 3, 3) and lengths (n,), for joints of the same form."""
    axes, lengths = np.array([joint.axes for joint in joints]), np.array([length_of(joint) for joint in joints])
    return function(joints[0], axes, lengths)
