"""Drafts: sparse rows of a mechanism over its unknowns, with its equations as far as they are assembled."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.families import connection_rows
from mbsvib.equations.inertia import spatial_inertia
from mbsvib.equations.ports import ports
from mbsvib.kinematics.shared_rows import shared_rows
from mbsvib.sparse.constraints import constraints
from mbsvib.sparse.layout import layout as unknowns_of
from mbsvib.sparse.rows import relative_rows
from mbsvib.sparse.self_stress import regions
from mbsvib.sparse.tree import tree

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Body
    from mbsvib.elements.rows import ElementRows
    from mbsvib.equations.inertia import SpatialInertia
    from mbsvib.equations.ports import Ports
    from mbsvib.equations.self_stress import Undetermined
    from mbsvib.equations.spin_terms import CrossCoupling
    from mbsvib.kinematics.shared_rows import Shared
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.mechanism.topology import Topology
    from mbsvib.sparse.constraints import Constraints
    from mbsvib.sparse.geometric_stiffness import Loading
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.massless import SparseSeparation
    from mbsvib.sparse.self_stress import Region
    from mbsvib.sparse.tableau import Tableau
    from mbsvib.sparse.tree import Tree

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
        from scipy.sparse import vstack

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
    from scipy.sparse import csr_matrix

    n = len(inertia.linear)
    root = np.zeros((n, 6, 6))
    root[:, [0, 1, 2], [0, 1, 2]] = inertia.linear[:, None]
    root[:, 3:, 3:] = inertia.angular
    body, row, direction = np.nonzero((root != 0.0) & (layout.displacement >= 0)[:, None])
    return csr_matrix((root[body, row, direction], (6 * body + row, layout.displacement[body, direction])),
                      shape=(6 * n, layout.size))  # fmt: skip
