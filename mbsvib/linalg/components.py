"""Vectors and rotations of components: the numbers on which parts state their finite motion.

A component is a float, an array with any leading axes (real, or complex for derivatives by a complex step), a ``Jet``
or a CasADi scalar. The same lines run on all of them. A vector is a triple of components, a rotation matrix a triple of
rows. CasADi is imported only where its scalars come in, by which it is imported already.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import factorial
from math import sqrt as sqrt_of_float
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.linalg.jets import Jet

Component = Any
Triple = tuple[Component, Component, Component]
Rotation = tuple[Triple, Triple, Triple]

IDENTITY: Rotation = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
# Below this square of an angle, and of a sine, power series replace closed forms, which divide by zero at 0. The first
# term that is left out is below 1e-17 of the value, also after two derivatives.
SMALL_ANGLE, SMALL_SINE = 0.25, 0.02
# sin(a) / a and asin(s) / s, as power series in a^2 and s^2
SINC = [(-1.0) ** k / factorial(2 * k + 1) for k in range(11)]
ARCSINE = [factorial(2 * k) / (4.0**k * factorial(k) ** 2 * (2 * k + 1)) for k in range(13)]


def sqrt(x: Component) -> Component:
    """Square root."""
    if isinstance(x, float):
        return sqrt_of_float(x)
    return x.sqrt() if hasattr(x, "sqrt") else np.sqrt(x)


def sin(x: Component) -> Component:
    """Sine."""
    return x.sin() if hasattr(x, "sin") else np.sin(x)


def cos(x: Component) -> Component:
    """Cosine."""
    return x.cos() if hasattr(x, "cos") else np.cos(x)


def arctan2(y: Component, x: Component) -> Component:
    """Angle of the point (x, y); for complex arrays it is that of the real parts, with its derivative."""
    if isinstance(y, Jet):
        return y.arctan2(x)
    if not (_is_numeric(y) and _is_numeric(x)):
        import casadi as ca

        return ca.atan2(y, x)
    if np.iscomplexobj(y) or np.iscomplexobj(x):
        a, b = np.real(x), np.real(y)
        return np.arctan2(b, a) + 1j * (a * np.imag(y) - b * np.imag(x)) / (a * a + b * b)
    return np.arctan2(y, x)


def add(a: Triple, b: Triple) -> Triple:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Triple, b: Triple) -> Triple:
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(s: Component, a: Triple) -> Triple:
    """Return s a."""
    return (s * a[0], s * a[1], s * a[2])


def dot(a: Triple, b: Triple) -> Component:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Triple, b: Triple) -> Triple:
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a: Triple) -> Component:
    """Return the length of a vector, which is not zero."""
    return sqrt(dot(a, a))


def apply(rotation: Rotation, a: Triple) -> Triple:
    """Return R a."""
    return (dot(rotation[0], a), dot(rotation[1], a), dot(rotation[2], a))


def transpose(rotation: Rotation) -> Rotation:
    """Return R^T."""
    a, b, c = rotation
    return ((a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2]))


def product(a: Rotation, b: Rotation) -> Rotation:
    """Return A B."""
    columns = transpose(b)
    return (apply(columns, a[0]), apply(columns, a[1]), apply(columns, a[2]))


def axial(rotation: Rotation) -> Triple:
    """Return the vector w whose [w]x is the antisymmetric part of R."""
    a, b, c = rotation
    return (0.5 * (c[1] - b[2]), 0.5 * (a[2] - c[0]), 0.5 * (b[0] - a[1]))


def around(w: Triple, s: Component, c: Component) -> Rotation:
    """Return 1 + s [w]x + c [w]x^2."""
    x, y, z = w
    xy, xz, yz = c * x * y, c * x * z, c * y * z
    return ((1.0 - c * (y * y + z * z), xy - s * z, xz + s * y), (xy + s * z, 1.0 - c * (x * x + z * z), yz - s * x),
            (xz - s * y, yz + s * x, 1.0 - c * (x * x + y * y)))  # fmt: skip


def turn(axis: Triple, angle: Component) -> Rotation:
    """Return the rotation by an angle [rad] about a unit vector."""
    half = sin(0.5 * angle)
    return around(axis, sin(angle), 2.0 * half * half)


def exponential(w: Triple) -> Rotation:
    """Return the rotation of a vector [rad], exp([w]x) = 1 + sin(a)/a [w]x + (1 - cos(a))/a^2 [w]x^2, a = |w|."""
    square = dot(w, w)
    half = sinc(0.25 * square)
    return around(w, sinc(square), 0.5 * half * half)


def sinc(square: Component) -> Component:
    """Return sin(a) / a of the square of an angle."""
    return _series(square, SINC, SMALL_ANGLE, lambda x: sin(sqrt(x)) / sqrt(x))


def rotation_vector(rotation: Rotation) -> Triple:
    """Return the rotation vector [rad] of a rotation, less than half a turn long."""
    w = axial(rotation)
    cosine = 0.5 * (rotation[0][0] + rotation[1][1] + rotation[2][2] - 1.0)
    factor = _series(dot(w, w), ARCSINE, SMALL_SINE, lambda x: arctan2(sqrt(x), cosine) / sqrt(x), cosine)
    return scale(factor, w)


def stacked(components: Sequence[Component]) -> Array:
    """Return a vector (..., 3) or a rotation (..., 3, 3) as an array with the axes of its components in front."""
    if isinstance(components[0], tuple):
        shape = np.broadcast_shapes(*[np.shape(x) for row in components for x in row])
        return np.stack([np.stack([np.broadcast_to(x, shape) for x in row], axis=-1) for row in components], axis=-2)
    return np.stack(np.broadcast_arrays(*components), axis=-1)


def stacked_all(values: Sequence[Any]) -> Array:
    """Return vectors (..., n, 3) or rotations (..., n, 3, 3) as one array with the axes of their components in front;
    (0, 3) without any.
    """
    if not values:
        return np.zeros((0, 3))
    return np.stack(np.broadcast_arrays(*map(stacked, values)), axis=-3 if isinstance(values[0][0], tuple) else -2)


def _is_numeric(x: Component) -> bool:
    return isinstance(x, (float, int, complex, np.generic, np.ndarray))


def _series(
    x: Component, terms: Sequence[float], limit: float, closed: Callable[[Component], Component],
    positive: Component = 1.0,
) -> Component:  # fmt: skip
    """The power series of a function of x where |x| is below a limit and ``positive`` is so, else its closed form.

    Jets are those of parts at the pose, where x is small.
    """
    total: Component = terms[-1]
    for term in terms[-2::-1]:
        total = total * x + term
    if isinstance(x, Jet):
        return total
    if _is_numeric(x):
        small = (np.abs(x) < limit) & (np.real(positive) > 0.0)
        return np.where(small, total, closed(np.where(small, 1.0, x)))
    import casadi as ca

    small = ca.logic_and(x < limit, positive > 0.0)
    return ca.if_else(small, total, closed(ca.if_else(small, 1.0, x)))
