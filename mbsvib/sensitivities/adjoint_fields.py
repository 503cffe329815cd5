"""Motions, the wrenches that they put into bodies and connections, and those that joints transmit.

A motion q e^(s t) strains springs, moves dampers and accelerates bodies. What a joint transmits is all that acts behind
it: the sum over what it carries, and over the loops through it what their closing constraints transmit, which the
dependent coordinates give, Phi_d^T mu = (B'^T F)_d. On motions in which joints come apart by gaps, while loops stay
closed, these wrenches do work.

Arrays are (parts, 6, ...): behind their first two axes come those of the motions, which broadcast against each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from mbsvib.linalg.products import real_product
from mbsvib.linalg.vectors import Field, incidence_sum, moved, moved_wrench, transformed
from mbsvib.sensitivities.forces import geometric_wrenches
from mbsvib.sensitivities.network import Network


@dataclass(frozen=True, slots=True)
class Motions:
    """Motions ``vectors`` (m, ...) in minimal coordinates, of ``body`` (b, 6, ...) at their centres of mass and
    ``relative`` (j + s, 6, ...) of connections at their points, with what mass, stiffness and damping make of them:
    ``momentum`` (b, 6, ...), ``elastic`` and ``viscous`` (s, 6, ...), the latter None without dampers; ``nodes``
    (n, ...) are the displacements of nodes that more than two bodies share, None without any.
    """

    vectors: Field
    body: Field
    relative: Field
    momentum: Field
    elastic: Field
    viscous: Field | None
    nodes: Field | None = None


@dataclass(frozen=True, slots=True)
class Fields:
    """Motions of bodies and connections, and the wrench in each, world axes.

    ``vectors`` (m, ...) in minimal coordinates, bodies (b, 6, ...) at their centres of mass, connections
    (j + s, 6, ...) at their points; ``strain`` (s, 6, ...) is what springs see, ``support`` (f, 6, ...) what ground
    would have to do to bodies that float and to all that hangs on them, ``tied`` (rows, ...) the forces in the rows
    that close loops. ``stiff``, ``rate`` and ``square`` are factors of stiffness, damping and inertia: 1, s and s^2.
    ``turned`` (j, 3, ...) is how far joints are turned open, whose moments at rest go with their first bodies,
    ``inertia_only`` (b, 6, ...) what part of the motions of bodies only their inertia does work on; ``side``
    tells the right (1) from the left (-1) of forms that need not be symmetric.
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
    inertia_only: Field | None = None
    side: int = 0

    @property
    def carrying(self) -> Field:
        """Motions of the bodies that forces at rest see."""
        return self.body if self.inertia_only is None else self.body - self.inertia_only

    def take(self, columns: Any) -> Fields:
        """Return some of the motions, numbered along the last axis."""
        return Fields(*(array if array is None or isinstance(array, int) else array[..., columns]
                        for array in (getattr(self, key) for key in Fields.__slots__)))  # type: ignore[arg-type]  # fmt: skip


def motions(network: Network, vectors: Field) -> Motions:
    """Return the motions of bodies and connections.

    ``vectors`` (m, ...) are motions in minimal coordinates; the momentum of bodies and the wrenches of springs and
    dampers come with those of bodies and connections.
    """
    tail = vectors.shape[1:]
    flat = vectors.reshape(len(vectors), prod(tail))
    of_joints = flat if network.coordinates.reduction is None else real_product(network.coordinates.reduction, flat)
    relative = real_product(network.coordinates.relative, of_joints)
    body: Field = np.zeros((6 * len(network.bodies), flat.shape[1]), dtype=flat.dtype)
    moves = network.coordinates.moves
    if len(moves) == len(body):
        body = real_product(network.coordinates.displacements, flat)
    else:
        body[moves] = real_product(network.coordinates.displacements[moves], flat)
    body, relative = body.reshape(len(network.bodies), 6, *tail), relative.reshape(len(network.point), 6, *tail)
    strained = relative[len(network.joints) :]
    nodes = None if network.matrices.shared is None else real_product(network.matrices.shared.base, of_joints)
    return Motions(vectors, body, relative, momentum(network, body), transformed(network.matrices.stiffness, strained),
                   transformed(network.matrices.damping, strained) if network.matrices.damped else None,
                   None if nodes is None else nodes.reshape(len(nodes), *tail))  # fmt: skip


def momentum(network: Network, body: Field) -> Field:
    """Return mass times translation and inertia times rotation of bodies (b, 6, ...)."""
    result: Field = np.empty_like(body)
    np.multiply(body[:, :3], network.matrices.mass.reshape(-1, *[1] * (body.ndim - 1)), out=result[:, :3])
    result[:, 3:] = transformed(network.matrices.inertia, body[:, 3:])
    return result


def fields(
    network: Network, motion: Motions, stiff: Field, rate: Field, square: Field, load: Field | None = None,
    strain: Field | None = None, side: int = 0, turned: Field | None = None, inertia_only: Field | None = None,
) -> Fields:  # fmt: skip
    """Return motions with the wrenches that go with them, in bodies and connections.

    ``stiff``, ``rate``, ``square``: factors of stiffness, damping and inertia: 1, s and s^2 for motions with e^(s t); 1
    or 0 to have the derivatives of one matrix only; ``load`` (b, 6, ...): further wrenches on bodies, at their centres
    of mass, counted as inertia is; ``strain`` (s, 6, ...): what springs see, where that is not their relative motion;
    ``side``: 1 for the right, -1 for the left side of forms between two motions, which need not be symmetric;
    ``turned`` (j, 3, ...): how far joints are turned open; ``inertia_only`` (b, 6, ...): the part of the motions of
    bodies that only inertia does work on.
    """
    body_wrench = motion.momentum * square
    joints = len(network.joints)
    tail = np.broadcast_shapes(body_wrench.shape[2:], motion.elastic.shape[2:], np.shape(rate))
    wrench: Field = np.empty((len(network.point), 6, *tail), dtype=np.result_type(motion.elastic, stiff, rate, square))
    spring_wrench = wrench[joints:]
    np.multiply(motion.elastic, stiff, out=spring_wrench)
    if motion.viscous is not None:
        spring_wrench += motion.viscous * rate
    if network.matrices.inertance is not None:
        spring_wrench += transformed(network.matrices.inertance, motion.relative[joints:]) * square
    on_bodies = body_wrench if load is None else body_wrench + load
    if network.matrices.shared is not None and motion.nodes is not None:
        on_bodies = on_bodies + network.matrices.shared.wrench(motion.nodes, (stiff, rate, square))
    if network.matrices.spin is not None and side:
        on_bodies = on_bodies + 0.0 * rate
        on_bodies[:, 3:] += network.matrices.spin.on_bodies(motion.body, rate, side)
        if network.matrices.spin.coupling is not None:
            spring_wrench += network.matrices.spin.in_springs(motion.relative[joints:], stiff, rate, side)
    if network.forces is not None:
        carrying = motion.body if inertia_only is None else motion.body - inertia_only
        on_bodies = on_bodies + geometric_wrenches(network.forces, carrying, side, turned) * stiff
    wrench[:joints], support, tied = transmitted(network, on_bodies, spring_wrench)
    spring_strain = motion.relative[joints:] if strain is None else strain
    return Fields(motion.vectors, motion.body, body_wrench, motion.relative, spring_strain, wrench, support, tied,
                  stiff, rate, square, turned, inertia_only, side)  # fmt: skip


def transmitted(network: Network, body_wrench: Field, spring_wrench: Field) -> tuple[Field, Field, Field]:
    """Return what goes through joints where bodies and springs take wrenches.

    It is the wrenches in joints at their points (j, 6, ...), what bodies that float would ask of ground (f, 6, ...),
    and the forces in the rows that close loops (rows, ...). ``body_wrench`` (b, 6, ...): at the centres of mass;
    ``spring_wrench`` (s, 6, ...): at the points of springs.
    """
    tail = body_wrench.shape[2:]
    on_bodies, on_springs = (wrench.reshape(len(wrench), 6, prod(tail))
                             for wrench in (body_wrench, spring_wrench))  # fmt: skip
    load = moved_wrench(on_bodies, network.position - network.tree.origin)
    if len(on_springs):
        at = network.point[len(network.joints) :] - network.tree.origin
        load += incidence_sum(network.tree.springs, moved_wrench(on_springs, at))
    behind = _behind(network, load)
    if network.tree.constraints is None:
        in_joint, mu = _at_joints(network, behind), np.zeros((0, behind.shape[2]), dtype=behind.dtype)
    else:
        mu = multipliers(network, behind)
        behind, closing = _closed(network, behind, mu)
        in_joint = _at_joints(network, behind) + closing
    floating = network.tree.floating
    support = moved_wrench(behind[floating], network.tree.origin - network.position[floating])
    return (in_joint.reshape(len(network.joints), 6, *tail), support.reshape(len(floating), 6, *tail),
            mu.reshape(len(mu), *tail))  # fmt: skip


def in_joints(network: Network, behind: Field, mu: Field) -> Field:
    """Return the wrenches in joints at their points (j, 6, n), from what acts behind them and from the forces that
    close loops.

    ``behind`` (b, 6, n): what acts on each body and those outwards from it, about the network's origin; ``mu``
    (rows, n): forces in the locked rows of cut joints.
    """
    behind, closing = _closed(network, behind, mu)
    return np.asarray(_at_joints(network, behind) + closing)


def _closed(network: Network, behind: Field, mu: Field) -> tuple[Field, Field]:
    """What acts on each body and outwards once loops are closed, and the wrenches (j, 6, n) that close them."""
    ties, closes = network.tree.constraints, network.tree.joints
    assert ties is not None
    assert closes is not None
    closing = incidence_sum(ties.closing, ties.wrench[:, :, None] * real_product(ties.share, mu)[:, None])
    pull = incidence_sum(closes, moved_wrench(closing, network.point[: len(network.joints)] - network.tree.origin))
    return behind - _behind(network, pull), closing


def _behind(network: Network, load: Field) -> Field:
    """What acts on each body and those outwards from it; ``load`` is used up."""
    for body, parent in reversed(network.tree.branches):
        if parent < len(load):
            load[parent] += load[body]
    return load


def _at_joints(network: Network, behind: Field) -> Field:
    joints = network.point[: len(network.joints)]
    return moved_wrench(behind[network.tree.behind] * network.tree.sign[:, None, None], network.tree.origin - joints)


def multipliers(network: Network, behind: Field) -> Field:
    """Return the forces mu (rows, n) [N, N m] in the locked rows of cut joints, the smallest where rows are redundant.

    ``behind`` (b, 6, n): what acts on each body and those outwards from it, about the network's origin.
    """
    ties = network.tree.constraints
    assert ties is not None
    wrench = moved_wrench(behind[ties.body], ties.arm)
    on_dependent = transformed(ties.twist[:, None], wrench)[:, 0]
    return real_product(ties.pull, on_dependent)


def joint_release_motion(network: Network, gap: Field) -> Field:
    """Return the motions of the bodies (bodies, 6, ...), at their centres of mass, in which joints come apart while no
    independent coordinate moves.

    ``gap`` (joints, 6, ...): how far the second body of each joint moves against the first at the joint's point, beside
    what the joint frees.
    """
    tail, joints, bodies, tree = gap.shape[2:], len(gap), len(network.bodies), network.tree
    flat = moved(gap.reshape(joints, 6, prod(tail)), tree.origin - network.point[:joints])
    result = np.zeros((bodies + 1, *flat.shape[1:]), dtype=flat.dtype)
    pairs = zip(tree.behind.tolist(), tree.sign.tolist(), strict=True)
    hangs = {body: (k, sign) for k, (body, sign) in enumerate(pairs) if sign}
    for body, parent in tree.branches:
        result[body] = result[parent]
        if body in hangs:
            joint, sign = hangs[body]
            result[body] += sign * flat[joint]
    result, ties = result[:-1], network.tree.constraints
    if ties is not None:
        opened = moved(incidence_sum(tree.joints.T, result) - flat, network.point[:joints] - tree.origin)
        residual = ties.share.T @ transformed(ties.wrench[:, None], incidence_sum(ties.closing.T, opened))[:, 0]
        dependent = np.tensordot(network.swing, ties.pull.T @ residual, axes=1)
        return np.asarray((moved(result, network.position - network.tree.origin) - dependent).reshape(bodies, 6, *tail))
    return moved(result, network.position - network.tree.origin).reshape(bodies, 6, *tail)


def relative_twists(network: Network, body: Field) -> Field:
    """Return the relative motions of connections (j + s, 6, n) at their points, for those of bodies (b, 6, n)."""
    at_origin = moved(body, network.tree.origin - network.position)
    incidences = network.tree.joints, network.tree.springs
    relative = np.concatenate([incidence_sum(incidence.T, at_origin) for incidence in incidences])
    return moved(relative, network.point - network.tree.origin)
