"""Couplers of many bodies: linear relations of joint coordinates as sparse rows, after the locked rows of cut joints.

The coordinate of a joint in the tree is an unknown of the tableau; that of a cut joint is the relative motion of its
bodies. Each coupler is a loop of its own, with one multiplier.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics.couplers import terms
from mbsvib.sparse.rows import path_entries, relative_rows

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray
    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Body
    from mbsvib.elements.coupler import Coupling
    from mbsvib.elements.rows import Rows
    from mbsvib.kinematics.couplers import Moving
    from mbsvib.kinematics.couplings import Couplings
    from mbsvib.mechanism.topology import Topology
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.tree import Tree

Entry = tuple["Index", "Index", "Array"]


@dataclass(frozen=True, slots=True)
class Coupled:
    """Couplers by ``names`` with their ``terms``, whose ``touched`` is empty.

    ``joint`` is the number of the cut joint of each measured row, ``largest`` (2, couplers) are the largest
    coefficients of each coupler's angles and distances.
    """

    names: tuple[str, ...]
    terms: Couplings
    joint: Index
    largest: Array

    @property
    def translational(self) -> NDArray[np.bool_]:
        """Mask of the couplers with a translation among their coordinates, shape (couplers,)."""
        return np.asarray(self.largest[1] > 0.0)

    def scale(self, length: float, members: Index | slice = slice(None)) -> Array:
        """Return factors that scale rows to order one, with distances in units of ``length`` [m]."""
        angle, distance = self.largest[:, members]
        return np.asarray(1.0 / np.maximum(angle, distance * length))

    @property
    def measured(self) -> tuple[Index, Array]:
        """Coupler and coefficient of each measured row."""
        at = np.flatnonzero(self.terms.column < 0)
        return self.terms.row[at], self.terms.value[at]

    def nearby(self, turn: Moving, shift: Moving) -> Coupled:
        """Return the couplers in a neighbouring pose."""
        return replace(self, terms=self.terms.nearby(turn, shift))

    def entries(self, tree: Tree) -> Entry:
        """Return row, coordinate (ascending by row) and value of every entry over the joint coordinates of a tree."""
        from scipy.sparse import coo_matrix

        inside = np.flatnonzero(self.terms.column >= 0)
        row, column, value, _ = path_entries(tree, self.terms.measured, None)
        coupler, coefficient = self.measured
        rows = np.concatenate((self.terms.row[inside], coupler[row]))
        columns = np.concatenate((self.terms.column[inside], column))
        values = np.concatenate((self.terms.value[inside], coefficient[row] * value))
        summed = coo_matrix((values, (rows, columns)), shape=(len(self.names), len(tree.names))).tocsr().tocoo()
        return summed.row.astype(np.intp), summed.col.astype(np.intp), summed.data

    def rows(self, tree: Tree, layout: Layout) -> csr_matrix:
        """Return the rows over the unknowns, (couplers, size), scaled to coefficients of order one."""
        from scipy.sparse import csr_matrix, diags

        shape = (len(self.names), layout.size)
        inside = np.flatnonzero(self.terms.column >= 0)
        at = (self.terms.row[inside], layout.coordinate[self.terms.column[inside]])
        of_tree = csr_matrix((self.terms.value[inside], at), shape=shape)
        coupler, coefficient = self.measured
        coefficients = csr_matrix((coefficient, (coupler, np.arange(len(coupler)))), shape=(shape[0], len(coupler)))
        total = of_tree + coefficients @ relative_rows(tree, layout, self.terms.measured)
        unit = 2.0 ** np.round(np.log2(self.scale(tree.length)))
        unit[self.translational] *= tree.length  # the scale of the multiplier divides by it
        return (diags(unit) @ total).tocsr()


def coupled(
    parts: Sequence[Coupling], topology: Topology, bodies: Sequence[Body], number: Mapping[str, int], tree: Tree
) -> Coupled | None:
    """Return the couplers of a mechanism as arrays, or None if there is none."""
    if not parts:
        return None
    coupling_terms, of_joint = terms(parts, tree.names, topology, bodies, number)
    largest = np.zeros((2, len(parts)))
    np.maximum.at(largest, (np.where(coupling_terms.turns, 0, 1), coupling_terms.row), np.abs(coupling_terms.value))
    return Coupled(tuple(part.name for part in parts), coupling_terms, of_joint, largest)


def locked_entries(tree: Tree, rows: Rows, couplers: Coupled | None) -> Entry:
    """Return row (ascending), joint coordinate and value of all entries of locked rows and, after them, of couplers."""
    row, column, value, _ = path_entries(tree, rows, None)
    if couplers is None:
        return row, column, value
    coupler, more_columns, more_values = couplers.entries(tree)
    return (np.concatenate((row, len(rows.first) + coupler)), np.concatenate((column, more_columns)),
            np.concatenate((value, more_values)))  # fmt: skip


def row_scale(rows: Rows, couplers: Coupled | None, members: Index, length: float) -> Array:
    """Return the factors (n,) that make the locked rows ``members`` (n,) dimensionless.

    1 / ``length`` for translations, 1 for rotations, 1 / the largest coefficient for couplers
    """
    count = len(rows.first)
    of_joints = members[members < count]
    scale = np.where(rows.force[:, of_joints].any(axis=0), 1.0 / length, 1.0)
    if couplers is None:
        return scale
    result = np.empty(len(members))
    result[members < count] = scale
    result[members >= count] = couplers.scale(length, members[members >= count] - count)
    return result
