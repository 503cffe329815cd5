"""Drafts: sparse rows of a mechanism over its unknowns, with its equations as far as they are assembled; and steps of
the assembly, each of which returns a draft with the terms of its parts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import block_diag, csr_matrix, diags, vstack

from mbsvib.common.arrays import Array, Index
from mbsvib.elements import Body
from mbsvib.elements.families import connection_rows
from mbsvib.elements.rows import ElementRows, Rows
from mbsvib.equations.inertia import SpatialInertia, spatial_inertia
from mbsvib.equations.ports import (
    Ports,
    feedthrough_of_ground,
    feedthrough_of_motions,
    force_weights,
    inertia_of_ground_motion,
    motion_weights,
    ports,
)
from mbsvib.equations.self_stress import Undetermined
from mbsvib.equations.spin_terms import CrossCoupling, check_spin, cross_couplings, momenta
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.kinematics.shared_rows import Shared, shared_rows, stack
from mbsvib.linalg.rotations import skew
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import Topology
from mbsvib.sparse.constraints import Constraints, constraints
from mbsvib.sparse.layout import Layout, relative_rows
from mbsvib.sparse.layout import layout as unknowns_of
from mbsvib.sparse.massless import SparseSeparation
from mbsvib.sparse.self_stress import Region, regions
from mbsvib.sparse.tableau import Tableau
from mbsvib.sparse.tree import Tree, tree

if TYPE_CHECKING:
    from mbsvib.sparse.geometric_stiffness import Loading


_LATER: Any = None


@dataclass(frozen=True, slots=True)
class SparseDraft:
    """Incomplete sparse equations: each step of the assembly returns a draft with the contribution of its parts.

    ``nodes`` is the ``model`` with the nodes of its Maxwell elements. ``springs`` are the rows of connections,
    ``elastic`` these rows over the unknowns; ``rows`` with stiffness ``k``, damping ``c`` and ``owner`` are all elastic
    rows. ``body_factor`` are the inertia rows of bodies and shared mass, ``factor`` includes those of inerters.
    ``port_rows`` are the relative displacements of ``port``, ``regions`` the loops with redundant constraints that
    contain joints of force outputs. ``coupled`` are the cross-coupled elements by name, with their six rows. Fields of
    later steps are None.
    """

    model: Mechanism
    nodes: Mechanism
    topology: Topology
    bodies: Sequence[Body]
    number: Mapping[str, int]
    structure: Tree
    closure: Constraints
    layout: Layout
    springs: ElementRows
    elastic: csr_matrix
    rows: csr_matrix
    k: Array
    c: Array
    owner: Index
    inertia: SpatialInertia
    body_factor: csr_matrix
    factor: csr_matrix
    shared: Shared | None
    port: Ports
    port_rows: csr_matrix
    regions: Mapping[int, Region]
    names: tuple[str, ...]
    loading: Loading | None = None
    coupled: Mapping[str, tuple[CrossCoupling, csr_matrix]] = field(default_factory=dict)
    circulatory: csr_matrix | None = None
    gyroscopic: csr_matrix | None = None
    loop_rows: csr_matrix = _LATER
    tableau: Tableau = _LATER
    inputs: csr_matrix = _LATER
    outputs: tuple[csr_matrix, csr_matrix, csr_matrix] = _LATER
    D: Array = _LATER
    undetermined: tuple[Undetermined, ...] = ()
    separation: SparseSeparation | None = None

    def over(self, tree: Tree, layout: Layout) -> SparseDraft:
        """Return the draft of bodies, connections and ports over the unknowns of a tree and layout."""
        springs, factor = self.springs, inertia_rows(layout, self.inertia)
        elastic = relative_rows(tree, layout, springs.rows)
        return replace(
            self, structure=tree, layout=layout, elastic=elastic, rows=elastic, k=springs.stiffness, c=springs.damping,
            owner=springs.owner, body_factor=factor, factor=factor,
            port_rows=relative_rows(tree, layout, self.port.rows), gyroscopic=None, circulatory=None,
        )  # fmt: skip

    def with_rows(self, rows: csr_matrix, k: Array, c: Array, owner: Index) -> SparseDraft:
        """Return the draft with more elastic rows."""
        return replace(
            self, rows=vstack((self.rows, rows)).tocsr(), k=np.concatenate((self.k, k)),
            c=np.concatenate((self.c, c)), owner=np.concatenate((self.owner, owner)),
        )  # fmt: skip

    def with_antisymmetric(self, gyroscopic: csr_matrix | None, circulatory: csr_matrix | None) -> SparseDraft:
        """Return the draft with antisymmetric matrices or None added to C and to K."""
        return replace(self, gyroscopic=_sum(self.gyroscopic, gyroscopic),
                       circulatory=_sum(self.circulatory, circulatory))  # fmt: skip


def _sum(a: csr_matrix | None, b: csr_matrix | None) -> csr_matrix | None:
    return a if b is None else b if a is None else a + b


def first_draft(model: Mechanism, nodes: Mechanism, topology: Topology, removed: frozenset[str]) -> SparseDraft:
    """Return the rows of bodies, joints and connections of an expanded model, of which ``nodes`` has all Maxwell nodes.

    ``removed`` bodies are not in the model but still named by springs and ports: they are fixed.
    """
    bodies = list(nodes.bodies.values())
    number = topology.body_numbers | dict.fromkeys(removed, len(bodies))
    structure = tree(topology, bodies)
    closure = constraints(topology, bodies, number, structure, tuple(model.couplers.values()))
    layout = unknowns_of(structure, int(closure.is_independent.sum()), closure.path_joints)
    springs = connection_rows(model.springs.values(), number)
    springs = springs.take(np.flatnonzero(np.diff(relative_rows(structure, layout, springs.rows).indptr)))
    port = ports(model, bodies, number)
    shared = None if model.expansion is None else shared_rows(model.expansion, number, len(model.springs))
    output_joints = [joint for _, kind, joint, _ in port.wrench_outputs if kind == "joint"]
    draft = SparseDraft(
        model, nodes, topology, bodies, number, structure, closure, layout, springs, _LATER, _LATER, _LATER, _LATER,
        _LATER, spatial_inertia(bodies), _LATER, _LATER, shared, port, _LATER,
        regions(topology, structure, closure, number, output_joints),
        (*model.springs, *(() if shared is None else shared.names)),
    )  # fmt: skip
    return draft.over(structure, layout)


def inertia_rows(layout: Layout, inertia: SpatialInertia) -> csr_matrix:
    """Return W (6 bodies, size) of M = W^T W: three rows for the translation of each body and three for its rotation.
    """
    n = len(inertia.linear)
    root = np.zeros((n, 6, 6))
    root[:, [0, 1, 2], [0, 1, 2]] = inertia.linear[:, None]
    root[:, 3:, 3:] = inertia.angular
    body, row, direction = np.nonzero((root != 0.0) & (layout.displacement >= 0)[:, None])
    return csr_matrix((root[body, row, direction], (6 * body + row, layout.displacement[body, direction])),
                      shape=(6 * n, layout.size))  # fmt: skip


def with_shared(draft: SparseDraft) -> SparseDraft:
    """Return a draft with mass and elastic rows that more than two bodies share."""
    shared, factor = draft.shared, draft.factor
    if shared is None:
        return draft
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
    if not momenta:
        return None
    column = layout.displacement[[body for body, _ in momenta], 3:]
    form = -skew(np.array([momentum for _, momentum in momenta]))
    k, i, j = np.nonzero((column >= 0)[:, :, None] & (column >= 0)[:, None] & (form != 0.0))
    return csr_matrix((form[k, i, j], (column[k, i], column[k, j])), shape=(layout.size, layout.size))


def _form(rows: csr_matrix, matrices: Sequence[Array]) -> csr_matrix | None:
    """The antisymmetric part of R^T A R for the six rows R of each of some matrices A (6, 6); None if it is zero."""
    half = block_diag([csr_matrix(np.triu(0.5 * (matrix - matrix.T), 1)) for matrix in matrices], format="csr")
    if not half.nnz:
        return None
    part = rows.T @ half @ rows
    return (part - part.T).tocsr()


def with_ports(draft: SparseDraft) -> SparseDraft:
    """Return a draft with the rows of its inputs and outputs, and the feedthrough D, except forces in joints."""
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
    return csr_matrix((np.ones(len(at)), (at, np.arange(len(at)))), shape=(count, len(at))) @ rows
