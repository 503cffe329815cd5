"""Linear solutions at many frequencies from one Schur form.

In energy coordinates x = (Omega eta, eta') the equations are x' = A x with A = [[0, Omega], [-Omega, -Gamma]], whose
norm is the largest frequency and not its square. With A = Z T Z^H and T upper triangular every frequency costs one
triangular solution, and the substitution runs over all frequencies at once: one matrix product for each block of rows.
No eigenvectors are needed, so nearly defective pairs lose no accuracy.

In these coordinates rounding of a vector is that of its length, whatever the units: an entry of the inputs
F = (0, Phi^T B) or of the outputs is known to eps |F| or eps |c_e|. So it is known whether inputs drive modes that do
not decay, or outputs show them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex
from mbsvib.linalg.rank import ZERO_SUM

if TYPE_CHECKING:
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


@dataclass(frozen=True, slots=True)
class ModalStates:
    """Modal states in energy coordinates: ``columns`` T (n, n), the ``forces`` F = T B there, and the states of modes
    that do not decay, ``lasting`` (n,).
    """

    columns: Array
    forces: Array
    lasting: Bools


def zeros_of_lasting_states(
    states: ModalStates, b: Array, c: Array, seen: Sequence[tuple[Array, Array]]
) -> tuple[Array, Array]:
    """Return B (n, inputs) and C (outputs, n) of modal states with zeros for what is rounding in modes that last.

    ``seen``: rows, and columns of the states or their rates, whose products add up to C; rounding of a part of a column
    is that of its whole length.
    """
    lasting = states.lasting
    if not lasting.any():
        return b, c
    left = np.linalg.norm(np.linalg.inv(states.columns)[lasting], axis=1)
    b, c = b.copy(), c.copy()
    small = np.abs(b[lasting]) <= ZERO_SUM * np.outer(left, np.linalg.norm(states.forces, axis=0))
    b[lasting] = np.where(small, 0.0, b[lasting])
    limit = np.sum([np.outer(np.linalg.norm(rows, axis=1), np.linalg.norm(part[:, lasting], axis=0))
                    for rows, part in seen], axis=0)  # fmt: skip
    c[:, lasting] = np.where(np.abs(c[:, lasting]) <= ZERO_SUM * limit, 0.0, c[:, lasting])
    return b, c


def last(poles: Complex) -> Bools:
    """Return which eigenvalues of a mechanism, known to rounding of their size, do not decay."""
    return np.asarray(poles.real >= -ZERO_SUM * np.abs(poles))
