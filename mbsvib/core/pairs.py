"""The wrench pairs of a mechanism: loads and weights, preloaded connections, cut joints, and terms of couplers.

Each family states its deformation once; here are its first and second derivatives at the pose, times the forces there.

Second derivatives to rotation vectors and shifts are terms of pairs and joints that turn with their first bodies.

With the wrench (m, f) on the body b of a pair or joint at its point, the rotations theta of bodies, and the rotation
vector and shift (delta, d) of b relative to a, the terms of ``core.geometric_stiffness`` of a pose in balance add up to

    theta_a . (d x f + 1/2 delta x m) + 1/2 theta_b . T(f r_b^T) theta_b - 1/2 theta_a . T(f r_a^T) theta_a + own terms

of each pair and joint, with the arms r from the centres of mass and T(S) = tr(S) 1 - sym S. Terms in the translation of
a body cancel with the sum of the forces on it. Own terms are 1/2 (delta, d) . H (delta, d) of a pair, and
1/2 q . ((m, f) . D) q of a joint with the second derivatives D of its motion to its coordinates q.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.core import expansions
from mbsvib.core.expansions import form_of, length_of, of_place
from mbsvib.core.geometric_stiffness import Pairs
from mbsvib.elements import Joint
from mbsvib.kinematics.couplers import measure
from mbsvib.linalg.products import concatenated
from mbsvib.linalg.rank import ZERO_FORM
from mbsvib.linalg.rotations import crossed_product as cross
from mbsvib.linalg.rotations import frames_along, skew


def of_places(first: Index, body: Index, point: Array, force: Array, torque: Array, follower: Bools) -> Pairs:
    """Return the pairs of forces and torques on bodies, fixed in the world or, if ``follower``, in the body.

    ``first`` (p,): the ground. ``body`` (p,); ``point``, ``force``, ``torque`` (..., 3, p), world axes; ``follower``
    (p,): bool. V = -f . u; the tangent of a torque t is -1/2 [t]x, of a follower one 1/2 [t]x, and a follower force
    adds [f]x (Ziegler, Principles of Structural Stability, 1968).
    """
    force, torque = np.broadcast_arrays(force, torque)
    wrench = -np.concatenate((torque, force), axis=-2)
    hessian = np.tensordot(-force.swapaxes(-1, -2), expansions.of_place(), 1)
    torsion = None
    if np.count_nonzero(torque) or follower.any():
        torsion = np.zeros((*torque.shape[:-2], len(body), 6, 6), np.result_type(force, torque))
        turns = follower[:, None, None]
        torsion[..., :3, :3] = np.where(turns, 0.5, -0.5) * skew(torque.swapaxes(-1, -2))
        torsion[..., 3:, :3] = np.where(turns, skew(force.swapaxes(-1, -2)), 0.0)
    return Pairs(first, body, point, wrench, hessian, torsion)


def of_lines(first: Index, second: Index, start: Array, end: Array, force: Array) -> Pairs:
    """Return the pairs of tensions along lines from ``start`` to ``end`` (..., 3, p) [m].

    ``force`` (..., 3, p): forces on the second bodies at the ends, minus the tension along the line.
    """
    line = end - start
    length = np.sqrt((line * line).sum(axis=-2))
    axes = frames_along((line / length[..., None, :]).swapaxes(-1, -2))
    tension = -(force * line).sum(axis=-2) / length
    hessian = expansions.with_length(expansions.of_line(), expansions.line_units(), length)
    hessian = tension[..., None, None] * expansions.turned(axes, hessian)
    return Pairs(first, second, end, np.concatenate((np.zeros_like(force), -force), axis=-2), hessian)


def of_sixes(first: Index, second: Index, point: Array, force: Array, torque: Array) -> Pairs:
    """Return the pairs of preloads whose force and torque turn with the first body.

    ``force``, ``torque`` (..., 3, p): on the second bodies at ``point`` (..., 3, p), world axes.
    """
    force, torque = np.broadcast_arrays(force, torque)
    work = -np.concatenate((force, torque), axis=-2).swapaxes(-1, -2)
    wrench = -np.concatenate((torque, force), axis=-2)
    return Pairs(first, second, point, wrench, np.tensordot(work, expansions.of_six(), 1))


@dataclass(frozen=True, slots=True)
class CutJoints:
    """Cut joints between the bodies ``first`` and ``second`` (joints,) at their points ``point`` (..., 3, joints).

    ``wrench`` (..., 6, rows) (moment, force) are their locked rows, of the joints ``number`` (rows,), which begin at
    ``start`` (joints,); ``hessian`` (..., rows, 6, 6) are the second derivatives of their openings, world axes.
    """

    first: Index
    second: Index
    point: Array
    wrench: Array
    number: Index
    start: Index
    hessian: Array

    def pairs(self, multipliers: Array) -> Pairs:
        """Return the pairs of multipliers (..., rows)."""
        wrench = np.add.reduceat(self.wrench * multipliers[..., None, :], self.start, axis=-1)
        hessian = np.add.reduceat(self.hessian * multipliers[..., None, None], self.start, axis=-3)
        return Pairs(self.first, self.second, self.point, wrench, hessian)


def opening_hessians(joints: Sequence[Joint], axes: Mapping[str, Array], lengths: Mapping[str, Array]) -> Array:
    """Return the second derivatives (..., locked rows, 6, 6) of the openings of cut joints, world axes.

    ``axes`` (..., 3, 3) and ``lengths`` (...): of the joints by name where they differ from those of the part.
    """
    parts = []
    for joint in joints:
        form = expansions.form_of(joint)
        if not form.locked:
            continue
        constants = expansions.of_openings(form)
        length = lengths.get(joint.name, expansions.length_of(joint))
        if np.ndim(length) or length != 1.0:
            constants = expansions.with_length(constants, expansions.opening_units(form), length)
        parts.append(expansions.turned(np.asarray(axes.get(joint.name, joint.axes))[..., None, :, :], constants))
    return concatenated(parts, -3) if parts else np.zeros((0, 6, 6))


def of_measured(
    ends: tuple[Index, Index], vectors: tuple[Array, Array, Array], joints: Sequence[tuple[Joint, str]],
    multipliers: Array, axes: Mapping[str, Array], lengths: Mapping[str, Array],
) -> Pairs:  # fmt: skip
    """Return the pairs of coordinates of cut joints that couplers measure.

    ``ends`` (t,): numbers of the bodies. ``vectors`` (..., 3, t): points, forces and moments of these coordinates as
    relative displacements. ``joints`` (t,): the joint of each, and the name of its coordinate. ``multipliers``
    (..., t): forces along the coordinates. ``axes``, ``lengths``: as in ``opening_hessians``. With xi = S q + 1/2 D q q
    and the row d of a coordinate, q = d . (xi - 1/2 D q q).
    """
    point, force, moment = vectors
    hessians = []
    for joint, name in joints:
        own = [direction for direction, _ in joint.freedom].index(name)
        duals: Array = np.array([measure(joint, free)[::-1] for free, _ in joint.freedom]).reshape(-1, 2, 3)
        frame = axes.get(joint.name)
        if frame is not None:
            duals = duals @ (np.array(joint.axes) @ frame.swapaxes(-1, -2))[..., None, :, :]
        duals = duals.reshape(*duals.shape[:-2], 6)
        curvature = displacement_curvature(joint, frame, lengths.get(joint.name))
        hessians.append(-np.einsum("...i,...iab,...ax,...by->...xy", duals[..., own, :], curvature, duals, duals))
    hessian = concatenated([array[..., None, :, :] for array in hessians], -3)
    wrench = concatenated((moment, force), -2) * multipliers[..., None, :]
    return Pairs(*ends, point, wrench, hessian * multipliers[..., None, None])


def displacement_curvature(joint: Joint, axes: Array | None = None, length: Array | None = None) -> Array:
    """Return the second derivatives (..., 6, f, f) of a joint's exponential coordinates to its own ones, world axes.

    ``axes`` (..., 3, 3) and ``length`` (...): where they differ from those of the part.
    """
    form = expansions.form_of(joint)
    constants = expansions.of_displacement(form)
    size = expansions.length_of(joint) if length is None else length
    if np.ndim(size) or size != 1.0:
        constants = expansions.with_length(constants, expansions.displacement_units(form), size)
    frame = np.array(joint.axes) if axes is None else axes
    f = constants.shape[-1]
    result = frame[..., None, :, :] @ constants.reshape(*constants.shape[:-3], 2, 3, f * f)
    return np.asarray(result).reshape(*result.shape[:-3], 6, f, f)


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
