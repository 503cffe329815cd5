"""The transfer matrix by solving, not by modes: for zeros near repeated eigenvalues, where modal sums cancel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import schur, solve_triangular

from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex


# The power of s far above all poles is determined at these multiples of |A|; it must be an integer within OFF, from
# singular values that exceed rounding by CLEAR.
FAR = np.array([1e3, 1e4])
OFF, CLEAR = 0.1, 1e3


@dataclass(frozen=True, slots=True)
class Resolvent:
    """G(s) = C (s - T)^-1 B + D with T upper triangular, A = Q T Q^H."""

    t: Complex
    b: Complex
    c: Complex
    d: Array

    @classmethod
    def of(cls, a: Array, b: Array, c: Array, d: Array) -> Resolvent:
        """Return that of x' = A x + B u, y = C x + D u."""
        t, q = schur(a, output="complex")
        return cls(t, q.conj().T @ b, c @ q, d)

    def at(self, s: Complex) -> Complex:
        """Return G at the points ``s`` (n,), shape (outputs, inputs, n)."""
        result = np.empty((*self.d.shape, len(s)), dtype=complex)
        for i, point in enumerate(s.tolist()):
            value = self.c @ self._states(complex(point.real, abs(point.imag))) + self.d
            result[..., i] = value.conj() if point.imag < 0.0 else value  # exactly so, as zeros are conjugate
        return result

    def noise(self, s: Complex) -> Array:
        """Return a bound of the rounding of G, shape (outputs, inputs, n).

        |dG| <= eps (|s| + |A|) |C R| |R B|, R = (s - A)^-1: solutions are exact for a change of A by rounding
        """
        size = float(np.linalg.norm(self.t))
        result = np.empty((*self.d.shape, len(s)))
        for i, point in enumerate(s.tolist()):
            output_gain = np.linalg.norm(np.abs(self._solved(point, self.c.T, 1)), axis=0)
            input_gain = np.linalg.norm(np.abs(self._states(point)), axis=0)
            result[..., i] = EPS * ((abs(point) + size) * np.outer(output_gain, input_gain) + np.abs(self.d))
        return result

    def _states(self, point: complex) -> Complex:
        return self._solved(point, self.b, 0)

    def _solved(self, point: complex, right: Complex, trans: int) -> Complex:
        """(s - T)^-1 or, with ``trans`` = 1, (s - T)^-T times a right side; infinite at an eigenvalue."""
        matrix = point * np.eye(len(self.t)) - self.t
        if not np.isfinite(point) or not matrix.diagonal().all():
            return np.full(right.shape, np.inf, dtype=complex)
        return np.asarray(solve_triangular(matrix, right, trans=trans))

    def finite_zeros(self) -> int | None:
        """Return the number of finite zeros of a square system: that of its states, minus the power of s by which its
        determinant decreases far above all poles and zeros; None if it is not square or the determinant is rounding.
        """
        if len(self.d) != self.d.shape[1]:
            return None
        s = 1j * float(np.linalg.norm(self.t)) * FAR
        stack = self.at(s).transpose(2, 0, 1)
        least = np.linalg.svd(stack, compute_uv=False)[:, -1]
        if (least <= CLEAR * np.linalg.norm(self.noise(s), axis=(0, 1))).any():
            return None
        size = np.log(np.abs(np.linalg.det(stack)))
        power = float((size[0] - size[1]) / np.log(FAR[1] / FAR[0]))
        return len(self.t) - round(power) if abs(power - round(power)) < OFF else None
