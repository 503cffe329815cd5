"""The wrenches that joints transmit where wrenches act on bodies and springs, and motions in which joints give way.

What a joint transmits is all that acts behind it: the sum over what it carries, and over the loops through it what
their closing constraints transmit, which the dependent coordinates give, Phi_d^T mu = (B'^T F)_d. On motions in which
joints come apart by gaps, while loops stay closed, these wrenches do work.
"""

from __future__ import annotations

from math import prod
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.products import real_product
from mbsvib.linalg.vectors import incidence_sum, moved, moved_wrench, transformed

if TYPE_CHECKING:
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.network import Network


def transmitted(network: Network, body_wrench: Field, spring_wrench: Field) -> tuple[Field, Field, Field]:
    """Return what goes through joints where bodies and springs take wrenches.

    It is the wrenches in joints at their points (j, 6, ...), what bodies that float would ask of ground (f, 6, ...),
    and the forces in the rows that close loops (rows, ...). ``body_wrench`` (b, 6, ...): at the centres of mass;
    ``spring_wrench`` (s, 6, ...): at the points of springs.
    """
    tail = body_wrench.shape[2:]
    on_bodies, on_springs = (wrench.reshape(len(wrench), 6, prod(tail))
                             for wrench in (body_wrench, spring_wrench))  # fmt: skip
    load = moved_wrench(on_bodies, network.position - network.origin)
    if len(on_springs):
        at = network.point[len(network.joints) :] - network.origin
        load += incidence_sum(network.spring_incidence, moved_wrench(on_springs, at))
    behind = _behind(network, load)
    if network.constraints is None:
        in_joint, mu = _at_joints(network, behind), np.zeros((0, behind.shape[2]), dtype=behind.dtype)
    else:
        mu = multipliers(network, behind)
        behind, closing = _closed(network, behind, mu)
        in_joint = _at_joints(network, behind) + closing
    floating = network.floating
    support = moved_wrench(behind[floating], network.origin - network.position[floating])
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
    ties, closes = network.constraints, network.closing
    assert ties is not None
    assert closes is not None
    closing = incidence_sum(ties.closing, ties.wrench[:, :, None] * real_product(ties.share, mu)[:, None])
    pull = incidence_sum(closes, moved_wrench(closing, network.point[: len(network.joints)] - network.origin))
    return behind - _behind(network, pull), closing


def _behind(network: Network, load: Field) -> Field:
    """What acts on each body and those outwards from it; ``load`` is used up."""
    for body, parent in reversed(network.tree):
        if parent < len(load):
            load[parent] += load[body]
    return load


def _at_joints(network: Network, behind: Field) -> Field:
    joints = network.point[: len(network.joints)]
    return moved_wrench(behind[network.behind] * network.sign[:, None, None], network.origin - joints)


def multipliers(network: Network, behind: Field) -> Field:
    """Return the forces mu (rows, n) [N, N m] in the locked rows of cut joints, the smallest where rows are redundant.

    ``behind`` (b, 6, n): what acts on each body and those outwards from it, about the network's origin.
    """
    ties = network.constraints
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
    tail, joints, bodies = gap.shape[2:], len(gap), len(network.bodies)
    flat = moved(gap.reshape(joints, 6, prod(tail)), network.origin - network.point[:joints])
    result = np.zeros((bodies + 1, *flat.shape[1:]), dtype=flat.dtype)
    hangs = {body: (k, sign) for k, (body, sign) in enumerate(zip(network.behind.tolist(), network.sign.tolist(),
                                                                  strict=True)) if sign}  # fmt: skip
    for body, parent in network.tree:
        result[body] = result[parent]
        if body in hangs:
            joint, sign = hangs[body]
            result[body] += sign * flat[joint]
    result, ties = result[:-1], network.constraints
    if ties is not None:
        assert network.closing is not None
        opened = moved(incidence_sum(network.closing.T, result) - flat, network.point[:joints] - network.origin)
        residual = ties.share.T @ transformed(ties.wrench[:, None], incidence_sum(ties.closing.T, opened))[:, 0]
        dependent = np.tensordot(network.swing, ties.pull.T @ residual, axes=1)
        return np.asarray((moved(result, network.position - network.origin) - dependent).reshape(bodies, 6, *tail))
    return moved(result, network.position - network.origin).reshape(bodies, 6, *tail)


def relative_twists(network: Network, body: Field) -> Field:
    """Return the relative motions of connections (j + s, 6, n) at their points, for those of bodies (b, 6, n)."""
    assert network.closing is not None
    at_origin = moved(body, network.origin - network.position)
    incidences = network.closing, network.spring_incidence
    relative = np.concatenate([incidence_sum(incidence.T, at_origin) for incidence in incidences])
    return moved(relative, network.point - network.origin)
