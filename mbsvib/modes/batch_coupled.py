"""Modes that dampers couple, of all variants at once.

In the basis of the undamped modes (lambda^2 + lambda Gamma + Omega^2) y = 0, and conjugates are solutions too. With
light damping every y is near a unit vector, which is the initial guess. Corrections through the resolvent, the sum of
y y^T / (slope (s - lambda)) over all eigenvalues, converge quadratically. If they do not converge quickly, or if modes
are overdamped, the eigenvalues of the state matrix in energy coordinates are the initial guess. The Rayleigh step with
the factors of M, C and K (``rayleigh``) follows, as in a single system.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.products import real_product
from mbsvib.modes.classical import quadratic_roots
from mbsvib.modes.rayleigh import both

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex, Index

    Mask = NDArray[np.bool_]

# Maximum number of corrections from unit vectors; they take less time than an eigensolver.
STEPS = 5
# Larger corrections do not converge.
START = 2.0
# Vectors that differ by less from unit vectors are independent.
INDEPENDENT = 0.95
# The correction after one of this size is rounding.
CONVERGED = 1e-7


@dataclass(frozen=True, slots=True)
class Start:
    """Eigenvalues ``values`` (k, h) and vectors ``y`` (k, m, h) of the variants ``which`` (k,): first
    ``complex_count`` with positive imaginary parts, which also represent their conjugates, then real ones.
    """

    which: Index
    values: Complex
    y: Complex
    complex_count: int


def starts(gamma: Array, square: Array) -> list[Start]:
    """Return eigenvalues and vectors of (lambda^2 + lambda Gamma + Omega^2) y = 0.

    ``gamma`` (n, m, m): Gamma. ``square`` (n, m): Omega^2, all positive.
    """
    m = square.shape[1]
    values, y, converged = _from_unit_vectors(gamma, square)
    rest = np.flatnonzero(~converged)
    if not len(rest):
        return [Start(np.arange(len(gamma)), values, y, m)]
    eigenvalues, vectors, complex_count = _by_eigensolver(gamma[rest], square[rest])
    oscillates = complex_count == m
    values[rest[oscillates]], y[rest[oscillates]] = eigenvalues[oscillates, :m], vectors[oscillates, :, :m]
    converged[rest[oscillates]] = True
    which = np.flatnonzero(converged)
    result = [Start(which, subset(values, which), subset(y, which), m)] if len(which) else []
    for count in np.unique(complex_count[~oscillates]).tolist():
        group = complex_count == count
        size = 2 * m - count
        result.append(Start(rest[group], eigenvalues[group, :size], vectors[group][..., :size], count))
    return result


def _from_unit_vectors(gamma: Array, square: Array) -> tuple[Complex, Complex, Mask]:
    """Corrections of undamped modes; if they converge, the vectors are independent and no mode is missing."""
    n, m = square.shape
    at = np.arange(m)
    damping = gamma[:, at, at]
    under = (damping * damping < 4.0 * square).all(axis=1)
    values = np.ascontiguousarray(quadratic_roots(square.reshape(-1), damping.reshape(-1))[:, 0]).reshape(n, m)
    distance = values[:, None] * (values[:, None] + damping[:, :, None]) + square[:, :, None]
    distance[:, at, at] = 1.0
    y = np.divide(-values[:, None] * gamma, distance, out=np.full(gamma.shape, np.inf + 0j), where=distance != 0.0)
    y[:, at, at] = 1.0
    todo = np.flatnonzero(under & (_off_diagonal(y) < START))
    converged = np.zeros(n, dtype=bool)
    for _ in range(STEPS):
        if not len(todo):
            break
        g, w = subset(gamma, todo), subset(square, todo)
        values[todo], y[todo], step = _corrected(g, w, subset(values, todo), subset(y, todo))
        done = step < CONVERGED
        converged[todo[done]] = True
        todo = todo[~done & (step < START)]
    converged &= _off_diagonal(y) < INDEPENDENT
    return values, y, converged


def _off_diagonal(y: Complex) -> Array:
    """The largest sum of the absolute off-diagonal entries of a column."""
    size = np.abs(y).sum(axis=1) - np.abs(np.einsum("vii->vi", y))
    return np.asarray(size.max(axis=1, initial=0.0))


def _corrected(gamma: Array, square: Array, values: Complex, y: Complex) -> tuple[Complex, Complex, Array]:
    """Values and vectors after one correction, which squares their error, and the largest correction."""
    m, braked = y.shape[2], real_product(gamma, y)
    slope = np.einsum("vij,vij->vj", y, 2.0 * values[:, None] * y + braked)
    residual = values[:, None] * (values[:, None] * y + braked) + square[:, :, None] * y
    every = both(y, m)
    distance = both(slope, m)[:, :, None] * (values[:, None] - both(values, m)[:, :, None])
    np.einsum("vii->vi", distance[:, :m])[...] = slope
    together = distance == 0.0  # repeated eigenvalues: these corrections cannot separate their vectors
    distance[together] = 1.0
    mixing = every.swapaxes(1, 2) @ residual / distance
    own = np.einsum("vii->vi", mixing[:, :m])
    improved = values - own
    own[...] = 0.0
    result = y - every @ mixing
    result /= np.einsum("vii->vi", result)[:, None].copy()
    return improved, result, np.where(together.any(axis=(1, 2)), np.inf, np.abs(mixing).max(axis=(1, 2)))


def _by_eigensolver(gamma: Array, square: Array) -> tuple[Complex, Complex, Index]:
    """Eigenvalues of the state matrix [0 Omega; -Omega -Gamma], whose velocity parts are the vectors: those with
    positive imaginary part, whose number comes with them, then real ones, then the others.
    """
    n, m = square.shape
    omega, at = np.sqrt(square), np.arange(m)
    a = np.zeros((n, 2 * m, 2 * m))
    a[:, at, m + at] = omega
    a[:, m + at, at] = -omega
    a[:, m:, m:] = -gamma
    values, right = np.linalg.eig(a)
    values, right = values.astype(complex), right[:, m:].astype(complex)
    order = np.argsort(-np.sign(values.imag), axis=1, kind="stable")
    return (np.take_along_axis(values, order, 1), np.take_along_axis(right, order[:, None], 2),
            np.count_nonzero(values.imag > 0.0, axis=1))  # fmt: skip


def subset(array: Any, which: Any) -> Any:
    """Return the variants ``which`` of an array; all of them without a copy."""
    return array if len(which) == len(array) else array[which]
