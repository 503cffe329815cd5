"""Derivatives of frequency responses to parameters, from the motions that inputs cause and that outputs see.

With R = T^-1 B and L = T^-T H^T, T = K + s C + s^2 M and H = Cq + s Cv + s^2 Ca, the response is G = H R + D.

Ports are loads of the network where these give the system's own B, Cq, Cv, Ca and D.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import BaseMotion, Input, Output
from mbsvib.elements.motion_input import DrivenCoordinate, MotionForce
from mbsvib.linalg.rank import SAME_PORT_ROW, ZERO_PORT_ROW
from mbsvib.linalg.vectors import transformed
from mbsvib.sensitivities.adjoint_fields import fields, momentum, motions
from mbsvib.sensitivities.ports import loads
from mbsvib.sensitivities.products import form_table
from mbsvib.sensitivities.second_order_work import geometric_wrenches

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields, Motions
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.parameter_groups import ParameterGroups
    from mbsvib.sensitivities.ports import Loads




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
    relative = network.relative if network.reduction is None else network.relative @ network.reduction
    strains = np.asarray(relative @ np.eye(system.dof)).reshape(len(network.point), 6, system.dof)[joints:]
    momenta = momentum(network, actuation.base_motion)
    acts = np.einsum("pi,pim->mp", actuation.wrench, actuation.motion)
    acts -= np.einsum("bim,bip->mp", system.body_motion, momenta)
    moves = np.einsum("pi,pim->pm", sensing.wrench, sensing.motion)
    strain = sensing.strain - sensing.openings[joints:]
    forces = [np.einsum("sip,sij,sjm->pm", strain, z, strains) for z in (network.stiffness, network.damping)]
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
        none = np.zeros((len(network.floating), 6, 1, 1))
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
    viscous = None if motion.viscous is None else motion.viscous + transformed(network.damping, strained)
    return replace(motion, body=motion.body + body, relative=motion.relative + openings,
                   momentum=motion.momentum + momentum(network, body),
                   elastic=motion.elastic + transformed(network.stiffness, strained), viscous=viscous)  # fmt: skip


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
    viscous = None if motion.viscous is None else motion.viscous - transformed(network.damping, of_springs)
    unbalanced = replace(motion, elastic=motion.elastic - transformed(network.stiffness, of_springs), viscous=viscous)
    return fields(network, unbalanced, *powers, load=load, strain=strain, side=-1, turned=turned,
                  inertia_only=inertia_only)  # fmt: skip


def _move_ports(
    result: Field, groups: ParameterGroups, ports: tuple[Loads, Loads], vectors: tuple[Field, Field],
    by_order: Field, turns: Array,
) -> None:  # fmt: skip
    """Ports move with centres of mass, and with the bodies as the pose moves: dG = wrench . (angular x dp)."""
    (actuation, sensing), (right, left) = ports, (vectors[0][:, 0], vectors[1][:, :, 0])
    rotations = sensing.virtual_displacements[:, 3:] * sensing.works
    turned = np.concatenate((rotations, np.zeros((1, 3, len(sensing.wrench)))))
    moves = [(actuation, i, result[:, :, i], np.tensordot(actuation.motion[i, 3:], left, axes=1)
              + (turned[actuation.ends[i, 1]] - turned[actuation.ends[i, 0]])[:, :, None])
             for i in range(len(actuation.wrench))]  # fmt: skip
    moves += [(sensing, o, result[:, o], np.tensordot(sensing.motion[o, 3:], right, axes=1) * by_order[o]
               + turns[o][:, :, None].swapaxes(0, 1)) for o in range(len(sensing.wrench))]  # fmt: skip
    for port, k, form, theta in moves:
        slope = np.cross(port.wrench[k, :3], theta, axisb=0, axisc=0)
        if port.carrier[k] >= 0 and groups.loaded is not None:
            groups.loaded.add_point_motion(form, int(port.carrier[k]), port.point[k], slope)
        for group in groups.of_bodies("position"):
            for rows in group.rows[group.number == port.centre[k]]:
                of_springs = rows >= 0
                form[rows[of_springs]] += slope[of_springs]
        for group in groups.by_rule:
            if group.kind == "composed":  # its nodes move
                at = group.data[0][0] == port.centre[k]
                form[group.rows[0, 0]] += np.tensordot(group.data[1][0, at].sum(axis=0), slope, axes=1)
