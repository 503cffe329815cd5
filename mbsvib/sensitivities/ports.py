"""Ports as connections of the network: what inputs load and what outputs see, so that joints carry the true wrenches.

With L = T^-T H^T and R = T^-1 B the response is G = H R + D, and where T, H and B change
dG = dD - sum over bodies and connections of what changes there, between the fields of L and those of R. On the side of
R an input is a connection with the wrench -B; on that of L an output one with the wrench -H. Forces in springs see
strains that lack what was asked for, base motion adds momentum to the bodies.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import BaseMotion, Bushing, ForceOutput, Input, Output
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.families import EXPANSIONS
from mbsvib.elements.ports import QUANTITIES
from mbsvib.elements.rows import Rows
from mbsvib.kinematics.relative_motion import relative_motion
from mbsvib.linalg.rank import ZERO_STRESS
from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.transmitted_wrenches import in_joints, joint_release_motion, relative_twists

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.equations import Equations
    from mbsvib.sensitivities.network import Network



@dataclass(frozen=True, slots=True)
class Loads:
    """Inputs or outputs (p,) as ``wrench`` (p, 6), world axes, in ``motion`` (p, 6, m) of one body against another at a
    point, ``on_bodies`` (b, 6, p) at the centres of mass; ``order`` (p,) is how often an output is differentiated.

    ``strain`` (s, 6, p) is what forces in springs take from the strain, ``base_motion`` (b, 6, p) the motion of the
    bodies with the base. ``centre`` (p,) is the body with whose centre of mass the port moves, -1 where its ``point``
    (p, 3) is given, and ``carrier`` (p,) the body that carries this point along, -1 for none. Ports ``excluded`` are
    forces in joints and sums of forces, which are none of that.

    A force in a joint is minus the work of all others in the ``virtual_displacements`` (b, 6, p) that open the joint
    along it, with ``openings`` (j + s, 6, p) of connections and rotations ``turned`` (j, 3, p); the sum of forces on
    bodies is that of their inertia as these move alone. Inputs do work on the former, as ``works`` (p,) says; ``ends``
    (p, 2) are the bodies of ports.
    """

    wrench: Array
    motion: Array
    on_bodies: Array
    order: Index
    strain: Array
    base_motion: Array
    centre: Index
    carrier: Index
    point: Array
    ends: Index
    virtual_displacements: Array
    openings: Array
    turned: Array
    works: NDArray[np.bool_]
    excluded: tuple[int, ...] = ()


def loads(system: Equations, network: Network, which: list[int], kind: str, excluded: Sequence[int] = ()) -> Loads:
    """Return some of a system's inputs or outputs as loads.

    ``kind``: "inputs" or "outputs"; ``excluded``: places of forces in joints and sums of forces that are no work on a
    motion.
    """
    kinds = (Input, BaseMotion) if kind == "inputs" else (Output, ForceOutput)
    known = {part.name: part for part in system.provenance.ports if isinstance(part, kinds)}
    parts: list[Any] = [known[getattr(system, kind)[k]] for k in which]
    origin = system.provenance.origin
    generated = set() if origin is None or kind == "inputs" else {
        name for name, part in origin.outputs.items() if type(part) in EXPANSIONS}  # fmt: skip
    bodies = len(network.bodies)
    number = {body.name: i for i, body in enumerate(network.bodies)} | {"ground": bodies}
    count = len(parts)
    wrench, point = np.zeros((count, 6)), np.zeros((count, 3))
    first, second = np.full(count, bodies), np.full(count, bodies)
    centre, carrier = np.full(count, -1), np.full(count, -1)
    strain, base_motion = np.zeros((len(network.springs), 6, count)), np.zeros((bodies, 6, count))
    virtual_displacements, openings = np.zeros((bodies, 6, count)), np.zeros((len(network.point), 6, count))
    turned = np.zeros((len(network.joints), 3, count))
    order, works, others = np.zeros(count, dtype=np.intp), np.zeros(count, dtype=bool), []
    for i, part in enumerate(parts):
        if part.name in generated or i in excluded:
            others.append(i)
        elif isinstance(part, ForceOutput):
            spring_strain = _spring(network, part)
            worked = _worked(system, network, part) if spring_strain is None else None
            if spring_strain is not None:
                strain[spring_strain[0], :, i] = spring_strain[1]
            elif worked is not None:
                virtual_displacements[:, :, i], openings[:, :, i], turned[:, :, i], works[i] = worked
            else:
                others.append(i)
        elif isinstance(part, BaseMotion):
            base_motion[:, :, i] = _rigid_motion(network, part)
        else:
            first[i], second[i] = number[part.relative_to], number[part.body]
            owner = int(second[i] if second[i] < bodies else first[i])
            if part.position is None:
                centre[i] = owner
            elif second[i] < bodies:
                carrier[i] = second[i]
            point[i] = network.position[owner] if part.position is None else part.position
            wrench[i] = part.wrench
            order[i] = 0 if isinstance(part, Input) else QUANTITIES.index(part.quantity)
    on_bodies = np.zeros((bodies, 6, count))
    for i in range(count):
        for body, sign in ((first[i], -1.0), (second[i], 1.0)):
            if body < bodies:
                on_bodies[body, :, i] += sign * wrench[i]
                on_bodies[body, 3:, i] += sign * np.cross(point[i] - network.position[body], wrench[i, :3])
    return Loads(wrench, _motion(network, first, second, point), on_bodies, order, strain, base_motion, centre, carrier,
                 point, np.stack((first, second), axis=1), virtual_displacements, openings, turned, works,
                 tuple(others))  # fmt: skip


def no_loads(network: Network, count: int) -> Loads:
    """Return loads that are zero, as many as asked for."""
    none = np.zeros((len(network.bodies), 6, count))
    return Loads(np.zeros((count, 6)), np.zeros((count, 6, network.displacements.shape[1])), none,
                 np.zeros(count, dtype=np.intp), np.zeros((len(network.springs), 6, count)), none,
                 np.full(count, -1), np.full(count, -1), np.zeros((count, 3)),
                 np.full((count, 2), len(network.bodies)), none, np.zeros((len(network.point), 6, count)),
                 np.zeros((len(network.joints), 3, count)), np.zeros(count, dtype=bool))  # fmt: skip


def _worked(system: Equations, network: Network, part: ForceOutput) -> tuple[Array, Array, Array, bool] | None:
    """The motion of bodies, of connections and the turns of joints on which a force in a joint, or all forces on a
    body, do work; whether inputs do, too. None for moments about centres of mass, which move by themselves, beside
    couplers, about the axes of screws, whose pitch ties it to the force, where redundant constraints share forces at
    will, and in loaded scenes for universal and homokinetic joints, whose axes do not go with the first body alone.
    """
    wrench = np.array(part.wrench)
    number = {body.name: i for i, body in enumerate(network.bodies)}
    k = next((k for k, joint in enumerate(network.joints) if joint.name == part.element), None)
    about_centre = k is None or network.joints[k].point is None
    tied = any(isinstance(other, Coupling) for other in network.parts)
    loaded = system.provenance.statics is not None and (
        network.forces is None or k in network.forces.twice or k in network.forces.halves)
    if loaded or tied or (about_centre and wrench[3:].any()):
        return None
    still, gap = np.zeros((len(network.point), 6)), np.zeros((len(network.joints), 6, 1))
    if k is None:
        virtual_displacements = np.zeros((len(network.bodies), 6))
        if part.element == "ground":
            virtual_displacements[:] = wrench
        elif part.element in number:
            virtual_displacements[number[part.element]] = -wrench
        else:
            return None
        return virtual_displacements, still, gap[:, 3:, 0], False
    if _shared(network)[k] or (network.joints[k].pitch is not None and wrench[5]):
        return None
    gap[k, :, 0] = (wrench.reshape(2, 3) @ np.array(network.joints[k].axes).T).reshape(6)
    body = joint_release_motion(network, gap)
    return body[:, :, 0], relative_twists(network, body)[:, :, 0], gap[:, 3:, 0], True


def _spring(network: Network, part: ForceOutput) -> tuple[list[int], Array] | None:
    """Numbers of springs and the direction of their force that is asked for, world axes; None for joints."""
    lines = network.maxwell_lines.get(part.element)
    carriers = network.carriers.get(part.element, (part.element,))
    numbers = [lines["static_stiffness"], lines["stiffness"]] if lines is not None else [
        network.spring_number[name] for name in carriers if name in network.spring_number]
    if not numbers or rules_of(network.springs[numbers[0]]).kind == "element":
        return None
    spring: Any = network.springs[numbers[0]]
    six = np.array(part.wrench)
    if not isinstance(spring, Bushing):
        return numbers, np.concatenate((np.array(spring.line) * six[2], np.zeros(3)))
    return numbers, np.concatenate((np.array(spring.orientation) @ six[:3], np.array(spring.orientation) @ six[3:]))


def _rigid_motion(network: Network, part: BaseMotion) -> Array:
    """Motion (b, 6) of the bodies with a base that moves by one unit."""
    linear, angular = np.array(part.wrench[:3]), np.array(part.wrench[3:])
    result = np.empty((len(network.bodies), 6))
    result[:, :3] = np.cross(angular, network.position - part.position) + linear
    result[:, 3:] = angular
    return result


def _motion(network: Network, first: Index, second: Index, point: Array) -> Array:
    """Relative motion (p, 6, m) of the ports."""
    count = len(point)
    if not count or network.coordinates is None:
        return np.zeros((0, 6, network.displacements.shape[1]))
    six = np.tile(np.eye(6), (count, 1)).T
    rows = Rows(np.repeat(first, 6), np.repeat(second, 6), np.repeat(point, 6, axis=0).T, six[:3], six[3:])
    relative = relative_motion(network.coordinates, rows).dense(0, 6 * count)
    if network.reduction is not None:
        relative = relative @ network.reduction
    return relative.reshape(count, 6, -1)


def _shared(network: Network) -> NDArray[np.bool_]:
    """Joints (j,) whose forces redundant constraints leave open: a state of self-stress goes through them."""
    ties = network.constraints
    if ties is None or not ties.stress.shape[1]:
        return np.zeros(len(network.joints), dtype=bool)
    states = np.abs(in_joints(network, np.zeros((len(network.bodies), 6, ties.stress.shape[1])), ties.stress))
    return np.asarray((states > ZERO_STRESS * states.max(axis=(0, 1))).any(axis=(1, 2)))


