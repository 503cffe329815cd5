"""Assembly of many bodies: from a model to sparse rows and the tableau, in time proportional to the bodies."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.equations.locked_loops import check_loops
from mbsvib.equations.maxwell_nodes import with_maxwell_nodes
from mbsvib.equations.spin_terms import spin_contribution
from mbsvib.equations.wrenches import is_loaded
from mbsvib.sparse.cuts import short_span
from mbsvib.sparse.draft import first_draft
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.layout import kinematics
from mbsvib.sparse.massless import separation
from mbsvib.sparse.massless_motions import massless_motions
from mbsvib.sparse.mobility import check_mobility
from mbsvib.sparse.ports import with_ports
from mbsvib.sparse.rows import relative_rows
from mbsvib.sparse.spin_forces import spin_forces
from mbsvib.sparse.statement import antisymmetric, unknown_rows
from mbsvib.sparse.tableau import build

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.sparse.constraints import Constraints
    from mbsvib.sparse.draft import SparseDraft

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
        loading=() if draft.geometric is None else draft.geometric.names, undetermined=draft.undetermined,
        circulatory=draft.circulatory, gyroscopic=draft.gyroscopic, separation=draft.separation,
    )  # fmt: skip


def _shared(draft: SparseDraft) -> SparseDraft:
    """Add mass and elastic rows that more than two bodies share."""
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


def _inerters(draft: SparseDraft) -> SparseDraft:
    """Append the rows of inerters, times the square roots of their inertance, to those of bodies."""
    inertance = draft.springs.inertance
    if inertance is None:
        return draft
    from scipy.sparse import diags, vstack

    used = inertance.nonzero()[0]
    rows = diags(np.sqrt(inertance[used])) @ draft.elastic[used]
    return replace(draft, factor=vstack((draft.factor, rows)).tocsr())


def _loads(draft: SparseDraft) -> SparseDraft:
    """Add geometric stiffness."""
    if not is_loaded(draft.model):
        return draft
    from mbsvib.sparse.loads import geometric

    part = geometric(draft.nodes, draft.topology, draft.structure, draft.layout, draft.closure, draft.number,
                     draft.springs, dict.fromkeys(draft.regions.values()))  # fmt: skip
    draft = draft.with_rows(part.rows, part.stiffness, np.zeros(len(part.owner)), len(draft.names) + part.owner)
    return replace(draft, geometric=part).with_antisymmetric(None, part.circulatory)


def _spin(draft: SparseDraft) -> SparseDraft:
    """Add gyroscopic and circulatory terms of rotors, rotating dampers and cross-coupling."""
    spins = spin_forces(draft.model, draft.bodies, draft.structure, draft.layout)
    if spins is None:
        return draft
    part = spin_contribution(draft.model, draft.bodies, tuple(draft.model.springs.values()))
    rows = unknown_rows(part, draft.structure, draft.layout)
    return replace(draft, spins=spins).with_antisymmetric(antisymmetric(part.gyroscopic, rows),
                                                          antisymmetric(part.circulatory, rows))  # fmt: skip


def _tableau(draft: SparseDraft) -> SparseDraft:
    """Put all rows into the tableau, and check that the degrees of freedom are those of neighbouring poses."""
    loop_rows = draft.closure.over_unknowns(draft.structure, draft.layout)
    tableau = build(
        draft.structure, draft.layout, draft.kinematics, draft.rows, draft.k, draft.c,
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
    from mbsvib.sparse.forces import ForceSums

    sums = ForceSums.of(draft)
    force_rows, feedthrough = sums.rows_of_outputs()
    q, v, a = (rows + more for rows, more in zip(draft.outputs, force_rows, strict=True))
    return replace(draft, outputs=(q, v, a), D=draft.D + feedthrough,
                   undetermined=sums.undetermined_outputs(tuple(draft.model.outputs)))  # fmt: skip


def _massless(draft: SparseDraft) -> SparseDraft:
    """Classify massless motions."""
    motions = massless_motions(draft.structure, draft.layout, draft.inertia, draft.shared, draft.kinematics,
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
    _shared, _inerters, _loads, _spin, _tableau, with_ports, _joint_forces, _massless,
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
