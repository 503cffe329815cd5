"""Sensitivities of frequency responses by the adjoint: all parameters for about one more solution a frequency.

With R = T^-1 B and L = T^-T H^T, H = Cq + s Cv + s^2 Ca, the response is G = H R + D, and
dG = dD + L^T dB + dH R - L^T dT R: products of what parameters change and of the fields of L and R.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.expected import angular
from mbsvib.equations.controllable_part import chosen
from mbsvib.sensitivities.adjoint_fields import applied, fields, momentum, motions
from mbsvib.sensitivities.eigenvalues import planned
from mbsvib.sensitivities.ports import feedthrough, ported
from mbsvib.sensitivities.products import table
from mbsvib.sensitivities.solutions import solutions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.responses.basis import Basis
    from mbsvib.sensitivities.adjoint_fields import Field, Fields, Motions
    from mbsvib.sensitivities.basis import SensitivityBasis
    from mbsvib.sensitivities.eigenvalues import Asked
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.parameter_groups import Plan
    from mbsvib.sensitivities.ports import Loads

    Ports = str | Sequence[str] | None

# Numbers that the fields of one block of frequencies may hold.
BLOCK = 2_000_000
# Numbers that a force at the pose takes for a pair of motions.
PAIRED = 48


def frequency_response_sensitivities(
    basis: SensitivityBasis, omega: ArrayLike, parameters: Asked = None, inputs: Ports = None, outputs: Ports = None
) -> Complex:
    """Return the derivatives of the frequency response.

    dG/dp = dD/dp + L^T dB/dp + dH/dp R - L^T (dK/dp + i w dC/dp - w^2 dM/dp) R

    Parameters
    ----------
    basis : SensitivityBasis
        The equations of motion, their modes and their network.
    omega : array-like, shape (n,)
        Angular frequencies [rad/s]; 0 gives the static compliance.
    parameters : str, iterable of str, mapping or None
        Names, patterns or linear maps of parameters; None: every parameter of the system.
    inputs, outputs : str or sequence of str, optional
        Names of ports; default: all.

    Returns
    -------
    array, shape (parameters, outputs, inputs, n)
        Derivatives [output unit / input unit per unit of the parameter].

    Raises
    ------
    ModelError
        If a parameter is unknown, or the system does not change smoothly with it.
    ResponseError
        If a frequency is not finite or is an undamped pole, or a port is unknown.
    """
    system = basis.equations
    w = angular(omega)
    i = chosen(system.inputs, inputs, "inputs", system.name)
    o = chosen(system.outputs, outputs, "outputs", system.name)
    network, acting, seeing = ported(basis, i, o)
    plan = planned(basis, parameters, network)
    turns = feedthrough(system, (i, acting), (o, seeing))[1]
    result = np.empty((len(plan.variables.names), len(o), len(i), len(w)), dtype=complex)
    numbers = (len(network.point) + 1) * 12 * (len(i) + len(o))
    if plan.balanced is not None:  # forces see each pair of an input and an output
        numbers += len(plan.balanced.forces.first) * PAIRED * len(i) * len(o)
    block = max(1, BLOCK // max(1, numbers))
    for start in range(0, len(w), block):
        part = slice(start, start + block)
        size = np.abs(w[part])
        s: Complex = (1j * size).astype(complex)
        powers = np.ones(len(s), dtype=complex), s, s * s
        vectors = _vectors(basis.responses, i, o, size)
        forms = derivatives(plan, (acting, seeing), powers, vectors, turns)
        if plan.whole is not None:
            plan.whole.with_ports(forms, (i, o), powers, vectors, seeing.beside)
        found = plan.chain(forms)
        for k in seeing.beside:
            found[:, k] += _seen_beside(plan, o[k], i, vectors[0][:, 0], powers)
        result[..., part] = found
    result[..., w < 0.0] = result[..., w < 0.0].conj()
    return result


def _vectors(basis: Basis, i: list[int], o: list[int], w: Array) -> tuple[Complex, Complex]:
    """R (m, 1, inputs, n) and L (m, outputs, 1, n)."""
    system = basis.equations
    rates = np.array([c[o] for c in (system.Cq, system.Cv, system.Ca)])
    order, output = np.nonzero(rates.any(axis=2))
    right, rows = system.B[:, i], rates[order, output].T
    if system.gyroscopic is None and system.circulatory is None:
        both = solutions(basis, np.concatenate((right, rows), axis=1), w)
        found, back = both[:, : len(i)], both[:, len(i) :]
    else:
        found, back = solutions(basis, right, w), solutions(basis, rows, w, adjoint=True)
    left = np.zeros((system.dof, len(o), len(w)), dtype=complex)
    for k, (power, place) in enumerate(zip(order.tolist(), output.tolist(), strict=True)):
        left[:, place] += (1j * w) ** power * back[:, k]
    return found[:, None], left[:, :, None]


def derivatives(
    plan: Plan, ports: tuple[Loads, Loads], powers: tuple[Field, Field, Field], vectors: tuple[Field, Field],
    turns: Array,
) -> Field:  # fmt: skip
    """Return dD + L^T dB + dH R - L^T dT R, with H = Cq + s Cv + s^2 Ca and T = K + s C + s^2 M.

    Parameters
    ----------
    plan : Plan
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
        Derivatives to all parameters of the plan.
    """
    network, (acting, seeing) = plan.network, ports
    x, y = motions(network, vectors[0]), _with_given(network, motions(network, vectors[1]), seeing)
    momenta = momentum(network, acting.carried)
    on_right = (momenta - acting.on_bodies)[:, :, None, :, None]
    by_order = np.array([powers[k] for k in seeing.order]).reshape(-1, 1, len(powers[0]))
    on_left = -seeing.on_bodies[:, :, :, None, None] * by_order
    right = fields(network, x, *powers, load=on_right, side=1)
    left = _seeing(network, y, seeing, powers, on_left)
    result: Field = -table(plan, left, right)
    bodies = plan.only("body")
    for at in np.flatnonzero(acting.carried.any(axis=(0, 1))):
        one, carried = np.ones(1), acting.carried[:, :, at, None, None]
        none = np.zeros((len(network.floating), 6, 1, 1))
        by_base = replace(right, body=carried, body_wrench=momenta[:, :, at, None, None], support=none, square=one)
        still = replace(left, body=y.body[..., 0, :], body_wrench=y.momentum[..., 0, :], support=none, square=one)
        result[:, :, at] -= table(plan, still, by_base, bodies)
    _move_ports(result, plan, (acting, seeing), vectors, by_order[:, 0], turns)
    return result


def _seen_beside(plan: Plan, output: int, inputs: list[int], right: Field, powers: tuple[Field, Field, Field]) -> Field:
    """dD + (dCq + s dCv + s^2 dCa) R (variables, inputs, n) of an output that is no motion, R (m, inputs, n)."""
    result = plan.beside["D"][:, output][:, inputs, None].astype(complex)
    for key, power in zip(("Cq", "Cv", "Ca"), powers, strict=True):
        result = result + power * np.tensordot(plan.beside[key][:, output], right, axes=1)
    return result


def _with_given(network: Network, motion: Motions, seeing: Loads) -> Motions:
    """L with the motions on which forces in joints and sums of forces do work."""
    if not seeing.given.any():
        return motion
    body, apart = (each[:, :, :, None, None] for each in (seeing.given, seeing.apart))
    strained = apart[len(network.joints) :]
    viscous = None if motion.viscous is None else motion.viscous + applied(network.damping, strained)
    return replace(motion, body=motion.body + body, relative=motion.relative + apart,
                   momentum=motion.momentum + momentum(network, body),
                   elastic=motion.elastic + applied(network.stiffness, strained), viscous=viscous)  # fmt: skip


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
    viscous = None if motion.viscous is None else motion.viscous - applied(network.damping, asked)
    lacking = replace(motion, elastic=motion.elastic - applied(network.stiffness, asked), viscous=viscous)
    return fields(network, lacking, *powers, load=load, strain=strain, side=-1, turned=turned,
                  alone=alone)  # fmt: skip


def _move_ports(
    result: Field, plan: Plan, ports: tuple[Loads, Loads], vectors: tuple[Field, Field], by_order: Field,
    turns: Array,
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
        if port.carrier[k] >= 0 and plan.balanced is not None:
            plan.balanced.carry(own, int(port.carrier[k]), port.point[k], slope)
        for family in plan.only("body", "position"):
            for rows in family.rows[family.number == port.centre[k]]:
                asked = rows >= 0
                own[rows[asked]] += slope[asked]
