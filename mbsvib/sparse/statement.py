"""The sum of all contributions over the unknowns of sparse equations: rows and antisymmetric matrices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.sparse.rows import relative_rows

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.contribution import Contribution, Weights
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.tree import Tree


def unknown_rows(part: Contribution, tree: Tree, layout: Layout) -> csr_matrix:
    """Return the rows of a contribution over the unknowns, (count, unknowns)."""
    from scipy.sparse import csr_matrix, vstack

    rows, ground = part.rows, len(tree.position)
    rotations_only = np.flatnonzero((rows.first == ground) & ~rows.force.any(axis=0))
    others = np.setdiff1d(np.arange(len(part.row)), rotations_only)
    of_body = _rotations(layout, rows.second[rotations_only], rows.moment[:, rotations_only])
    between = relative_rows(tree, layout, rows.take(others))
    stacked, order = vstack((of_body, between)).tocsr(), np.concatenate((rotations_only, others))
    into = csr_matrix((np.ones(len(order)), (part.row[order], np.arange(len(order)))), shape=(part.count, len(order)))
    return (into @ stacked).tocsr()


def _rotations(layout: Layout, body: Index, along: Array) -> csr_matrix:
    """Rows along . theta for bodies (k,) and vectors (3, k), over the rotations of the bodies themselves.

    Terms in the rotation of a body may cancel exactly; as sums over joint coordinates they would cancel to rounding.
    """
    from scipy.sparse import csr_matrix

    column = layout.displacement[:, 3:][body]
    row, direction = np.nonzero((column >= 0) & (along.T != 0.0))
    return csr_matrix((along.T[row, direction], (row, column[row, direction])), shape=(len(body), layout.size))


def antisymmetric(weights: Weights, rows: csr_matrix) -> csr_matrix | None:
    """Return sum of value (d_i d_j^T - d_j d_i^T), an antisymmetric form of rows (unknowns, unknowns); None if zero."""
    if not len(weights.value):
        return None
    from scipy.sparse import diags

    part = rows[weights.first].T @ diags(weights.value) @ rows[weights.second]
    return (part - part.T).tocsr()
