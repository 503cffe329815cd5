"""Ports: inputs and outputs of a model as rows of relative displacements, with their units and matrices.

A base motion is a rigid motion of all bodies with the ground; what does not rotate with the ground is refused.

The equations are in coordinates relative to the moving ground. Relative to a rotating ground, the directions of
gravity, of forces fixed in the world and of the axes of rotors change by the integral of the angular acceleration,
which is no linear function of this input. They do not change if the ground rotates about the direction itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import hypot
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array, Index
from mbsvib.common.fast_init import fast_init
from mbsvib.elements import BaseMotion, Body, Input, Output
from mbsvib.elements.rows import ElementRows, Rows
from mbsvib.elements.shared_rows import carriers
from mbsvib.errors import ModelError
from mbsvib.kinematics.shared_rows import Shared
from mbsvib.linalg.products import widened
from mbsvib.linalg.rank import PARALLEL_DIRECTIONS, ZERO_SUM
from mbsvib.linalg.rotations import cross
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from mbsvib.equations.inertia import SpatialInertia


@fast_init
@dataclass(frozen=True, slots=True)
class Ports:
    """Inputs and outputs as arrays: ``rows`` are those of force inputs, then those of motion outputs.

    ``force_inputs`` are the columns of B and ``motion_outputs`` the rows of outputs of these rows, ``derivative`` (0, 1
    or 2) that of each motion output. ``base_motions`` start with the column of B, ``inertial_outputs`` and
    ``force_outputs`` with the row of the output; those of several elements add up. ``motion_forces`` are forces of
    moved ends, which add up likewise: column, number of the element, 0 by displacement or 1 by velocity, and direction
    in its axes. ``wrench_outputs`` are forces in joints and sums of all forces on a body or the ground: row of the
    output, "joint" or "body", number and direction.
    """

    rows: Rows
    force_inputs: Index
    motion_outputs: Index
    derivative: Index
    base_motions: tuple[tuple[int, BaseMotion], ...]
    inertial_outputs: tuple[tuple[int, Output, Array], ...]
    force_outputs: tuple[tuple[int, int, Array], ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    wrench_outputs: tuple[tuple[int, str, int, Array], ...] = ()
    motion_forces: tuple[tuple[int, int, int, Array], ...] = ()

    @property
    def needs_elements(self) -> bool:
        """Whether it needs the stiffness and damping of elements."""
        return bool(self.force_outputs or self.motion_forces)


def port_bodies(model: Mechanism, number: Mapping[str, int]) -> list[tuple[Any, int]]:
    """Return the inputs and outputs with rows, each with the body that carries its point: by default that at whose
    centre of mass it is, of two bodies the one that is not ground.
    """
    parts: list[Any] = [*(part for part in model.inputs.values() if part.element is None and not part.moves_ground),
                        *(part for part in model.outputs.values() if part.element is None)]  # fmt: skip
    return [(part, number[part.body if part.position is not None or part.body != "ground" else part.relative_to])
            for part in parts]


def ports(model: Mechanism, bodies: list[Body], number: Mapping[str, int]) -> Ports:
    """Return the ports of a model."""

    def row(part: Input | Output) -> tuple[float, ...]:
        a, b = number[part.relative_to], number[part.body]
        # the ground has no centre of mass: a port on ground is at that of the other body
        point = part.position or bodies[b if b < len(bodies) else a].position
        return (a, b, *point, *part.wrench)

    rows: list[tuple[float, ...]] = []
    force_inputs, motion_outputs, derivative = [], [], []
    base_motions, inertial, force_outputs, wrench_outputs = [], [], [], []
    inputs: list[Any] = list(model.inputs.values())
    outputs: list[Any] = list(model.outputs.values())
    elements = {name: i for i, name in enumerate(model.springs)}
    motion_forces = []
    for i, source in enumerate(inputs):
        if source.moves_ground:
            check_rotation(model, source)
            base_motions.append((i, source))
        elif source.element is not None:
            # what is not there was removed from a sparse system
            motion_forces += [(i, elements[name], source.order, np.array(source.wrench))
                              for name in carriers(model.expansion, source.element) if name in elements]  # fmt: skip
        else:
            force_inputs.append(i)
            rows.append(row(source))
    for i, output in enumerate(outputs):
        if output.element is not None:
            wrench = np.array(output.wrench)
            summed = [elements[name] for name in carriers(model.expansion, output.element) if name in elements]
            if summed:
                force_outputs += [(i, element, wrench) for element in summed]
            elif output.element in model.joints:
                wrench_outputs.append((i, "joint", list(model.joints).index(output.element), wrench))
            elif output.element == "ground" or output.element in model.bodies:
                wrench_outputs.append((i, "body", number[output.element], wrench))
            # otherwise the element was removed from a sparse system, and its output is zero
            continue
        motion_outputs.append(i)
        rows.append(row(output))
        derivative.append(output.order)
        if output.inertial and base_motions:
            if output.order < 2:
                raise ModelError(
                    f"output '{output.name}': an absolute {output.quantity} would integrate the base motion "
                    f"'{base_motions[0][1].name}', which is an acceleration. Ask for quantity='acceleration', or for "
                    f"the {output.quantity} relative to the moving ground (absolute=False).",
                    element=output.name, field="absolute",
                )  # fmt: skip
            inertial.append((i, output, np.array(rows[-1][2:5])))
    return Ports(
        Rows.stack(rows), np.array(force_inputs, dtype=np.intp), np.array(motion_outputs, dtype=np.intp),
        np.array(derivative, dtype=np.intp), tuple(base_motions), tuple(inertial), tuple(force_outputs),
        tuple([source.unit for source in inputs]), tuple([output.unit for output in outputs]), tuple(wrench_outputs),
        tuple(motion_forces),
    )  # fmt: skip


def port_matrices(
    port: Ports, port_rows: Array, springs: ElementRows, elastic: Array, inertia: SpatialInertia, factor: Array,
    position: Array, shared: Shared | None = None,
) -> dict[str, Array]:
    """Return B, Cq, Cv, Ca and D of q'' M + ... = B u, y = Cq q + Cv q' + Ca q'' + D u, by name.

    ``port_rows`` (..., rows, m): their relative displacements in minimal coordinates. ``elastic`` (..., elastic rows,
    m): their rows in minimal coordinates. ``factor`` (..., 6 bodies, m): W of M = W^T W. ``position`` (..., bodies, 3):
    centres of mass [m], world axes.
    """
    m, forces = factor.shape[-1], len(port.force_inputs)
    variants = port_rows.shape[:-2]
    if port.base_motions:
        variants = max(variants, factor.shape[:-2], position.shape[:-2])
    kind_of_ground = np.result_type(port_rows, factor, position)
    b = np.zeros((*variants, m, len(port.input_units)), kind_of_ground)
    b[..., port.force_inputs] = port_rows[..., :forces, :].swapaxes(-1, -2)
    for column, source in port.base_motions:
        rows = inertia_of_ground_motion(source.wrench, source.position, position, inertia, shared)
        b[..., column] = -(rows[..., None, :] @ factor)[..., 0, :]
    variants = port_rows.shape[:-2]
    weights_of = springs.weights if port.force_outputs else ()
    if port.force_outputs:
        variants = max(variants, elastic.shape[:-2], springs.unit.shape[:-2],
                       *(value.shape[:-1] for _, value in weights_of))  # fmt: skip
    kind = np.result_type(port_rows, elastic, springs.unit, *(value for _, value in weights_of))
    c = np.zeros((*variants, 3, len(port.output_units), m), kind)
    c[..., port.derivative, port.motion_outputs, :] = port_rows[..., forces:, :]
    for row, order, which, weights in force_weights(port, springs):
        c[..., order, row, :] += (weights[..., None, :] @ elastic[..., which, :])[..., 0, :]
    if port.motion_forces:
        b = _with_motion_forces(port, springs, elastic, b)
    return {"B": b, "Cq": c[..., 0, :, :], "Cv": c[..., 1, :, :], "Ca": c[..., 2, :, :],
            "D": feedthrough_of_ground(port, position, kind_of_ground)}


def force_weights(port: Ports, springs: ElementRows) -> Iterator[tuple[int, int, Index, Array]]:
    """Yield for forces in elements output, order of the derivative, elastic rows and their weights (..., rows)."""
    for row, owner, wrench in port.force_outputs:
        which = np.nonzero(springs.owner == owner)[0]
        factors = springs.unit[..., which, :] @ wrench
        for order, value in springs.weights:
            yield row, order, which, factors * value[..., which]


def motion_weights(port: Ports, springs: ElementRows) -> Iterator[tuple[int, int, Index, Array]]:
    """Yield for forces of moved ends the input, the element, the elastic rows and their weights (..., rows)."""
    for column, owner, order, wrench in port.motion_forces:
        which = np.nonzero(springs.owner == owner)[0]
        yield column, owner, which, springs.unit[..., which, :] @ wrench * dict(springs.weights)[order][..., which]


def feedthrough_of_ground(port: Ports, position: Array, kind: Any = float) -> Array:
    """Return D with the absolute accelerations by those of the ground, for bodies at ``position`` (..., bodies, 3)."""
    variants = position.shape[:-2] if port.inertial_outputs else ()
    d = np.zeros((*variants, len(port.output_units), len(port.input_units)), kind)
    for column, source in port.base_motions:
        for row, output, point in port.inertial_outputs:
            terms = ground_motion(source.wrench, source.position, point) * output.wrench
            value = terms.sum(axis=-1)
            zero = np.abs(value) <= ZERO_SUM * np.abs(terms).sum(axis=-1)  # the directions are perpendicular
            d[..., row, column] = np.where(zero, value - value.real, value)
    return d


def feedthrough_of_motions(port: Ports, springs: ElementRows, d: Array) -> Array:
    """Return D with the forces in elements by the motion of their own ends, -w . k w'.

    ``springs``: rows of all elements, also those that no coordinate deforms.
    """
    for column, owner, which, weights in motion_weights(port, springs):
        for row, measured, direction in port.force_outputs:
            if measured == owner:
                direct = -(springs.unit[..., which, :] @ direction * weights).sum(axis=-1, keepdims=True)
                d = widened(d, direct[..., None])
                d[..., row, column] += direct[..., 0]
    return d


def _with_motion_forces(port: Ports, springs: ElementRows, elastic: Array, b: Array) -> Array:
    """B with the forces of moved ends, k d^T and c d^T."""
    for column, _, which, weights in motion_weights(port, springs):
        force = weights[..., None, :] @ elastic[..., which, :]
        b = widened(b, force)
        b[..., column] += force[..., 0, :]
    return b


def ground_motion(twist: ArrayLike, origin: ArrayLike, points: Array) -> Array:
    """Return the motions of points (..., 3) that move rigidly with the ground, (..., 6), world axes.

    ``twist`` (..., 6): translation of the origin and rotation of the ground. ``origin`` (..., 3): a point of the ground
    [m]. ``points`` (..., 3): the points [m]. Returns (..., 6): translations and rotations.
    """
    six = np.array(twist)
    linear, angular = six[..., :3], six[..., 3:]
    translation = cross(angular, points - np.array(origin), -1) + linear
    return np.concatenate((translation, angular + np.zeros_like(translation)), axis=-1)


def inertia_of_ground_motion(
    twist: ArrayLike, origin: ArrayLike, position: Array, inertia: SpatialInertia, shared: Shared | None
) -> Array:
    """Return W u of the motion u of all bodies with the ground, with W of M = W^T W.

    ``twist`` (6,): translation of the origin and rotation of the ground. ``origin`` (3,): a point of the ground [m].
    ``position`` (..., bodies, 3): centres of mass [m]. Returns (..., rows): rows of bodies, then shared rows.
    """
    rows = inertia.factor(ground_motion(twist, origin, position)[..., None])
    if shared is not None:
        linear, angular = np.array(twist).reshape(2, 3)
        rows = shared.of_ground_motion(rows, linear, angular, np.array(origin))
    return np.asarray(rows[..., 0])


def check_rotation(model: Mechanism, source: BaseMotion) -> None:
    """Refuse a rotation of the ground that changes the direction of gravity, loads or rotors relative to it."""
    axis = source.wrench[3:]
    if not any(axis):
        return
    for name, direction, hint in fixed_in_world(model):
        cross = (axis[1] * direction[2] - axis[2] * direction[1], axis[2] * direction[0] - axis[0] * direction[2],
                 axis[0] * direction[1] - axis[1] * direction[0])  # fmt: skip
        if hypot(*cross) > PARALLEL_DIRECTIONS * hypot(*axis) * hypot(*direction):
            raise ModelError(
                f"base motion '{source.name}': turns the ground about {tuple(axis)}, but {name}, which does not turn "
                f"with it; its effect depends on the angle, which is no linear function of the acceleration. "
                f"{hint}, or carry the mechanism on a body that a torque turns.",
                element=source.name, field="direction",
            )  # fmt: skip


def fixed_in_world(model: Mechanism) -> Iterator[tuple[str, Vector, str]]:
    """Yield description, direction and advice for gravity, loads and rotors with directions fixed in the world."""
    if model.gravity is not None and any(model.gravity):
        yield f"gravity acts along {model.gravity}", model.gravity, "Turn about that direction only, leave gravity out"
    for load in model.loads.values():
        for field in ("force", "torque"):
            vector: Any = getattr(load, field)
            if any(vector) and not load.follower:
                yield f"load '{load.name}' has the {field} {vector}", vector, "Give the load as follower=True"
    for rotor in model.rotors.values():
        if rotor.speed:
            yield f"rotor '{rotor.name}' spins about {rotor.axis}", rotor.axis, "Turn about the rotor's axis only"
