"""Kinds of joints in finite motion: with what the axes of a joint turn, and how far it is open.

With the rotations A of the first and B of the second body since they were described, the joint's point p in both, and
d = p_b - p_a: locked translations are zero in d, in axes that turn with the first body. Where one rotation is free both
bodies keep its axis; where two successive ones are (see ``elements.joint``), the one named first (``axis`` of a
universal joint) stays in the first body and the other (``axis2``) in the second, at their angle; other two, and three,
are the components of one rotation vector log(A^T B). The rod of a distance joint, from p_a to p_b, keeps its length.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arguments import frame_along
from mbsvib.linalg.rotations import axial, exponential, logarithm, skew

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Joint
    from mbsvib.equilibrium.pose import Pose


@dataclass(frozen=True, slots=True)
class Joints:
    """Joints (k) of one rule as described.

    ``first``, ``second`` (k,) are their bodies, ``start`` and ``end`` (k, 3) their points as the first and the second
    body carry them [m], ``one`` and ``two`` (k, 3) the axes of their first and last free rotation, ``pitch`` (k,) that
    of screws [m].
    """

    first: Index
    second: Index
    start: Array
    end: Array
    one: Array
    two: Array
    pitch: Array

    def gap(self, pose: Pose) -> Array:
        """Return p_b - p_a (k, 3) in a pose [m]."""
        ends = pose.points(np.concatenate((self.second, self.first)), np.concatenate((self.end, self.start)))
        return np.asarray(ends[: len(self.first)] - ends[len(self.first) :])


Axes = Callable[[Joints, "Pose"], "Array"]
Opening = Callable[[Joints, "Pose", "Array"], tuple["Array", "Array"]]


@dataclass(frozen=True, slots=True)
class Rule:
    """What a kind of joint does in finite motion.

    ``axes`` returns axes (k, 3, 3) with which all of its directions turn; None: they turn with the first body.
    ``opening`` takes p_b - p_a and returns the translation [m] and the small rotation [rad] (k, 3) of the second body
    against the first that should be none; None: all rotations are free. Only what these have along locked directions
    counts: that is exactly zero where the joint is assembled, and to first order the displacement that opened it.
    """

    axes: Axes | None = None
    opening: Opening | None = None


def _cross(a: Array, b: Array) -> Array:
    """Return the vector products of (k, 3)."""
    return np.asarray((skew(a) @ b[..., None])[..., 0])


def _normal(joints: Joints, pose: Pose) -> Array:
    """The cross product of the axis in the first and that in the second body."""
    return _cross(pose.vectors(joints.first, joints.one), pose.vectors(joints.second, joints.two))


def _turned_apart(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    first, second = pose.turn[joints.first], pose.turn[joints.second]
    return gap, logarithm(second @ first.swapaxes(-1, -2))


def _tilted(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    return gap, _normal(joints, pose)


def _off_thread(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    """The angle that the screw has turned by, whole turns as its advance tells them, on top of the tilt."""
    axis, (_, tilt) = pose.vectors(joints.first, joints.one), _tilted(joints, pose, gap)
    relative = pose.turn[joints.first].swapaxes(-1, -2) @ pose.turn[joints.second]
    along = (joints.one * np.einsum("kij,kj->ki", relative, joints.one)).sum(axis=-1)
    sine, cosine = 2.0 * (joints.one * axial(relative)).sum(axis=-1), np.einsum("kii->k", relative) - along
    angle = np.arctan2(sine, cosine)
    advance = (axis * gap).sum(axis=-1) / joints.pitch
    angle += 2.0 * np.pi * np.round((advance - angle) / (2.0 * np.pi))
    return gap, tilt + angle[:, None] * axis


def _between_axes(joints: Joints, pose: Pose) -> Array:
    """Axes along the one in the first body, along the normal of both, and across."""
    one = pose.vectors(joints.first, joints.one)
    normal = _cross(one, pose.vectors(joints.second, joints.two))
    normal /= np.sqrt((normal * normal).sum(axis=-1, keepdims=True))
    result = np.empty((*one.shape, 3))
    result[..., 0], result[..., 1], result[..., 2] = one, normal, _cross(normal, one)
    return result


def _off_angle(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    one, two = pose.vectors(joints.first, joints.one), pose.vectors(joints.second, joints.two)
    normal = _cross(one, two)
    change = (joints.one * joints.two).sum(axis=-1) - (one * two).sum(axis=-1)
    return gap, (change / (normal * normal).sum(axis=-1))[:, None] * normal


def _halfway(joints: Joints, pose: Pose) -> Array:
    first, second = pose.turn[joints.first], pose.turn[joints.second]
    return np.asarray(first @ exponential(0.5 * logarithm(first.swapaxes(-1, -2) @ second)))


def _bent(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    first, second = pose.turn[joints.first], pose.turn[joints.second]
    bend = logarithm(first.swapaxes(-1, -2) @ second)
    angle = np.sqrt((bend * bend).sum(axis=-1))
    return gap, np.sinc(0.5 * angle / np.pi)[:, None] * np.einsum("kij,kj->ki", _halfway(joints, pose), bend)


def _along_rod(joints: Joints, pose: Pose) -> Array:
    rod = joints.gap(pose)
    rod /= np.sqrt((rod * rod).sum(axis=-1, keepdims=True))
    return np.array([frame_along((x, y, z)) for x, y, z in rod.tolist()])


def _stretched(joints: Joints, pose: Pose, gap: Array) -> tuple[Array, Array]:
    length = np.sqrt((gap * gap).sum(axis=-1))
    described = np.sqrt(np.square(joints.end - joints.start).sum(axis=-1))
    return ((length - described) / length)[:, None] * gap, np.zeros(gap.shape)


SUCCESSIVE = Rule(_between_axes, _off_angle)
BY_KIND = {
    "screw": Rule(opening=_off_thread),
    "homokinetic": Rule(_halfway, _bent),
    "distance": Rule(_along_rod, _stretched),
}
BY_ROTATIONS = {0: Rule(opening=_turned_apart), 1: Rule(opening=_tilted), 3: Rule()}


def rule_of(joint: Joint) -> Rule:
    """Return the rule that a joint follows in finite motion."""
    if joint.kind in BY_KIND:
        return BY_KIND[joint.kind]
    return SUCCESSIVE if joint.successive else BY_ROTATIONS[sum(name[0] == "r" for name, _ in joint.freedom)]


def in_groups(joints: Sequence[Joint], number: Mapping[str, int], origin: Array) -> list[tuple[Rule, Index, Joints]]:
    """Return joints in groups of one rule.

    Parameters
    ----------
    joints : sequence of Joint
        Joints as described.
    number : mapping
        Number of each body, ground included.
    origin : array, shape (bodies + 1, 3)
        Centres of mass as described [m], the points of joints that have none.

    Returns
    -------
    list of (Rule, array, Joints)
        Each rule, the numbers (k,) of the joints that follow it, and these joints.
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
    turns = [[six[3:] for name, six in joint.freedom if name[0] == "r"] or [(0.0,) * 3] for joint in joints]
    one, two = np.array([axes[0] for axes in turns]), np.array([axes[-1] for axes in turns])
    return Joints(first, second, start, end, one, two,
                  np.array([joint.pitch or 0.0 for joint in joints]))  # fmt: skip
