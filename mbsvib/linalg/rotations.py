"""Finite rotations: the exponential map, its inverse, and what the inverse does to second order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array

# Below this angle [rad] the series of the coefficients are as exact as their closed forms, and do not divide by zero.
SMALL = 0.05


def skew(w: Array) -> Array:
    """Return [w]x, the matrix with [w]x v = w x v."""
    x, y, z = w
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def exponential(w: Array) -> Array:
    """Return the rotation matrix of a rotation vector [rad].

    exp([w]x) = 1 + sin(a)/a [w]x + (1 - cos(a))/a^2 [w]x^2,  a = |w|
    """
    angle = float(np.linalg.norm(w))
    matrix = skew(w)
    half = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * matrix + half * (matrix @ matrix))


def logarithm(rotation: Array) -> Array:
    """Return the rotation vector [rad] of a rotation matrix, at most half a turn long."""
    axial = 0.5 * np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0],
                            rotation[1, 0] - rotation[0, 1]])  # fmt: skip
    sine, cosine = float(np.linalg.norm(axial)), 0.5 * (float(np.trace(rotation)) - 1.0)
    angle = float(np.arctan2(sine, cosine))
    if cosine > -0.99:
        return axial / np.sinc(angle / np.pi)
    # next to half a turn the axial part vanishes: the axis is the largest column of the symmetric part
    symmetric = 0.5 * (rotation + rotation.T) - cosine * np.eye(3)
    axis = symmetric[:, int(np.argmax(np.diagonal(symmetric)))]
    axis = axis / np.linalg.norm(axis)
    return np.asarray(angle * (axis if axis @ axial >= 0.0 else -axis))


def orthonormal(rotation: Array) -> Array:
    """Return the rotation matrix nearest to one that rounding has taken off by a little."""
    return np.asarray(1.5 * rotation - 0.5 * rotation @ (rotation.T @ rotation))


def inverse_jacobian(w: Array) -> Array:
    """Return the matrix J with log(exp(e) exp(w)) = w + J e + ... for small rotations e.

    J = 1 - [w]x / 2 + g(a) [w]x^2,  g = (1 - (a/2) cot(a/2)) / a^2
    """
    matrix = skew(w)
    return np.asarray(np.eye(3) - 0.5 * matrix + _coefficient(float(w @ w))[0] * (matrix @ matrix))


def second_order(w: Array, moment: Array) -> Array:
    """Return the Hessian (3, 3) of moment . log(exp(e) exp(w)) in the small rotation e, at e = 0."""
    # d/ds log(exp(s e) exp(w)) = J(w(s)) e along the whole line, so that the second derivative is dJ[J e] e
    jacobian, matrix = inverse_jacobian(w), skew(w)
    value, slope = _coefficient(float(w @ w))
    result = np.empty((3, 3))
    for k in range(3):
        turn = jacobian[:, k]
        change = skew(turn)
        derivative = -0.5 * change + value * (change @ matrix + matrix @ change)
        derivative += 2.0 * slope * float(w @ turn) * (matrix @ matrix)
        result[k] = moment @ derivative
    return 0.5 * (result + result.T)


def _coefficient(square: float) -> tuple[float, float]:
    """Return g of ``inverse_jacobian`` and its derivative, as functions of the square of the angle."""
    if square < SMALL * SMALL:
        value = 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square / 1209600.0))
        return value, 1.0 / 720.0 + square * (1.0 / 15120.0 + square * (1.0 / 403200.0 + square / 11975040.0))
    angle = float(np.sqrt(square))
    half = 0.5 * angle
    cotangent = 1.0 / np.tan(half)
    value = (1.0 - half * cotangent) / square
    # d(half cot half)/d(angle) = cot/2 - half/2 / sin^2
    slope = -(0.5 * cotangent - 0.5 * half / np.sin(half) ** 2) / (2.0 * angle * square) - value / square
    return float(value), float(slope)
