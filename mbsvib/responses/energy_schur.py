"""Linear solutions at many frequencies from one Schur form.

In energy coordinates x = (Omega eta, eta') the equations are x' = A x with A = [[0, Omega], [-Omega, -Gamma]], whose
norm is the largest frequency and not its square. With A = Z T Z^H and T upper triangular every frequency costs one
triangular solution, and the substitution runs over all frequencies at once: one matrix product for each block of rows.
No eigenvectors are needed, so nearly defective pairs lose no accuracy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.modes.damped import Damped


BLOCK = 32


@dataclass(frozen=True, slots=True)
class EnergySchur:
    """A = ``vectors`` ``triangle`` vectors^H of the m ``scale`` d eta and m rates eta'."""

    triangle: Complex
    vectors: Complex
    scale: Array

    def solve(self, s: Complex, right: Complex | Array) -> Complex:
        """Return eta with (s^2 + s Gamma + Omega^2) eta = right, both (m, columns, n), at the points ``s`` (n,)."""
        m, columns, n = right.shape
        upper, lower = self.vectors[:m], self.vectors[m:]
        x = (lower.conj().T @ np.ascontiguousarray(right).reshape(m, -1)).reshape(2 * m, columns, n)
        x = triangular_solutions(self.triangle, x, s)
        eta: Complex = (upper @ x.reshape(2 * m, -1)).reshape(m, columns, n) / self.scale[:, None, None]
        return eta


def triangular_solutions(triangle: Complex, right: Complex, s: Complex) -> Complex:
    """Return x (n, columns, points) with (s - T) x = right for an upper triangular T (n, n), in place of ``right``."""
    x, (n, columns, points) = right, right.shape
    for stop in range(n, 0, -BLOCK):
        start = max(0, stop - BLOCK)
        if stop < n:
            done = x[stop:].reshape(n - stop, -1)
            x[start:stop] += (triangle[start:stop, stop:] @ done).reshape(stop - start, columns, points)
        for i in range(stop - 1, start - 1, -1):
            if i + 1 < stop:
                x[i] += np.tensordot(triangle[i, i + 1 : stop], x[i + 1 : stop], axes=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                x[i] /= s - triangle[i, i]
    return x


def energy_schur(modal: Damped) -> EnergySchur:
    """Return the Schur form of the state matrix in energy coordinates."""
    from scipy.linalg import schur

    scale, a = energy_matrix(modal)
    triangle, vectors = schur(a, output="complex")
    return EnergySchur(triangle, vectors, scale)


def energy_matrix(modal: Damped) -> tuple[Array, Array]:
    """Return d (m,) and the matrix A of x' = A x for x = (d eta, eta'), shape (2m, 2m).

    d is Omega, and for rigid-body modes the lowest one (or 1).
    """
    m = len(modal.square)
    omega = np.sqrt(np.abs(modal.square))
    scale = np.where(omega > 0.0, omega, omega[omega > 0.0].min(initial=np.inf))
    scale[~np.isfinite(scale)] = 1.0
    a = np.zeros((2 * m, 2 * m))
    at = np.arange(m)
    a[at, m + at] = scale
    a[m + at, at] = -modal.square / scale
    a[m:, m:] = -(np.diag(modal.gamma) if modal.gamma.ndim == 1 else modal.gamma)
    return scale, a
