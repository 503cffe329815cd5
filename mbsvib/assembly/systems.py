"""Equations of parts that are joined at ports, of second order and minimal.

Parts side by side have block diagonal M, C, K and factors. With the relative displacements L q of two ports and the
forces f between them, M q'' + C q' + K q = B u + L^T f. A spring-damper has f = -(k L q + c L q'); rigid connections
have L q = 0, so that q = N z with as many coordinates fewer as rows of L are independent, and f follows from the
equations of the dependent coordinates.

Source: de Klerk, Rixen & Voormeeren, AIAA J. 46 (2008) 1169, primal assembly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from mbsvib.assembly.connections import WHO, Part
from mbsvib.common.arrays import Array, Index
from mbsvib.elements.ports import BaseMotion
from mbsvib.equations.equations import Connection, Equations, Provenance
from mbsvib.equations.unresisted_motion import without_free_motions
from mbsvib.errors import ModelError, SingularPoseError
from mbsvib.kinematics.loops import Reduction
from mbsvib.linalg.products import eigenrows, gram_matrix, weighted_gram
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import DEPENDENT_ROWS, RANK_GAP, TIE_BREAK, ZERO_SUM
from mbsvib.mechanism.topology import Topology

# Displacements and forces of a port are those of one point up to this share, of files with nine digits or more.
COLLOCATED = 1e-9


class Ends(NamedTuple):
    """Numbers of the outputs and inputs of the two ports of a connection, among those of all parts."""

    connection: Connection
    outputs: tuple[list[int], list[int]]
    inputs: tuple[list[int], list[int]]

    @property
    def name(self) -> str:
        """What its forces and energies are called."""
        return f"{self.connection.first} to {self.connection.second}"

    def relative(self, rows: Array) -> Array:
        """Return rows of the second port less those of the first, of rows of all outputs."""
        return np.asarray(rows[self.outputs[1]] - rows[self.outputs[0]])

    def acting(self, columns: Array) -> Array:
        """Return columns of forces on the second port and their reactions on the first, of columns of all inputs."""
        return np.asarray(columns[:, self.inputs[1]] - columns[:, self.inputs[0]])


def ends_of(parts: Sequence[Part], connections: Sequence[Connection]) -> list[Ends]:
    """Return the channels of connections among those of all parts, one part after the other."""
    starts, at = {}, [0, 0]
    for part in parts:
        starts[part.name] = tuple(at)
        at = [at[0] + len(part.linear.outputs), at[1] + len(part.linear.inputs)]
    result = []
    for connection in connections:
        channels = []
        for name in (connection.first, connection.second):
            part = max((p for p in parts if name.startswith(f"{p.name}.")), key=lambda p: len(p.name))
            own = part.channels(name.removeprefix(f"{part.name}."), connection.directions)
            channels.append(tuple([k + start for k in numbers]
                                  for numbers, start in zip(own, starts[part.name], strict=True)))  # fmt: skip
        (out1, in1), (out2, in2) = channels
        result.append(Ends(connection, (out1, out2), (in1, in2)))
    return result


def assembled_system(parts: Sequence[Part], connections: Sequence[Connection], name: str) -> Any:
    """Return the equations of parts that are joined."""
    shared = _base_motions(parts)
    systems = [part.linear for part in parts]
    ends = ends_of(parts, connections)
    whole = _side_by_side(parts, name, connections)
    for one in ends:
        _check_port(whole, one)
    rigid = [one for one in ends if one.connection.stiffness is None]
    soft = [one for one in ends if one.connection.stiffness is not None]
    if rigid and whole.massless:
        part = next(part for part, system in zip(parts, systems, strict=True) if system.massless)
        raise ModelError(f"{WHO}: '{part.name}' has motions without mass, and rigid connections would change which "
                         f"these are; give the bodies that move there a mass, or join it by a stiffness.",
                         element=part.name)  # fmt: skip
    if rigid:
        whole = _joined_rigidly(whole, rigid)
    for one in soft:
        whole = _with_spring(whole, one)
    return _with_shared_inputs(whole, parts, shared)


def _side_by_side(parts: Sequence[Part], name: str, connections: Sequence[Connection]) -> Any:
    """The equations of all parts without connections, with the names PART.NAME."""
    systems: list[Equations] = [part.linear for part in parts]

    def named(field: str) -> tuple[str, ...]:
        return tuple([f"{part.name}.{one}" for part in parts for one in getattr(part.linear, field)])

    def units(field: str) -> tuple[str, ...]:
        return sum((getattr(system, field) for system in systems), ())

    def blocks(field: str) -> Array:
        return np.asarray(block_diag(*(getattr(system, field) for system in systems)))

    def optional(field: str) -> Array | None:
        known = [getattr(system, field) for system in systems]
        if all(one is None for one in known):
            return None
        return np.asarray(block_diag(*(np.zeros((system.dof, system.dof)) if one is None else one
                                       for system, one in zip(systems, known, strict=True))))  # fmt: skip

    owners = [f"{part.name}.{spring}" for part in parts for spring in part.linear.provenance.springs]
    first = np.cumsum([0, *(len(system.provenance.springs) for system in systems)])
    factors = [np.split(system.inertia_factor, [6 * len(system.bodies)]) for system in systems]
    coordinates, massless = named("coordinates"), sum(system.massless for system in systems)
    motion = block_diag(*(system.body_motion.reshape(6 * len(system.bodies), system.dof) for system in systems))
    null = [np.zeros((system.dof, 0)) if system.null_inertia is None else system.null_inertia for system in systems]
    inner = [replace(one, first=f"{part.name}.{one.first}", second=f"{part.name}.{one.second}")
             for part in parts for one in part.linear.provenance.connections]  # fmt: skip
    matrices = {key: blocks(key) for key in ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D", "elastic_rows")}
    return type(systems[0])(
        name=name, coordinates=coordinates, coordinate_units=units("coordinate_units"), inputs=named("inputs"),
        input_units=units("input_units"), outputs=named("outputs"), output_units=units("output_units"),
        bodies=named("bodies"), **matrices,
        inertia_factor=np.concatenate([block_diag(*(pair[k] for pair in factors)) for k in (0, 1)]),
        row_stiffness=np.concatenate([system.row_stiffness for system in systems]),
        row_damping=np.concatenate([system.row_damping for system in systems]),
        row_owner=np.concatenate([system.row_owner + k for system, k in zip(systems, first, strict=False)]),
        body_motion=motion.reshape(-1, 6, len(coordinates)), gyroscopic=optional("gyroscopic"),
        circulatory=optional("circulatory"), massless=massless, null_inertia=block_diag(*null) if massless else None,
        provenance=Provenance(Topology((), (), (), (), ()), Reduction(np.arange(len(coordinates)), None, ()),
                              coordinates, tuple(owners), from_matrices=True, connections=(*inner, *connections)),
    )  # fmt: skip


def _check_port(whole: Equations, ends: Ends) -> None:
    """Refuse ports whose outputs are no displacements, or not those of the point where the inputs act."""
    weight = 1.0 / np.sqrt(np.where(whole.M.diagonal() > 0.0, whole.M.diagonal(), 1.0))
    for outputs, inputs in zip(ends.outputs, ends.inputs, strict=True):
        for row, column in zip(outputs, inputs, strict=True):
            name = whole.outputs[row]
            if whole.Cv[row].any() or whole.Ca[row].any():
                raise ModelError(f"{WHO}: output '{name}' is a velocity, an acceleration or a force; expected the "
                                 f"displacement of the port.", element=name)  # fmt: skip
            if whole.D[row].any():
                raise ModelError(f"{WHO}: output '{name}' follows forces at once, as a body without mass does; "
                                 f"expected a port on a body with mass.", element=name)  # fmt: skip
            moved, pushed = whole.Cq[row] * weight, whole.B[:, column] * weight
            size = max(np.abs(moved).max(initial=0.0), np.abs(pushed).max(initial=0.0))
            if np.abs(moved - pushed).max(initial=0.0) > COLLOCATED * size:
                raise ModelError(f"{WHO}: input '{name}' does not act where and as output '{name}' is measured; "
                                 f"expected pairs at one point along one direction, as model.add_port adds them.",
                                 element=name)  # fmt: skip


def _with_spring(whole: Any, ends: Ends) -> Any:
    """The equations with a spring-damper between two ports: K + L^T k L, C + L^T c L.

    A stiffness that depends on frequency adds relaxations: a spring g k in series with a damper g tau k each.
    """
    connection, relative, forces = ends.connection, ends.relative(whole.Cq), ends.acting(whole.D)
    k, c = (np.asarray(one) for one in (connection.stiffness, connection.damping))
    dynamic = connection.dynamic
    axes, sizes = _squares(k)
    whole = replace(whole, provenance=replace(whole.provenance, springs=(*whole.provenance.springs, ends.name)))
    if dynamic is None:
        whole = _with_rows(whole, (axes @ relative, sizes, np.zeros(len(sizes))), forces @ axes.T)
        others, damping = _squares(c)
        return _with_rows(whole, (others @ relative, np.zeros(len(damping)), damping), forces @ others.T)
    if dynamic.weights is None or dynamic.times is None:
        raise ModelError(f"{WHO}: {dynamic!r} between {ends.name} has no states; expected a rational one, as "
                         f".rational((low, high)) [Hz] makes it. Responses alone take it where a part is measured.",
                         element=connection.first)  # fmt: skip
    whole = _with_rows(whole, (axes @ relative, dynamic.static * sizes, dynamic.viscous * sizes), forces @ axes.T)
    for k_term, (g, tau) in enumerate(zip(dynamic.weights.tolist(), dynamic.times.tolist(), strict=True), 1):
        names = [f"{ends.name}.relaxation{k_term}.{i + 1}" for i in range(len(sizes))]
        whole, own = _with_massless(whole, names), np.eye(whole.dof + len(sizes))[whole.dof :]
        stretched = axes @ ends.relative(whole.Cq) - own
        whole = _with_rows(whole, (stretched, g * sizes, np.zeros(len(sizes))), forces @ axes.T)
        whole = _with_rows(whole, (own, np.zeros(len(sizes)), g * tau * sizes), np.zeros((len(forces), len(sizes))))
    return whole


def _with_rows(whole: Any, rows: tuple[Array, Array, Array], forces: Array) -> Any:
    """The equations with elastic rows of the last spring: rows, stiffness and damping.

    ``forces`` (outputs, rows): how outputs follow the forces along these rows, positive as they act.
    """
    elastic, k, c = rows
    return replace(
        whole, K=whole.K + weighted_gram(elastic, k), C=whole.C + weighted_gram(elastic, c),
        Cq=whole.Cq - forces @ (k[:, None] * elastic), Cv=whole.Cv - forces @ (c[:, None] * elastic),
        elastic_rows=np.concatenate((whole.elastic_rows, elastic)),
        row_stiffness=np.concatenate((whole.row_stiffness, k)), row_damping=np.concatenate((whole.row_damping, c)),
        row_owner=np.concatenate((whole.row_owner, np.full(len(k), len(whole.provenance.springs) - 1))),
    )  # fmt: skip


def _with_massless(whole: Any, names: Sequence[str]) -> Any:
    """The equations with further coordinates that have no mass, and nothing else yet."""
    count, m = len(names), whole.dof

    def wide(array: Array | None, both: bool = False) -> Any:
        widths = [(0, 0)] * (array.ndim - 1) + [(0, count)] if array is not None else []
        if both:
            widths[0:1] = [(0, count)] * bool(widths)
        return None if array is None else np.pad(array, widths)

    null = np.zeros((m, 0)) if whole.null_inertia is None else whole.null_inertia
    square = {key: wide(getattr(whole, key), True) for key in ("M", "C", "K", "gyroscopic", "circulatory")}
    flat = {key: wide(getattr(whole, key))
            for key in ("Cq", "Cv", "Ca", "inertia_factor", "elastic_rows", "body_motion")}  # fmt: skip
    coordinates = (*whole.coordinates, *names)
    return replace(
        whole, **square, **flat, B=np.pad(whole.B, ((0, count), (0, 0))), coordinates=coordinates,
        coordinate_units=(*whole.coordinate_units, *([""] * count)), massless=whole.massless + count,
        null_inertia=np.block([[null, np.zeros((m, count))], [np.zeros((count, null.shape[1])), np.eye(count)]]),
        provenance=replace(whole.provenance, joint_coordinates=coordinates,
                           reduction=Reduction(np.arange(m + count), None, ())),
    )  # fmt: skip


def _squares(matrix: Array) -> tuple[Array, Array]:
    """Unit rows E and weights w with E^T diag(w) E = the matrix."""
    weights, rows = eigenrows(matrix)
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    acts = weights > 0.0
    return (rows / length)[acts], (weights * length[:, 0] ** 2)[acts]


def _joined_rigidly(whole: Any, rigid: Sequence[Ends]) -> Any:
    """The equations in the coordinates that rigid connections leave."""
    rows = np.concatenate([one.relative(whole.Cq) for one in rigid])
    kept, dependent, reduction = _reduction(whole, rows, rigid)
    forces = np.concatenate([one.acting(whole.D) for one in rigid], axis=1)
    if forces.any():
        whole = _with_forces(whole, forces, rows, kept, dependent)
    factor = reduction.apply_exactly(whole.inertia_factor)
    elastic = _without_rounding(whole, reduction, rows)
    matrix = reduction.matrix
    assert matrix is not None
    gyroscopic, circulatory = (None if part is None else matrix.T @ part @ matrix
                               for part in (whole.gyroscopic, whole.circulatory))  # fmt: skip
    damping, stiffness = weighted_gram(elastic, whole.row_damping), weighted_gram(elastic, whole.row_stiffness)
    at = reduction.independent
    coordinates = tuple([whole.coordinates[k] for k in at])
    return replace(
        whole, coordinates=coordinates, coordinate_units=tuple([whole.coordinate_units[k] for k in at]),
        M=gram_matrix(factor), C=damping if gyroscopic is None else damping + gyroscopic,
        K=stiffness if circulatory is None else stiffness + circulatory, B=reduction.apply_exactly(whole.B.T).T,
        Cq=reduction.apply_exactly(whole.Cq), Cv=reduction.apply_exactly(whole.Cv),
        Ca=reduction.apply_exactly(whole.Ca), inertia_factor=factor, elastic_rows=elastic,
        body_motion=reduction.apply_to_bodies(whole.body_motion), gyroscopic=gyroscopic, circulatory=circulatory,
        provenance=replace(whole.provenance, joint_coordinates=coordinates,
                           reduction=Reduction(np.arange(len(at)), None, ())),
    )  # fmt: skip


def _reduction(whole: Equations, rows: Array, rigid: Sequence[Ends]) -> tuple[Index, Index, Reduction]:
    """The independent rows of L, the dependent coordinates, and q = N z.

    Coordinates are compared by the motion of unit kinetic energy, rows by their largest entry; coordinates of earlier
    parts remain where sizes are equal.
    """
    turns = np.array([direction[0] == "r" for one in rigid for direction in one.connection.directions])
    kept, dependent, independent, block = eliminated(rows, np.sqrt(whole.M.diagonal()), turns, rigid[-1].name)
    matrix = np.zeros((rows.shape[1], len(independent)))
    matrix[independent, np.arange(len(independent))] = 1.0
    matrix[dependent] = block
    return kept, dependent, Reduction(independent, matrix, ())


def eliminated(rows: Array, unit: Array, turns: Any, beside: str) -> tuple[Index, Index, Index, Array]:
    """Return independent rows of L q = 0, dependent and independent coordinates, and q_d = N q_i (d, i).

    ``unit`` (n,): roots of masses; ``turns`` (rows,): which rows are rotations; ``beside``: the last connection.
    """
    n = rows.shape[1]
    size = (1.0 + TIE_BREAK * np.arange(n)) / unit
    scaled = rows * size
    largest = np.abs(scaled).max(axis=1, initial=0.0)
    for kind in (turns, ~turns):
        scaled[kind & (largest <= ZERO_SUM * largest[kind].max(initial=0.0))] = 0.0
    scaled /= np.where(scaled.any(axis=1), largest, 1.0)[:, None]
    qr, order, _ = pivoted_qr(scaled)
    pivots = np.abs(qr.diagonal())
    rank = int(np.count_nonzero(pivots > DEPENDENT_ROWS))
    if rank < len(pivots) and rank and pivots[rank] * RANK_GAP > pivots[rank - 1]:
        raise SingularPoseError(
            f"{WHO}: it is in doubt whether a rigid connection locks a motion or repeats another one (pivots "
            f"{pivots[rank - 1]:.1e} and {pivots[rank]:.1e}, beside {beside}). Move ports that nearly "
            f"coincide, or join some of them by a stiffness.")  # fmt: skip
    dependent = np.sort(order[:rank])
    kept = np.sort(pivoted_qr(scaled[:, dependent].T)[1][:rank])
    independent = np.setdiff1d(np.arange(n), dependent)
    block = np.asarray(-np.linalg.solve(rows[np.ix_(kept, dependent)], rows[np.ix_(kept, independent)]), dtype=float)
    return kept, dependent, independent, block


def _with_forces(whole: Any, forces: Array, rows: Array, kept: Index, dependent: Index) -> Any:
    """The equations with outputs that the forces f in rigid connections act on.

    f = L_d^-T (M q'' + C q' + K q - B u)_d in the dependent coordinates d.
    ``forces`` (outputs, rows): how outputs follow f; ``rows`` (rows, n) are L, those ``kept`` independent.
    """
    redundant = np.setdiff1d(np.arange(len(rows)), kept)
    if forces[:, redundant].any():
        name = whole.outputs[int(np.flatnonzero(forces[:, redundant].any(axis=1))[0])]
        raise ModelError(f"{WHO}: output '{name}' depends on forces in rigid connections that are redundant, and not "
                         f"determined; leave directions out, join them by a stiffness, or leave the output out.",
                         element=name)  # fmt: skip
    share = np.linalg.solve(rows[np.ix_(kept, dependent)], forces[:, kept].T).T
    return replace(
        whole, Cq=whole.Cq + share @ whole.K[dependent], Cv=whole.Cv + share @ whole.C[dependent],
        Ca=whole.Ca + share @ whole.M[dependent], D=whole.D - share @ whole.B[dependent])  # fmt: skip


def _without_rounding(whole: Equations, reduction: Reduction, rows: Array) -> Array:
    """Elastic rows in minimal coordinates, without rounding in motions that deform nothing."""
    result = reduction.apply_exactly(whole.elastic_rows)
    stiff = whole.row_stiffness != 0.0
    for which, others in ((stiff, stiff), (~stiff, np.ones(len(stiff), dtype=bool))):
        every = np.concatenate((whole.elastic_rows[others], rows))
        result[which] = without_free_motions(result[which], every, reduction.independent)
    return result


def _base_motions(parts: Sequence[Part]) -> dict[str, BaseMotion]:
    """Motions of the ground, which must be the same for all parts."""
    known = [{one.name: one for one in part.linear.provenance.ports if isinstance(one, BaseMotion)
              and one.name in part.linear.inputs} for part in parts]  # fmt: skip
    for part, own in zip(parts, known, strict=True):
        for other, others in zip(parts, known, strict=True):
            for name, motion in others.items():
                if own.get(name) != motion:
                    raise ModelError(f"{WHO}: the ground of '{other.name}' moves by '{name}', that of '{part.name}' "
                                     f"does not, so that displacements are relative to different frames; add the same "
                                     f"base motion to '{part.name}'.", element=part.name)  # fmt: skip
    return known[0] if known else {}


def _with_shared_inputs(whole: Any, parts: Sequence[Part], shared: dict[str, BaseMotion]) -> Any:
    """The equations with one input for each motion of the ground, with its own name, in the place of the first."""
    if not shared:
        return whole
    columns: dict[str, list[int]] = {}
    names = [name for part in parts for name in part.linear.inputs]
    for k, (name, own) in enumerate(zip(whole.inputs, names, strict=True)):
        columns.setdefault(own if own in shared else name, []).append(k)
    b, d = (np.column_stack([matrix[:, numbers].sum(axis=1) for numbers in columns.values()])
            for matrix in (whole.B, whole.D))  # fmt: skip
    return replace(whole, inputs=tuple(columns), B=b, D=d,
                   input_units=tuple([whole.input_units[numbers[0]] for numbers in columns.values()]))  # fmt: skip
