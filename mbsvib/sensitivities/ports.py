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

from mbsvib.elements import BaseMotion, ForceOutput, Input, Maxwell, Output, Spring
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.ports import QUANTITIES
from mbsvib.elements.rows import Rows
from mbsvib.kinematics.relative_motion import relative_motion
from mbsvib.sensitivities.adjoint_fields import in_joints, momentum
from mbsvib.sensitivities.joint_release_motion import given_way, seen
from mbsvib.sensitivities.maxwell import name_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.equations import Equations
    from mbsvib.sensitivities.balance.forces import Forces
    from mbsvib.sensitivities.basis import SensitivityBasis
    from mbsvib.sensitivities.network import Network

# B, H and D of the network and those of the system are the same numbers but for rounding.
SAME = 1e-9
# Rounding of the largest among all rows.
ROUNDING = 1e-12


@dataclass(frozen=True, slots=True)
class Loads:
    """Inputs or outputs (p,) as ``wrench`` (p, 6), world axes, in ``motion`` (p, 6, m) of one body against another at a
    point, ``on_bodies`` (b, 6, p) at the centres of mass; ``order`` (p,) is how often an output is differentiated.

    ``strain`` (s, 6, p) is what forces in springs take from the strain, ``carried`` (b, 6, p) the motion of the bodies
    with the base. ``centre`` (p,) is the body with whose centre of mass the port moves, -1 where its ``point`` (p, 3)
    is given, and ``carrier`` (p,) the body that carries this point along, -1 for none. Ports ``beside`` these are
    forces in joints and sums of forces, which are none of that.

    A force in a joint is minus the work of all others on the motion ``given`` (b, 6, p) in which the joint comes apart
    along it, ``apart`` (j + s, 6, p) in connections and ``turned`` (j, 3, p) open; the sum of forces on bodies is that
    of their inertia as these move alone. Inputs do work on the former, which ``works`` (p,) tells; ``ends`` (p, 2) are
    the bodies of ports.
    """

    wrench: Array
    motion: Array
    on_bodies: Array
    order: Index
    strain: Array
    carried: Array
    centre: Index
    carrier: Index
    point: Array
    ends: Index
    given: Array
    apart: Array
    turned: Array
    works: NDArray[np.bool_]
    beside: tuple[int, ...] = ()


def ported(basis: SensitivityBasis, inputs: list[int], outputs: list[int]) -> tuple[Network, Loads, Loads]:
    """Return the network of a system with some of its ports as loads; one without parts where ports are more than that.

    Parameters
    ----------
    basis : SensitivityBasis
        The equations of motion, their modes and their network.
    inputs, outputs : list of int
        Numbers of the ports.

    Returns
    -------
    Network
        Bodies and connections.
    Loads, Loads
        Inputs and outputs.
    """
    system, network = basis.equations, basis.network
    if not network.bare:
        acting, seeing = (loads(system, network, *each) for each in ((inputs, "inputs"), (outputs, "outputs")))
        wrong = _wrong(system, network, (inputs, acting), (outputs, seeing))
        if wrong:
            seeing = loads(system, network, outputs, "outputs", wrong)
            wrong = _wrong(system, network, (inputs, acting), (outputs, seeing))
        if wrong == []:
            return network, acting, seeing
    network = basis.bare_network
    return network, no_loads(network, len(inputs)), no_loads(network, len(outputs))


def loads(system: Equations, network: Network, which: list[int], kind: str, beside: Sequence[int] = ()) -> Loads:
    """Return some of a system's inputs or outputs as loads.

    Parameters
    ----------
    system : Equations
        The equations of motion.
    network : Network
        Its bodies and connections.
    which : list of int
        Numbers of the ports.
    kind : str
        "inputs" or "outputs".
    beside : sequence of int
        Places of forces in joints and sums of forces that are no work on a motion.

    Returns
    -------
    Loads
        Wrenches and motions.
    """
    kinds = (Input, BaseMotion) if kind == "inputs" else (Output, ForceOutput)
    known = {part.name: part for part in system.provenance.ports if isinstance(part, kinds)}
    parts: list[Any] = [known[getattr(system, kind)[k]] for k in which]
    bodies = len(network.bodies)
    number = {body.name: i for i, body in enumerate(network.bodies)} | {"ground": bodies}
    count = len(parts)
    wrench, point = np.zeros((count, 6)), np.zeros((count, 3))
    first, second = np.full(count, bodies), np.full(count, bodies)
    centre, carrier = np.full(count, -1), np.full(count, -1)
    strain, carried = np.zeros((len(network.springs), 6, count)), np.zeros((bodies, 6, count))
    given, apart = np.zeros((bodies, 6, count)), np.zeros((len(network.point), 6, count))
    turned = np.zeros((len(network.joints), 3, count))
    order, works, others = np.zeros(count, dtype=np.intp), np.zeros(count, dtype=bool), []
    for i, part in enumerate(parts):
        if isinstance(part, ForceOutput):
            felt = _spring(network, part)
            worked = _worked(system, network, part) if felt is None and i not in beside else None
            if felt is not None:
                strain[felt[0], :, i] = felt[1]
            elif worked is not None:
                given[:, :, i], apart[:, :, i], turned[:, :, i], works[i] = worked
            else:
                others.append(i)
        elif isinstance(part, BaseMotion):
            carried[:, :, i] = _carried(network, part)
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
    return Loads(wrench, _motion(network, first, second, point), on_bodies, order, strain, carried, centre, carrier,
                 point, np.stack((first, second), axis=1), given, apart, turned, works, tuple(others))  # fmt: skip


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
    tied = any(isinstance(each, Coupling) for each in network.parts)
    loaded = system.provenance.statics is not None and (
        network.forces is None or k in network.forces.twice or k in network.forces.halves)
    if loaded or tied or (about_centre and wrench[3:].any()):
        return None
    still, gap = np.zeros((len(network.point), 6)), np.zeros((len(network.joints), 6, 1))
    if k is None:
        whole = np.zeros((len(network.bodies), 6))
        if part.element == "ground":
            whole[:] = wrench
        elif part.element in number:
            whole[number[part.element]] = -wrench
        else:
            return None
        return whole, still, gap[:, 3:, 0], False
    if _shared(network)[k] or (network.joints[k].pitch is not None and wrench[5]):
        return None
    gap[k, :, 0] = (wrench.reshape(2, 3) @ np.array(network.joints[k].axes).T).reshape(6)
    body = given_way(network, gap)
    return body[:, :, 0], seen(network, body)[:, :, 0], gap[:, 3:, 0], True


def _spring(network: Network, part: ForceOutput) -> tuple[list[int], Array] | None:
    """Numbers of springs and the direction of their force that is asked for, world axes; None for joints."""
    maxwell = next((each for each in network.parts if isinstance(each, Maxwell) and each.name == part.element), None)
    names = [part.element] if maxwell is None else [name_of(maxwell, field) for field in
                                                    ("static_stiffness", "stiffness")]  # fmt: skip
    found = [k for k, spring in enumerate(network.springs) if spring.name in names]
    if not found:
        return None
    spring, six = network.springs[found[0]], np.array(part.wrench)
    if isinstance(spring, Spring):
        return found, np.concatenate((np.array(spring.line) * six[2], np.zeros(3)))
    return found, np.concatenate((np.array(spring.orientation) @ six[:3], np.array(spring.orientation) @ six[3:]))


def _carried(network: Network, part: BaseMotion) -> Array:
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
    found = relative_motion(network.coordinates, rows).dense(0, 6 * count)
    if network.reduction is not None:
        found = found @ network.reduction
    return found.reshape(count, 6, -1)


def feedthrough(
    system: Equations, inputs: tuple[list[int], Loads], outputs: tuple[list[int], Loads]
) -> tuple[Array, Array]:
    """Return D, what outputs against inertial space see of base motions, and how the base turns there.

    Parameters
    ----------
    system : Equations
        The equations of motion.
    inputs, outputs : pair of list of int and Loads
        Numbers of the ports, and their loads.

    Returns
    -------
    pair of array, shape (outputs, inputs) and (outputs, inputs, 3)
        D, and the angular acceleration with which it changes as outputs move, dD = wrench . (angular x dp).
    """
    known = {(part.name, isinstance(part, (Input, BaseMotion))): part for part in system.provenance.ports}
    d = np.zeros((len(outputs[0]), len(inputs[0])))
    turns = np.zeros((*d.shape, 3))
    for i, k in enumerate(inputs[0]):
        base = known[system.inputs[k], True]
        for o, j in enumerate(outputs[0]):
            seen = known[system.outputs[j], False]
            if isinstance(base, BaseMotion) and isinstance(seen, Output) and seen.inertial:
                angular = turns[o, i] = base.wrench[3:]
                linear = base.wrench[:3] + np.cross(angular, outputs[1].point[o] - base.position)
                d[o, i] = np.concatenate((linear, angular)) @ outputs[1].wrench[o]
    return d, turns


def _shared(network: Network) -> NDArray[np.bool_]:
    """Joints (j,) whose forces redundant constraints leave open: a state of self-stress goes through them."""
    ties = network.constraints
    if ties is None or not ties.stress.shape[1]:
        return np.zeros(len(network.joints), dtype=bool)
    states = np.abs(in_joints(network, np.zeros((len(network.bodies), 6, ties.stress.shape[1])), ties.stress))
    return np.asarray((states > SAME * states.max(axis=(0, 1))).any(axis=(1, 2)))


def _at_rest(network: Network, forces: Forces, seeing: Loads, motion: Array) -> Array:
    """What forces at rest do to those seen in joints, (p, m) per unit of the motion (b, 6, m) of the bodies."""
    turned = seeing.turned if seeing.turned.any() else None
    wrench = forces.on_bodies(seeing.given * seeing.works, -1, turned)
    return np.asarray(np.einsum("bip,bim->pm", wrench, motion))


def _wrong(
    system: Equations, network: Network, inputs: tuple[list[int], Loads], outputs: tuple[list[int], Loads]
) -> list[int] | None:
    """The outputs whose rows of Cq, Cv, Ca and D these loads do not give, None if they do not give B."""
    (i, acting), (o, seeing), joints = inputs, outputs, len(network.joints)
    relative = network.relative if network.reduction is None else network.relative @ network.reduction
    strains = np.asarray(relative @ np.eye(system.dof)).reshape(len(network.point), 6, system.dof)[joints:]
    momenta = momentum(network, acting.carried)
    acts = np.einsum("pi,pim->mp", acting.wrench, acting.motion)
    acts -= np.einsum("bim,bip->mp", system.body_motion, momenta)
    moves = np.einsum("pi,pim->pm", seeing.wrench, seeing.motion)
    felt = seeing.strain - seeing.apart[joints:]
    forces = [np.einsum("sip,sij,sjm->pm", felt, z, strains) for z in (network.stiffness, network.damping)]
    forces.append(-np.einsum("bip,bim->pm", seeing.given, momentum(network, system.body_motion)))
    if network.forces is not None:
        forces[0] -= _at_rest(network, network.forces, seeing, system.body_motion)
    ours = [moves * (seeing.order == k)[:, None] + forces[k] for k in range(3)]
    direct = feedthrough(system, inputs, outputs)[0] - np.einsum("bio,bip->op", seeing.given, momenta)
    direct += np.einsum("bio,bip->op", seeing.given * seeing.works, acting.on_bodies)
    if np.abs(acts - system.B[:, i]).max(initial=0.0) > SAME * np.abs(system.B[:, i]).max(initial=0.0):
        return None
    off = np.zeros(len(o), dtype=bool)
    for found, given in zip((direct, *ours), (system.D[np.ix_(o, i)], system.Cq[o], system.Cv[o], system.Ca[o]),
                            strict=True):  # fmt: skip
        size = np.abs(given)
        allowed = SAME * size.max(axis=1, initial=0.0) + ROUNDING * size.max(initial=0.0)
        off |= np.abs(found - given).max(axis=1, initial=0.0) > allowed
    off[list(seeing.beside)] = False
    return np.flatnonzero(off).tolist()
