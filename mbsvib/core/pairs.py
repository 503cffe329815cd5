"""The wrench pairs of a mechanism: loads and weights, preloaded connections, cut joints, and terms of couplers.

Each family states its deformation once; here are its first and second derivatives at the pose, times the forces there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.core import expansions
from mbsvib.core.geometric_stiffness import Pairs
from mbsvib.kinematics.couplers import measure
from mbsvib.linalg.products import concatenated
from mbsvib.linalg.rotations import frames_along, skew

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Bools, Index
    from mbsvib.elements import Joint


def of_places(first: Index, body: Index, point: Array, force: Array, torque: Array, follower: Bools) -> Pairs:
    """Return the pairs of forces and torques on bodies, fixed in the world or, if ``follower``, in the body.

    ``first`` (p,): the ground. ``body`` (p,); ``point``, ``force``, ``torque`` (..., 3, p), world axes; ``follower``
    (p,): bool. V = -f . u; the tangent of a torque t is -1/2 [t]x, of a follower one 1/2 [t]x, and a follower force
    adds [f]x (Ziegler, Principles of Structural Stability, 1968).
    """
    force, torque = np.broadcast_arrays(force, torque)
    wrench = -np.concatenate((torque, force), axis=-2)
    hessian = np.tensordot(-np.moveaxis(force, -2, -1), expansions.of_place(), 1)
    torsion = None
    if np.count_nonzero(torque) or follower.any():
        torsion = np.zeros((*torque.shape[:-2], len(body), 6, 6), np.result_type(force, torque))
        turns = follower[:, None, None]
        torsion[..., :3, :3] = np.where(turns, 0.5, -0.5) * skew(np.moveaxis(torque, -2, -1))
        torsion[..., 3:, :3] = np.where(turns, skew(np.moveaxis(force, -2, -1)), 0.0)
    return Pairs(first, body, point, wrench, hessian, torsion)


def of_lines(first: Index, second: Index, start: Array, end: Array, force: Array) -> Pairs:
    """Return the pairs of tensions along lines from ``start`` to ``end`` (..., 3, p) [m].

    ``force`` (..., 3, p): forces on the second bodies at the ends, minus the tension along the line.
    """
    line = end - start
    length = np.sqrt((line * line).sum(axis=-2))
    axes = frames_along(np.moveaxis(line / length[..., None, :], -2, -1))
    tension = -(force * line).sum(axis=-2) / length
    hessian = expansions.with_length(expansions.of_line(), expansions.line_units(), length)
    hessian = tension[..., None, None] * expansions.turned(axes, hessian)
    return Pairs(first, second, end, np.concatenate((np.zeros_like(force), -force), axis=-2), hessian)


def of_sixes(first: Index, second: Index, point: Array, force: Array, torque: Array) -> Pairs:
    """Return the pairs of preloads whose force and torque turn with the first body.

    ``force``, ``torque`` (..., 3, p): on the second bodies at ``point`` (..., 3, p), world axes.
    """
    force, torque = np.broadcast_arrays(force, torque)
    work = -np.moveaxis(np.concatenate((force, torque), axis=-2), -2, -1)
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
        duals: Array = np.array([measure(joint, free)[1::-1] for free, _ in joint.freedom]).reshape(-1, 2, 3)
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
