"""The terms of all couplers as arrays, and their rows over the joint coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.elements import Joint
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.pose import Pose
from mbsvib.elements.rows import Rows
from mbsvib.kinematics.relative_motion import Twists, relative_motion
from mbsvib.linalg.components import arctan2
from mbsvib.linalg.rotations import logarithm


@dataclass(frozen=True)
class Couplings:
    """The terms (t,) of all couplers: ``row`` is the number of the coupler, ``value`` (..., t) the coefficient,
    ``turns`` is true for angles.

    ``column`` (t,) is the coordinate of a joint in the tree, or -1 where the term is the next of ``measured``, the
    relative motions of cut joints, of the joints ``owner``. ``touched`` (couplers, n) are the coordinates involved.
    """

    row: Index
    value: Array
    turns: Bools
    column: Index
    measured: Rows
    owner: Index
    touched: Bools

    def dense(self, coordinates: Twists) -> Array:
        """Return the rows (..., couplers, n) over the joint coordinates."""
        measured = relative_motion(coordinates, self.measured).dense(0, len(self.measured.first))
        lead = np.broadcast_shapes(measured.shape[:-2], self.value.shape[:-1])
        result = np.zeros((*lead, *self.touched.shape), np.result_type(measured, self.value))
        number = 0
        for k, (row, column) in enumerate(zip(self.row.tolist(), self.column.tolist(), strict=True)):
            if column >= 0:
                result[..., row, column] += self.value[..., k]
            else:
                result[..., row, :] += self.value[..., k, None] * measured[..., number, :]
                number += 1
        return result

    @cached_property
    def largest(self) -> Array:
        """The largest coefficients (2, ..., couplers) of angles and of distances of each coupler."""
        count = len(self.touched)
        result = np.zeros((2, *self.value.shape[:-1], count))
        places: Any = np.where(self.turns, 0, 1), ..., self.row
        np.maximum.at(result, places, np.moveaxis(np.abs(self.value), -1, 0))
        return result

    @property
    def of_measured(self) -> tuple[Index, Array]:
        """Coupler and coefficient (..., measured) of each of ``measured``."""
        at = (self.column < 0).nonzero()[0]
        return self.row[at], self.value[..., at]

    def sums(self, travel: Array) -> Array:
        """Return the sums (..., couplers) of displacements (..., t) of the coordinates, which couplers hold at zero."""
        return np.asarray((self.value * travel) @ (self.row[:, None] == np.arange(len(self.touched))))

    def row_scale(self, length: float | Array, members: Index | slice = slice(None)) -> Array:
        """Return factors that scale some rows to entries of at most one, with ``length`` [m] as the unit of length: one
        for all, or one for each (members,).
        """
        angle, distance = self.largest[..., members]
        return np.asarray(1.0 / np.maximum(angle, distance * length))

    def lever(self, members: Index) -> float:
        """Return the mean length [m] by which some couplers take angles to distances, 0 where none does; negative
        ``members`` are none.
        """
        angle, distance = self.largest[..., members[members >= 0]]
        both = (angle > 0.0) & (distance > 0.0)
        return float(np.exp(np.log(angle[both] / distance[both]).mean())) if both.any() else 0.0


def coupler_travel(
    couplers: Sequence[Coupling], joints: Sequence[Joint], pose: Pose, near: Array | None = None
) -> Array:
    """Return the displacements of coupled coordinates in a pose, one for each term of each coupler.

    ``near`` (..., terms): approximate displacements, from which full turns are counted. Returns (..., terms): distances
    [m] and angles [rad].
    """
    named = {joint.name: joint for joint in joints}
    names = [name.rpartition(".") for part in couplers for name, _ in part.terms]
    if not names:
        return np.zeros((*pose.centre.shape[:-2], 0))
    values = np.stack([joint_travel(named[owner], direction, pose) for owner, _, direction in names], axis=-1)
    if near is None:
        return values
    full_turns = 2.0 * np.pi * np.round(np.real(near - values) / (2.0 * np.pi))
    return np.where([direction[0] == "r" for *_, direction in names], values + full_turns, values)


def joint_travel(joint: Joint, direction: str, pose: Pose) -> Array:
    """Return the displacement (...) of one coordinate of a joint [m, rad], angles within half a turn."""
    k, axes = DIRECTIONS.index(direction), np.array(joint.axes)
    a, b = pose.number[joint.first], pose.number[joint.second]
    first, second = pose.rotations[..., a, :, :] @ axes, pose.rotations[..., b, :, :] @ axes
    if k < 3:
        at = np.array([pose.origin[min(a, b)] if joint.point is None else joint.point])
        apart = pose.points(np.array([b]), at) - pose.points(np.array([a]), at)
        return np.asarray((first[..., k] * apart[..., 0, :]).sum(axis=-1))
    relative, turns = first.swapaxes(-1, -2) @ second, joint.rotation_axes
    if len(turns) == 1:
        i, j = (k - 2) % 3, (k - 1) % 3
        return np.asarray(arctan2(relative[..., j, i] - relative[..., i, j], relative[..., i, i] + relative[..., j, j]))
    if joint.successive:
        e1, e2 = (axes.T @ axis for axis in turns)
        # relative = exp(a e1) exp(b e2): the angle a turns e2 about e1, the angle -b turns e1 about e2
        about_first = direction == next(name for name, _ in joint.freedom if name[0] == "r")
        axis, arm, turned = (e1, e2, relative @ e2) if about_first else (e2, e1, relative.swapaxes(-1, -2) @ e1)
        angle = arctan2(turned @ np.cross(axis, arm), turned @ arm - (axis @ arm) * (turned @ axis))
        return np.asarray(angle if about_first else -angle)
    return logarithm(relative)[..., k - 3]
