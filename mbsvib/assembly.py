"""Assembly: from a model to the factors of its matrices, and to the system of named equations.

M = W^T W with one row of W per translation and rotation of a body, K = D^T diag(k) D and C = D^T diag(c) D with one row
of D per elastic direction: everything comes from the geometry by the path rule, and products are formed last.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from mbsvib import elements as _elements
from mbsvib.errors import ModelError
from mbsvib.kinematics import Rows, body_motion, relative_motion, twists
from mbsvib.loops import Cuts, reduce
from mbsvib.mobility import check_mobility
from mbsvib.ports import Ports, ports
from mbsvib.system import Provenance, System
from mbsvib.topology import span

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.kinematics import Array
    from mbsvib.model import Model
    from mbsvib.parts import Body
    from mbsvib.topology import Topology

# Pivots of the mass matrix, scaled to a unit diagonal, below this are rounding: the coordinate has no inertia.
MASSLESS = 1e-14
_LINEAR = np.arange(3)
_TENSOR = [0, 3, 4, 3, 1, 5, 4, 5, 2]  # xx xy xz, xy yy yz, xz yz zz out of xx yy zz xy xz yz


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
    coordinates = twists(topology, bodies)
    cuts = _cuts(topology, bodies, number)
    springs = _elements.stack(model.springs.values(), number)
    port = ports(model, bodies, number, springs)
    # one pass over all relative displacements: what cut joints lock, what springs feel, what ports see
    everything = Rows.join([*([cuts.rows] if cuts else []), springs.rows, port.rows])
    relative = relative_motion(coordinates, everything)
    locked, felt = len(cuts.names) if cuts else 0, len(springs.owner)
    reduction = reduce(coordinates, cuts, relative[:locked], independent)
    position = np.array([body.position for body in bodies])
    check_mobility(topology, coordinates, cuts, reduction, position)

    rows = reduction.apply(relative[locked:])
    motion = reduction.apply(body_motion(coordinates, position))
    weight = inertia_weights(bodies)
    inertia = np.matmul(weight, motion).reshape(6 * len(bodies), -1)
    mass = inertia.T @ inertia
    kept = reduction.independent.tolist()
    names = tuple([coordinates.names[i] for i in kept])
    check_inertia(mass, names)
    acting = rows[:felt].any(axis=1)
    elastic, k, c, owner = rows[:felt], springs.stiffness, springs.damping, springs.owner
    if not acting.all():
        elastic, k, c, owner = elastic[acting], k[acting], c[acting], owner[acting]
    return System(
        name=model.name, coordinates=names,
        coordinate_units=tuple(["rad" if turn else "m" for turn in coordinates.turns[kept].tolist()]),
        inputs=tuple(model.inputs), input_units=port.input_units, outputs=tuple(model.outputs),
        output_units=port.output_units, bodies=topology.bodies,
        M=mass, C=product(elastic, c), K=product(elastic, k),
        **_input_output(port, rows[felt:], rows[:felt], springs, inertia, weight, position),
        inertia_factor=inertia, elastic_rows=elastic, stiffness=k, damping=c, row_owner=owner, body_motion=motion,
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


def inertia_weights(bodies: Sequence[Body]) -> Array:
    """Return the factors F of the bodies' spatial inertia, F^T F = diag(m 1, I), world axes, shape (bodies, 6, 6)."""
    table = np.array([(body.mass, *body.inertia) for body in bodies])
    weight = np.zeros((len(bodies), 6, 6))
    weight[:, _LINEAR, _LINEAR] = np.sqrt(table[:, :1])
    root = np.zeros((len(bodies), 3, 3))
    if table[:, 4:].any():
        root = _roots(table[:, 1:])
    else:
        root[:, _LINEAR, _LINEAR] = np.sqrt(table[:, 1:4])
    axes = np.array([body.orientation for body in bodies])
    np.matmul(root, axes.transpose(0, 2, 1), out=weight[:, 3:, 3:])
    return weight


def _roots(inertia: Array) -> Array:
    """Return F with F^T F = the inertia tensors given by their entries (n, 6), upper triangular, shape (n, 3, 3)."""
    try:
        return np.asarray(np.linalg.cholesky(inertia[:, _TENSOR].reshape(-1, 3, 3)).transpose(0, 2, 1), dtype=float)
    except np.linalg.LinAlgError:
        xx, yy, zz, xy, xz, yz = inertia.T
        # L D L^T: of a body without extent in some direction a pivot and its whole row are zero
        d1 = np.maximum(xx, 0.0)
        a, b = _ratio(xy, d1), _ratio(xz, d1)
        d2 = np.maximum(yy - a * xy, 0.0)
        e = _ratio(yz - a * xz, d2)
        d3 = np.maximum(zz - b * xz - e * (yz - a * xz), 0.0)
        one, none = np.ones_like(a), np.zeros_like(a)
        root = np.stack([one, a, b, none, one, e, none, none, one], axis=-1).reshape(-1, 3, 3)
        root *= np.sqrt(np.stack([d1, d2, d3], axis=-1))[..., None]
        return root


def _ratio(a: Array, b: Array) -> Array:
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0.0)


def check_inertia(mass: Array, names: tuple[str, ...]) -> None:
    """Refuse coordinates whose motion moves no mass, by name."""
    if not names:
        return
    diagonal = mass.diagonal()
    lowest = None
    if float(diagonal.min()) <= 0.0:
        lowest = int(diagonal.argmin())
    else:
        scale = 1.0 / np.sqrt(diagonal)
        scaled = mass * scale[:, None] * scale
        factor, info = lapack.dpotrf(scaled, overwrite_a=False)
        pivots = factor.diagonal() ** 2 if info == 0 else np.linalg.eigvalsh(scaled)
        if float(pivots.min()) < MASSLESS:
            lowest = int(pivots.argmin())
    if lowest is not None:
        raise ModelError(
            f"coordinate '{names[lowest]}': the mass matrix is singular, this motion (alone or with others) moves no "
            f"mass. Massless coordinates are not supported yet: give the bodies it moves an inertia about its axis.",
            element=names[lowest],
        )  # fmt: skip


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


def _input_output(
    port: Ports, rows: Array, elastic: Array, springs: _elements.Elements, inertia: Array, weight: Array,
    position: Array,
) -> dict[str, Array]:  # fmt: skip
    """Matrices B, Cq, Cv, Ca and D of the ports."""
    m = inertia.shape[1]
    b = np.zeros((m, len(port.input_units)))
    b[:, port.force_inputs] = rows[: len(port.force_inputs)].T
    d = np.zeros((len(port.output_units), b.shape[1]))
    for column, motion in port.base_motions:
        linear, angular = motion.wrench[:3], motion.wrench[3:]
        carried = np.cross(angular, position - motion.position) + linear
        spatial = np.concatenate((carried, np.broadcast_to(angular, carried.shape)), axis=1)
        b[:, column] = -(np.matmul(weight, spatial[..., None]).reshape(-1) @ inertia)
        for row, output, point in port.inertial_outputs:
            at = np.cross(angular, np.subtract(point, motion.position)) + linear
            d[row, column] = np.dot(output.wrench, (*at, *angular))
    c = np.zeros((3, len(port.output_units), m))
    c[port.derivative, port.motion_outputs] = rows[len(port.force_inputs) :]
    for row, owner, wrench in port.force_outputs:
        own = np.nonzero(springs.owner == owner)[0]
        share = springs.unit[own] @ wrench
        c[0, row] = (share * springs.stiffness[own]) @ elastic[own]
        c[1, row] = (share * springs.damping[own]) @ elastic[own]
    return {"B": b, "Cq": c[0], "Cv": c[1], "Ca": c[2], "D": d}


