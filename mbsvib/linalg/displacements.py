"""Displacements of one body against another, of components of any kind (see ``components``)."""

from __future__ import annotations

from dataclasses import dataclass

from mbsvib.linalg.components import (
    IDENTITY,
    Rotation,
    Triple,
    add,
    apply,
    cross,
    product,
    scale,
    subtract,
    transpose,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Displacement:
    """What was at x is at p + u + R (x - p): ``rotation`` R, ``shift`` u of the ``origin`` p [m]."""

    rotation: Rotation = IDENTITY
    shift: Triple = (0.0, 0.0, 0.0)
    origin: Triple = (0.0, 0.0, 0.0)

    def point(self, x: Triple) -> Triple:
        """Return where a point is that was at x [m]."""
        return add(add(self.origin, self.shift), apply(self.rotation, subtract(x, self.origin)))

    def moved(self, x: Triple) -> Triple:
        """Return how far a point has gone that was at x [m]."""
        return self.shift if x is self.origin else subtract(self.point(x), x)

    def vector(self, a: Triple) -> Triple:
        """Return a vector that turns with the body."""
        return apply(self.rotation, a)

    def then(self, inner: Displacement) -> Displacement:
        """Return this displacement of the result of another one, x -> this(inner(x))."""
        return Displacement(product(self.rotation, inner.rotation),
                            subtract(self.point(inner.point(self.origin)), self.origin), self.origin)  # fmt: skip

    def inverse(self) -> Displacement:
        """Return the displacement of the first body against the second."""
        back = transpose(self.rotation)
        return Displacement(back, scale(-1.0, apply(back, self.shift)), self.origin)


def small(theta: Triple, v: Triple, origin: Triple) -> Displacement:
    """Return the displacement with small exponential coordinates (theta, v) at a point, to second order.

    R = 1 + [theta]x + [theta]x^2 / 2,  u = v + theta x v / 2
    """
    x, y, z = theta
    rotation = (
        (1.0 - 0.5 * (y * y + z * z), 0.5 * x * y - z, 0.5 * x * z + y),
        (0.5 * x * y + z, 1.0 - 0.5 * (x * x + z * z), 0.5 * y * z - x),
        (0.5 * x * z - y, 0.5 * y * z + x, 1.0 - 0.5 * (x * x + y * y)),
    )
    return Displacement(rotation, add(v, scale(0.5, cross(theta, v))), origin)
