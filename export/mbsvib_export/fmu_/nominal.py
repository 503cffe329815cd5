"""Nominal values of states, which tell importers at what size an error of a state matters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


_SMALL = 60  # states up to which the Gramian costs nothing
_PROBES = 3


def nominal_values(a: Array, b: Array) -> Array:
    """Return the size that inputs give each state, in proportion to the others, two digits of it.

    The roots of the diagonal of the controllability Gramian, A P + P A^T + B B^T = 0, for few states; for many, or
    where the system is not stable, the size of (s - A)^-1 B at a few s > 0 (real, so that no resonance is met).

    Parameters
    ----------
    a : array, shape (n, n)
        State matrix [1/s].
    b : array, shape (n, inputs)
        Input matrix.

    Returns
    -------
    array, shape (n,)
        Positive; 1 for states that no input reaches.
    """
    n = len(a)
    if n == 0:
        return np.ones(0)
    # without inputs, or for states they do not reach: what an unknown force on everything would do
    b = b if b.shape[1] and b.any() else np.eye(n)
    size = _gramian(a, b) if n <= _SMALL else None
    if size is None:
        size = _probed(a, b)
    size = np.where(np.isfinite(size) & (size > 0), size, 1.0)
    return np.array([float(f"{value:.1e}") for value in np.clip(size, 1e-100, 1e100)])


def _gramian(a: Array, b: Array) -> Array | None:
    from scipy.linalg import eigvals, solve_continuous_lyapunov

    if eigvals(a).real.max() > -1e-9 * max(np.abs(a).max(), 1e-300):
        return None
    scale = np.abs(b).max(axis=0)
    unit = b / np.where(scale > 0, scale, 1.0)
    diagonal = np.diag(solve_continuous_lyapunov(a, -unit @ unit.T))
    return np.sqrt(diagonal) if (diagonal > 0).all() else None


def _probed(a: Array, b: Array) -> Array:
    scale = np.abs(b).max(axis=0)
    unit = b / np.where(scale > 0, scale, 1.0)
    rate = np.sqrt(np.abs(np.einsum("ij,ji->i", a, a)).max()) or 1.0
    largest = np.zeros(len(a))
    for s in rate * np.logspace(-3, 0, _PROBES):
        largest = np.maximum(largest, np.abs(np.linalg.solve(s * np.eye(len(a)) - a, unit)).max(axis=1))
    return largest
