"""Joints in finite motion: the displacement of the second body against the first, and what a cut joint demands.

All is said in world axes of the pose as described, which turn with the first body. ``equilibrium.joint_rules`` states
the same rules for numbers.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.finite_motion.frames import Frame
from mbsvib.finite_motion.rotations import Expression, about, axial, exponential, sinc

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.elements import Body, Joint
    from mbsvib.finite_motion.numbers import Numbers


def point_of(joint: Joint, numbers: Numbers) -> Expression:
    """Return the point (3,) of a joint as described [m]; the origin where any will do."""
    if joint.is_rod:
        return ca.SX(np.array(joint.end))
    return ca.SX.zeros(3) if joint.position is None else numbers.vector(joint, "position")


def displacement(joint: Joint, numbers: Numbers, q: Expression, base: Expression | None = None) -> Frame:
    """Return the displacement of the second body against the first by joint coordinates.

    ``q`` (f,): its coordinates [m, rad]. ``base`` (3, 3): rotation on top of which those of a joint with three free
    rotations come; default: none.
    """
    shift, turns = ca.SX.zeros(3), []
    for k, (name, six) in enumerate(joint.freedom):
        shift += q[k] * ca.SX(np.array(six[:3]))
        if name[0] == "r":
            turns.append((ca.SX(np.array(six[3:])), q[k]))
    rotation = _rotation(joint, turns, base)
    if joint.is_rod:
        shift = _swing(joint, shift)
    point = point_of(joint, numbers)
    return Frame(rotation, point + shift - rotation @ point)


def virtual_displacement(
    joint: Joint, numbers: Numbers, bodies: Mapping[str, Body], relative: Frame, q: Expression
) -> Frame:
    """Return a virtual displacement of the second body of a joint, in the directions in which its forces are defined.

    ``relative``: displacement of the second body against the first. ``q`` (6,): displacement along the axes of the
    joint, which turn with the first body, and rotation about them at its point on the second body [m, rad]; a joint
    without a point has it at the centre of mass of this body, or of the first where the second is the ground. A rod has
    its z axis along itself, and no others.
    """
    if joint.is_rod:
        rod = relative.point(point_of(joint, numbers)) - ca.SX(np.array(joint.position))
        return Frame(ca.SX.eye(3), q[2] * rod / ca.norm_2(rod))
    if joint.position is not None:
        point = relative.point(point_of(joint, numbers))
    elif joint.second in bodies:
        point = relative.point(numbers.vector(bodies[joint.second], "position"))
    else:
        point = numbers.vector(bodies[joint.first], "position")
    return small_displacement(ca.SX(np.array(joint.axes)), point, q)


def small_displacement(axes: Expression, point: Expression, q: Expression) -> Frame:
    """Return a displacement along axes (columns) and a rotation about them at a point, q (6,) [m, rad]."""
    rotation = exponential(axes @ q[3:])
    return Frame(rotation, point + axes @ q[:3] - rotation @ point)


def openings(joint: Joint, numbers: Numbers, relative: Frame) -> list[tuple[str, Expression]]:
    """Return how far a joint is open along each of its locked directions, zero where it is assembled [m, rad].

    ``relative``: displacement of the second body against the first.
    """
    point = point_of(joint, numbers)
    if joint.is_rod:
        rod = relative.point(point) - ca.SX(np.array(joint.position))
        length = math.dist(joint.position or (0.0, 0.0, 0.0), joint.end or (0.0, 0.0, 0.0))
        return [("z", 0.5 * (ca.dot(rod, rod) - length**2) / length)]
    gap, turns, result = relative.point(point) - point, [np.array(axis) for axis in joint.rotation_axes], []
    for name, six in joint.locked:
        along, axis = ca.SX(np.array(six[:3])), ca.SX(np.array(six[3:]))
        if joint.pitch is not None and name == "z":
            value = _off_thread(joint, relative.rotation, gap)
        elif name[0] != "r":
            value = ca.dot(along, gap)
        elif joint.successive:
            first, second = map(ca.SX, turns)
            change = ca.dot(first, second) - ca.dot(first, relative.rotation @ second)
            value = change / float(np.linalg.norm(np.cross(turns[0], turns[1])))
        elif len(turns) == 1:
            value = ca.dot(axis, ca.cross(ca.SX(turns[0]), relative.rotation @ ca.SX(turns[0])))
        else:
            value = ca.dot(axis, axial(relative.rotation))
        result.append((name, value))
    return result


def _rotation(joint: Joint, turns: list[tuple[Expression, Expression]], base: Expression | None) -> Expression:
    if len(turns) == 1:
        return about(*turns[0])
    if joint.successive:
        return about(*turns[0]) @ about(*turns[1])
    if not turns:
        return ca.SX.eye(3)
    rotation = exponential(sum((axis * angle for axis, angle in turns), ca.SX.zeros(3)))
    return rotation if base is None else rotation @ base


def _swing(joint: Joint, across: Expression) -> Expression:
    """How far the end of a rod goes on its sphere: as far along an arc as its coordinates across say."""
    rod = np.subtract(joint.end or 0.0, joint.position or 0.0)
    length = float(np.linalg.norm(rod))
    square = ca.dot(across, across) / length**2
    return sinc(square) * across - 0.5 * length * square * sinc(0.25 * square) ** 2 * ca.SX(rod / length)


def _off_thread(joint: Joint, rotation: Expression, gap: Expression) -> Expression:
    """How far a screw is off its thread: pitch times the sine of the angle that its advance is ahead."""
    axis = np.array(joint.rotation_axes[0])
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    x, y = ca.SX(first), ca.SX(np.cross(axis, first))
    sine = 0.5 * (ca.dot(y, rotation @ x) - ca.dot(x, rotation @ y))
    cosine = 0.5 * (ca.dot(x, rotation @ x) + ca.dot(y, rotation @ y))
    pitch = joint.pitch or 1.0
    angle = ca.dot(ca.SX(axis), gap) / pitch
    return pitch * (ca.sin(angle) * cosine - ca.cos(angle) * sine)
