"""Joints in finite motion: the displacement of the second body against the first, and what a cut joint demands.

All is in world axes of the pose as described, which turn with the first body; ``elements.joint_kinds`` states it for
all kinds.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements import Body, Joint
from mbsvib.elements.joint_kinds import Columns, normals
from mbsvib.finite_motion.frames import Expression, Frame, entries, exponential, matrix
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
    moved = joint.motion.displacement([q[k] for k in range(len(joint.freedom))], _columns(joint, numbers))
    rotation = matrix(moved.rotation)
    if base is not None and len(joint.rotation_axes) == 3:
        rotation = rotation @ base
    point = point_of(joint, numbers)
    return Frame(rotation, point + ca.vertcat(*moved.shift) - rotation @ point)


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
    return small_displacement(ca.SX(np.array(joint.axes)), place_of(joint, numbers, bodies, relative), q)


def place_of(joint: Joint, numbers: Numbers, bodies: Mapping[str, Body], relative: Frame) -> Expression:
    """Return where the wrench of a joint is taken, (3,) in the axes of the first body as described [m]."""
    if joint.position is not None:
        return relative.point(point_of(joint, numbers))
    if joint.second in bodies:
        return relative.point(numbers.vector(bodies[joint.second], "position"))
    return numbers.vector(bodies[joint.first], "position")


def small_displacement(axes: Expression, point: Expression, q: Expression) -> Frame:
    """Return a displacement along axes (columns) and a rotation about them at a point, q (6,) [m, rad]."""
    rotation = exponential(axes @ q[3:])
    return Frame(rotation, point + axes @ q[:3] - rotation @ point)


def openings(joint: Joint, numbers: Numbers, relative: Frame) -> list[tuple[str, Expression]]:
    """Return how far a joint is open along each of its locked directions, zero where it is assembled [m, rad].

    ``relative``: displacement of the second body against the first.
    """
    values = joint.motion.openings(relative.displacement, _columns(joint, numbers))
    return [(name, value) for (name, _), value in zip(joint.locked, values, strict=True)]


def coordinates(joint: Joint, numbers: Numbers, relative: Frame) -> list[tuple[str, Expression]]:
    """Return the joint coordinates, by direction, that make a relative displacement [m, rad].

    An axis a turns a vector v by the angle atan2((a x v) . v', (v - a a . v) . v') to v'. Angles are within half a
    turn; rods, and rotation vectors of joints that turn about two or three axes at once, have no coordinates here.
    """
    if joint.is_rod:
        return []
    point, turns = point_of(joint, numbers), [np.array(axis) for axis in joint.rotation_axes]
    gap, angles = relative.point(point) - point, []
    if len(turns) == 1:
        across = np.array(normals(tuple(turns[0]))[0])
        angles = [_angle(turns[0], across, relative.rotation @ across)]
    elif joint.successive:
        first, second = turns
        back = relative.rotation.T @ first
        angles = [_angle(first, second, relative.rotation @ second), -_angle(second, first, back)]
    left = iter(angles)
    values = [(name, next(left, None) if name[0] == "r" else ca.dot(ca.SX(np.array(six[:3])), gap))
              for name, six in joint.freedom]  # fmt: skip
    return [(name, value) for name, value in values if value is not None]


def _angle(axis: Array, vector: Array, turned: Expression) -> Expression:
    return ca.atan2(ca.dot(np.cross(axis, vector), turned), ca.dot(vector - axis * (axis @ vector), turned))


def _columns(joint: Joint, numbers: Numbers) -> Columns:
    point, start = entries(point_of(joint, numbers)), joint.position or (0.0, 0.0, 0.0)
    return Columns(joint.freedom, joint.locked, point, start, joint.successive)
