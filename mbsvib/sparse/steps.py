"""Steps of the assembly over sparse unknowns: each returns a draft with the terms of its parts.

Rows that more than two bodies share, inerters, rotors and cross-coupled elements, inputs and outputs.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.rows import Rows
from mbsvib.equations.ports import (
    feedthrough_of_ground,
    feedthrough_of_motions,
    force_weights,
    inertia_of_ground_motion,
    motion_weights,
)
from mbsvib.equations.spin_terms import check_spin, cross_couplings, momenta
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.kinematics.shared_rows import stack
from mbsvib.linalg.rotations import skew
from mbsvib.sparse.rows import relative_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.sparse.draft import SparseDraft
    from mbsvib.sparse.layout import Layout


def with_shared(draft: SparseDraft) -> SparseDraft:
    """Return a draft with mass and elastic rows that more than two bodies share."""
    shared, factor = draft.shared, draft.factor
    if shared is None:
        return draft
    from scipy.sparse import vstack

    if shared.mass is not None:
        mass_rows = shared.mass.of_sparse(relative_rows(draft.structure, draft.layout, shared.mass.rows))
        factor = vstack((factor, mass_rows)).tocsr()
    draft = replace(draft, body_factor=factor, factor=factor)
    if shared.elastic is None:
        return draft
    elastic = shared.elastic
    rows = elastic.composite.of_sparse(relative_rows(draft.structure, draft.layout, elastic.composite.rows))
    rows.eliminate_zeros()
    used = np.flatnonzero(np.diff(rows.indptr))
    number = {name: shared.first + i for i, name in enumerate(shared.names)}
    owner = np.array([number[name] for name in elastic.owner], dtype=np.intp)
    return draft.with_rows(rows[used], elastic.stiffness[used], elastic.damping[used], owner[used])


def with_inerters(draft: SparseDraft) -> SparseDraft:
    """Return a draft with the rows of inerters, times the square roots of their inertance, below those of bodies."""
    inertance = draft.springs.inertance
    if inertance is None:
        return draft
    from scipy.sparse import diags, vstack

    used = inertance.nonzero()[0]
    rows = diags(np.sqrt(inertance[used])) @ draft.elastic[used]
    return replace(draft, factor=vstack((draft.factor, rows)).tocsr())


def with_spin(draft: SparseDraft) -> SparseDraft:
    """Return a draft with the antisymmetric terms of rotors and elements."""
    if not draft.model.derived(has_antisymmetric_forces):
        return draft
    elements = tuple(draft.model.springs.values())
    check_spin(draft.model, draft.bodies, elements)
    draft = draft.with_antisymmetric(of_rotors(draft.layout, momenta(draft.model, draft.bodies)), None)
    expansion = draft.model.expansion
    if expansion is not None and expansion.gyroscopic:
        shared = stack(expansion.gyroscopic, draft.number)
        rows = shared.of_sparse(relative_rows(draft.structure, draft.layout, shared.rows))
        form = _form(rows, [np.array(part.gyroscopic) for part in expansion.gyroscopic])
        draft = draft.with_antisymmetric(form, None)
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


def with_ports(draft: SparseDraft) -> SparseDraft:
    """Return a draft with the rows of its inputs and outputs, and the feedthrough D, except forces in joints."""
    from scipy.sparse import csr_matrix

    port, springs, position = draft.port, draft.springs, draft.structure.position
    forces, u, y = len(port.force_inputs), len(port.input_units), len(port.output_units)
    inputs = placed(draft.port_rows[:forces], port.force_inputs, u)
    for column, source in port.base_motions:
        inertia = inertia_of_ground_motion(source.wrench, source.position, position, draft.inertia, draft.shared)
        inputs = inputs + placed(csr_matrix(-(draft.body_factor.T @ inertia)), [column], u)
    for column, _, which, weights in motion_weights(port, springs):
        inputs = inputs + placed(csr_matrix(weights) @ draft.elastic[which], [column], u)
    outputs = []
    for derivative in range(3):
        used = np.flatnonzero(port.derivative == derivative)
        outputs.append(placed(draft.port_rows[forces + used], port.motion_outputs[used], y))
    for row, order, which, weights in force_weights(port, springs):
        outputs[order] = outputs[order] + placed(csr_matrix(weights) @ draft.elastic[which], [row], y)
    names = list(draft.model.springs)
    for row, owner, wrench in port.force_outputs:
        if names[owner] in draft.coupled:
            part, rows = draft.coupled[names[owner]]
            for order, matrix in enumerate((part.stiffness, part.damping)):
                line = csr_matrix(matrix.T @ (part.axes @ wrench)) @ rows
                outputs[order] = outputs[order] + placed(line, [row], y)
    through = feedthrough_of_motions(port, springs, feedthrough_of_ground(port, position))
    return replace(draft, inputs=inputs, outputs=(outputs[0], outputs[1], outputs[2]), D=through)


def placed(rows: csr_matrix, at: Sequence[int] | Index, count: int) -> csr_matrix:
    """Return rows (n, size) in the places ``at`` (n,) of ``count`` rows."""
    from scipy.sparse import csr_matrix

    return csr_matrix((np.ones(len(at)), (at, np.arange(len(at)))), shape=(count, len(at))) @ rows
