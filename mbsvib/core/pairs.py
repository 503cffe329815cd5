"""The wrench pairs of a mechanism: loads and weights, preloaded connections, cut joints, and terms of couplers.

Each family states its deformation once; here are its first and second derivatives at the pose, times the forces there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.core import expansions
from mbsvib.core.geometric_stiffness import Pairs
from mbsvib.linalg.rotations import skew

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Joint
    from mbsvib.elements.rows import Rows


def of_places(first: Index, body: Index, point: Array, force: Array, torque: Array, follower: Array) -> Pairs:
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
        torsion = np.zeros((*torque.shape[:-2], len(body), 6, 6))
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
    axes = np.moveaxis(_along_z(line / length[..., None, :]), (0, 1), (-2, -1))
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
    """Cut joints as pairs: ``rows``, the locked ones, of the joints ``number`` (rows,), which begin at ``start``
    (joints,); ``hessian`` (..., rows, 6, 6) are the second derivatives of their openings, world axes.
    """

    rows: Rows
    number: Index
    start: Index
    hessian: Array

    def pairs(self, point: Array, force: Array, moment: Array, multipliers: Array) -> Pairs:
        """Return the pairs of multipliers (..., rows), rows being ``force``, ``moment`` (..., 3, rows) at ``point``."""
        work = np.concatenate((moment, force), axis=-2) * multipliers[..., None, :]
        hessian = self.hessian * multipliers[..., None, None]
        return Pairs(
            self.rows.first[self.start], self.rows.second[self.start], point[..., self.start],
            np.add.reduceat(work, self.start, axis=-1), np.add.reduceat(hessian, self.start, axis=-3),
        )  # fmt: skip


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
    if not parts:
        return np.zeros((0, 6, 6))
    lead = np.broadcast_shapes(*(part.shape[:-3] for part in parts))
    return np.concatenate([np.broadcast_to(part, (*lead, *part.shape[-3:])) for part in parts], axis=-3)


def rod_curvature(joint: Joint) -> Array:
    """Return the second derivatives (6, f, f) of a rod's exponential coordinates to its own ones, world axes."""
    return _displacement_curvature(joint)


def of_measured(rows: Rows, joints: Sequence[tuple[Joint, str, Array]], multipliers: Array) -> Pairs:
    """Return the pairs of coordinates of cut joints that couplers measure.

    ``rows`` (t,): these coordinates as relative displacements. ``joints`` (t,): the joint of each, the name of its
    coordinate, and the rows (f, 6) of all its free directions to (theta, v), world axes. ``multipliers`` (..., t):
    forces along the coordinates. With xi = S q + 1/2 D q q and the row d of a coordinate, q = d . (xi - 1/2 D q q).
    """
    hessian = np.zeros((len(joints), 6, 6))
    for k, (joint, name, duals) in enumerate(joints):
        own = [direction for direction, _ in joint.freedom].index(name)
        curvature = _displacement_curvature(joint)
        hessian[k] = -np.einsum("i,iab,ax,by->xy", duals[own], curvature, duals, duals)
    wrench = np.concatenate((rows.moment, rows.force)) * multipliers[..., None, :]
    return Pairs(rows.first, rows.second, rows.point, wrench, hessian * multipliers[..., None, None])


def _displacement_curvature(joint: Joint) -> Array:
    form = expansions.form_of(joint)
    constants = expansions.of_displacement(form)
    length = expansions.length_of(joint)
    if length != 1.0:
        constants = expansions.with_length(constants, expansions.displacement_units(form), length)
    shape = constants.shape[1:]
    return np.asarray(np.array(joint.axes) @ constants.reshape(2, 3, -1)).reshape(6, *shape)


def _along_z(line: Array) -> Array:
    """Axes (3, 3, ..., p) whose last column is along unit vectors (..., 3, p)."""
    x, y, z = (line[..., i, :] for i in range(3))
    # the image of x and y by the smallest rotation that takes +-z to the line (Frisvad 2012; Duff et al. 2017)
    sign = np.where(z.real < 0.0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array([[1.0 + sign * x * x * a, b, x], [sign * b, sign + y * y * a, y], [-sign * x, -y, z]])
