"""Frames of bodies in finite motion: where points and vectors go that were somewhere in the pose as described.

Rotations are matrices of expressions from ``linalg.components``, which can be differentiated also at angle 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from mbsvib.linalg import components as c
from mbsvib.linalg.displacements import Displacement

Expression = Any


def matrix(rows: c.Rotation) -> Expression:
    """Return a rotation of components as a matrix (3, 3)."""
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def entries(vector: Expression) -> c.Triple:
    """Return the components of a vector (3,)."""
    x, y, z = ca.vertsplit(vector)
    return x, y, z


def rows_of(matrix: Expression) -> c.Rotation:
    """Return the components of a matrix (3, 3), row by row."""
    x, y, z = ca.vertsplit(matrix)
    return entries(x.T), entries(y.T), entries(z.T)


def axial(matrix: Expression) -> Expression:
    """Return the vector w (3,) whose [w]x is the antisymmetric part of a matrix (3, 3)."""
    return ca.vertcat(*c.axial(rows_of(matrix)))


def exponential(w: Expression) -> Expression:
    """Return the rotation matrix (3, 3) of a rotation vector (3,) [rad]."""
    return matrix(c.exponential(entries(w)))


def logarithm(rotation: Expression) -> Expression:
    """Return the rotation vector (3,) [rad] of a rotation matrix (3, 3), less than half a turn long."""
    return ca.vertcat(*c.rotation_vector(rows_of(rotation)))


@dataclass(frozen=True, slots=True)
class Frame:
    """The displacement of a body since the pose as described: what was at p is at R p + s.

    ``rotation`` R (3, 3), ``shift`` s (3,) [m]; world axes.
    """

    rotation: Expression
    shift: Expression

    @property
    def displacement(self) -> Displacement:
        """The same in components."""
        return Displacement(rows_of(self.rotation), entries(self.shift))

    def point(self, p: Expression) -> Expression:
        """Return where a point (3,) of the body is that was at p as described [m]."""
        return self.rotation @ p + self.shift

    def vector(self, v: Expression) -> Expression:
        """Return a vector (3,) that turns with the body."""
        return self.rotation @ v

    def seen_from(self, other: Frame) -> Frame:
        """Return the displacement relative to another body, in the axes in which that was described."""
        back = other.rotation.T
        return Frame(back @ self.rotation, back @ (self.shift - other.shift))

    def then(self, relative: Frame) -> Frame:
        """Return the frame of a body with this displacement relative to the one in this frame."""
        return Frame(self.rotation @ relative.rotation, self.rotation @ relative.shift + self.shift)

    def inverse(self) -> Frame:
        """Return the displacement of the first body relative to the second."""
        back = self.rotation.T
        return Frame(back, -(back @ self.shift))


REST = Frame(ca.SX.eye(3), ca.SX.zeros(3))


def rate(expression: Expression, q: Expression, qd: Expression) -> Expression:
    """Return the time derivative of an expression of coordinates q (n,) with rates qd (n,)."""
    return ca.jtimes(expression, q, qd)


def rate_in_motion(expression: Expression, q: Expression, qd: Expression, qdd: Expression) -> Expression:
    """Return the time derivative of an expression of coordinates q and rates qd (n,) with accelerations qdd (n,)."""
    return ca.jtimes(expression, q, qd) + ca.jtimes(expression, qd, qdd)


def angular_velocity(frame: Frame, q: Expression, qd: Expression) -> Expression:
    """Return the angular velocity (3,) [rad/s] of a body in axes that turn with it, [w]x = R^T dR/dt."""
    spin_rate = ca.reshape(rate(ca.vec(frame.rotation), q, qd), 3, 3)
    return axial(frame.rotation.T @ spin_rate)
