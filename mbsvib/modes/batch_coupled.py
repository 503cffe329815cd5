"""Modes that dampers couple, of all variants at once.

In the basis of the undamped modes (lambda^2 + lambda Gamma + Omega^2) y = 0, and conjugates are solutions too. With
light damping every y is near a unit vector, which is the initial guess. Corrections through the resolvent, the sum of
y y^T / (slope (s - lambda)) over all eigenvalues, converge quadratically. If they do not converge quickly, or if modes
are overdamped, the eigenvalues of the state matrix in energy coordinates are the initial guess. A last correction uses
the factors of M, C and K and bounds the remaining error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.rank import EPS
from mbsvib.modes.classical import quadratic_roots
from mbsvib.modes.damped import CORRECTION

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
class Forms:
    """M, C and K in the basis of undamped modes, (variants, m, m): ``mass``, ``damping`` and ``stiffness``;
    ``magnitude`` is the sum of the absolute values of the terms of C.
    """

    mass: Array
    damping: Array
    stiffness: Array
    magnitude: Array


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
    at = np.arange(y.shape[2])
    braked = _times(gamma, y)
    slope = np.einsum("vij,vij->vj", y, 2.0 * values[:, None] * y + braked)
    residual = values[:, None] * (values[:, None] * y + braked) + square[:, :, None] * y
    parts, (mixing, conjugate_mixing) = _projections(y, residual)
    distance = _away(slope, values, values)
    distance[:, at, at] = slope
    together = distance == 0.0  # repeated eigenvalues: these corrections cannot separate their vectors
    distance[together] = 1.0
    step = mixing[:, at, at] / distance[:, at, at]
    mixing[:, at, at] = 0.0
    mixing /= distance
    conjugate_mixing /= _away(slope.conj(), values.conj(), values)
    change = np.maximum(np.abs(mixing).max(axis=(1, 2)), np.abs(conjugate_mixing).max(axis=(1, 2)))
    result = y - _combined(parts, mixing, conjugate_mixing)
    result /= result[:, at, at][:, None]
    return values - step, result, np.where(together.any(axis=(1, 2)), np.inf, change)


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


def refined(
    forms: Forms, values: Complex, y: Complex, square: Array, errors: Array, complex_count: int
) -> tuple[Complex, Complex, Complex, Array, Array]:
    """Improve eigenvalues by their two-sided Rayleigh quadratics, and vectors by the projections of the residual.

    ``values``, ``y`` (n, h) and (n, m, h): as in ``Start``; the first ``complex_count`` represent their conjugates.
    ``errors`` (n, m): relative ones of the undamped frequencies. Returns values; unit vectors y; the slopes (n, h) of
    these, y^T (2 lambda + Gamma) y; a bound (n, h) of the relative errors; and the largest relative error (n,) without
    the part that comes from the undamped modes.
    """
    y = y / _lengths(y)
    inertia, damping, elastic = _times(forms.mass, y), _times(forms.damping, y), _times(forms.stiffness, y)
    a, b, c = (np.einsum("vij,vij->vj", y, part) for part in (inertia, damping, elastic))
    improved = values
    for _ in range(2):  # the second step squares the error of the first
        slope = 2.0 * improved * a + b
        step = np.divide(improved * (improved * a + b) + c, slope, out=np.zeros_like(slope), where=slope != 0.0)
        small = np.abs(step) <= CORRECTION * np.abs(improved)
        improved = np.where(small, improved - step, improved)
    size, speed, wide = np.abs(y), np.abs(improved), improved[:, None]
    exact_slope = 2.0 * improved * a + b
    slope = np.abs(exact_slope)
    parts, shares = _projections(y, wide * (wide * inertia + damping) + elastic)
    away = _away(exact_slope, improved, improved), _away(exact_slope.conj(), improved.conj(), improved)
    at = np.arange(y.shape[2])
    uncertainty = 4.0 * EPS * speed * np.einsum("vij,vij->vj", size, forms.magnitude @ size)
    for share, distance in zip(shares, away, strict=True):
        projection, separation = np.abs(share), np.abs(distance)
        if share is shares[0]:
            separation[:, at, at] = np.inf
        else:  # real ones are their own conjugates
            projection[:, complex_count:] = 0.0
        ratio = np.divide(projection, separation, out=np.ones_like(projection), where=separation > projection)
        uncertainty += np.einsum("vij,vij->vj", projection, ratio)
        near = (CORRECTION * separation <= projection) | (distance == 0.0)
        if share is not shares[0]:
            near[:, complex_count:] = True
        share[near] = 0.0
        np.divide(share, distance, out=share, where=~near)
    reach = slope * speed
    reducible = np.divide(uncertainty, reach, out=np.ones_like(slope), where=reach > 0.0)
    reducible[~small] = 1.0
    trust = 2.0 * (errors[:, :, None] + EPS)
    uncertainty += np.einsum("vij,vij->vj", size, (speed[:, None] ** 2 + np.abs(square)[:, :, None]) * trust * size)
    bound = np.divide(uncertainty, reach, out=np.ones_like(slope), where=reach > 0.0)
    relative = np.divide(np.abs(step), speed, out=np.ones_like(speed), where=speed > 0.0)
    bound = np.minimum(np.where(small, bound, np.maximum(bound, relative)), 1.0)
    y = y - _combined(parts, *shares)
    y.imag[:, :, complex_count:] = improved.imag[:, complex_count:] = 0.0
    y /= _lengths(y)
    slopes = np.einsum("vij,vij->vj", y, 2.0 * wide * y + _times(forms.damping, y))
    return improved, y, slopes, bound, reducible.max(axis=1, initial=0.0)


def subset(array: Any, which: Any) -> Any:
    """Return the variants ``which`` of an array; all of them without a copy."""
    return array if len(which) == len(array) else array[which]


def _times(matrix: Array, y: Complex) -> Complex:
    """Real matrices times complex vectors, without complex copies of the matrices."""
    result: Complex = (matrix @ np.ascontiguousarray(y).view(float)).view(complex)
    return result


def _projections(y: Complex, residual: Complex) -> tuple[tuple[Array, Array], tuple[Complex, Complex]]:
    """Real and imaginary parts of y, and the projections y^T r and y^H r of residuals."""
    real, imaginary = np.ascontiguousarray(y.real), np.ascontiguousarray(y.imag)
    real_product, imaginary_product = _times(real.swapaxes(1, 2), residual), _times(imaginary.swapaxes(1, 2), residual)
    imaginary_product *= 1j
    return (real, imaginary), (real_product + imaginary_product, real_product - imaginary_product)


def _combined(parts: tuple[Array, Array], mixing: Complex, conjugate_mixing: Complex) -> Complex:
    """Y mixing + conj(Y) conjugate_mixing."""
    return _times(parts[0], mixing + conjugate_mixing) + 1j * _times(parts[1], mixing - conjugate_mixing)


def _away(slope: Complex, values: Complex, column_values: Complex) -> Complex:
    """Slopes of the rows times the distances of their eigenvalues from those of the columns."""
    result: Complex = slope[:, :, None] * (column_values[:, None] - values[:, :, None])
    return result


def _lengths(y: Complex) -> Array:
    real, imaginary = (np.einsum("vij,vij->vj", part, part) for part in (y.real, y.imag))
    return np.asarray(np.sqrt(real + imaginary))[:, None]
