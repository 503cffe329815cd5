"""The network of a system: its bodies and connections in numbers, and whether these are all that the system has."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array

from mbsvib.elements.families import has_rows
from mbsvib.elements.part import Composed
from mbsvib.elements.rows import Rows
from mbsvib.equations.expansion import expanded
from mbsvib.linalg.rank import NO_WORK, SAME_WORK
from mbsvib.linalg.vectors import entries_matrix, transformed
from mbsvib.mechanism.topology import FLOATS
from mbsvib.sensitivities.adjoint_fields import motions
from mbsvib.sensitivities.applicability import follows, is_loaded, limits
from mbsvib.sensitivities.element_matrices import element_matrices
from mbsvib.sensitivities.element_reactions import element_reactions
from mbsvib.sensitivities.families import rules_of
from mbsvib.sensitivities.families.element import point_of
from mbsvib.sensitivities.forces_at_rest import forces_at_rest
from mbsvib.sensitivities.network import Network, maxwell_parts
from mbsvib.sensitivities.network_kinematics import JointCoordinates
from mbsvib.sensitivities.shared_wrenches import shared_forces, spin

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Body, Joint
    from mbsvib.elements.part import Part
    from mbsvib.equations.equations import Equations
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.sensitivities.element_reactions import ElementReactions
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network_kinematics import Kinematics

# Kinds of parts that are springs of the network; others are made of these.
SPRINGS = ("spring", "element")
_TENSOR = [0, 3, 4, 3, 1, 5, 4, 5, 2]  # xx xy xz, xy yy yz, xz yz zz out of xx yy zz xy xz yz
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
    if network.shared is not None and motion.nodes is not None:
        shared = [float((motion.body * network.shared.wrench(motion.nodes, powers)).sum()) for powers in _POWERS]
    far = NO_WORK * float(np.square(motion.relative).max(initial=0.0))
    return all(
        bool(abs(work + shared_work - terms.sum()) <= SAME_WORK * np.abs(terms).sum() + far * float(np.abs(size).sum()))
        for work, shared_work, terms, size in (
            ((strain * motion.elastic).sum(), shared[0], system.row_stiffness * strained**2, network.stiffness),
            (0.0 if motion.viscous is None else (strain * motion.viscous).sum(), shared[1],
             system.row_damping * strained**2, network.damping),
            ((motion.body * motion.momentum).sum(), shared[2] + _inertial(network, strain),
             moved[:, 0] ** 2, network.mass),
        )
    )


def _inertial(network: Network, strain: Array) -> float:
    """The work of inerters."""
    return 0.0 if network.inertance is None else float((strain * transformed(network.inertance, strain)).sum())


def bare_network(system: Equations) -> Network:
    """Return a network without parts, for a system whose parameters have no rules of their own."""
    none, vectors, matrices = np.zeros(0), np.zeros((0, 3)), np.zeros((0, 6, 6))
    index = np.zeros(0, dtype=np.intp)
    return Network(
        system.provenance.parts, (), (), (), None, None, none, np.zeros((0, 3, 3)), vectors, np.zeros((0, 3, 3)),
        vectors, csr_array((0, system.dof)), matrices, matrices, (), index, none, csr_array((0, 0)), None, None,
        np.zeros(3), np.zeros((0, system.dof)), index, index, limits(system), True,
    )  # fmt: skip


def assembled(system: Equations, kinematics: Kinematics | None = None) -> Network:
    """Return the network of a system.

    Its coordinates are ``kinematics``, joint coordinates unless others are given.
    """
    members = _members(system)
    network, forces = _unloaded(system, members, kinematics or JointCoordinates.of(system, members.bodies)), None
    if kinematics is None and follows(system):  # amplitudes of some modes do not tell how the pose moves
        forces = _forces(system, network)
    if forces is not None:
        network = replace(network, forces=forces[0], reactions=forces[1])
    if members.plain is None or (forces is None and is_loaded(system)):
        return network
    spins = spin(members.plain, members.bodies, members.springs)
    return network if spins is None else replace(network, spin=spins)


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
    tensors = np.array([body.inertia for body in bodies])[:, _TENSOR].reshape(-1, 3, 3)
    every = np.concatenate((point, position))
    centre = 0.5 * (every.min(axis=0) + every.max(axis=0))
    six = np.tile(_SIX, (len(first), 1)).T
    rows = Rows(np.repeat(first, 6), np.repeat(second, 6), np.repeat(point, 6, axis=0).T, six[:3], six[3:])
    stiffness, damping, inertance = element_matrices(springs, point[len(joints) :])
    displacements = system.body_motion.reshape(6 * len(bodies), -1)
    behind, sign = _outer_bodies(system)
    return Network(
        system.provenance.parts, bodies, joints, springs, kinematics.coordinates, kinematics.reduction,
        np.array([body.mass for body in bodies]), axes @ tensors @ axes.transpose(0, 2, 1), position, axes, point,
        kinematics.relative(rows), stiffness, damping,
        tuple([(branch.body, branch.parent) for branch in topology.branches]), behind, sign,
        _incidence(first[len(joints) :], second[len(joints) :], len(bodies)),
        _incidence(first[: len(joints)], second[: len(joints)], len(bodies)),
        kinematics.constraints(bodies, number, centre), centre, displacements,
        np.flatnonzero(displacements.any(axis=1)), np.array(topology.floating, dtype=np.intp), limits(system),
        loads=() if plain is None else tuple(plain.loads.values()), inertance=inertance,
        carriers={} if plain is None or plain.expansion is None else plain.expansion.carriers,
        shared=None if plain is None else shared_forces(plain, bodies, number, kinematics),
    )  # fmt: skip


def _forces(system: Equations, network: Network) -> tuple[Forces, ElementReactions | None] | None:
    """The forces at the pose, and the elements of beams and superelements whose forces statics gives; None where it
    does not determine these.
    """
    composed, reactions = [part for part in network.parts if rules_of(part).kind == "composed"], None
    if composed:
        at_joints = network.relative if network.reduction is None else network.relative @ network.reduction
        moves = np.asarray(at_joints @ np.eye(system.dof)).reshape(-1, 6, system.dof)[len(network.joints) :]
        reactions = element_reactions([rules_of(part).reactions(part) for part in composed], network.spring_number,
                                      moves, dict(zip(system.bodies, system.body_motion, strict=True)))  # fmt: skip
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


def _outer_bodies(system: Equations) -> tuple[Index, Array]:
    """Body behind each joint of the tree and the joint's sign, 0 for joints that are cut."""
    topology = system.provenance.topology
    behind, sign = np.zeros(len(topology.joints), dtype=np.intp), np.zeros(len(topology.joints))
    for branch in topology.branches:
        if branch.joint != FLOATS:
            behind[branch.joint], sign[branch.joint] = branch.body, branch.sign
    return behind, sign


def _incidence(first: Index, second: Index, bodies: int) -> Any:
    """+1 for the second and -1 for the first body of each of n connections, (bodies, n)."""
    n = len(first)
    row, column = np.concatenate((second, first)), np.tile(np.arange(n), 2)
    value = np.repeat([1.0, -1.0], n)
    moves = row < bodies
    return entries_matrix(value[moves], row[moves], column[moves], (bodies, n))
