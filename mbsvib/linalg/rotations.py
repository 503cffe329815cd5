"""Finite rotations: the exponential map, its inverse, and the derivatives of the inverse up to second order."""

from __future__ import annotations

import numpy as np

from mbsvib.common.arrays import AnyArray, Array
from mbsvib.linalg.components import arctan2

# Below this angle [rad] the coefficients are computed by series, which are as accurate and do not divide by zero.
SMALL = 0.05
# The smallest angle [rad] used as a divisor.
LEAST = 1e-150
# Rotations with a cosine below this are close to half a turn.
HALF_TURN = -0.99
_IDENTITY = np.eye(3)
# x y z x y: both cyclic shifts of a cross product are slices of vectors with these components.
CYCLE = np.array((0, 1, 2, 0, 1))
# y z x and z x y
_NEXT, _LAST = np.array((1, 2, 0)), np.array((2, 0, 1))
# [w]x of w = (x, y, z) is w @ _SKEW, row by row
_SKEW = np.array([[0.0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]])


def components_first(vectors: Array) -> Array:
    """Return vectors (..., 3) as components (3, ...)."""
    return vectors.transpose(vectors.ndim - 1, *range(vectors.ndim - 1))


def components_last(components: Array) -> Array:
    """Return components (3, ...) as vectors (..., 3)."""
    return components.transpose(*range(1, components.ndim), 0)


def cross(a: AnyArray, b: AnyArray, axis: int = -3) -> AnyArray:
    """Return a x b of arrays that broadcast, whose components are along an ``axis``."""
    result = a.take(_NEXT, axis) * b.take(_LAST, axis)
    result -= a.take(_LAST, axis) * b.take(_NEXT, axis)
    return result


def crossed_product(a: Array, b: Array) -> Array:
    """Return a x b of vectors (3, n), either of them with an axis of variants (3, variants, n)."""
    if a.ndim != b.ndim:
        a, b = (a[:, None], b) if a.ndim < b.ndim else (a, b[:, None])
    return cross(a, b, 0)


def skew(w: Array) -> Array:
    """Return [w]x (..., 3, 3), the matrices with [w]x v = w x v, of vectors (..., 3)."""
    vectors = np.asarray(w)
    return np.asarray(vectors @ _SKEW).reshape(*vectors.shape, 3)


def frames_along(z: Array) -> Array:
    """Return axes (..., 3, 3) whose third columns are unit vectors (..., 3), as ``common.arguments.frame_along`` does.

    The others are x and y, turned by the smallest rotation that takes the positive or negative z axis to the vector.
    """
    x, y, z = components_first(np.asarray(z))
    sign = np.where(np.real(z) < -0.5, -1.0, 1.0)
    share = 1.0 / (1.0 + sign * z)
    mixed = x * y * share
    entries = (1.0 - x * x * share, -sign * mixed, x, -mixed, sign * (1.0 - y * y * share), y, -sign * x, -y, z)
    return np.stack(entries, axis=-1).reshape(*x.shape, 3, 3)


def rigid_transport(arm: Array) -> Array:
    """Return matrices (..., 6, 6) that map the motion (u, theta) of a point of a rigid body to that of another point.

    u + theta x arm, theta with the ``arm`` (..., 3) to the other point
    """
    shift = skew(np.negative(arm))
    result = np.zeros((*shift.shape[:-2], 6, 6), shift.dtype)
    result[...] = np.eye(6)
    result[..., :3, 3:] = shift
    return result


def axial(matrix: Array) -> Array:
    """Return the vectors w (..., 3) whose [w]x is the antisymmetric part of matrices (..., 3, 3)."""
    return np.asarray(matrix.reshape(*matrix.shape[:-2], 9) @ (0.5 * _SKEW.T))


def exponential(w: Array) -> Array:
    """Return the rotation matrices (..., 3, 3) of rotation vectors (..., 3) [rad].

    exp([w]x) = 1 + cos(a/2) [v]x + 1/2 [v]x^2,  v = w sin(a/2) / (a/2),  a = |w|
    """
    half, share = _half_angle(w)
    matrix = skew(share * w)
    result: Array = matrix @ matrix
    result *= 0.5
    result += np.cos(half)[..., None] * matrix
    result += _IDENTITY
    return result


def _half_angle(w: Array) -> tuple[Array, Array]:
    """Half the angles (..., 1) of rotation vectors, and sin(a/2) / (a/2), which is 1 for the least angle kept."""
    half = 0.5 * np.maximum(np.sqrt(np.add.reduce(w * w, axis=-1, keepdims=True)), LEAST)
    return half, np.sin(half) / half


def logarithm(rotation: Array) -> Array:
    """Return the rotation vectors (..., 3) [rad] of rotation matrices (..., 3, 3), at most half a turn long.

    Complex matrices are steps from the rotations that their real parts are.
    """
    w = axial(rotation)
    sine, cosine = np.sqrt(np.add.reduce(w * w, axis=-1)), 0.5 * (rotation.trace(axis1=-2, axis2=-1) - 1.0)
    angle = arctan2(sine, cosine)
    straight = cosine <= HALF_TURN
    if not np.count_nonzero(straight):
        angle = np.maximum(angle, LEAST)
        return np.asarray(w * (angle / np.sin(angle))[..., None])
    if rotation.ndim > 2:
        return np.array([logarithm(single) for single in rotation])
    # close to half a turn the axial part vanishes: the axis is the largest column of the symmetric part
    symmetric = 0.5 * (rotation + rotation.T) - cosine * _IDENTITY
    axis = symmetric[:, int(np.argmax(np.diagonal(symmetric)))]
    axis = axis / np.sqrt(axis @ axis)
    return np.asarray(angle * (axis if axis @ w >= 0.0 else -axis))


def orthonormal(rotation: Array) -> Array:
    """Return the rotation matrices nearest to matrices (..., 3, 3) that are orthonormal except for rounding."""
    gram = rotation.swapaxes(-1, -2) @ rotation
    gram *= -0.5
    gram += 1.5 * _IDENTITY
    return np.asarray(rotation @ gram)


def jacobian(w: Array) -> Array:
    """Return the matrices J (..., 3, 3) from rates of rotation vectors w (..., 3) [rad] to angular velocities.

    J = 1 + (1 - cos(a))/a^2 [w]x + (a - sin(a))/a^3 [w]x^2,  a = |w|: the left Jacobian of the exponential map

    What cancels in the last coefficient is of the size of rounding in the product.
    """
    half, share = (array[..., None] for array in _half_angle(w))
    matrix = skew(w)
    square = 0.25 * (1.0 - share * np.cos(half)) / (half * half) * (matrix @ matrix)
    return np.asarray(_IDENTITY + 0.5 * share * share * matrix + square)


def inverse_jacobian(w: Array) -> Array:
    """Return the matrices J (..., 3, 3) with log(exp(e) exp(w)) = w + J e + ... for small rotations e.

    J = 1 - [w]x / 2 + g(a) [w]x^2,  g = (1 - (a/2) cot(a/2)) / a^2
    """
    matrix, value = skew(w), _coefficients(np.add.reduce(w * w, axis=-1))[0]
    return np.asarray(_IDENTITY - 0.5 * matrix + value[..., None, None] * (matrix @ matrix))


def second_order(w: Array, moment: Array) -> Array:
    """Return the Hessians (..., 3, 3) of moment . log(exp(e) exp(w)) in the small rotation e, at e = 0.

    H = (b w^T + w b^T) / 2 + (m . w) (g - 1/4 - g^2 a^2) 1,
    b = (1/4 - g - g^2 a^2 - 2 g' a^2) m + 2 (m . w) (g^2 + g') w + g w x m

    with the moment m, g of ``inverse_jacobian`` and g' = dg / d(a^2): the symmetric part of dJ[J e] e, which is the
    second derivative as d/ds log(exp(s e) exp(w)) = J(w(s)) e along the whole line.
    """
    square, along = np.add.reduce(w * w, axis=-1), np.add.reduce(moment * w, axis=-1)
    value, slope = _coefficients(square)
    squared = value * value
    b = (0.25 - value - square * (squared + 2.0 * slope))[..., None] * moment
    b += (2.0 * along * (squared + slope))[..., None] * w
    b += value[..., None] * (skew(w) @ moment[..., None])[..., 0]
    half = b[..., None] * (0.5 * w)[..., None, :]
    spherical = (along * (value - 0.25 - squared * square))[..., None, None]
    return np.asarray(half + half.swapaxes(-1, -2) + spherical * _IDENTITY)


def _coefficients(square: Array) -> tuple[Array, Array]:
    """Return g of ``inverse_jacobian`` and its derivative, as functions of the square of the angle."""
    value = 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square / 1209600.0))
    slope = 1.0 / 720.0 + square * (1.0 / 15120.0 + square * (1.0 / 403200.0 + square / 11975040.0))
    large = square >= SMALL * SMALL
    if not np.count_nonzero(large):
        return value, slope
    square = np.where(large, square, 1.0)
    angle = np.sqrt(square)
    half = 0.5 * angle
    cotangent = 1.0 / np.tan(half)
    closed = (1.0 - half * cotangent) / square
    # d(half cot half)/d(angle) = cot/2 - half/2 / sin^2
    fall = -(0.5 * cotangent - 0.5 * half / np.sin(half) ** 2) / (2.0 * angle * square) - closed / square
    return np.where(large, closed, value), np.where(large, fall, slope)


def quaternion(turn: Array) -> tuple[Array, Array]:
    """Return scalars (...) and vectors (..., 3) of the unit quaternions of rotation matrices (..., 3, 3).

    The scalars are not negative.
    """
    vector = logarithm(turn)
    half = 0.5 * np.sqrt(np.add.reduce(vector * vector, axis=-1))
    return np.cos(half), 0.5 * np.sinc(half / np.pi)[..., None] * vector
