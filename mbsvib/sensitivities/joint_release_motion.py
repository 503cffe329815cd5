"""Motions in which joints give way: those of the bodies when joints come apart by gaps and loops stay closed."""

from __future__ import annotations

from math import prod
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.vectors import incidence_sum, moved, transformed

if TYPE_CHECKING:
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.network import Network


def joint_release_motion(network: Network, gap: Field) -> Field:
    """Return the motions of the bodies in which joints come apart, while no independent coordinate moves.

    Parameters
    ----------
    network : Network
        Bodies and joints.
    gap : array, shape (joints, 6, ...)
        How far the second body of each joint moves against the first at the joint's point, beside what the joint frees.

    Returns
    -------
    array, shape (bodies, 6, ...)
        At the centres of mass.
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
    incidences = network.closing, network.acting
    relative = np.concatenate([incidence_sum(incidence.T, at_origin) for incidence in incidences])
    return moved(relative, network.point - network.origin)
