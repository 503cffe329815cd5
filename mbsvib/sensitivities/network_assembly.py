"""The network of a system: its bodies, connections and forces in numbers, and which parameters act by rules there.

In mechanisms with loads, stiffness, damping and inertia enter by the motions alone, too: the pose balances as before,
as preloads are forces at the pose. What moves the equilibrium or changes forces in joints goes through the balance of
the network, where all parts are known there, or acts on the matrices as wholes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array

from mbsvib.common.arrays import Array, Index
from mbsvib.elements import Body, Joint
from mbsvib.elements.body import tensors
from mbsvib.elements.connection import Connection
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.families import has_rows
from mbsvib.elements.hub import Hub
from mbsvib.elements.load import Gravity
from mbsvib.elements.motion_input import DrivenCoordinate
from mbsvib.elements.part import Composed, Part
from mbsvib.elements.rotor import Rotor
from mbsvib.elements.rows import Rows
from mbsvib.elements.superelement import Superelement
from mbsvib.equations.equations import Equations
from mbsvib.equations.expansion import expanded
from mbsvib.equations.wrenches import is_loaded as carries_loads
from mbsvib.linalg.rank import NO_WORK, SAME_WORK
from mbsvib.linalg.rotations import logarithm
from mbsvib.linalg.vectors import entries_matrix, transformed
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.sensitivities.adjoint_fields import motions
from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.families.connections import element_matrices, point_of
from mbsvib.sensitivities.families.pose_changes import displaced, turned
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.network import (
    Coefficients,
    Coordinates,
    Limit,
    Network,
    Tree,
    maxwell_parts,
    shared_forces,
    spin,
)
from mbsvib.sensitivities.network_kinematics import ElementReactions, Kinematics, element_reactions, joint_coordinates

# Kinds of parts that are springs of the network; others are made of these.
SPRINGS = ("spring", "element")
_SIX = np.eye(6)
# Factors of stiffness, damping and inertia of which one is 1.
_POWERS = tuple([(one[0], one[1], one[2]) for one in np.eye(3)])


def complete_network(system: Equations) -> Network:
    """Return the network of a system, without any of its parts where these do not make up all of its forces."""
    system.provenance.check_parameters(system.name, "sensitivities")
    if not has_network(system):
        return bare_network(system)
    network = assembled(system)
    return network if is_complete(system, network) else bare_network(system)


def has_network(system: Equations) -> bool:
    """Tell whether a system may be a network: its parts are known, and none of those that share it is missing.

    Parts of mechanisms with loops or massless motions, which ``reachable`` has taken out of them, have none.
    """
    provenance = system.provenance
    if provenance.removed is not None and (provenance.separation is not None or provenance.topology.cut):
        return False
    return provenance.origin is not None or not any(isinstance(part, Composed) for part in provenance.parts)


def is_complete(system: Equations, network: Network) -> bool:
    """Tell whether the forces of rigid bodies, beams and spring-dampers are all that a system has.

    The work of one motion is compared with that of the system's factors.
    """
    trial = np.cos(np.arange(system.dof))[:, None]  # no structure of a mechanism
    moved, strained = system.inertia_factor @ trial, system.elastic_rows @ trial
    motion = motions(network, trial)
    strain = motion.relative[len(network.joints) :]
    # rows of geometric stiffness, behind those of the springs, belong to parameters that have no rule
    strained = strained[:, 0] * (system.row_owner < len(system.provenance.springs))
    shared = [0.0, 0.0, 0.0]
    matrices = network.matrices
    if matrices.shared is not None and motion.nodes is not None:
        shared = [float((motion.body * matrices.shared.wrench(motion.nodes, powers)).sum()) for powers in _POWERS]
    far = NO_WORK * float(np.square(motion.relative).max(initial=0.0))
    return all(
        bool(abs(work + shared_work - terms.sum()) <= SAME_WORK * np.abs(terms).sum() + far * float(np.abs(size).sum()))
        for work, shared_work, terms, size in (
            ((strain * motion.elastic).sum(), shared[0], system.row_stiffness * strained**2, matrices.stiffness),
            (0.0 if motion.viscous is None else (strain * motion.viscous).sum(), shared[1],
             system.row_damping * strained**2, matrices.damping),
            ((motion.body * motion.momentum).sum(), shared[2] + _inertial(network, strain),
             moved[:, 0] ** 2, network.matrices.mass),
        )
    )


def _inertial(network: Network, strain: Array) -> float:
    """The work of inerters."""
    inertance = network.matrices.inertance
    return 0.0 if inertance is None else float((strain * transformed(inertance, strain)).sum())


def bare_network(system: Equations) -> Network:
    """Return a network without parts, for a system whose parameters have no rules of their own."""
    none, vectors, matrices = np.zeros(0), np.zeros((0, 3)), np.zeros((0, 6, 6))
    index, empty = np.zeros(0, dtype=np.intp), csr_array((0, 0))
    return Network(
        system.provenance.parts, (), (), (), vectors, vectors,
        Coordinates(None, None, csr_array((0, system.dof)), np.zeros((0, system.dof))),
        Tree((), index, index, empty, empty, index, None, np.zeros(3)),
        Coefficients(none, np.zeros((0, 3, 3)), matrices, matrices), limits(system), True,
    )  # fmt: skip


def assembled(system: Equations, kinematics: Kinematics | None = None) -> Network:
    """Return the network of a system.

    Its coordinates are ``kinematics``, joint coordinates unless others are given.
    """
    members = _members(system)
    network, forces = _unloaded(system, members, kinematics or joint_coordinates(system, members.bodies)), None
    if kinematics is None and follows(system):  # amplitudes of some modes do not tell how the pose moves
        forces = _forces(system, network)
    if forces is not None:
        network = replace(network, forces=forces[0], reactions=forces[1])
    if members.plain is None or (forces is None and is_loaded(system)):
        return network
    spins = spin(members.plain, members.bodies, members.springs)
    return network if spins is None else replace(network, matrices=replace(network.matrices, spin=spins))


class _Members(NamedTuple):
    """Bodies, joints and springs of a system, with those that beams, superelements and Maxwell elements are made of,
    and its ``plain`` model in which these are replaced; None where there is no model.
    """

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    springs: tuple[Any, ...]
    plain: Mechanism | None


def _members(system: Equations) -> _Members:
    parts, topology, origin = system.provenance.parts, system.provenance.topology, model_in_pose(system)
    plain = None if origin is None else expanded(origin)
    springs: tuple[Any, ...] = tuple([part for part in parts if _is_spring(part)])
    nodes, lines = maxwell_parts(parts)
    known: dict[str, Any] = {} if plain is None else dict(plain.bodies)
    known |= {part.name: part for part in (*parts, *nodes) if rules_of(part).kind == "body"}
    names = {spring.name for spring in springs}
    generated = [] if plain is None or plain.expansion is None else [
        part for part in plain.springs.values() if part.name not in names and _is_spring(part)]
    return _Members(tuple([known[name] for name in topology.bodies]), topology.joints, (*springs, *generated, *lines),
                    plain)  # fmt: skip


def _unloaded(system: Equations, members: _Members, kinematics: Kinematics) -> Network:
    """The network without forces at the pose."""
    topology, (bodies, joints, springs, plain) = system.provenance.topology, members
    number = {body.name: i for i, body in enumerate(bodies)} | {"ground": len(bodies)}
    point = np.array([*(_point(joint, bodies, number) for joint in joints), *(point_of(part) for part in springs),
                      ]).reshape(-1, 3)  # fmt: skip
    first, second = (np.array([number[getattr(part, end)] for part in (*joints, *springs)], dtype=np.intp)
                     for end in ("first", "second"))  # fmt: skip
    position, axes = np.array([body.position for body in bodies]), np.array([body.orientation for body in bodies])
    tensor = tensors(np.array([body.inertia for body in bodies]))
    every = np.concatenate((point, position))
    centre = 0.5 * (every.min(axis=0) + every.max(axis=0))
    six = np.tile(_SIX, (len(first), 1)).T
    rows = Rows(np.repeat(first, 6), np.repeat(second, 6), np.repeat(point, 6, axis=0).T, six[:3], six[3:])
    tree = Tree(
        tuple([(branch.body, branch.parent) for branch in topology.branches]), *topology.outer,
        _incidence(first[len(joints) :], second[len(joints) :], len(bodies)),
        _incidence(first[: len(joints)], second[: len(joints)], len(bodies)),
        np.array(topology.floating, dtype=np.intp), kinematics.constraints(bodies, number, centre), centre,
    )  # fmt: skip
    matrices = Coefficients(
        np.array([body.mass for body in bodies]), axes @ tensor @ axes.transpose(0, 2, 1),
        *element_matrices(springs, point[len(joints) :]),
        None if plain is None else shared_forces(plain, bodies, number, kinematics),
    )  # fmt: skip
    coordinates = Coordinates(kinematics.coordinates, kinematics.reduction, kinematics.relative(rows),
                              system.body_motion.reshape(6 * len(bodies), -1))  # fmt: skip
    return Network(
        system.provenance.parts, bodies, joints, springs, position, point, coordinates, tree, matrices, limits(system),
        loads=() if plain is None else tuple(plain.loads.values()),
        carriers={} if plain is None or plain.expansion is None else plain.expansion.carriers,
    )  # fmt: skip


def _forces(system: Equations, network: Network) -> tuple[Forces, ElementReactions | None] | None:
    """The forces at the pose, and the elements of beams and superelements whose forces statics gives; None where it
    does not determine these.
    """
    composed, reactions = [part for part in network.parts if rules_of(part).kind == "composed"], None
    if composed:
        moves = network.coordinates.of_connections()[len(network.joints) :]
        elements = [rules_of(part).loaded.reactions(part) for part in composed]
        motion_of = dict(zip(system.bodies, system.body_motion, strict=True))
        reactions = element_reactions(elements, network.spring_number, moves, motion_of)
        if reactions is None:
            return None
    return forces_at_rest(system, network), reactions


def _is_spring(part: Part) -> bool:
    return has_rows(part) and rules_of(part).kind in SPRINGS


def model_in_pose(system: Equations) -> Mechanism | None:
    """Return the model of a system in the pose of its equations; None where there is none."""
    provenance = system.provenance
    if provenance.origin is None or not provenance.moved_to_equilibrium:
        return provenance.origin
    part_of = {part.name: part for part in provenance.parts}
    groups: Any = {key: {name: part_of[name] for name in group} for key, group in provenance.origin.groups().items()
              if key not in ("inputs", "outputs")}  # fmt: skip
    return provenance.origin.with_parts(**groups)


def _point(joint: Joint, bodies: Sequence[Body], number: dict[str, int]) -> tuple[float, float, float]:
    return joint.point or bodies[min(number[joint.first], number[joint.second])].position


def _incidence(first: Index, second: Index, bodies: int) -> Any:
    """+1 for the second and -1 for the first body of each of n connections, (bodies, n)."""
    n = len(first)
    row, column = np.concatenate((second, first)), np.tile(np.arange(n), 2)
    value = np.repeat([1.0, -1.0], n)
    moves = row < bodies
    return entries_matrix(value[moves], row[moves], column[moves], (bodies, n))


_STIFFNESS = {("spring", "stiffness"), ("torsion", "stiffness")}
_DAMPING = {("spring", "damping"), ("torsion", "damping")}
_INERTIA, _MASS = {("body", "inertia"), ("spring", "inertance")}, {("body", "mass")}


def limits(system: Equations) -> tuple[Limit, ...]:
    """Return what limits the parameters that act by rules of their own, nothing for most systems.

    They are kinds of parts with their fields; only what is in all of these sets has a rule.
    """
    provenance = system.provenance
    parts, result = provenance.parts, []
    if is_loaded(system):
        falls = _has(parts, Gravity)
        if provenance.moved_to_equilibrium:
            result.append(_INERTIA if _turned(system) else _DAMPING | _INERTIA)
        else:
            result.append(_STIFFNESS | _DAMPING | _INERTIA | (set() if falls else _MASS))
    coupled = any(isinstance(part, Connection) and part.cross_coupling is not None for part in parts)
    if (_has(parts, Rotor) or coupled) and (is_loaded(system) or provenance.origin is None):
        # dampers that turn with a rotor are stiffness, too
        result.append(_STIFFNESS | _DAMPING if system.circulatory is None else _STIFFNESS)
    # masses and places of parts on hubs act on forces at rest as well; what drives move is no coordinate
    if _has(parts, Hub) or _has(provenance.ports, DrivenCoordinate):
        result.append(set())
    separation = provenance.separation
    if separation is not None and separation.transform is not None and system.circulatory is not None:
        # motions without mass follow others by K, from the left in other ways than from the right
        result.append(_DAMPING | _INERTIA | _MASS)
    return tuple(map(frozenset, result))


def is_loaded(system: Equations) -> bool:
    """Tell whether loads act at the pose of a system; of one in some modes, its model says so."""
    provenance = system.provenance
    return provenance.statics is not None or (provenance.origin is not None and carries_loads(provenance.origin))


def may_move(system: Equations) -> bool:
    """Tell whether parameters may move the pose: forces act on it, or are zero and may be changed."""
    provenance = system.provenance
    return provenance.statics is not None or _has(provenance.parts, Gravity) or any(
        getattr(part, "preload", None) is not None or getattr(part, "free_length", None) is not None
        for part in provenance.parts)  # fmt: skip


def follows(system: Equations) -> bool:
    """Tell whether derivatives through the equilibrium of a loaded scene are known of all its parts.

    True where all motions without mass have dampers, and each part has rules for what forces at the pose do.
    """
    provenance = system.provenance
    turned_bushings = _turned(system)
    return (
        may_move(system) and provenance.removed is None
        and (provenance.statics is not None or not (is_loaded(system) or _has(provenance.parts, Composed)))
        and (provenance.separation is None or provenance.separation.transform is None)
        and not any(group.surplus for group in provenance.reduction.groups if _has(provenance.parts, Coupling))
        and not (_has(provenance.parts, Superelement) and any(
            isinstance(part, Gravity) and not any(part.acceleration) for part in provenance.parts))
        and not any(rules_of(part).loaded.is_exception(part, provenance.moved_to_equilibrium, turned_bushings)
                    for part in provenance.parts)
    )  # fmt: skip


def _has(parts: Iterable[Part], kind: type[Part]) -> bool:
    return any(isinstance(part, kind) for part in parts)


def _turned(system: Equations) -> frozenset[str]:
    """Bushings that turned on the way to an equilibrium that was found elsewhere."""
    provenance = system.provenance
    if not provenance.moved_to_equilibrium or provenance.origin is None:
        return frozenset()
    return turned(provenance.origin, provenance.parts)


def forces_at_rest(system: Equations, network: Network) -> Forces:
    """Return the forces at the pose of a system: those in joints and springs, of gravity and of loads."""
    statics, loads, point, gravity = system.provenance.statics, network.loads, network.point, network.gravity
    bodies, joints, springs, number = network.bodies, network.joints, network.springs, network.body_number
    ground, j = len(bodies), len(joints)
    connections: tuple[Any, ...] = (*joints, *springs)
    n = len(connections) + len(bodies) + len(loads)
    wrench, points, span, axes = np.zeros((n, 6)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 2, 3))
    first, second = np.full(n, ground), np.empty(n, dtype=np.intp)
    first[: len(connections)] = [number[part.first] for part in connections]
    second[:] = [*(number[part.second] for part in connections), *range(ground), *(number[p.body] for p in loads)]
    first[first < 0], second[second < 0] = ground, ground
    points[: len(connections)] = point
    halves = np.array([k for k, joint in enumerate(joints) if joint.bisects], dtype=np.intp)
    for k, joint in enumerate(joints):
        if statics is not None:
            at = statics.pairs.end[:, len(statics.applied.names) + k]
            wrench[k] = statics.joints[:, k]
            wrench[k, 3:] += np.cross(at - points[k], wrench[k, :3])
        if joint.end is not None:
            span[k] = np.subtract(joint.end, joint.position or np.zeros(3))
        if joint.successive:
            axes[k] = [six[3:] for _, six in joint.freedom[-2:]]
    for k, spring in enumerate(springs, j):
        wrench[k] = spring.rest_wrench
        if spring.points:
            points[k] = spring.points[-1]
        if spring.acts_along_line:
            span[k] = np.subtract(spring.points[-1], spring.points[0])
    for k, body in enumerate(bodies, len(connections)):
        points[k], wrench[k, :3] = body.position, body.mass * gravity
    for k, load in enumerate(loads, len(connections) + len(bodies)):
        points[k] = bodies[number[load.body]].position if load.position is None else load.position
        wrench[k] = *load.force, *load.torque
    follows = np.array([load.follower for load in loads], dtype=bool)
    every = np.arange(n - len(loads), n)
    angle = _angles(system, bodies, [joints[k] for k in halves])
    centre = np.array([body.position for body in bodies])
    return Forces(first, second, points, wrench, span, axes, halves, angle, centre,
                  (j, len(springs), ground, len(loads)), gravity, every[~follows], every[follows])  # fmt: skip


def _angles(system: Equations, bodies: Sequence[Body], joints: Sequence[Joint]) -> Array:
    """The rotation vectors (joints, 3) by which joints turned on the way to the equilibrium, world axes there."""
    provenance, angle = system.provenance, np.zeros((len(joints), 3))
    if provenance.moved_to_equilibrium and provenance.origin is not None:
        pose = displaced(provenance.origin, bodies)
        for k, joint in enumerate(joints):
            first, second = (pose.rotations[pose.number[body]] for body in (joint.first, joint.second))
            angle[k] = logarithm(second @ first.T)
    return angle
