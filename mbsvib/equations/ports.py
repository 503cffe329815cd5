"""Ports: the model's inputs and outputs as rows of relative displacement, with their units."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import BaseMotion, ForceOutput, Input
from mbsvib.elements.ports import QUANTITIES
from mbsvib.elements.rows import Rows
from mbsvib.equations.base_motion import check_turning
from mbsvib.errors import ModelError
from mbsvib.linalg.rank import ZERO_SUM

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Body, Output
    from mbsvib.elements.element_rows import ElementRows
    from mbsvib.equations.inertia import SpatialInertia
    from mbsvib.kinematics.shared_rows import Shared
    from mbsvib.mechanism.mechanism import Mechanism

_FORCE = ("N", "N m")
_BASE = ("m/s^2", "rad/s^2")
_MOTION = (("m", "rad"), ("m/s", "rad/s"), _BASE)


@dataclass(frozen=True, slots=True)
class Ports:
    """Inputs and outputs in numbers: ``rows`` hold the force inputs, then the motion outputs.

    ``force_inputs`` and ``motion_outputs`` give the column of B and the row of the outputs that each row belongs to,
    ``derivative`` 0, 1 or 2 per motion output; the other kinds are listed with their place. ``wrench_outputs``, forces
    in joints and all forces on a body or the ground, are (row, "joint" or "body", number, direction).
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


def ports(model: Mechanism, bodies: list[Body], number: Mapping[str, int]) -> Ports:
    """Return the ports of a model.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    bodies : list of Body
        Its bodies in order.
    number : mapping
        Number of each body, ground included.

    Returns
    -------
    Ports
        Rows, places and units.

    Raises
    ------
    ModelError
        If an absolute displacement or velocity is asked for while the ground moves, or the ground turns under gravity,
        a load or a rotor.
    """

    def row(part: Input | Output) -> tuple[float, ...]:
        a, b = number[part.relative_to], number[part.body]
        # a port on ground itself has no centre of mass: it sits at that of the body it refers to
        at = part.position or bodies[b if b < len(bodies) else a].position
        return (a, b, *at, *part.wrench)

    rows: list[tuple[float, ...]] = []
    force_inputs, motion_outputs, derivative = [], [], []
    base_motions, inertial, force_outputs, wrench_outputs = [], [], [], []
    input_units, output_units = [], []
    for i, source in enumerate(model.inputs.values()):
        if isinstance(source, BaseMotion):
            check_turning(model, source)
            base_motions.append((i, source))
            input_units.append(unit(source.wrench, _BASE))
        else:
            force_inputs.append(i)
            rows.append(row(source))
            input_units.append(unit(source.wrench, _FORCE))
    for i, output in enumerate(model.outputs.values()):
        if isinstance(output, ForceOutput):
            wrench = np.array(output.wrench)
            if output.element in model.springs:
                force_outputs.append((i, list(model.springs).index(output.element), wrench))
            elif output.element in model.joints:
                wrench_outputs.append((i, "joint", list(model.joints).index(output.element), wrench))
            elif output.element == "ground" or output.element in model.bodies:
                wrench_outputs.append((i, "body", number[output.element], wrench))
            # else it is a part that was left out as out of reach: it sees nothing
            output_units.append(unit(output.wrench, _FORCE))
            continue
        motion_outputs.append(i)
        place = row(output)
        rows.append(place)
        order_of = QUANTITIES.index(output.quantity)
        derivative.append(order_of)
        output_units.append(output.unit or unit(output.wrench, _MOTION[order_of]))
        if output.inertial and base_motions:
            if order_of < 2:
                raise ModelError(
                    f"output '{output.name}': an absolute {output.quantity} would integrate the base motion "
                    f"'{base_motions[0][1].name}', which is an acceleration. Ask for quantity='acceleration', or for "
                    f"the {output.quantity} relative to the moving ground (absolute=False).",
                    element=output.name, field="absolute",
                )  # fmt: skip
            inertial.append((i, output, np.array(place[2:5])))
    return Ports(
        Rows.stack(rows), np.array(force_inputs, dtype=np.intp), np.array(motion_outputs, dtype=np.intp),
        np.array(derivative, dtype=np.intp), tuple(base_motions), tuple(inertial), tuple(force_outputs),
        tuple(input_units), tuple(output_units), tuple(wrench_outputs),
    )  # fmt: skip


@lru_cache
def output_unit(output: Any) -> str:
    """Return the unit of an output of any kind."""
    if isinstance(output, ForceOutput):
        return unit(output.wrench, _FORCE)
    return output.unit or unit(output.wrench, _MOTION[QUANTITIES.index(output.quantity)])


def unit(wrench: tuple[float, ...], units: tuple[str, str]) -> str:
    """Return the unit of a direction: of translations, of rotations, or both where it mixes them."""
    translates, turns = any(wrench[:3]), any(wrench[3:])
    return units[0] if not turns else units[1] if not translates else " + ".join(units)


def port_matrices(
    port: Ports, seen: Array, springs: ElementRows, elastic: Array, inertia: SpatialInertia, factor: Array,
    position: Array, shared: Shared | None = None,
) -> dict[str, Array]:
    """Return B, Cq, Cv, Ca and D of q'' M + ... = B u, y = Cq q + Cv q' + Ca q'' + D u, by name.

    Parameters
    ----------
    port : Ports
        Inputs and outputs.
    seen : array, shape (..., port rows, m)
        Their relative displacements in minimal coordinates.
    springs : ElementRows
        The spring-dampers that act.
    elastic : array, shape (..., elastic rows, m)
        Their rows in minimal coordinates.
    inertia : SpatialInertia
        Square roots of the bodies' inertia.
    factor : array, shape (..., 6 bodies, m)
        W of M = W^T W.
    position : array, shape (..., bodies, 3)
        Centres of mass [m], world axes.
    shared : Shared, optional
        Mass that more than one body carries.

    Returns
    -------
    dict of str to array
        The five matrices.
    """
    m, forces = factor.shape[-1], len(port.force_inputs)
    lead = seen.shape[:-2]
    if port.base_motions:
        lead = max(lead, factor.shape[:-2], position.shape[:-2])
    b = np.zeros((*lead, m, len(port.input_units)))
    b[..., port.force_inputs] = seen[..., :forces, :].swapaxes(-1, -2)
    d = np.zeros((*(position.shape[:-2] if port.inertial_outputs else ()), len(port.output_units), b.shape[-1]))
    for column, motion in port.base_motions:
        linear, angular = np.array(motion.wrench[:3]), np.array(motion.wrench[3:])
        carried = np.empty((*position.shape[:-1], 6, 1))
        carried[..., :3, 0] = np.cross(angular, position - motion.position) + linear
        carried[..., 3:, 0] = angular
        moved = inertia.factor(carried)
        if shared is not None:
            moved = shared.carried(moved, linear, angular, np.array(motion.position))
        b[..., column] = -(moved.swapaxes(-1, -2) @ factor)[..., 0, :]
        for row, output, point in port.inertial_outputs:
            at = np.cross(angular, np.subtract(point, motion.position)) + linear
            terms = np.stack((at * output.wrench[:3], np.broadcast_to(angular * output.wrench[3:], at.shape)))
            value = terms.sum(axis=(0, -1))
            zero = np.abs(value) <= ZERO_SUM * np.abs(terms).sum(axis=(0, -1))  # the directions are perpendicular
            d[..., row, column] = np.where(zero, 0.0, value)
    lead = seen.shape[:-2]
    if port.force_outputs:
        lead = max(lead, elastic.shape[:-2], springs.stiffness.shape[:-1], springs.damping.shape[:-1],
                   springs.unit.shape[:-2])  # fmt: skip
    c = np.zeros((*lead, 3, len(port.output_units), m))
    c[..., port.derivative, port.motion_outputs, :] = seen[..., forces:, :]
    for row, owner, wrench in port.force_outputs:
        own = np.nonzero(springs.owner == owner)[0]
        share = springs.unit[..., own, :] @ wrench
        for order, value in springs.weights:
            c[..., order, row, :] = ((share * value[..., own])[..., None, :] @ elastic[..., own, :])[..., 0, :]
    return {"B": b, "Cq": c[..., 0, :, :], "Cv": c[..., 1, :, :], "Ca": c[..., 2, :, :], "D": d}
