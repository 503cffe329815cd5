"""Antisymmetric parts of C and K by rotors, rotating dampers and cross-coupled elements, over sparse unknowns."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.rows import Rows
from mbsvib.equations.spin_terms import check_spin, cross_couplings, momenta
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.linalg.rotations import skew
from mbsvib.sparse.rows import relative_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array
    from mbsvib.sparse.draft import SparseDraft
    from mbsvib.sparse.layout import Layout


def with_spin(draft: SparseDraft) -> SparseDraft:
    """Return a draft with the antisymmetric terms of rotors and elements."""
    if not draft.model.derived(has_antisymmetric_forces):
        return draft
    elements = tuple(draft.model.springs.values())
    check_spin(draft.model, draft.bodies, elements)
    draft = draft.with_antisymmetric(of_rotors(draft.layout, momenta(draft.model, draft.bodies)), None)
    parts = cross_couplings(draft.model, draft.bodies, elements)
    if not parts:
        return draft
    rows = relative_rows(draft.structure, draft.layout, Rows.join([part.rows for part in parts]))
    circulatory, gyroscopic = (_form(rows, [getattr(part, key) for part in parts]) for key in ("stiffness", "damping"))
    coupled = {part.name: (part, rows[6 * k : 6 * k + 6]) for k, part in enumerate(parts)}
    return replace(draft, coupled=coupled).with_antisymmetric(gyroscopic, circulatory)


def of_rotors(layout: Layout, momenta: Sequence[tuple[int, Array]]) -> csr_matrix | None:
    """Return -[h]x over the rotations of bodies, (size, size), of the angular momenta h of rotors; None without any.

    Terms in the rotation of a body may cancel exactly; as sums over joint coordinates they would cancel to rounding.
    """
    from scipy.sparse import csr_matrix

    if not momenta:
        return None
    column = layout.displacement[[body for body, _ in momenta], 3:]
    form = -skew(np.array([momentum for _, momentum in momenta]))
    k, i, j = np.nonzero((column >= 0)[:, :, None] & (column >= 0)[:, None] & (form != 0.0))
    return csr_matrix((form[k, i, j], (column[k, i], column[k, j])), shape=(layout.size, layout.size))


def _form(rows: csr_matrix, matrices: Sequence[Array]) -> csr_matrix | None:
    """The antisymmetric part of R^T A R for the six rows R of each of some matrices A (6, 6); None if it is zero."""
    from scipy.sparse import block_diag

    half = block_diag([np.triu(0.5 * (matrix - matrix.T), 1) for matrix in matrices], format="csr")
    if not half.nnz:
        return None
    part = rows.T @ half @ rows
    return (part - part.T).tocsr()
