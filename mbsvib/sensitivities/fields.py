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

    from mbsvib.kinematics import Array
    from mbsvib.sensitivities.network import Network
    from mbsvib.system import System

    Field = NDArray[Any]  # real or complex

# Rounding of the work of a motion, relative to its terms, is far below this; a missing force is not.
COMPLETE = 1e-8


@dataclass(frozen=True, slots=True)
class Fields:
    """n motions: of bodies and connections, (b or j + s, 6, n), and the ``wrench`` in each; world axes, bodies at their
    centres of mass, connections at their points. ``stiff``, ``rate`` and ``square`` (n,) are the factors of stiffness,
    damping and inertia, 1, s and s^2.
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


def fields(
    system: System, network: Network, vectors: Field, stiff: Field, rate: Field, square: Field
) -> Fields:
    """Return motions and the wrenches that go with them.

    Parameters
    ----------
    system : System
        The equations of motion.
    network : Network
        Its bodies and connections.
    vectors : array, shape (m, n)
        Motions in minimal coordinates.
    stiff, rate, square : array, shape (n,)
        Factors of stiffness, damping and inertia: 1, s and s^2 for motions with e^(s t); 1 or 0 to have the derivatives
        of one matrix only.

    Returns
    -------
    Fields
        Motions and wrenches of bodies and connections.
    """
    body = system.body_motion @ vectors
    joint_motion = vectors if network.reduction is None else network.reduction @ vectors
    relative = (network.relative @ joint_motion).reshape(len(network.point), 6, -1)
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
    at = np.concatenate((network.point[len(network.joints) :], network.position))
    origin = 0.5 * (at.min(axis=0) + at.max(axis=0))
    load = np.concatenate((spring_wrench, body_wrench))
    carried = _sum(network.carried, shifted(load, at - origin))
    ties = network.constraints
    if ties is None:
        return in_joints(network, carried, None, origin)
    return in_joints(network, carried, multipliers(network, carried, origin), origin)


def in_joints(network: Network, carried: Field, mu: Field | None, origin: Array) -> Field:
    """Return the wrenches in joints, from what acts behind them and from the forces that close loops.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    carried : array, shape (t, 6, n)
        What acts behind each joint of the tree, about ``origin``.
    mu : array, shape (rows, n), or None
        Forces in the locked rows of cut joints.
    origin : array, shape (3,)
        The point [m].

    Returns
    -------
    array, shape (j, 6, n)
        Wrenches at the joints' points.
    """
    ties = network.constraints
    wrench = np.zeros((len(network.joints), *carried.shape[1:]), dtype=carried.dtype)
    if ties is not None and mu is not None:
        closing = ties.wrench[:, :, None] * mu[:, None]
        np.add.at(wrench, ties.joint, closing)
        carried = carried - _sum(_through(network), shifted(closing, network.point[ties.joint] - origin))
    moves = network.branch >= 0
    wrench[moves] = shifted(carried[network.branch[moves]], (origin - network.point[: len(moves)])[moves])
    return wrench


def multipliers(network: Network, carried: Field, origin: Array) -> Field:
    """Return the forces mu (rows, n) in the locked rows of cut joints, the smallest where rows are redundant.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    carried : array, shape (t, 6, n)
        What acts behind each joint of the tree, about ``origin``.
    origin : array, shape (3,)
        The point [m].

    Returns
    -------
    array, shape (rows, n)
        Forces [N] and moments [N m].
    """
    ties, twist = network.constraints, network.coordinates
    assert ties is not None
    own = shifted(carried[network.column[ties.dependent]], (origin - twist.point[:, ties.dependent].T))
    six = np.concatenate((twist.linear, twist.angular))[:, ties.dependent].T
    felt = np.einsum("kc,kcn->kn", six, own)
    return ties.q @ np.linalg.solve(ties.r.T, felt)


def _through(network: Network) -> Array:
    """Which joints of the tree carry what acts in the locked rows, (t, rows)."""
    ties, path = network.constraints, network.coordinates.path
    assert ties is not None
    number = {body.name: i for i, body in enumerate(network.bodies)} | {"ground": len(network.bodies)}
    leads = np.unique(network.column, return_index=True)[1]
    ends = np.array([(number[network.joints[k].first], number[network.joints[k].second]) for k in ties.joint])
    return np.asarray((path[ends[:, 1]] - path[ends[:, 0]])[:, leads].T, dtype=float)


def shifted(wrench: Field, arm: Array) -> Field:
    """Return wrenches (w, 6, n) about another point, from which the present one is at ``arm`` (w, 3)."""
    result = np.array(wrench)
    x, y, z = arm.T[:, :, None]
    fx, fy, fz = wrench[:, 0], wrench[:, 1], wrench[:, 2]
    result[:, 3] += y * fz - z * fy
    result[:, 4] += z * fx - x * fz
    result[:, 5] += x * fy - y * fx
    return result


def _sum(sign: Array, wrench: Field) -> Field:
    """Sum wrenches (w, 6, n) with signs (t, w); complex ones as pairs of real numbers."""
    flat = wrench.reshape(len(wrench), -1)
    if flat.dtype.kind == "c":
        total: Field = (sign @ np.ascontiguousarray(flat).view(float)).view(complex)
    else:
        total = sign @ flat
    return total.reshape(len(sign), *wrench.shape[1:])


def check_complete(system: System, values: Field, vectors: Field, found: Fields) -> None:
    """Refuse systems with forces that are not those of rigid bodies and spring-dampers.

    Parameters
    ----------
    system : System
        The equations of motion.
    values : array, shape (n,)
        s of each motion.
    vectors : array, shape (m, n)
        Motions in minimal coordinates.
    found : Fields
        The same with the wrenches that go with them.

    Raises
    ------
    ModelError
        If the work of these wrenches is not that of the system's matrices.
    """
    joints = len(found.wrench) - len(system.provenance.springs)
    work = np.einsum("bcn,bcn->n", found.body, found.body_wrench)
    work = work + np.einsum("bcn,bcn->n", found.relative[joints:], found.wrench[joints:])
    inertia, rows = system.inertia_factor @ vectors, system.elastic_rows @ vectors
    k, c = system.stiffness[:, None], system.damping[:, None]
    parts = values**2 * inertia * inertia, (k + values * c) * rows * rows
    whole, size = sum(part.sum(axis=0) for part in parts), sum(np.abs(part).sum(axis=0) for part in parts)
    if (np.abs(work - whole) > COMPLETE * size).any() or system.gyroscopic is not None or \
            system.circulatory is not None:  # fmt: skip
        raise ModelError(
            f"sensitivities of '{system.name}': it has forces beyond those of rigid bodies and spring-dampers (loads, "
            f"spin, beams), whose derivatives are not supported yet. Compare variants by model.with_values instead.",
            element=system.name,
        )  # fmt: skip
