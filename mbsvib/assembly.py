"""Assembly: from a model to the factors of its matrices, and to the system of named equations.

M = W^T W with one row of W per translation and rotation of a body, K = D^T diag(k) D and C = D^T diag(c) D with one row
of D per elastic direction: everything comes from the geometry by the path rule, and products are formed last.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib import elements as _elements
from mbsvib.inertia import check_mass, spatial_inertia
from mbsvib.kinematics import Rows, body_motion, relative_motion, twists
from mbsvib.loops import Cuts, reduce
from mbsvib.mobility import check_mobility
from mbsvib.ports import port_matrices, ports
from mbsvib.system import Provenance, System
from mbsvib.topology import span

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.kinematics import Array
    from mbsvib.model import Model
    from mbsvib.parts import Body
    from mbsvib.topology import Topology


def linearize(
    model: Model, independent: Sequence[str] | None = None, cut: Sequence[str] | None = None
) -> System:
    """Return the minimal linear equations of motion about the model's pose.

    M q'' + C q' + K q = B u,  y = Cq q + Cv q' + Ca q'' + D u

    Parameters
    ----------
    model : Model
        The mechanism.
    independent : sequence of str, optional
        Joint coordinates (``"hip1.rx"``) that are to be among the minimal ones.
    cut : sequence of str, optional
        Joints at which loops are to be cut; default: chosen by the smallest cumulative degree of freedom.

    Returns
    -------
    System
        Matrices, names and the way back to the bodies.

    Raises
    ------
    ModelError
        If a name is unknown, a cut leaves bodies hanging, a coordinate cannot be independent or has no inertia.
    SingularPoseError
        If the number of degrees of freedom is not defined in this pose.

    Source: Jiang, Chen & Luo (2011), sections 2 and 3.
    """
    topology = span(model, cut)
    bodies = list(model.bodies.values())
    number = {name: i for i, name in enumerate(topology.bodies)}
    number["ground"] = len(bodies)
    position = np.array([body.position for body in bodies])
    coordinates = twists(topology, bodies)
    cuts = _cuts(topology, bodies, number)
    springs = _elements.stack(model.springs.values(), number)
    port = ports(model, bodies, number)

    # one pass over all relative displacements: what cut joints lock, what springs feel, what ports see
    everything = [*([cuts.rows] if cuts else []), springs.rows, port.rows]
    locked, felt = len(cuts.names) if cuts else 0, len(springs.owner)
    relative = relative_motion(coordinates, Rows.join(everything))
    reduction = reduce(coordinates, cuts, relative.dense(0, locked), independent)
    check_mobility(topology, coordinates, cuts, reduction, position)

    kept = reduction.independent.tolist()
    names = tuple([coordinates.names[i] for i in kept])
    motion = reduction.apply(body_motion(coordinates, position))
    inertia = spatial_inertia(bodies)
    factor = inertia.factor(motion)
    mass = factor.T @ factor
    check_mass(mass, names)
    acting = relative.acting(locked, locked + felt)
    springs = springs.only(acting)
    elastic = reduction.apply_exactly(relative.dense(locked, locked + felt, acting))
    if reduction.matrix is not None:
        acting = np.asarray(elastic.any(axis=1))
        springs, elastic = springs.only(acting), elastic[acting]
    seen = reduction.apply(relative.dense(locked + felt, relative.shape[0]))
    return System(
        name=model.name, coordinates=names,
        coordinate_units=tuple(["rad" if turn else "m" for turn in coordinates.turns[kept].tolist()]),
        inputs=tuple(model.inputs), input_units=port.input_units, outputs=tuple(model.outputs),
        output_units=port.output_units, bodies=topology.bodies,
        M=mass, C=product(elastic, springs.damping), K=product(elastic, springs.stiffness),
        **port_matrices(port, seen, springs, elastic, inertia, factor, position),
        inertia_factor=factor, elastic_rows=elastic, stiffness=springs.stiffness, damping=springs.damping,
        row_owner=springs.owner, body_motion=motion,
        provenance=Provenance(topology, reduction, coordinates.names, tuple(model.springs)),
    )  # fmt: skip


def product(rows: Array, value: Array) -> Array:
    """Return rows^T diag(value) rows, exactly symmetric."""
    used = value != 0.0
    if not used.all():
        rows, value = rows[used], value[used]
    negative = value < 0.0
    half: Array = rows * np.sqrt(np.abs(value))[:, None]
    if not negative.any():
        return half.T @ half
    plus, minus = half[~negative], half[negative]
    return plus.T @ plus - minus.T @ minus


def _cuts(topology: Topology, bodies: list[Body], number: Mapping[str, int]) -> Cuts | None:
    if not topology.cut:
        return None
    tuples: list[tuple[float, ...]] = []
    names: list[str] = []
    owner: list[int] = []
    start: list[int] = []
    for count, k in enumerate(topology.cut):
        joint = topology.joints[k]
        a, b = number[joint.first], number[joint.second]
        point = joint.position or bodies[min(a, b)].position
        if joint.locked:
            start.append(len(names))
        for direction, six in joint.locked:
            tuples.append((a, b, *point, *six))
            names.append(f"{joint.name}.{direction}")
            owner.append(count)
    rows = Rows.stack(tuples)
    return Cuts(rows, tuple(names), np.array(owner, dtype=np.intp), topology.cut_joints,
                np.array(start, dtype=np.intp), np.asarray(rows.force.any(axis=0)))  # fmt: skip
