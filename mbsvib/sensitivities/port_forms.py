"""Derivatives of frequency responses to parameters, from the motions that inputs cause and that outputs see.

With R = T^-1 B and L = T^-T H^T, T = K + s C + s^2 M and H = Cq + s Cv + s^2 Ca, the response is G = H R + D.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.vectors import transformed
from mbsvib.sensitivities.adjoint_fields import fields, momentum, motions
from mbsvib.sensitivities.products import form_table

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.adjoint_fields import Fields, Motions
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.parameter_groups import ParameterGroups
    from mbsvib.sensitivities.ports import Loads


def port_forms(
    groups: ParameterGroups, ports: tuple[Loads, Loads], powers: tuple[Field, Field, Field],
    vectors: tuple[Field, Field], turns: Array,
) -> Field:  # fmt: skip
    """Return dD + L^T dB + dH R - L^T dT R, with H = Cq + s Cv + s^2 Ca and T = K + s C + s^2 M.

    Parameters
    ----------
    groups : ParameterGroups
        What changes.
    ports : pair of Loads
        Inputs and outputs.
    powers : tuple of three arrays, shape (n,)
        1, s and s^2, or 1 and 0 to have the derivatives of one matrix only.
    vectors : pair of array, shape (m, 1, inputs, n) and (m, outputs, 1, n)
        R and L.
    turns : array, shape (outputs, inputs, 3)
        How D changes, see ``feedthrough``.

    Returns
    -------
    array, shape (parameters, outputs, inputs, n)
        Derivatives to all parameters of the groups.
    """
    network, (acting, seeing) = groups.network, ports
    x, y = motions(network, vectors[0]), _with_given(network, motions(network, vectors[1]), seeing)
    momenta = momentum(network, acting.carried)
    on_right = (momenta - acting.on_bodies)[:, :, None, :, None]
    by_order = np.array([powers[k] for k in seeing.order]).reshape(-1, 1, len(powers[0]))
    on_left = -seeing.on_bodies[:, :, :, None, None] * by_order
    right = fields(network, x, *powers, load=on_right, side=1)
    left = _seeing(network, y, seeing, powers, on_left)
    result: Field = -groups.forms(left, right)
    bodies = groups.of_bodies()
    for at in np.flatnonzero(acting.carried.any(axis=(0, 1))):
        one, carried = np.ones(1), acting.carried[:, :, at, None, None]
        none = np.zeros((len(network.floating), 6, 1, 1))
        by_base = replace(right, body=carried, body_wrench=momenta[:, :, at, None, None], support=none, square=one)
        still = replace(left, body=y.body[..., 0, :], body_wrench=y.momentum[..., 0, :], support=none, square=one)
        result[:, :, at] -= form_table(bodies, groups.size, still, by_base)
    _move_ports(result, groups, (acting, seeing), vectors, by_order[:, 0], turns)
    return result


def _with_given(network: Network, motion: Motions, seeing: Loads) -> Motions:
    """L with the motions on which forces in joints and sums of forces do work."""
    if not seeing.given.any():
        return motion
    body, apart = (each[:, :, :, None, None] for each in (seeing.given, seeing.apart))
    strained = apart[len(network.joints) :]
    viscous = None if motion.viscous is None else motion.viscous + transformed(network.damping, strained)
    return replace(motion, body=motion.body + body, relative=motion.relative + apart,
                   momentum=motion.momentum + momentum(network, body),
                   elastic=motion.elastic + transformed(network.stiffness, strained), viscous=viscous)  # fmt: skip


def _seeing(
    network: Network, motion: Motions, seeing: Loads, powers: tuple[Field, Field, Field], load: Field
) -> Fields:
    """Fields of L; forces in springs are seen through strains that lack their directions."""
    turned = alone = None
    if network.forces is not None and seeing.given.any():
        turned, alone = (each[:, :, :, None, None] for each in (seeing.turned, seeing.given * ~seeing.works))
    if not seeing.strain.any():
        return fields(network, motion, *powers, load=load, side=-1, turned=turned, alone=alone)
    asked = seeing.strain[:, :, :, None, None]
    strain = motion.relative[len(network.joints) :] - asked
    viscous = None if motion.viscous is None else motion.viscous - transformed(network.damping, asked)
    lacking = replace(motion, elastic=motion.elastic - transformed(network.stiffness, asked), viscous=viscous)
    return fields(network, lacking, *powers, load=load, strain=strain, side=-1, turned=turned,
                  alone=alone)  # fmt: skip


def _move_ports(
    result: Field, groups: ParameterGroups, ports: tuple[Loads, Loads], vectors: tuple[Field, Field],
    by_order: Field, turns: Array,
) -> None:  # fmt: skip
    """Ports move with centres of mass, and with the bodies as the pose moves: dG = wrench . (angular x dp)."""
    (acting, seeing), (right, left) = ports, (vectors[0][:, 0], vectors[1][:, :, 0])
    turned = np.concatenate((seeing.given[:, 3:] * seeing.works, np.zeros((1, 3, len(seeing.wrench)))))
    moves = [(acting, i, result[:, :, i], np.tensordot(acting.motion[i, 3:], left, axes=1)
              + (turned[acting.ends[i, 1]] - turned[acting.ends[i, 0]])[:, :, None])
             for i in range(len(acting.wrench))]  # fmt: skip
    moves += [(seeing, o, result[:, o], np.tensordot(seeing.motion[o, 3:], right, axes=1) * by_order[o]
               + turns[o][:, :, None].swapaxes(0, 1)) for o in range(len(seeing.wrench))]  # fmt: skip
    for port, k, own, theta in moves:
        slope = np.cross(port.wrench[k, :3], theta, axisb=0, axisc=0)
        if port.carrier[k] >= 0 and groups.loaded is not None:
            groups.loaded.add_point_motion(own, int(port.carrier[k]), port.point[k], slope)
        for group in groups.of_bodies("position"):
            for rows in group.rows[group.number == port.centre[k]]:
                asked = rows >= 0
                own[rows[asked]] += slope[asked]
        for group in groups.by_rule:
            if group.kind == "beam":  # its nodes move
                at = group.data[0][0] == port.centre[k]
                own[group.rows[0, 0]] += np.tensordot(group.data[1][0, at].sum(axis=0), slope, axes=1)
