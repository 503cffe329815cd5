"""Ports as connections of the network, and derivatives of frequency responses.

With R = T^-1 B and L = T^-T H^T, T = K + s C + s^2 M and H = Cq + s Cv + s^2 Ca, the response is G = H R + D, and where
T, H and B change dG = dD - sum over bodies and connections of what changes there, between the fields of L and those of
R. On the side of R an input is a connection with the wrench -B; on that of L an output one with the wrench -H. Forces
in springs see strains that lack what was asked for, base motion adds momentum to the bodies.

Ports are loads of the network where these give the system's own B, Cq, Cv, Ca and D.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Index
from mbsvib.elements import BaseMotion, Bushing, ForceOutput, Input, Output
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.families import EXPANSIONS
from mbsvib.elements.motion_input import DrivenCoordinate, MotionForce
from mbsvib.elements.ports import QUANTITIES
from mbsvib.elements.rows import Rows
from mbsvib.equations.equations import Equations
from mbsvib.kinematics.relative_motion import relative_motion
from mbsvib.linalg.rank import SAME_PORT_ROW, ZERO_PORT_ROW, ZERO_STRESS
from mbsvib.linalg.vectors import Field, moved, transformed
from mbsvib.sensitivities.adjoint_fields import (
    Fields,
    Motions,
    fields,
    in_joints,
    joint_release_motion,
    momentum,
    motions,
    relative_twists,
)
from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.forces import Forces, geometric_wrenches
from mbsvib.sensitivities.forms import form_table
from mbsvib.sensitivities.network import Network
from mbsvib.sensitivities.parameter_groups import ParameterGroups


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
    return Loads(np.zeros((count, 6)), np.zeros((count, 6, network.coordinates.displacements.shape[1])), none,
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
    if not count or network.coordinates.twists is None:
        return np.zeros((0, 6, network.coordinates.displacements.shape[1]))
    six = np.tile(np.eye(6), (count, 1)).T
    rows = Rows(np.repeat(first, 6), np.repeat(second, 6), np.repeat(point, 6, axis=0).T, six[:3], six[3:])
    relative = relative_motion(network.coordinates.twists, rows).dense(0, 6 * count)
    if network.coordinates.reduction is not None:
        relative = relative @ network.coordinates.reduction
    return relative.reshape(count, 6, -1)


def _shared(network: Network) -> NDArray[np.bool_]:
    """Joints (j,) whose forces redundant constraints leave open: a state of self-stress goes through them."""
    ties = network.tree.constraints
    if ties is None or not ties.stress.shape[1]:
        return np.zeros(len(network.joints), dtype=bool)
    states = np.abs(in_joints(network, np.zeros((len(network.bodies), 6, ties.stress.shape[1])), ties.stress))
    return np.asarray((states > ZERO_STRESS * states.max(axis=(0, 1))).any(axis=(1, 2)))


def checked_loads(
    system: Equations, network: Network, inputs: list[int], outputs: list[int]
) -> tuple[Loads, Loads] | None:
    """Return some inputs and outputs of a system as loads, None where they are more than loads of the network, as
    forces of moved ends are, which change with their element.
    """
    moved = {part.name for part in system.provenance.ports if isinstance(part, (MotionForce, DrivenCoordinate))}
    if any(system.inputs[k] in moved for k in inputs):
        return None
    actuation, sensing = (loads(system, network, *ports) for ports in ((inputs, "inputs"), (outputs, "outputs")))
    wrong = _wrong(system, network, (inputs, actuation), (outputs, sensing))
    if wrong:
        sensing = loads(system, network, outputs, "outputs", wrong)
        wrong = _wrong(system, network, (inputs, actuation), (outputs, sensing))
    return (actuation, sensing) if wrong == [] else None


def feedthrough(
    system: Equations, inputs: tuple[list[int], Loads], outputs: tuple[list[int], Loads]
) -> tuple[Array, Array]:
    """Return D (outputs, inputs), what outputs against inertial space see of base motions, and the base's angular
    acceleration for each (outputs, inputs, 3).

    As an output moves by dp, D changes by dD = wrench . (angular x dp).
    """
    sources = (Input, BaseMotion, MotionForce, DrivenCoordinate)
    known = {(part.name, isinstance(part, sources)): part for part in system.provenance.ports}
    d = np.zeros((len(outputs[0]), len(inputs[0])))
    turns = np.zeros((*d.shape, 3))
    for i, k in enumerate(inputs[0]):
        base = known[system.inputs[k], True]
        for o, j in enumerate(outputs[0]):
            observed = known[system.outputs[j], False]
            if isinstance(base, BaseMotion) and isinstance(observed, Output) and observed.inertial:
                angular = turns[o, i] = base.wrench[3:]
                linear = base.wrench[:3] + np.cross(angular, outputs[1].point[o] - base.position)
                d[o, i] = np.concatenate((linear, angular)) @ outputs[1].wrench[o]
    return d, turns


def _at_rest(network: Network, forces: Forces, sensing: Loads, motion: Array) -> Array:
    """What forces at rest do to those seen in joints, (p, m) per unit of the motion (b, 6, m) of the bodies."""
    turned = sensing.turned if sensing.turned.any() else None
    wrench = geometric_wrenches(forces, sensing.virtual_displacements * sensing.works, -1, turned)
    return np.asarray(np.einsum("bip,bim->pm", wrench, motion))


def _wrong(
    system: Equations, network: Network, inputs: tuple[list[int], Loads], outputs: tuple[list[int], Loads]
) -> list[int] | None:
    """The outputs whose rows of Cq, Cv, Ca and D these loads do not give, None if they do not give B."""
    (i, actuation), (o, sensing), joints = inputs, outputs, len(network.joints)
    strains, matrices = network.coordinates.of_connections()[joints:], network.matrices
    momenta = momentum(network, actuation.base_motion)
    acts = np.einsum("pi,pim->mp", actuation.wrench, actuation.motion)
    acts -= np.einsum("bim,bip->mp", system.body_motion, momenta)
    moves = np.einsum("pi,pim->pm", sensing.wrench, sensing.motion)
    strain = sensing.strain - sensing.openings[joints:]
    forces = [np.einsum("sip,sij,sjm->pm", strain, z, strains) for z in (matrices.stiffness, matrices.damping)]
    forces.append(-np.einsum("bip,bim->pm", sensing.virtual_displacements, momentum(network, system.body_motion)))
    if network.forces is not None:
        forces[0] -= _at_rest(network, network.forces, sensing, system.body_motion)
    direct_terms = [moves * (sensing.order == k)[:, None] + forces[k] for k in range(3)]
    direct = feedthrough(system, inputs, outputs)[0] - np.einsum("bio,bip->op", sensing.virtual_displacements, momenta)
    direct += np.einsum("bio,bip->op", sensing.virtual_displacements * sensing.works, actuation.on_bodies)
    if np.abs(acts - system.B[:, i]).max(initial=0.0) > SAME_PORT_ROW * np.abs(system.B[:, i]).max(initial=0.0):
        return None
    off = np.zeros(len(o), dtype=bool)
    stated = (system.D[np.ix_(o, i)], system.Cq[o], system.Cv[o], system.Ca[o])
    for computed, expected in zip((direct, *direct_terms), stated, strict=True):
        size = np.abs(expected)
        allowed = SAME_PORT_ROW * size.max(axis=1, initial=0.0) + ZERO_PORT_ROW * size.max(initial=0.0)
        off |= np.abs(computed - expected).max(axis=1, initial=0.0) > allowed
    off[list(sensing.excluded)] = False
    return np.flatnonzero(off).tolist()


def port_forms(
    groups: ParameterGroups, ports: tuple[Loads, Loads], powers: tuple[Field, Field, Field],
    vectors: tuple[Field, Field], turns: Array,
) -> Field:  # fmt: skip
    """Return dD + L^T dB + dH R - L^T dT R for all parameters of the groups, (parameters, outputs, inputs, n).

    H = Cq + s Cv + s^2 Ca, T = K + s C + s^2 M

    ``powers`` (n,): 1, s and s^2, or 1 and 0 to have the derivatives of one matrix only; ``vectors`` (m, 1, inputs, n)
    and (m, outputs, 1, n): R and L; ``turns`` (outputs, inputs, 3): how D changes, see ``feedthrough``.
    """
    network, (actuation, sensing) = groups.network, ports
    x, y = motions(network, vectors[0]), _with_released_motions(network, motions(network, vectors[1]), sensing)
    momenta = momentum(network, actuation.base_motion)
    on_right = (momenta - actuation.on_bodies)[:, :, None, :, None]
    by_order = np.array([powers[k] for k in sensing.order]).reshape(-1, 1, len(powers[0]))
    on_left = -sensing.on_bodies[:, :, :, None, None] * by_order
    right = fields(network, x, *powers, load=on_right, side=1)
    left = _sensing_fields(network, y, sensing, powers, on_left)
    result: Field = -groups.forms(left, right)
    bodies = groups.of_bodies()
    for at in np.flatnonzero(actuation.base_motion.any(axis=(0, 1))):
        ones, base_motion = np.ones(1), actuation.base_motion[:, :, at, None, None]
        none = np.zeros((len(network.tree.floating), 6, 1, 1))
        by_base = replace(right, body=base_motion, body_wrench=momenta[:, :, at, None, None], support=none, square=ones)
        still = replace(left, body=y.body[..., 0, :], body_wrench=y.momentum[..., 0, :], support=none, square=ones)
        result[:, :, at] -= form_table(bodies, groups.size, still, by_base)
    _move_ports(result, groups, (actuation, sensing), vectors, by_order[:, 0], turns)
    return result


def _with_released_motions(network: Network, motion: Motions, sensing: Loads) -> Motions:
    """L with the motions on which forces in joints and sums of forces do work."""
    if not sensing.virtual_displacements.any():
        return motion
    body, openings = (array[:, :, :, None, None] for array in (sensing.virtual_displacements, sensing.openings))
    strained = openings[len(network.joints) :]
    viscous = None if motion.viscous is None else motion.viscous + transformed(network.matrices.damping, strained)
    return replace(motion, body=motion.body + body, relative=motion.relative + openings,
                   momentum=motion.momentum + momentum(network, body), viscous=viscous,
                   elastic=motion.elastic + transformed(network.matrices.stiffness, strained))  # fmt: skip


def _sensing_fields(
    network: Network, motion: Motions, sensing: Loads, powers: tuple[Field, Field, Field], load: Field
) -> Fields:
    """Fields of L; forces in springs are seen through strains that lack their directions."""
    turned = inertia_only = None
    if network.forces is not None and sensing.virtual_displacements.any():
        without_work = sensing.virtual_displacements * ~sensing.works
        turned, inertia_only = (array[:, :, :, None, None] for array in (sensing.turned, without_work))
    if not sensing.strain.any():
        return fields(network, motion, *powers, load=load, side=-1, turned=turned, inertia_only=inertia_only)
    of_springs = sensing.strain[:, :, :, None, None]
    strain = motion.relative[len(network.joints) :] - of_springs
    viscous = None if motion.viscous is None else motion.viscous - transformed(network.matrices.damping, of_springs)
    elastic = motion.elastic - transformed(network.matrices.stiffness, of_springs)
    unbalanced = replace(motion, elastic=elastic, viscous=viscous)
    return fields(network, unbalanced, *powers, load=load, strain=strain, side=-1, turned=turned,
                  inertia_only=inertia_only)  # fmt: skip


def _move_ports(
    result: Field, groups: ParameterGroups, ports: tuple[Loads, Loads], vectors: tuple[Field, Field],
    by_order: Field, turns: Array,
) -> None:  # fmt: skip
    """Ports move with centres of mass, and with the bodies as the pose moves: dG = wrench . (angular x dp); directions
    turn with the first body by phi: dG = (phi x force) . linear + (phi x moment) . angular.
    """
    (actuation, sensing), (right, left) = ports, (vectors[0][:, 0], vectors[1][:, :, 0])
    works = np.concatenate((sensing.virtual_displacements * sensing.works, np.zeros((1, 6, len(sensing.wrench)))))
    centres = np.concatenate((groups.network.position, np.zeros((1, 3))))
    moves = [(actuation, i, result[:, :, i], np.tensordot(actuation.motion[i], left, axes=1)
              - np.subtract(*moved(works[ends], actuation.point[i] - centres[ends]))[:, :, None])
             for i, ends in enumerate(actuation.ends)]  # fmt: skip
    turned = np.concatenate((np.zeros_like(turns), turns), axis=2)
    moves += [(sensing, o, result[:, o], np.tensordot(sensing.motion[o], right, axes=1) * by_order[o]
               + turned[o].T[:, :, None]) for o in range(len(sensing.wrench))]  # fmt: skip
    for port, k, form, relative in moves:
        slope = np.cross(port.wrench[k, :3], relative[3:], axisb=0, axisc=0)
        if port.ends[k, 0] < len(groups.network.bodies) and groups.loaded is not None:
            groups.loaded.add_turn(form, int(port.ends[k, 0]), port.wrench[k], relative)
        if port.carrier[k] >= 0 and groups.loaded is not None:
            groups.loaded.add_point_motion(form, int(port.carrier[k]), port.point[k], slope)
        for group in groups.by_rule:
            for shift in group.shifts:
                at = np.flatnonzero(shift.number == port.centre[k])
                move = np.broadcast_to(shift.move, (len(shift.number), *shift.move.shape[1:]))[at]
                rows = group.rows[at] if len(group.rows) == len(shift.number) else group.rows.repeat(len(at), axis=0)
                np.add.at(form, rows[rows >= 0], np.tensordot(move, slope, axes=1)[rows >= 0])
