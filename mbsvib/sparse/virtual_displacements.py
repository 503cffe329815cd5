"""Release: motions of the tree with prescribed displacements in cut joints; all other constraints are satisfied.

With redundant constraints some of these motions do not exist (``self_stress`` determines which do).
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import blas, lapack

from mbsvib.common.tables import listed
from mbsvib.errors import ModelError
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import COLUMN_REGULARISATION, EPS, RANK_FACTOR
from mbsvib.sparse.constraints import MOST_DENSE_ENTRIES
from mbsvib.sparse.layout import motions

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array, Index
    from mbsvib.kinematics.loop_group import LoopGroup
    from mbsvib.sparse.constraints import Constraints, Entries
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.tree import Tree

STEPS = 60
# Iterative refinement stops when a step changes the solution by less than this, or by rounding.
CONVERGED = 1e-13


class Release:
    """Motions of the tree with prescribed displacements of the locked rows; factors of each loop group are cached."""

    def __init__(self, tree: Tree, layout: Layout, closure: Constraints) -> None:
        self._tree, self._layout, self._closure = tree, layout, closure
        self._solvers: dict[int, tuple[Callable[[Array], Array], Array, Array]] = {}

    @cached_property
    def _entries(self) -> Entries:
        return self._closure.entries(self._tree)

    @cached_property
    def _group(self) -> Index:
        result = np.zeros(len(self._closure.names), dtype=np.intp)
        for k, group in enumerate(self._closure.groups):
            result[group.rows] = k
        return result

    @cached_property
    def _motions(self) -> Callable[[Array], Array]:
        return motions(self._tree, self._layout)

    def unknowns(self, target: Array) -> Array:
        """Return the motion (size,) with prescribed displacements ``target`` (locked rows,)."""
        q = np.zeros(len(self._tree.names))
        for k in np.unique(self._group[np.flatnonzero(target)]).tolist():
            group = self._closure.groups[k]
            solve, scale, column_scale = self._solver(k, group)
            q[group.columns] = column_scale * solve(scale * target[group.rows])
        return self._motions(q)

    def _solver(self, k: int, group: LoopGroup) -> tuple[Callable[[Array], Array], Array, Array]:
        if k not in self._solvers:
            closure, tree = self._closure, self._tree
            shape = (len(group.rows), len(group.columns))
            small, length = shape[0] * shape[1] <= MOST_DENSE_ENTRIES, group.length
            rows = closure.cuts.row_scale(length, group.rows)
            column_scale = np.where(tree.turns[group.columns], 1.0, length)
            row, column, value = self._entries.of(group.rows)
            column = np.searchsorted(group.columns, column)
            value = value * rows[row] * column_scale[column]
            solve = _of_small((value, (row, column)), shape, group.rank) if small else \
                _of_large((value, (row, column)), shape, group)  # fmt: skip
            self._solvers[k] = (solve, rows, column_scale)
        return self._solvers[k]


def _of_small(entries: Any, shape: tuple[int, int], rank: int) -> Callable[[Array], Array]:
    """Least squares by pivoted QR of known rank."""
    a = np.zeros(shape)
    a[entries[1]] = entries[0]
    qr, order, tau = pivoted_qr(a)

    def solve(right: Array) -> Array:
        result = np.zeros(shape[1])
        if rank:
            rotated = lapack.dormqr("L", "T", qr[:, : len(tau)], tau, right[:, None], 64)[0]
            result[order[:rank]] = blas.dtrsm(1.0, qr[:rank, :rank], rotated[:rank])[:, 0]
        return result

    return solve


def _of_large(entries: Any, shape: tuple[int, int], group: LoopGroup) -> Callable[[Array], Array]:
    """Least squares by a regularised sparse system with iterative refinement."""
    from scipy.sparse import bmat, csc_matrix, diags, eye
    from scipy.sparse.linalg import splu

    rows, columns = shape
    a = csc_matrix(entries, shape=shape)
    # loops are short compared with their group: columns are scaled by their lengths, except for rounding errors
    size = np.sqrt(np.asarray(a.power(2).sum(axis=0))[0])
    unit = np.divide(1.0, size, out=np.zeros(columns), where=size > RANK_FACTOR * group.noise)
    a = (a @ diags(unit)).tocsc()
    lu = splu(bmat([[eye(rows), a], [a.T, -COLUMN_REGULARISATION * eye(columns)]], format="csc"))

    def solve(right: Array) -> Array:
        result: Array = np.zeros(columns)
        residual, rounding = right, EPS * float(np.abs(right).max())
        for _ in range(STEPS):
            step: Array = lu.solve(np.concatenate((residual, np.zeros(columns))))[rows:]
            result = result + step
            residual = right - a @ result
            if np.abs(a @ step).max() <= max(rounding, CONVERGED * np.abs(a @ result).max()):
                result *= unit
                return result
        raise ModelError(
            f"forces in joints of the loops closed by {listed(group.joints)} are not determined to many digits: the "
            f"constraints nearly depend on each other. Leave these outputs out, or use method='dense'.",
            element=group.joints[0], field="method",
        )  # fmt: skip

    return solve
