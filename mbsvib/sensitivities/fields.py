"""Motions, and the wrenches that they put into bodies and connections.

A motion q e^(s t) strains springs, moves dampers and accelerates bodies. What a joint transmits is all that acts behind
it: the sum over what it carries, and over the loops through it what their closing constraints transmit, which the
dependent coordinates give, Phi_d^T mu = (B'^T F)_d.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from mbsvib.kinematics import Array
    from mbsvib.sensitivities.network import Network
    from mbsvib.system import System

    Field = NDArray[Any]  # real or complex

# Rounding of the work of a motion, relative to its terms, is far below this; a missing force is not.
COMPLETE = 1e-8


@dataclass(frozen=True, slots=True)
class Fields:
    """Motions of bodies and connections, (b or j + s, 6, n), and the wrench in each, world axes.

    Bodies at their centres of mass, connections at their points. ``stiff``, ``rate`` and ``square`` (n,) are factors
    of stiffness, damping and inertia, 1, s and s^2.
    """

    body: Field
    body_wrench: Field
    relative: Field
    wrench: Field
    stiff: Field
    rate: Field
    square: Field

    def take(self, columns: Any) -> Fields:
        """Return some of the motions."""
        return Fields(*(getattr(self, key)[..., columns] for key in Fields.__slots__))


def motions(system: System, network: Network, vectors: Field) -> tuple[Field, Field]:
    """Return the motions of bodies and connections.

    Parameters
    ----------
    system : System
        The equations of motion.
    network : Network
        Its bodies and connections.
    vectors : array, shape (m, n)
        Motions in minimal coordinates.

    Returns
    -------
    pair of array, shape (b, 6, n) and (j + s, 6, n)
        Displacements of the centres of mass, and of each connection's second body against its first at its point.
    """
    of_joints = vectors if network.reduction is None else network.reduction @ vectors
    relative: Field = network.relative @ of_joints
    return system.body_motion @ vectors, relative.reshape(len(network.point), 6, -1)


def fields(network: Network, motion: tuple[Field, Field], stiff: Field, rate: Field, square: Field) -> Fields:
    """Return motions with the wrenches that go with them.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    motion : pair of array, shape (b, 6, n) and (j + s, 6, n)
        Motions of bodies and connections.
    stiff, rate, square : array, shape (n,)
        Factors of stiffness, damping and inertia: 1, s and s^2 for motions with e^(s t); 1 or 0 to have the derivatives
        of one matrix only.

    Returns
    -------
    Fields
        Motions and wrenches of bodies and connections.
    """
    body, relative = motion
    body_wrench = np.empty(body.shape, dtype=np.result_type(body, square))
    np.multiply(body[:, :3], network.mass[:, None, None] * square, out=body_wrench[:, :3])
    np.multiply(network.inertia @ body[:, 3:], square, out=body_wrench[:, 3:])
    strained = relative[len(network.joints) :]
    spring_wrench = (network.stiffness @ strained) * stiff
    if network.damping.any():
        spring_wrench = spring_wrench + (network.damping @ strained) * rate
    wrench = np.concatenate((_transmitted(network, body_wrench, spring_wrench), spring_wrench))
    return Fields(body, body_wrench, relative, wrench, stiff, rate, square)


def _transmitted(network: Network, body_wrench: Field, spring_wrench: Field) -> Field:
    """What the joints transmit, (j, 6, n) at their points."""
    place = np.concatenate((network.point, network.position))
    origin = 0.5 * (place.min(axis=0) + place.max(axis=0))
    at = network.point[len(network.joints) :] - origin
    load = shifted(body_wrench, network.position - origin) + _onto(network.acting, shifted(spring_wrench, at))
    behind = _behind(network, load)
    if network.constraints is None:
        return _at_joints(network, behind, origin)
    return in_joints(network, behind, multipliers(network, behind, origin), origin)


def in_joints(network: Network, behind: Field, mu: Field, origin: Array) -> Field:
    """Return the wrenches in joints, from what acts behind them and from the forces that close loops.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    behind : array, shape (b, 6, n)
        What acts on each body and those outwards from it, about ``origin``.
    mu : array, shape (rows, n)
        Forces in the locked rows of cut joints.
    origin : array, shape (3,)
        The point [m].

    Returns
    -------
    array, shape (j, 6, n)
        Wrenches at the joints' points.
    """
    ties, closes = network.constraints, network.closing
    assert ties is not None
    assert closes is not None
    closing = ties.wrench[:, :, None] * mu[:, None]
    pull = _onto(closes, shifted(closing, network.point[ties.joint] - origin))
    result = _at_joints(network, behind - _behind(network, pull), origin)
    np.add.at(result, ties.joint, closing)
    return result


def _onto(incidence: csr_array, wrench: Field) -> Field:
    """Wrenches of connections on the bodies that they connect, (b, 6, n)."""
    total: Field = incidence @ wrench.reshape(len(wrench), -1)
    return total.reshape(-1, *wrench.shape[1:])


def _behind(network: Network, load: Field) -> Field:
    """What acts on each body and those outwards from it; ``load`` is used up."""
    for body, parent in reversed(network.tree):
        if parent < len(load):
            load[parent] += load[body]
    return load


def _at_joints(network: Network, behind: Field, origin: Array) -> Field:
    joints = network.point[: len(network.joints)]
    return shifted(behind[network.behind] * network.sign[:, None, None], origin - joints)


def multipliers(network: Network, behind: Field, origin: Array) -> Field:
    """Return the forces mu (rows, n) in the locked rows of cut joints, the smallest where rows are redundant.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    behind : array, shape (b, 6, n)
        What acts on each body and those outwards from it, about ``origin``.
    origin : array, shape (3,)
        The point [m].

    Returns
    -------
    array, shape (rows, n)
        Forces [N] and moments [N m].
    """
    ties, twist = network.constraints, network.coordinates
    assert ties is not None
    k = ties.dependent
    own = shifted(behind[network.coordinate_behind[k]], origin - twist.point[:, k].T)
    six = np.concatenate((twist.linear, twist.angular))[:, k].T * network.coordinate_sign[k, None]
    felt = np.einsum("kc,kcn->kn", six, own)
    return np.asarray(ties.q @ np.linalg.solve(ties.r.T, felt))


def shifted(wrench: Field, arm: Array) -> Field:
    """Return wrenches (w, 6, n) about another point, from which the present one is at ``arm`` (w, 3)."""
    result = np.array(wrench)
    x, y, z = arm.T[:, :, None]
    fx, fy, fz = wrench[:, 0], wrench[:, 1], wrench[:, 2]
    result[:, 3] += y * fz - z * fy
    result[:, 4] += z * fx - x * fz
    result[:, 5] += x * fy - y * fx
    return result


def check_complete(system: System, network: Network) -> None:
    """Refuse systems with forces that are not those of rigid bodies and spring-dampers.

    Parameters
    ----------
    system : System
        The equations of motion.
    network : Network
        Its bodies and connections.

    Raises
    ------
    ModelError
        If the work of one motion is not that of the system's matrices, or they are not symmetric.
    """
    some = np.cos(np.arange(system.dof))[:, None]  # no structure of a mechanism
    one = np.ones(1)
    sizes = system.inertia_factor @ some, system.elastic_rows @ some
    complete = system.gyroscopic is None and system.circulatory is None
    for factors, weight in (((one, 0 * one, 0 * one), system.stiffness), ((0 * one, one, 0 * one), system.damping),
                            ((0 * one, 0 * one, one), None)):  # fmt: skip
        body, relative = motion = motions(system, network, some)
        found = fields(network, motion, *factors)
        work = float((body * found.body_wrench).sum() + (relative * found.wrench)[len(network.joints) :].sum())
        terms = sizes[0][:, 0] ** 2 if weight is None else weight * sizes[1][:, 0] ** 2
        complete &= abs(work - float(terms.sum())) <= COMPLETE * float(np.abs(terms).sum())
    if not complete:
        raise ModelError(
            f"sensitivities of '{system.name}': it has forces beyond those of rigid bodies and spring-dampers (loads, "
            f"spin, beams), whose derivatives are not supported yet. Compare variants by model.with_values instead.",
            element=system.name,
        )  # fmt: skip
