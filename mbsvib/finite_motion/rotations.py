"""Rotations as expressions that can be differentiated anywhere, also where the angle is 0."""

from __future__ import annotations

from math import factorial
from typing import Any

import casadi as ca

# Below these squares (of an angle, of a sine) series take the place of closed forms, which divide by zero at 0. With
# this many terms the first one left out is below 1e-17 of the value, also after two derivatives.
SMALL_ANGLE, ANGLE_TERMS = 0.25, 11
SMALL_SINE, SINE_TERMS = 0.02, 13

Expression = Any


def skew(w: Expression) -> Expression:
    """Return [w]x (3, 3), the matrix with [w]x v = w x v."""
    return ca.skew(w)


def axial(matrix: Expression) -> Expression:
    """Return the vector w (3,) whose [w]x is the antisymmetric part of a matrix (3, 3)."""
    return 0.5 * ca.vertcat(matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1])


def about(axis: Expression, angle: Expression) -> Expression:
    """Return the rotation matrix (3, 3) by an angle [rad] about a unit vector (3,)."""
    matrix = skew(axis)
    return ca.SX.eye(3) + ca.sin(angle) * matrix + 2.0 * ca.sin(0.5 * angle) ** 2 * (matrix @ matrix)


def exponential(w: Expression) -> Expression:
    """Return the rotation matrix (3, 3) of a rotation vector (3,) [rad].

    exp([w]x) = 1 + sin(a)/a [w]x + (1 - cos(a))/a^2 [w]x^2,  a = |w|
    """
    square, matrix = ca.dot(w, w), skew(w)
    return ca.SX.eye(3) + sinc(square) * matrix + 0.5 * sinc(0.25 * square) ** 2 * (matrix @ matrix)


def logarithm(rotation: Expression) -> Expression:
    """Return the rotation vector (3,) [rad] of a rotation matrix (3, 3), less than half a turn long."""
    w = axial(rotation)
    square, cosine = ca.dot(w, w), 0.5 * (ca.trace(rotation) - 1.0)
    small = ca.logic_and(square < SMALL_SINE, cosine > 0.0)
    series, coefficient = ca.SX(0.0), 1.0
    for k in range(SINE_TERMS):  # asin(s) / s
        series += coefficient / (2 * k + 1) * square**k
        coefficient *= (2 * k + 1) / (2 * k + 2)
    sine = ca.sqrt(ca.if_else(small, 1.0, square))
    return ca.if_else(small, series, ca.atan2(sine, cosine) / sine) * w


def twist_angle(rotation: Expression, across: Expression, third: Expression) -> Expression:
    """Return the angle [rad], within half a turn, by which a rotation turns about an axis before it swings across it.

    phi = 2 atan2(z, w) of the quaternion (w, x, y, z) with z along the axis; ``across`` and ``third`` complete it.
    """
    sine = ca.dot(third, rotation @ across) - ca.dot(across, rotation @ third)
    cosine = ca.dot(across, rotation @ across) + ca.dot(third, rotation @ third)
    return ca.atan2(sine, cosine)


def sinc(square: Expression) -> Expression:
    """Return sin(a) / a of the square of an angle."""
    small = square < SMALL_ANGLE
    series = sum((-square) ** k / factorial(2 * k + 1) for k in range(ANGLE_TERMS))
    angle = ca.sqrt(ca.if_else(small, 1.0, square))
    return ca.if_else(small, series, ca.sin(angle) / angle)
