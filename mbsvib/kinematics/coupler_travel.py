"""Couplers in finite motion: displacements of the coupled joint coordinates from the reference pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.linalg.components import arctan2
from mbsvib.linalg.rotations import logarithm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint
    from mbsvib.elements.coupler import Coupling
    from mbsvib.kinematics.pose import Pose


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
