"""Assembly of many bodies: from a model to sparse rows and the tableau, in time proportional to the bodies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from typing import TypeVar

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.equations.locked_loops import check_loops
from mbsvib.equations.scene import with_maxwell_nodes
from mbsvib.equations.wrenches import is_loaded
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.sparse.constraints import Constraints, check_mobility
from mbsvib.sparse.draft import SparseDraft, first_draft, with_inerters, with_ports, with_shared, with_spin
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.layout import kinematics
from mbsvib.sparse.massless import separation
from mbsvib.sparse.massless_motions import massless_motions
from mbsvib.sparse.tableau import build
from mbsvib.sparse.tree import short_span

# In the order from leaves to root, the fill grows with the square of the number of multipliers of loops through a
# joint. If there are more than this on average (grids; a single spatial loop has 6), a general ordering fills less.
OVERLAP = 12.0
# Frames from a warning to the line that asks for linear equations.
STACK = 7

S = TypeVar("S", bound=SparseEquations)


def linearized(
    model: Mechanism, cut: Sequence[str] | None = None, removed: frozenset[str] = frozenset(),
    form: type[S] = SparseEquations,  # type: ignore[assignment]
) -> S:  # fmt: skip
    """Return the linear equations of motion about the model's pose, as sparse matrices of the class ``form``.

    ``cut``: joints at which loops are to be cut; default: by the smallest cumulative degree of freedom. ``removed``:
    bodies that were removed from the model but are still named by springs and ports: they are fixed.
    """
    nodes = with_maxwell_nodes(model)
    draft = first_draft(model, nodes, short_span(nodes, cut), removed)
    for step in STEPS:
        draft = step(draft)
    port = draft.port
    return form(
        name=model.name, joint_coordinates=draft.structure.names, inputs=tuple(model.inputs),
        input_units=port.input_units, outputs=tuple(model.outputs), output_units=port.output_units,
        bodies=draft.topology.bodies, springs=draft.names, topology=draft.topology, structure=draft.structure,
        constraints=draft.closure, layout=draft.layout, tableau=draft.tableau, elastic_rows=draft.rows,
        loop_rows=draft.loop_rows, inertia_factor=draft.factor, row_stiffness=draft.k, row_damping=draft.c,
        row_owner=draft.owner, input_rows=draft.inputs, output_rows=draft.outputs, D=draft.D, model=copy(model),
        loading=() if draft.loading is None else draft.loading.names, undetermined=draft.undetermined,
        circulatory=draft.circulatory, gyroscopic=draft.gyroscopic, separation=draft.separation,
    )  # fmt: skip


def _loads(draft: SparseDraft) -> SparseDraft:
    """Add geometric stiffness."""
    if not is_loaded(draft.model):
        return draft
    from mbsvib.sparse.loads import with_loads

    return with_loads(draft)


def _tableau(draft: SparseDraft) -> SparseDraft:
    """Put all rows into the tableau, and check that the degrees of freedom are those of neighbouring poses."""
    loop_rows = draft.closure.over_unknowns(draft.structure, draft.layout)
    tableau = build(
        draft.structure, draft.layout, kinematics(draft.structure, draft.layout), draft.rows, draft.k, draft.c,
        (draft.factor.T @ draft.factor).tocsr(), loop_rows, draft.closure.translational, _ordering(draft.closure),
        draft.circulatory, draft.gyroscopic,
    )  # fmt: skip
    check_loops(draft.model, draft.closure.groups, draft.structure.names, STACK)
    check_mobility(draft.topology, draft.structure, draft.closure, draft.layout, tableau)
    return replace(draft, loop_rows=loop_rows, tableau=tableau)


def _joint_forces(draft: SparseDraft) -> SparseDraft:
    """Add rows of outputs that are forces in joints, or sums of all forces on a body."""
    if not draft.port.wrench_outputs:
        return draft
    from mbsvib.sparse.forces import with_joint_forces

    return with_joint_forces(draft)


def _massless(draft: SparseDraft) -> SparseDraft:
    """Classify massless motions."""
    motions = massless_motions(draft.structure, draft.layout, draft.inertia, draft.shared,
                               draft.factor, draft.loop_rows)  # fmt: skip
    if motions is None:
        return draft
    separated = separation(
        motions, draft.structure, draft.layout, draft.topology.bodies, (draft.rows, draft.k, draft.c),
        (draft.circulatory, draft.gyroscopic), draft.inputs, draft.outputs,
        (tuple(draft.model.outputs), tuple(draft.model.inputs)),
    )  # fmt: skip
    return replace(draft, separation=separated, D=draft.D + separated.at_once)


# Contributions of other parts than bodies and connections, in this order; a step without such parts returns its draft.
STEPS: tuple[Callable[[SparseDraft], SparseDraft], ...] = (
    with_shared, with_inerters, _loads, with_spin, _tableau, with_ports, _joint_forces, _massless,
)  # fmt: skip


def with_stiffness(system: SparseEquations, stiffness: Array) -> SparseEquations:
    """Return a system with other stiffness (rows,) in its elastic rows, and the same unknowns."""
    factor, translational = system.inertia_factor, system.constraints.translational
    tableau = build(
        system.structure, system.layout, kinematics(system.structure, system.layout), system.elastic_rows, stiffness,
        system.row_damping, (factor.T @ factor).tocsr(), system.loop_rows, translational, system.tableau.ordering,
    )  # fmt: skip
    return replace(system, row_stiffness=stiffness, tableau=tableau)


def _ordering(closure: Constraints) -> str:
    row, body = closure.path_joints
    covered = len(np.unique(body))
    return "NATURAL" if not covered or len(row) / covered < OVERLAP else "COLAMD"
