"""Second-order jets: numbers that carry their first and second derivatives to a few local variables."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsvib.common.arrays import AnyArray

Field = AnyArray  # real or complex


class Jet:
    """A value (...) with its gradient (..., k) and Hessian (..., k, k) to k local variables.

    Axes of derivatives are the last ones, so that leading axes broadcast. Values may be complex: a complex step through
    jets gives third derivatives.
    """

    __slots__ = ("gradient", "hessian", "value")
    __array_ufunc__ = None  # operators with arrays are ours

    def __init__(self, value: Any, gradient: Field, hessian: Field) -> None:
        self.value, self.gradient, self.hessian = np.asarray(value), gradient, hessian

    def __add__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            return Jet(self.value + other.value, self.gradient + other.gradient, self.hessian + other.hessian)
        return Jet(self.value + other, self.gradient, self.hessian)

    __radd__ = __add__

    def __neg__(self) -> Jet:
        return Jet(-self.value, -self.gradient, -self.hessian)

    def __sub__(self, other: Any) -> Jet:
        result: Jet = self + (-other)
        return result

    def __rsub__(self, other: Any) -> Jet:
        result: Jet = (-self) + other
        return result

    def __mul__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            factor = np.asarray(other)
            return Jet(self.value * factor, self.gradient * factor[..., None], self.hessian * factor[..., None, None])
        a, b = self.value[..., None], other.value[..., None]
        mixed = self.gradient[..., :, None] * other.gradient[..., None, :]
        hessian = a[..., None] * other.hessian + b[..., None] * self.hessian + mixed + mixed.swapaxes(-1, -2)
        return Jet(self.value * other.value, a * other.gradient + b * self.gradient, hessian)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Jet:
        return self * (other.inverse() if isinstance(other, Jet) else 1.0 / other)

    def __rtruediv__(self, other: Any) -> Jet:
        result: Jet = self.inverse() * other
        return result

    def inverse(self) -> Jet:
        """1 over this jet."""
        inverse = 1.0 / self.value
        return self._mapped(inverse, -(inverse**2), 2.0 * inverse**3)

    def __pow__(self, n: float) -> Jet:
        """This jet to the power of a number."""
        return self._mapped(self.value**n, n * self.value ** (n - 1.0), n * (n - 1.0) * self.value ** (n - 2.0))

    def sqrt(self) -> Jet:
        """Square root."""
        root = np.sqrt(self.value)
        return self._mapped(root, 0.5 / root, -0.25 / root**3)

    def sin(self) -> Jet:
        """Sine."""
        sine = np.sin(self.value)
        return self._mapped(sine, np.cos(self.value), -sine)

    def cos(self) -> Jet:
        """Cosine."""
        cosine = np.cos(self.value)
        return self._mapped(cosine, -np.sin(self.value), -cosine)

    def arctan2(self, x: Jet) -> Jet:
        """Angle of the point (x, y), y being this jet: d = (x dy - y dx) / (x^2 + y^2)."""
        square = (self.value**2 + x.value**2)[..., None]
        a, b = x.value[..., None], self.value[..., None]
        gradient = (a * self.gradient - b * x.gradient) / square
        growth = 2.0 * (b * self.gradient + a * x.gradient)
        mixed = x.gradient[..., None, :] * self.gradient[..., :, None]
        top = a[..., None] * self.hessian - b[..., None] * x.hessian + mixed - mixed.swapaxes(-1, -2)
        hessian = (top - gradient[..., :, None] * growth[..., None, :]) / square[..., None]
        angle = np.arctan2(self.value.real, x.value.real)
        return Jet(angle, gradient, 0.5 * (hessian + hessian.swapaxes(-1, -2)))

    def _mapped(self, value: Field, slope: Field, curvature: Field) -> Jet:
        """A function of this jet with these derivatives."""
        bent = self.gradient[..., :, None] * self.gradient[..., None, :]
        return Jet(value, slope[..., None] * self.gradient,
                   slope[..., None, None] * self.hessian + curvature[..., None, None] * bent)  # fmt: skip


def variables(values: Field) -> list[Jet]:
    """Return jets of k local variables with values (..., k)."""
    k, shape = values.shape[-1], values.shape
    none = np.zeros((*shape, k))
    return [Jet(values[..., i], np.broadcast_to(unit, shape), none) for i, unit in enumerate(np.eye(k))]
