"""Frames of bodies in finite motion: where points and vectors go that were somewhere in the pose as described."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from mbsvib.finite_motion.rotations import Expression, axial, entries, rows_of
from mbsvib.linalg.displacements import Displacement


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
