"""Second derivatives to rotation vectors and shifts, the terms of pairs and joints that turn with their first bodies.

With the wrench (m, f) on the body b of a pair or joint at its point, the rotations theta of bodies, and the rotation
vector and shift (delta, d) of b relative to a, the terms of ``core.geometric_stiffness`` of a pose in balance add up to

    theta_a . (d x f + 1/2 delta x m) + 1/2 theta_b . T(f r_b^T) theta_b - 1/2 theta_a . T(f r_a^T) theta_a + own terms

of each pair and joint, with the arms r from the centres of mass and T(S) = tr(S) 1 - sym S. Terms in the translation of
a body cancel with the sum of the forces on it. Own terms are 1/2 (delta, d) . H (delta, d) of a pair, and
1/2 q . ((m, f) . D) q of a joint with the second derivatives D of its motion to its coordinates q.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.core.expansions import form_of, length_of, of_place
from mbsvib.core.pairs import displacement_curvature
from mbsvib.kinematics.mobility import crossed_product as cross
from mbsvib.linalg.rank import ZERO_FORM
from mbsvib.linalg.rotations import skew

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.core.geometric_stiffness import Pairs
    from mbsvib.elements import Joint


def shift_hessian(pairs: Pairs) -> Array:
    """Return the second derivatives H (p, 6, 6) of pairs, with the symmetric part of those without potential."""
    of_shift = np.tensordot(pairs.wrench[3:].T, of_place(), 1)
    hessian, bound = pairs.hessian - of_shift, np.abs(pairs.hessian) + np.abs(of_shift)
    if pairs.torsion is not None:
        count = len(pairs.torsion)
        hessian[:count] += 0.5 * (pairs.torsion + pairs.torsion.swapaxes(-1, -2))
        bound[:count] += np.abs(pairs.torsion)
    largest = bound.reshape(-1, 2, 3, 2, 3).max(axis=(2, 4), initial=0.0).repeat(3, axis=1).repeat(3, axis=2)
    hessian[np.abs(hessian) <= ZERO_FORM * largest] = 0.0
    return hessian


def turning(turn: Array, shift: Array, moment: Array, force: Array) -> Array:
    """Return v x f + 1/2 w x m (3, n) of twists (w, v), zero where it is rounding."""
    result = cross(shift, force) + 0.5 * cross(turn, moment)
    sizes = [np.sqrt(np.square(array).sum(axis=0)) for array in (turn, shift, moment, force)]
    result[np.abs(result) <= ZERO_FORM * (sizes[1] * sizes[3] + sizes[0] * sizes[2])] = 0.0
    return result


def own_curvatures(joints: Sequence[Joint]) -> list[tuple[list[Joint], Index, Array]]:
    """Return joints of the same form, their numbers, and the second derivatives D (n, 6, f, f) of their rotation
    vectors and shifts to their coordinates. Only rods and successive rotations have any.
    """
    groups: dict[object, list[int]] = {}
    for number, joint in enumerate(joints):
        if joint.successive or joint.is_rod:
            groups.setdefault(form_of(joint), []).append(number)
    result = []
    for numbers in groups.values():
        alike = [joints[k] for k in numbers]
        axes, lengths = np.array([joint.axes for joint in alike]), np.array([length_of(joint) for joint in alike])
        curvature = displacement_curvature(alike[0], axes, lengths).copy()
        twists = twists_of(alike)[:, :, : curvature.shape[-1]]
        matrices = skew(twists[:, :3].swapaxes(1, 2)).transpose(0, 2, 3, 1)
        turned = np.einsum("nijf,njg->nifg", matrices, twists[:, 3:])
        curvature[:, 3:] += 0.5 * (turned + turned.swapaxes(-1, -2))
        result.append((alike, np.array(numbers), curvature))
    return result


def twists_of(joints: Sequence[Joint]) -> Array:
    """Return twists (n, 6, 6) (rotation, translation) along the free directions of joints, as columns, then zeros."""
    result = np.zeros((len(joints), 6, 6))
    for k, joint in enumerate(joints):
        for i, (_, six) in enumerate(joint.freedom):
            result[k, :, i] = *six[3:], *six[:3]
    return result


def duals(twists: Array) -> Array:
    """Return D (..., 6, f) with D^T S = 1 of twists S (..., 6, f); zero where a twist is zero."""
    gram = twists.swapaxes(-1, -2) @ twists
    diagonal = np.arange(twists.shape[-1])
    gram[..., diagonal, diagonal] += ~twists.any(axis=-2)
    return np.asarray(np.linalg.solve(gram, twists.swapaxes(-1, -2)).swapaxes(-1, -2))
