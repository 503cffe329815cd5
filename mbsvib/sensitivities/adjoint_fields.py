"""Motions, and the wrenches that they put into bodies and connections.

A motion q e^(s t) strains springs, moves dampers and accelerates bodies. What a joint transmits is all that acts behind
it: the sum over what it carries, and over the loops through it what their closing constraints transmit, which the
dependent coordinates give, Phi_d^T mu = (B'^T F)_d.

Arrays are (parts, 6, ...): behind their first two axes come those of the motions, which broadcast against each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.beam import Beam
from mbsvib.equations.reactions import skew

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations
    from mbsvib.sensitivities.network import Network

    Field = NDArray[Any]  # real or complex

# Rounding of the work of a motion, relative to its terms, is far below this; a missing force is not.
COMPLETE = 1e-8


@dataclass(frozen=True, slots=True)
class Motions:
    """Motions ``vectors`` (m, ...) in minimal coordinates, of ``body`` (b, 6, ...) at their centres of mass and
    ``relative`` (j + s, 6, ...) of connections at their points, with what mass, stiffness and damping make of them:
    ``momentum`` (b, 6, ...), ``elastic`` and ``viscous`` (s, 6, ...), the latter None without dampers.
    """

    vectors: Field
    body: Field
    relative: Field
    momentum: Field
    elastic: Field
    viscous: Field | None

    def take(self, columns: Any) -> Motions:
        """Return some of the motions, numbered along the last axis."""
        return Motions(*(None if (array := getattr(self, key)) is None else array[..., columns]
                         for key in Motions.__slots__))  # type: ignore[arg-type]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Fields:
    """Motions of bodies and connections, and the wrench in each, world axes.

    ``vectors`` (m, ...) in minimal coordinates, bodies (b, 6, ...) at their centres of mass, connections
    (j + s, 6, ...) at their points; ``strain`` (s, 6, ...) is what springs see, ``support`` (f, 6, ...) what ground
    would have to do to bodies that float and to all that hangs on them, ``tied`` (rows, ...) the forces in the rows
    that close loops. ``stiff``, ``rate`` and ``square`` are factors of stiffness, damping and inertia: 1, s and s^2.
    ``turned`` (j, 3, ...) is how far joints are turned open, whose moments at rest go with their first bodies,
    ``alone`` (b, 6, ...) what part of the motions of bodies only their inertia does work on.
    """

    vectors: Field
    body: Field
    body_wrench: Field
    relative: Field
    strain: Field
    wrench: Field
    support: Field
    tied: Field
    stiff: Field
    rate: Field
    square: Field
    turned: Field | None = None
    alone: Field | None = None

    @property
    def carrying(self) -> Field:
        """Motions of the bodies that forces at rest see."""
        return self.body if self.alone is None else self.body - self.alone

    def take(self, columns: Any) -> Fields:
        """Return some of the motions, numbered along the last axis."""
        return Fields(*(None if (array := getattr(self, key)) is None else array[..., columns]
                        for key in Fields.__slots__))  # type: ignore[arg-type]  # fmt: skip


def complete_network(system: Equations) -> Network:
    """Return the network of a system, without any of its parts where these do not make up all of its forces."""
    from mbsvib.sensitivities.network import bare, is_network, network

    if not is_network(system):
        return bare(system)
    found = network(system)
    return found if is_complete(system, found) else bare(system)


def motions(network: Network, vectors: Field) -> Motions:
    """Return the motions of bodies and connections.

    Parameters
    ----------
    network : Network
        Its bodies and connections.
    vectors : array, shape (m, ...)
        Motions in minimal coordinates.

    Returns
    -------
    Motions
        With the momentum of bodies and the wrench of springs and dampers.
    """
    tail = vectors.shape[1:]
    flat = vectors.reshape(len(vectors), prod(tail))
    of_joints = flat if network.reduction is None else network.reduction @ flat
    relative: Field = network.relative @ of_joints
    body: Field = np.zeros((6 * len(network.bodies), flat.shape[1]), dtype=flat.dtype)
    moves = network.moves
    if len(moves) == len(body):
        np.matmul(network.displacements, flat, out=body)
    else:
        body[moves] = network.displacements[moves] @ flat
    body, relative = body.reshape(len(network.bodies), 6, *tail), relative.reshape(len(network.point), 6, *tail)
    strained = relative[len(network.joints) :]
    return Motions(vectors, body, relative, momentum(network, body), applied(network.stiffness, strained),
                   applied(network.damping, strained) if network.damped else None)  # fmt: skip


def momentum(network: Network, body: Field) -> Field:
    """Return mass times translation and inertia times rotation of bodies (b, 6, ...)."""
    result: Field = np.empty_like(body)
    np.multiply(body[:, :3], network.mass.reshape(-1, *[1] * (body.ndim - 1)), out=result[:, :3])
    result[:, 3:] = applied(network.inertia, body[:, 3:])
    return result


def applied(matrices: Array, vectors: Field) -> Field:
    """Return products of matrices (k, i, j) and vectors (k, j, ...)."""
    tail = vectors.shape[2:]
    result: Field = matrices @ vectors.reshape(*vectors.shape[:2], prod(tail))
    return result.reshape(*result.shape[:2], *tail)


def fields(
    network: Network, motion: Motions, stiff: Field, rate: Field, square: Field, load: Field | None = None,
    strain: Field | None = None, side: int = 0, turned: Field | None = None, alone: Field | None = None,
) -> Fields:  # fmt: skip
    """Return motions with the wrenches that go with them.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    motion : Motions
        Motions of bodies and connections.
    stiff, rate, square : array
        Factors of stiffness, damping and inertia: 1, s and s^2 for motions with e^(s t); 1 or 0 to have the derivatives
        of one matrix only.
    load : array, shape (b, 6, ...), optional
        Further wrenches on bodies, at their centres of mass, counted as inertia is.
    strain : array, shape (s, 6, ...), optional
        What springs see, where that is not their relative motion.
    side : int
        1 for the right, -1 for the left side of forms between two motions, which need not be symmetric.
    turned : array, shape (j, 3, ...), optional
        How far joints are turned open.
    alone : array, shape (b, 6, ...), optional
        Motions that only inertia does work on, part of those of the bodies.

    Returns
    -------
    Fields
        Motions and wrenches of bodies and connections.
    """
    body_wrench = motion.momentum * square
    joints = len(network.joints)
    tail = np.broadcast_shapes(body_wrench.shape[2:], motion.elastic.shape[2:], np.shape(rate))
    wrench: Field = np.empty((len(network.point), 6, *tail), dtype=np.result_type(motion.elastic, stiff, rate, square))
    spring_wrench = wrench[joints:]
    np.multiply(motion.elastic, stiff, out=spring_wrench)
    if motion.viscous is not None:
        spring_wrench += motion.viscous * rate
    on_bodies = body_wrench if load is None else body_wrench + load
    if network.forces is not None:
        carrying = motion.body if alone is None else motion.body - alone
        on_bodies = on_bodies + network.forces.on_bodies(carrying, side, turned) * stiff
    wrench[:joints], support, tied = transmitted(network, on_bodies, spring_wrench)
    seen = motion.relative[joints:] if strain is None else strain
    return Fields(motion.vectors, motion.body, body_wrench, motion.relative, seen, wrench, support, tied,
                  stiff, rate, square, turned, alone)  # fmt: skip


def transmitted(network: Network, body_wrench: Field, spring_wrench: Field) -> tuple[Field, Field, Field]:
    """Return what goes through joints where bodies and springs take wrenches.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    body_wrench : array, shape (b, 6, ...)
        At the centres of mass.
    spring_wrench : array, shape (s, 6, ...)
        At the points of springs.

    Returns
    -------
    tuple of array, shape (j, 6, ...), (f, 6, ...) and (rows, ...)
        Wrenches in joints at their points, what bodies that float would ask of ground, and the forces in the rows that
        close loops.
    """
    tail = body_wrench.shape[2:]
    on_bodies, on_springs = (wrench.reshape(len(wrench), 6, prod(tail))
                             for wrench in (body_wrench, spring_wrench))  # fmt: skip
    load = shifted(on_bodies, network.position - network.origin)
    if len(on_springs):
        at = network.point[len(network.joints) :] - network.origin
        load += onto(network.acting, shifted(on_springs, at))
    behind = _behind(network, load)
    if network.constraints is None:
        carried, mu = _at_joints(network, behind), np.zeros((0, behind.shape[2]), dtype=behind.dtype)
    else:
        mu = multipliers(network, behind)
        behind, closing = _closed(network, behind, mu)
        carried = _at_joints(network, behind) + closing
    floating = network.floating
    support = shifted(behind[floating], network.origin - network.position[floating])
    return (carried.reshape(len(network.joints), 6, *tail), support.reshape(len(floating), 6, *tail),
            mu.reshape(len(mu), *tail))  # fmt: skip


def in_joints(network: Network, behind: Field, mu: Field) -> Field:
    """Return the wrenches in joints, from what acts behind them and from the forces that close loops.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    behind : array, shape (b, 6, n)
        What acts on each body and those outwards from it, about the network's origin.
    mu : array, shape (rows, n)
        Forces in the locked rows of cut joints.

    Returns
    -------
    array, shape (j, 6, n)
        Wrenches at the joints' points.
    """
    behind, closing = _closed(network, behind, mu)
    return np.asarray(_at_joints(network, behind) + closing)


def _closed(network: Network, behind: Field, mu: Field) -> tuple[Field, Field]:
    """What acts on each body and outwards once loops are closed, and the wrenches (j, 6, n) that close them."""
    ties, closes = network.constraints, network.closing
    assert ties is not None
    assert closes is not None
    closing = onto(ties.closing, ties.wrench[:, :, None] * (ties.share @ mu)[:, None])
    pull = onto(closes, shifted(closing, network.point[: len(network.joints)] - network.origin))
    return behind - _behind(network, pull), closing


def onto(incidence: csr_array, wrench: Field) -> Field:
    """Return sums of wrenches (w, 6, n) that a matrix (rows, w) picks, (rows, 6, n)."""
    total: Field = incidence @ wrench.reshape(len(wrench), prod(wrench.shape[1:]))
    return total.reshape(incidence.shape[0], *wrench.shape[1:])


def _behind(network: Network, load: Field) -> Field:
    """What acts on each body and those outwards from it; ``load`` is used up."""
    for body, parent in reversed(network.tree):
        if parent < len(load):
            load[parent] += load[body]
    return load


def _at_joints(network: Network, behind: Field) -> Field:
    joints = network.point[: len(network.joints)]
    return shifted(behind[network.behind] * network.sign[:, None, None], network.origin - joints)


def multipliers(network: Network, behind: Field) -> Field:
    """Return the forces mu (rows, n) in the locked rows of cut joints, the smallest where rows are redundant.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    behind : array, shape (b, 6, n)
        What acts on each body and those outwards from it, about the network's origin.

    Returns
    -------
    array, shape (rows, n)
        Forces [N] and moments [N m].
    """
    ties = network.constraints
    assert ties is not None
    own = shifted(behind[ties.carried], ties.arm)
    felt = applied(ties.twist[:, None], own)[:, 0]
    return np.asarray(ties.pull @ felt)


def acts(array: Field) -> bool:
    """Tell whether any number of an array is not zero; mostly the first one tells."""
    return bool(array.size and array.item(0)) or bool(array.any())


def shifted(wrench: Field, arm: Array) -> Field:
    """Return wrenches (w, 6, n) about another point, from which the present one is at ``arm`` (w, 3)."""
    result = np.array(wrench)
    moves: list[bool] = np.asarray(arm.any(axis=0)).tolist()
    if all(moves):
        result[:, 3:] += skew(arm.T).transpose(2, 0, 1) @ wrench[:, :3]
        return result
    for axis, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        if moves[j]:
            result[:, 3 + axis] += arm[:, j, None] * wrench[:, k]
        if moves[k]:
            result[:, 3 + axis] -= arm[:, k, None] * wrench[:, j]
    return result


def is_complete(system: Equations, network: Network) -> bool:
    """Tell whether the forces of rigid bodies, beams and spring-dampers are all that a system has.

    Parameters
    ----------
    system : Equations
        The equations of motion.
    network : Network
        Its bodies and connections.

    Returns
    -------
    bool
        Whether the work of one motion is that of the system's factors.
    """
    some = np.cos(np.arange(system.dof))[:, None]  # no structure of a mechanism
    moved, strained = system.inertia_factor @ some, system.elastic_rows @ some
    motion = motions(network, some)
    own = motion.relative[len(network.joints) :]
    # rows of geometric stiffness, behind those of the springs, belong to parameters that have no rule
    strained = strained[:, 0] * (system.row_owner < len(system.provenance.springs))
    beams = any(isinstance(part, Beam) for part in network.parts)  # their masses and dampers join more than two bodies
    return all(
        not whole or bool(abs(work - terms.sum()) <= COMPLETE * np.abs(terms).sum())
        for work, terms, whole in (
            ((motion.body * motion.momentum).sum(), moved[:, 0] ** 2, not beams),
            ((own * motion.elastic).sum(), system.stiffness * strained**2, True),
            (0.0 if motion.viscous is None else (own * motion.viscous).sum(), system.damping * strained**2, not beams),
        )
    )
