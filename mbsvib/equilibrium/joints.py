"""Joints in finite motion: how far a joint moves its bodies, where it is in another pose, and how far it is open.

With the axes A in the first and B in the second body (equal as described), the joint's point p in both, and
d = A^T (p_b - p_a): locked translations are zero in d, in axes that turn with the first body. Where one rotation is
free both bodies keep its axis; where two successive ones are (see ``parts.joint``), the one named first (``axis`` of a
universal joint) stays in the first body and the other (``axis2``) in the second, at their angle; other two, and three,
are the components of one rotation vector log(A^T B). The rod of a distance joint, from p_a to p_b, keeps its length.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import exponential, logarithm

if TYPE_CHECKING:
    from mbsvib.common.arguments import Vector
    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint
    from mbsvib.equilibrium.pose import Pose

ALONG_AXIS = frozenset({"revolute", "prismatic", "cylindrical", "screw"})
# sin of the angle by which the frame of a custom joint may have left the one that its locked translations need
SKEWED = 1e-12


class NoWordsError(ModelError):
    """A part that its own words cannot describe in another pose, wherever that is."""


def rotations(joint: Joint) -> tuple[int, ...]:
    """Return the numbers 0, 1, 2 of the joint's free rotations."""
    return tuple(DIRECTIONS.index(name) - 3 for name, _ in joint.freedom if name[0] == "r")


def two_axes(joint: Joint) -> tuple[Array, Array]:
    """Return the axes of a joint with two successive rotations: the one in the first and the one in the second body."""
    one, two = (np.array(six[3:]) for name, six in joint.freedom if name[0] == "r")
    return one, two


def displacement(joint: Joint, values: Array) -> tuple[Array, Array]:
    """Return rotation (3, 3) and shift (3,) of the second body relative to the first, about the joint's point.

    A point x of the second body goes to p + shift + rotation (x - p).
    """
    shift, turns = np.zeros(3), []
    if joint.kind == "distance":
        return exponential(np.array(joint.axes) @ values[2:]), _swing(joint, values[:2])
    for (name, six), value in zip(joint.freedom, values.tolist(), strict=True):
        shift += np.multiply(value, six[:3])
        if name[0] == "r":
            turns.append(np.multiply(value, six[3:]))
    if joint.successive:
        return exponential(turns[0]) @ exponential(turns[1]), shift
    return exponential(sum(turns, start=np.zeros(3))), shift


def _rod(joint: Joint) -> tuple[Vector, Vector]:
    """Where a rod begins on the first and ends on the second body."""
    return joint.position or (0.0, 0.0, 0.0), joint.end or (0.0, 0.0, 0.0)


def _swing(joint: Joint, across: Array) -> Array:
    """How far a rod's end goes on its sphere: as far along an arc as the rod's two coordinates say."""
    axes = np.array(joint.axes)
    length = float(np.linalg.norm(np.subtract(*_rod(joint))))
    angle = float(np.linalg.norm(across)) / length
    along = np.append(np.sinc(angle / np.pi) * across, -0.5 * length * angle**2 * np.sinc(0.5 * angle / np.pi) ** 2)
    return np.asarray(axes @ along)


def opening(joint: Joint, pose: Pose, at: Vector) -> Array:
    """Return how far a joint is open: the displacement of its second body against the first that should be none.

    Parameters
    ----------
    joint : Joint
        The joint as described.
    pose : Pose
        The pose.
    at : array-like, shape (3,)
        The joint's point as described.

    Returns
    -------
    array, shape (6,)
        Translation [m] and small rotation [rad], world axes. Only what it has along locked directions counts: that is
        exactly zero where the joint is assembled, and to first order the displacement that opened it.
    """
    if joint.kind == "distance":
        begin, end = _rod(joint)
        rod = pose.point(joint.second, end) - pose.point(joint.first, begin)
        length = float(np.linalg.norm(rod))
        surplus = length - float(np.linalg.norm(np.subtract(end, begin)))
        return np.concatenate((surplus / length * rod, np.zeros(3)))
    gap = pose.point(joint.second, at) - pose.point(joint.first, at)
    first, second = pose.turned(joint.first, joint.axes), pose.turned(joint.second, joint.axes)
    free = rotations(joint)
    turn = np.zeros(3)
    if not free:
        turn = logarithm(second @ first.T)
    elif len(free) == 1:
        turn = np.cross(first[:, free[0]], second[:, free[0]])
        if joint.pitch:
            relative = first.T @ second
            angle = float(np.arctan2(relative[1, 0] - relative[0, 1], relative[0, 0] + relative[1, 1]))
            advance = float(first[:, 2] @ gap) / joint.pitch
            turn += (angle + 2 * np.pi * np.round((advance - angle) / (2 * np.pi))) * first[:, 2]
    elif joint.successive:
        one, two = two_axes(joint)
        cosine = one @ two
        one, two = pose.turned(joint.first, one), pose.turned(joint.second, two)
        normal = np.cross(one, two)
        turn = (cosine - one @ two) / float(normal @ normal) * normal
    elif len(free) == 2:
        locked = 3 - sum(free)
        bend = logarithm(first.T @ second)
        turn = np.sinc(0.5 * np.linalg.norm(bend) / np.pi) * bend[locked] * halfway(joint, pose)[:, locked]
    return np.concatenate((gap, turn))


def words_at(joint: Joint, pose: Pose) -> dict[str, Any]:
    """Return the words of a joint in another pose, so that it holds its bodies to the same relative motions.

    Raises
    ------
    ModelError
        If it has two successive rotations and locked translations whose axes no longer go with them.
    """
    words = joint.words()
    if pose.stays(joint.first) and pose.stays(joint.second):
        return words
    if joint.kind == "distance":
        begin, end = _rod(joint)
        return words | {"position": pose.point(joint.first, begin), "end": pose.point(joint.second, end)}
    if joint.position is not None:
        words["position"] = pose.point(joint.second, joint.position)
    free = rotations(joint)
    if joint.successive:
        one, two = two_axes(joint)
        one, two = pose.turned(joint.first, one), pose.turned(joint.second, two)
        if joint.kind == "universal":
            return {key: value for key, value in words.items() if key != "orientation"} | {"axis": one, "axis2": two}
        words["orientation"] = _frame(joint, one, two, free, pose)
    elif joint.axis is not None and joint.kind in ALONG_AXIS:
        words["axis"] = pose.turned(joint.first, joint.axis)
        return words
    elif len(free) == 2:
        words["orientation"] = halfway(joint, pose)
    else:
        words["orientation"] = pose.turned(joint.first, joint.axes)
    words.pop("axis", None)
    return words


def halfway(joint: Joint, pose: Pose) -> Array:
    """Return the axes of a joint as the first body carries them, turned by half the way to those of the second."""
    first, second = pose.turned(joint.first, joint.axes), pose.turned(joint.second, joint.axes)
    return np.asarray(first @ exponential(0.5 * logarithm(first.T @ second)))


def _frame(joint: Joint, one: Array, two: Array, free: tuple[int, ...], pose: Pose) -> Array:
    """Axes of a custom joint with two successive rotations, from the axes that its bodies keep."""
    columns = [np.zeros(3)] * 3
    columns[free[0]], columns[free[1]] = one, two
    third = 3 - sum(free)
    columns[third] = np.cross(columns[(third + 1) % 3], columns[(third + 2) % 3])
    axes = np.array(columns).T
    axes /= np.linalg.norm(axes, axis=0)
    axes[:, free[1]] = np.cross(axes[:, (free[1] + 1) % 3], axes[:, (free[1] + 2) % 3])
    locked = [k for k in range(3) if DIRECTIONS[k] in dict(joint.locked)]
    if locked and len(locked) < 3:
        before = pose.turned(joint.first, joint.axes)[:, locked]
        if np.abs(before - axes[:, locked] @ (axes[:, locked].T @ before)).max() > SKEWED:
            who = f"joint '{joint.name}'"
            raise NoWordsError(
                f"{who}: its free rotations have turned against its locked translations, which no joint with "
                f"free = {joint.free} can say in this pose. Make it of two joints with a small body between them.",
                element=who, field="free",
            )  # fmt: skip
    return axes
