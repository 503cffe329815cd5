"""Assembly of many bodies: from a model to sparse rows and the tableau, in time proportional to the bodies."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.elements import Bushing
from mbsvib.elements.families import connection_rows
from mbsvib.equations.inertia import spatial_inertia
from mbsvib.equations.maxwell_nodes import with_maxwell_nodes
from mbsvib.equations.ports import ports
from mbsvib.equations.spin_terms import spin_contribution
from mbsvib.equations.wrenches import is_loaded
from mbsvib.kinematics.shared_rows import shared_rows
from mbsvib.sparse.constraints import constraints
from mbsvib.sparse.couplers import coupled
from mbsvib.sparse.cuts import short_span
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.layout import kinematics, layout
from mbsvib.sparse.massless import separation
from mbsvib.sparse.massless_motions import massless_motions
from mbsvib.sparse.mobility import check_mobility
from mbsvib.sparse.rows import relative_rows
from mbsvib.sparse.self_stress import regions
from mbsvib.sparse.spin_forces import spin_forces
from mbsvib.sparse.statement import antisymmetric, unknown_rows
from mbsvib.sparse.tableau import build
from mbsvib.sparse.tree import tree

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.element_rows import ElementRows
    from mbsvib.equations.inertia import SpatialInertia
    from mbsvib.equations.ports import Ports
    from mbsvib.equations.self_stress import Undetermined
    from mbsvib.kinematics.shared_rows import Shared
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.sparse.constraints import Constraints
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.loads import Geometric
    from mbsvib.sparse.spin_forces import SpinForces
    from mbsvib.sparse.tree import Tree

# In the order from leaves to root, the fill grows with the square of the number of multipliers of loops through a
# joint. If there are more than this on average (grids; a single spatial loop has 6), a general ordering fills less.
OVERLAP = 12.0

S = TypeVar("S", bound=SparseEquations)


def linearized(
    model: Mechanism, cut: Sequence[str] | None = None, gone: frozenset[str] = frozenset(),
    form: type[S] = SparseEquations,  # type: ignore[assignment]
) -> S:  # fmt: skip
    """Return the linear equations of motion about the model's pose, as sparse matrices.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    cut : sequence of str, optional
        Joints at which loops are to be cut; default: chosen by the smallest cumulative degree of freedom.
    gone : frozenset of str, optional
        Bodies that are no longer in the model, though springs and ports still name them: they are fixed.
    form : type
        The class of the equations.

    Returns
    -------
    SparseEquations
        Rows, the tableau and names.

    Raises
    ------
    ModelError
        If a name is unknown or a cut leaves bodies hanging.
    SingularPoseError
        If the number of degrees of freedom is not defined in this pose.
    """
    nodes = with_maxwell_nodes(model)
    topology = short_span(nodes, cut)
    bodies = list(nodes.bodies.values())
    number = {name: i for i, name in enumerate(topology.bodies)}
    number |= dict.fromkeys(("ground", *gone), len(bodies))
    structure = tree(topology, bodies)
    couplers = coupled(tuple(model.couplers.values()), topology, bodies, number, structure)
    closure = constraints(topology, bodies, number, structure, couplers)
    unknowns = layout(structure, int(closure.kept.sum()), closure.touched)
    springs = connection_rows(model.springs.values(), number)
    elastic = relative_rows(structure, unknowns, springs.rows)
    acting = np.flatnonzero(np.diff(elastic.indptr))
    springs, elastic = springs.only(acting), elastic[acting]
    inertia = spatial_inertia(bodies)
    of_bodies = inertia_rows(unknowns, inertia)
    rows, k, c, owner = elastic, springs.stiffness, springs.damping, springs.owner
    shared = None if model.pieces is None else shared_rows(model.pieces, number, len(model.springs))
    if shared is not None:
        of_bodies, rows, k, c, owner = _with_shared(shared, structure, unknowns, of_bodies, rows, k, c, owner)
    factor = _with_inerters(of_bodies, springs, elastic)
    names = (*model.springs, *(() if shared is None else shared.names))
    port = ports(model, bodies, number)
    loading: tuple[str, ...] = ()
    undetermined: tuple[Undetermined, ...] = ()
    geometric_part = None
    shared_by = regions(topology, structure, closure, number, [k for _, kind, k, _ in port.wrench_outputs
                                                               if kind == "joint"])  # fmt: skip
    if is_loaded(model):
        from mbsvib.sparse.loads import geometric

        geometric_part = geometric(nodes, topology, structure, unknowns, closure, number, springs,
                                   dict.fromkeys(shared_by.values()))  # fmt: skip
        rows, k, c, owner = _with_loads(geometric_part, rows, k, c, owner, len(names))
        loading = geometric_part.names
    circulatory = None if geometric_part is None else geometric_part.circulatory
    gyroscopic, spins = None, spin_forces(model, bodies, structure, unknowns)
    if spins is not None:
        spin = spin_contribution(model, bodies, tuple(model.springs.values()))
        spun = unknown_rows(spin, structure, unknowns)
        gyroscopic, turning = antisymmetric(spin.gyroscopic, spun), antisymmetric(spin.circulatory, spun)
        if turning is not None:
            circulatory = turning if circulatory is None else circulatory + turning
    loop_rows, moving = closure.over_unknowns(structure, unknowns), kinematics(structure, unknowns)
    tableau = build(
        structure, unknowns, moving, rows, k, c, (factor.T @ factor).tocsr(), loop_rows,
        closure.slides, _ordering(closure), circulatory, gyroscopic,
    )  # fmt: skip
    check_mobility(structure, closure, unknowns, tableau)
    seen = relative_rows(structure, unknowns, port.rows)
    inputs, outputs, through = _port_rows(port, seen, springs, elastic, of_bodies, inertia, unknowns,
                                          structure.position, shared)  # fmt: skip
    if spins is not None:
        outputs = (_with_spin(port, model, spins, outputs[0]), *outputs[1:])
    if port.wrench_outputs:
        from mbsvib.sparse.forces import ForceSums

        sums = ForceSums(topology, structure, unknowns, closure, number, springs, elastic, inertia, of_bodies, port,
                         seen[: len(port.force_inputs)], shared, geometric_part, shared_by, spins)  # fmt: skip
        more, straight = sums.outputs()
        undetermined = sums.undetermined(tuple(model.outputs))
        outputs = (outputs[0] + more[0], outputs[1] + more[1], outputs[2] + more[2])
        through = through + straight
    separated = None
    light = massless_motions(structure, unknowns, inertia, shared, moving, factor, loop_rows)
    if light is not None:
        separated = separation(
            light, structure, unknowns, topology.bodies, (rows, k, c), (circulatory, gyroscopic), inputs, outputs,
            (tuple(model.outputs), tuple(model.inputs)),
        )  # fmt: skip
        through = through + separated.at_once
    return form(
        name=model.name, joint_coordinates=structure.names, inputs=tuple(model.inputs), input_units=port.input_units,
        outputs=tuple(model.outputs), output_units=port.output_units, bodies=topology.bodies,
        springs=names, topology=topology,
        structure=structure, constraints=closure, layout=unknowns,
        tableau=tableau, elastic_rows=rows, loop_rows=loop_rows, inertia_factor=factor, stiffness=k, damping=c,
        row_owner=owner, input_rows=inputs, output_rows=outputs, D=through,
        model=copy(model), loading=loading, undetermined=undetermined, circulatory=circulatory,
        gyroscopic=gyroscopic, separation=separated,
    )  # fmt: skip


def _with_inerters(factor: csr_matrix, springs: ElementRows, elastic: csr_matrix) -> csr_matrix:
    """Append the rows of inerters, times the roots of their inertance, to those of bodies."""
    if springs.inertance is None:
        return factor
    from scipy.sparse import diags, vstack

    acts = springs.inertance.nonzero()[0]
    return vstack((factor, diags(np.sqrt(springs.inertance[acts])) @ elastic[acts])).tocsr()


def _with_shared(
    shared: Shared, structure: Tree, layout: Layout, factor: csr_matrix, rows: csr_matrix, k: Array, c: Array,
    owner: Index,
) -> tuple[csr_matrix, csr_matrix, Array, Array, Index]:  # fmt: skip
    """Append mass and elastic rows that more than two bodies share to those of bodies and springs."""
    from scipy.sparse import vstack

    if shared.mass is not None:
        factor = vstack((factor, shared.mass.of_sparse(relative_rows(structure, layout, shared.mass.rows)))).tocsr()
    if shared.elastic is not None:
        blend = shared.elastic
        more = blend.composite.of_sparse(relative_rows(structure, layout, blend.composite.rows))
        more.eliminate_zeros()
        acts = np.flatnonzero(np.diff(more.indptr))
        number = {name: shared.first + i for i, name in enumerate(shared.names)}
        own = np.array([number[name] for name in blend.owner], dtype=np.intp)
        rows = vstack((rows, more[acts])).tocsr()
        k, c = np.concatenate((k, blend.stiffness[acts])), np.concatenate((c, blend.damping[acts]))
        owner = np.concatenate((owner, own[acts]))
    return factor, rows, k, c, owner


def _with_loads(
    geometric_part: Geometric, rows: csr_matrix, k: Array, c: Array, owner: Index, first: int
) -> tuple[csr_matrix, Array, Array, Index]:
    """Append rows of geometric stiffness, without damping, to the elastic ones; ``first`` is their first owner."""
    from scipy.sparse import vstack

    added = geometric_part.owner
    return (vstack((rows, geometric_part.rows)).tocsr(), np.concatenate((k, geometric_part.stiffness)),
            np.concatenate((c, np.zeros(len(added)))), np.concatenate((owner, first + added)))  # fmt: skip


def _with_spin(port: Ports, model: Mechanism, spins: SpinForces, rows: csr_matrix) -> csr_matrix:
    """Rows of outputs, with the contributions of rotating dampers to the forces in their bushings."""
    from scipy.sparse import csr_matrix

    elements = list(model.springs.values())
    for row, owner, wrench in port.force_outputs:
        spring = elements[owner]
        if isinstance(spring, Bushing):
            axes = np.array(spring.orientation)
            line = spins.in_bushing(spring.name, np.concatenate((axes @ wrench[:3], axes @ wrench[3:])))
            if line is not None:
                at = np.flatnonzero(line)
                rows = rows + csr_matrix((line[at], (np.full(len(at), row), at)), shape=rows.shape)
    return rows


def with_stiffness(system: SparseEquations, stiffness: Array) -> SparseEquations:
    """Return a system with other stiffness in its elastic rows.

    Parameters
    ----------
    system : SparseEquations
        The system.
    stiffness : array, shape (rows,)
        One value for each elastic row.

    Returns
    -------
    SparseEquations
        The same unknowns and rows.
    """
    factor, slides = system.inertia_factor, system.constraints.slides
    tableau = build(
        system.structure, system.layout, kinematics(system.structure, system.layout), system.elastic_rows, stiffness,
        system.damping, (factor.T @ factor).tocsr(), system.loop_rows, slides, system.tableau.ordering,
    )  # fmt: skip
    return replace(system, stiffness=stiffness, tableau=tableau)


def _ordering(closure: Constraints) -> str:
    row, body = closure.touched
    covered = len(np.unique(body))
    return "NATURAL" if not covered or len(row) / covered < OVERLAP else "COLAMD"


def inertia_rows(layout: Layout, inertia: SpatialInertia) -> csr_matrix:
    """Return W of M = W^T W over the unknowns: three rows for the translation of each body and three for its rotation.

    Parameters
    ----------
    layout : Layout
        Positions of the displacements among the unknowns.
    inertia : SpatialInertia
        Square roots of the bodies' inertia.

    Returns
    -------
    csr_matrix, shape (6 bodies, size)
        The factor.
    """
    from scipy.sparse import csr_matrix

    n = len(inertia.linear)
    root = np.zeros((n, 6, 6))
    root[:, [0, 1, 2], [0, 1, 2]] = inertia.linear[:, None]
    root[:, 3:, 3:] = inertia.angular
    body, row, direction = np.nonzero((root != 0.0) & (layout.displacement >= 0)[:, None])
    return csr_matrix((root[body, row, direction], (6 * body + row, layout.displacement[body, direction])),
                      shape=(6 * n, layout.size))  # fmt: skip


def _port_rows(
    port: Ports, seen: csr_matrix, springs: ElementRows, elastic: csr_matrix, factor: csr_matrix,
    inertia: SpatialInertia, layout: Layout, position: Array, shared: Shared | None = None,
) -> tuple[csr_matrix, tuple[csr_matrix, csr_matrix, csr_matrix], Array]:  # fmt: skip
    """Rows of the inputs, rows of the outputs by derivative, and the feedthrough D."""
    from scipy.sparse import coo_matrix, csr_matrix

    forces = len(port.force_inputs)
    shape = (len(port.input_units), layout.size)
    entries = seen[:forces].tocoo()
    inputs = coo_matrix((entries.data, (port.force_inputs[entries.row], entries.col)), shape=shape).tocsr()
    through = np.zeros((len(port.output_units), len(port.input_units)))
    for column, motion in port.base_motions:
        linear, angular = np.array(motion.wrench[:3]), np.array(motion.wrench[3:])
        base_acceleration = np.empty((len(position), 6, 1))
        base_acceleration[:, :3, 0] = np.cross(angular, position - motion.position) + linear
        base_acceleration[:, 3:, 0] = angular
        moved = inertia.factor(base_acceleration)
        if shared is not None:
            moved = shared.carried(moved, linear, angular, np.array(motion.position))
        force = -(factor.T @ moved[:, 0])
        at = np.flatnonzero(force)
        inputs = inputs + csr_matrix((force[at], (np.full(len(at), column), at)), shape=shape)
        for row, output, point in port.inertial_outputs:
            here = np.cross(angular, np.subtract(point, motion.position)) + linear
            through[row, column] = np.dot(output.wrench, (*here, *angular))
    shape = (len(port.output_units), layout.size)
    outputs = []
    entries = seen[forces:].tocoo()
    for derivative in range(3):
        used = port.derivative[entries.row] == derivative
        rows = port.motion_outputs[entries.row[used]]
        outputs.append(csr_matrix((entries.data[used], (rows, entries.col[used])), shape=shape))
    for row, owner, wrench in port.force_outputs:
        own = np.flatnonzero(springs.owner == owner)
        share = springs.unit[own] @ wrench
        for derivative, value in springs.weights:
            line = (csr_matrix(share * value[own]) @ elastic[own]).tocoo()
            outputs[derivative] = outputs[derivative] + csr_matrix(
                (line.data, (np.full(line.nnz, row), line.col)), shape=shape)  # fmt: skip
    return inputs, (outputs[0], outputs[1], outputs[2]), through
