"""Kinds of joints in finite motion: how the axes of a joint turn, and how far its constraints are violated.

A and B are the rotations of the first and the second body from the reference pose, p_a and p_b the joint's point on
each, and d = p_b - p_a. Locked translations require d = 0 along axes that turn with the first body. One free rotation:
its axis is fixed in both bodies. Two successive free rotations (see ``elements.joint_kinds``): the first axis
(``axis`` of a universal joint) is fixed in the first body, the other (``axis2``) in the second, and their angle is
constant. Any other two, or three: components of the rotation vector log(A^T B); of two, the axes bisect the angle of
both bodies. A distance joint: the length of d is constant.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arguments import frame_along
from mbsvib.linalg.rotations import axial, exponential, logarithm, skew

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Joint
    from mbsvib.equilibrium.pose import Pose


@dataclass(frozen=True, slots=True)
class Joints:
    """Joints (k) of one rule in the reference pose.

    ``first``, ``second`` (k,) are their bodies, ``start`` and ``end`` (k, 3) their points as the first and the second
    body carry them [m], ``first_axis`` and ``last_axis`` (k, 3) the axes of their first and last free rotation,
    ``pitch`` (k,) that of screws [m].
    """

    first: Index
    second: Index
    start: Array
    end: Array
    first_axis: Array
    last_axis: Array
    pitch: Array

    def gap(self, pose: Pose) -> Array:
        """Return p_b - p_a (k, 3) in a pose [m]."""
        ends = pose.points(np.concatenate((self.second, self.first)), np.concatenate((self.end, self.start)))
        return np.asarray(ends[: len(self.first)] - ends[len(self.first) :])


Axes = Callable[[Joints, "Pose"], "Array"]
Opening = Callable[[Joints, "Pose", "Array"], tuple["Array", "Array"]]


@dataclass(frozen=True, slots=True)
class Rule:
    """The finite motion of a kind of joint.

    ``axes`` returns axes (k, 3, 3) with which all directions of the joint turn; None: they turn with the first body.
    ``opening`` takes p_b - p_a and returns the violation of the constraints, translation [m] and small rotation [rad]
    (k, 3) of the second body against the first; None: all rotations are free. Only the components along locked
    directions count. They are zero where the joint is assembled, and to first order equal the relative displacement.
    """

    axes: Axes | None = None
    opening: Opening | None = None


def _cross(a: Array, b: Array) -> Array:
    """Return the vector products of (k, 3)."""
    return np.asarray((skew(a) @ b[..., None])[..., 0])


def _relative_rotation(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    first, second = pose.rotations[joints.first], pose.rotations[joints.second]
    return gap, logarithm(second @ first.swapaxes(-1, -2))


def _tilted(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    """The cross product of the axis in the first and that in the second body."""
    return gap, _cross(pose.vectors(joints.first, joints.first_axis), pose.vectors(joints.second, joints.last_axis))


def _off_thread(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    """The tilt plus the angle of the screw about its axis, with full turns counted by its advance."""
    axis, (_, tilt) = pose.vectors(joints.first, joints.first_axis), _tilted(joints, pose, gap)
    relative = pose.rotations[joints.first].swapaxes(-1, -2) @ pose.rotations[joints.second]
    along = (joints.first_axis * np.einsum("kij,kj->ki", relative, joints.first_axis)).sum(axis=-1)
    sine, cosine = 2.0 * (joints.first_axis * axial(relative)).sum(axis=-1), np.einsum("kii->k", relative) - along
    angle = np.arctan2(sine, cosine)
    advance = (axis * gap).sum(axis=-1) / joints.pitch
    angle += 2.0 * np.pi * np.round((advance - angle) / (2.0 * np.pi))
    return gap, tilt + angle[:, None] * axis


def _between_axes(joints: Joints, pose: Pose) -> Array:
    """Axes along the first axis, along the normal of both axes, and perpendicular to these."""
    first_axis = pose.vectors(joints.first, joints.first_axis)
    normal = _cross(first_axis, pose.vectors(joints.second, joints.last_axis))
    normal /= np.sqrt((normal * normal).sum(axis=-1, keepdims=True))
    result = np.empty((*first_axis.shape, 3))
    result[..., 0], result[..., 1], result[..., 2] = first_axis, normal, _cross(normal, first_axis)
    return result


def _off_angle(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    first_axis, last_axis = pose.vectors(joints.first, joints.first_axis), pose.vectors(joints.second, joints.last_axis)
    normal = _cross(first_axis, last_axis)
    change = (joints.first_axis * joints.last_axis).sum(axis=-1) - (first_axis * last_axis).sum(axis=-1)
    return gap, (change / (normal * normal).sum(axis=-1))[:, None] * normal


def _halfway(joints: Joints, pose: Pose) -> Array:
    first, second = pose.rotations[joints.first], pose.rotations[joints.second]
    return np.asarray(first @ exponential(0.5 * logarithm(first.swapaxes(-1, -2) @ second)))


def _bent(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    first, second = pose.rotations[joints.first], pose.rotations[joints.second]
    relative_rotation = logarithm(first.swapaxes(-1, -2) @ second)
    angle = np.sqrt((relative_rotation * relative_rotation).sum(axis=-1))
    chord = np.sinc(0.5 * angle / np.pi)[:, None] * relative_rotation
    return gap, np.einsum("kij,kj->ki", _halfway(joints, pose), chord)


def _along_rod(joints: Joints, pose: Pose) -> Array:
    rod = joints.gap(pose)
    rod /= np.sqrt((rod * rod).sum(axis=-1, keepdims=True))
    return np.array([frame_along((x, y, z)) for x, y, z in rod.tolist()])


def _stretched(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    length = np.sqrt((gap * gap).sum(axis=-1))
    described = np.sqrt(np.square(joints.end - joints.start).sum(axis=-1))
    return ((length - described) / length)[:, None] * gap, np.zeros(gap.shape)


SUCCESSIVE, SCREW, ROD = Rule(_between_axes, _off_angle), Rule(opening=_off_thread), Rule(_along_rod, _stretched)
BY_ROTATIONS = (Rule(opening=_relative_rotation), Rule(opening=_tilted), Rule(_halfway, _bent), Rule())


def rule_of(joint: Joint) -> Rule:
    """Return the rule that a joint follows in finite motion."""
    if joint.is_rod or joint.pitch is not None:
        return ROD if joint.is_rod else SCREW
    return SUCCESSIVE if joint.successive else BY_ROTATIONS[len(joint.rotation_axes)]


def in_groups(joints: Sequence[Joint], number: Mapping[str, int], origin: Array) -> list[tuple[Rule, Index, Joints]]:
    """Return joints in groups of one rule.

    ``origin`` (bodies + 1, 3): centres of mass in the reference pose [m], used as the points of joints that have none.
    """
    members: dict[int, list[int]] = {}
    rules = [rule_of(joint) for joint in joints]
    for k, rule in enumerate(rules):
        members.setdefault(id(rule), []).append(k)
    return [(rules[which[0]], np.array(which, dtype=np.intp), _stack([joints[k] for k in which], number, origin))
            for which in members.values()]  # fmt: skip


def _stack(joints: Sequence[Joint], number: Mapping[str, int], origin: Array) -> Joints:
    first, second = (np.array([number[body] for body in bodies], dtype=np.intp) for bodies in (
        [joint.first for joint in joints], [joint.second for joint in joints]))  # fmt: skip
    inner = np.minimum(first, second)
    end = np.array([origin[k] if joint.point is None else joint.point for k, joint in zip(inner, joints, strict=True)])
    start = np.array([point if joint.end is None else joint.position or (0.0, 0.0, 0.0)
                      for point, joint in zip(end, joints, strict=True)])  # fmt: skip
    turns = [joint.rotation_axes or ((0.0,) * 3,) for joint in joints]
    first_axis, last_axis = np.array([axes[0] for axes in turns]), np.array([axes[-1] for axes in turns])
    return Joints(first, second, start, end, first_axis, last_axis,
                  np.array([joint.pitch or 0.0 for joint in joints]))  # fmt: skip
