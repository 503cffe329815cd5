"""Ports of a system as loads of its network, where these give the system's own B, Cq, Cv, Ca and D."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import BaseMotion, Input, Output
from mbsvib.sensitivities.adjoint_fields import momentum
from mbsvib.sensitivities.ports import loads
from mbsvib.sensitivities.second_order_work import geometric_wrenches

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.ports import Loads

# B, H and D of the network and those of the system are the same numbers but for rounding.
SAME = 1e-9
# Rounding of the largest among all rows.
ROUNDING = 1e-12


def checked_loads(
    system: Equations, network: Network, inputs: list[int], outputs: list[int]
) -> tuple[Loads, Loads] | None:
    """Return some of the ports of a system as loads.

    Parameters
    ----------
    system : Equations
        The equations of motion.
    network : Network
        Their bodies and connections.
    inputs, outputs : list of int
        Numbers of the ports.

    Returns
    -------
    pair of Loads or None
        Inputs and outputs; None where ports are more than loads of the network.
    """
    acting, seeing = (loads(system, network, *each) for each in ((inputs, "inputs"), (outputs, "outputs")))
    wrong = _wrong(system, network, (inputs, acting), (outputs, seeing))
    if wrong:
        seeing = loads(system, network, outputs, "outputs", wrong)
        wrong = _wrong(system, network, (inputs, acting), (outputs, seeing))
    return (acting, seeing) if wrong == [] else None


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


def _at_rest(network: Network, forces: Forces, seeing: Loads, motion: Array) -> Array:
    """What forces at rest do to those seen in joints, (p, m) per unit of the motion (b, 6, m) of the bodies."""
    turned = seeing.turned if seeing.turned.any() else None
    wrench = geometric_wrenches(forces, seeing.given * seeing.works, -1, turned)
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
