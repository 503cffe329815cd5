"""Rows of inputs and outputs over sparse unknowns."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.base_motion import ground_motion, inertia_of_ground_motion

if TYPE_CHECKING:
    from mbsvib.sparse.draft import SparseDraft


def with_ports(draft: SparseDraft) -> SparseDraft:
    """Return a draft with the rows of its inputs and outputs, and the feedthrough D, except forces in joints."""
    from scipy.sparse import coo_matrix, csr_matrix

    port, springs, layout = draft.port, draft.springs, draft.layout
    forces = len(port.force_inputs)
    shape = (len(port.input_units), layout.size)
    entries = draft.port_rows[:forces].tocoo()
    inputs = coo_matrix((entries.data, (port.force_inputs[entries.row], entries.col)), shape=shape).tocsr()
    through = np.zeros((len(port.output_units), len(port.input_units)))
    position = draft.structure.position
    for column, source in port.base_motions:
        rows = inertia_of_ground_motion(source.wrench, source.position, position, draft.inertia, draft.shared)
        force = -(draft.body_factor.T @ rows)
        at = np.flatnonzero(force)
        inputs = inputs + csr_matrix((force[at], (np.full(len(at), column), at)), shape=shape)
        for row, output, point in port.inertial_outputs:
            through[row, column] = np.dot(output.wrench, ground_motion(source.wrench, source.position, point))
    shape = (len(port.output_units), layout.size)
    outputs = []
    entries = draft.port_rows[forces:].tocoo()
    for derivative in range(3):
        used = port.derivative[entries.row] == derivative
        rows = port.motion_outputs[entries.row[used]]
        outputs.append(csr_matrix((entries.data[used], (rows, entries.col[used])), shape=shape))
    coupled = {k: name for k, name in enumerate(draft.model.springs) if name in draft.coupled}
    for row, owner, wrench in port.force_outputs:
        which = np.flatnonzero(springs.owner == owner)
        factors = springs.unit[which] @ wrench
        for derivative, value in springs.weights:
            line = (csr_matrix(factors * value[which]) @ draft.elastic[which]).tocoo()
            outputs[derivative] = outputs[derivative] + csr_matrix(
                (line.data, (np.full(line.nnz, row), line.col)), shape=shape)  # fmt: skip
        if owner in coupled:
            part, rows = draft.coupled[coupled[owner]]
            for derivative, matrix in enumerate((part.stiffness, part.damping)):
                line = csr_matrix((matrix.T @ (part.axes @ wrench))[None]) @ rows
                outputs[derivative] = outputs[derivative] + csr_matrix(
                    (line.data, (np.full(line.nnz, row), line.indices)), shape=shape)  # fmt: skip
    return replace(draft, inputs=inputs, outputs=(outputs[0], outputs[1], outputs[2]), D=through)
