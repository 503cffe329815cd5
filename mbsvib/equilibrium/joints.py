"""Joints in another pose; ``joint_rules`` has their finite motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.elements.joint import moved_joint
from mbsvib.errors import NoWordsError
from mbsvib.linalg.rotations import exponential, logarithm

if TYPE_CHECKING:
    from mbsvib.common.arguments import Matrix3
    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint
    from mbsvib.elements.joint import Six
    from mbsvib.equilibrium.pose import Pose

ALONG_AXIS = frozenset({"revolute", "prismatic", "cylindrical", "screw"})
ORIGIN = (0.0, 0.0, 0.0)
# Sine of the largest angle between the frame of a custom joint and the one that its locked translations need.
SKEWED = 1e-12


def rotations(joint: Joint) -> tuple[int, ...]:
    """Return the numbers 0, 1, 2 of the joint's free rotations."""
    return tuple(DIRECTIONS.index(name) - 3 for name, _ in joint.freedom if name[0] == "r")


def two_axes(joint: Joint) -> tuple[Six, Six]:
    """Return the axes of a joint with two successive rotations, that of the first and that of the second body."""
    first, second = (six[3:] for name, six in joint.freedom if name[0] == "r")
    return first, second


def in_pose(joint: Joint, pose: Pose) -> Joint:
    """Return a joint in another pose, with the same free relative motions of its bodies.

    Raises
    ------
    ModelError
        If it has two successive rotations, and its locked translations are no longer along axes of one frame with them.
    """
    if joint.kind == "distance":
        begin, end = joint.position or ORIGIN, joint.end or ORIGIN
        return moved_joint(joint, pose.point(joint.first, begin), pose.point(joint.second, end))
    position = None if joint.position is None else pose.point(joint.second, joint.position)
    if joint.successive:
        axis, axis2 = map(pose.rotated_vector, (joint.first, joint.second), two_axes(joint))
        if joint.kind == "universal":
            return moved_joint(joint, position, axis=axis, axis2=axis2)
        axes = as_matrix(_frame(joint, np.array(axis), np.array(axis2), rotations(joint), pose))
    elif joint.axis is not None and joint.kind in ALONG_AXIS:
        return moved_joint(joint, position, axis=pose.rotated_vector(joint.first, joint.axis))
    elif joint.kind != "spherical" and len(rotations(joint)) == 2:
        axes = as_matrix(halfway(joint, pose))
    else:
        axes = pose.rotated_axes(joint.first, joint.axes)
    return moved_joint(joint, position, axes=axes)


def as_matrix(axes: Array) -> Matrix3:
    """Return axes as tuples of numbers."""
    x, y, z = axes.tolist()
    return tuple(x), tuple(y), tuple(z)


def halfway(joint: Joint, pose: Pose) -> Array:
    """Return the axes of a joint on the first body, turned halfway to those on the second."""
    first, second = pose.rotated(joint.first, joint.axes), pose.rotated(joint.second, joint.axes)
    return np.asarray(first @ exponential(0.5 * logarithm(first.T @ second)))


def _frame(joint: Joint, first_axis: Array, second_axis: Array, free: tuple[int, ...], pose: Pose) -> Array:
    """Axes of a custom joint with two successive rotations, from the axes that are fixed in its bodies."""
    columns = [np.zeros(3)] * 3
    columns[free[0]], columns[free[1]] = first_axis, second_axis
    third = 3 - sum(free)
    columns[third] = np.cross(columns[(third + 1) % 3], columns[(third + 2) % 3])
    axes = np.array(columns).T
    axes /= np.linalg.norm(axes, axis=0)
    axes[:, free[1]] = np.cross(axes[:, (free[1] + 1) % 3], axes[:, (free[1] + 2) % 3])
    locked = [k for k in range(3) if DIRECTIONS[k] in dict(joint.locked)]
    if locked and len(locked) < 3:
        before = pose.rotated(joint.first, joint.axes)[:, locked]
        if np.abs(before - axes[:, locked] @ (axes[:, locked].T @ before)).max() > SKEWED:
            who = f"joint '{joint.name}'"
            raise NoWordsError(
                f"{who}: its free rotations have turned against its locked translations, which no joint with "
                f"free = {joint.free} can say in this pose. Make it of two joints with a small body between them.",
                element=who, field="free",
            )  # fmt: skip
    return axes
