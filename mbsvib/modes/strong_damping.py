"""Eigenvalues under strong damping, with the forces of the dampers as unknowns.

If dampers nearly lock a motion, rounding errors of Gamma = L^T L exceed the terms of the other motions, whose
eigenvalues lose their digits. The forces f = lambda L y stay of the order of the other terms of these motions, so that
with

    T(lambda) (y, f) = [[lambda^2 + Omega^2, L^T], [L, -1 / lambda]] (y, f) = 0,    det T = det Q (-lambda)^-r

scaled to entries of the order of one, no digits are lost. Inaccurate eigenvalues are improved together, by steps that
keep them apart from all others (Aberth), and each then by the quotient that is stationary in y and f.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import eigh

from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.common.memory import BATCH_BYTES
from mbsvib.linalg.groups import part_numbers
from mbsvib.linalg.qr import sorted_qr
from mbsvib.linalg.rank import EPS

# Eigenvalues with some correct digits need one to three steps; the others seldom more than ten.
STEPS = 30
# After steps this small the quotients take over: each squares the error.
CLOSE = 1e-7
# An eigenvalue as uncertain as this may be real or complex: the iteration starts off the real axis.
UNSURE = 1e-3
# Each squares the error of the one before.
QUOTIENTS = 4
# Eigenvalues that are closer than this share of them form a cluster.
NEIGHBOUR = 1e-4
# Factors of s by which the matrix is evaluated off an eigenvalue, where it is regular; the first that works is used.
OFFSETS = (1.0 + 5.0 * EPS, 1.0 + 70.0 * EPS, 1.0 + 900.0 * EPS, 1.0 + 1e4 * EPS)
# Vectors are as inexact as the bounds by their residuals: errors of eigenvalues are up to twice as large.
INEXACT = 2.0
# Rounding of a solution with an equilibrated matrix, and of the products, each some times eps; calibrated in the tests.
ROUNDING = 4.0


@dataclass(frozen=True, slots=True)
class DamperForces:
    """The equations with the dampers' forces: ``square`` (n,) of the undamped frequencies, rows ``dampers`` (r, n) of
    L, or (k, r, n) for k points, and how often 0 is an eigenvalue (rigid-body modes that come to rest).
    """

    square: Array
    dampers: Array
    zeros: int

    def near(self, s: Any) -> DamperForces:
        """Return the equations with other rows L of the same L^T L for each of the points s (k,): they are nearly at
        right angles where motions have the sizes of ``matrix``, so that no forces cancel in it.
        """
        size = np.maximum(np.abs(s)[:, None], np.sqrt(np.abs(self.square)))
        roots = (sorted_qr(self.dampers / point) for point in size)
        return replace(self, dampers=np.array([root[:, np.argsort(order)] for root, order in roots]) * size[:, None])

    def matrix(self, s: Any) -> tuple[Any, Array]:
        """Return S T S with entries of the order of one, (k, n + r, n + r), and the scale S (k, n + r)."""
        n, size, omega = len(self.square), np.abs(s)[:, None], np.sqrt(np.abs(self.square))
        scale = np.empty((len(s), n + self.dampers.shape[-2]))
        scale[:, :n] = 1.0 / np.maximum(size, omega)
        rows = self.dampers * scale[:, None, :n]
        scale[:, n:] = 1.0 / np.maximum(np.abs(rows).max(axis=2), 1.0 / np.sqrt(size))
        rows *= scale[:, n:, None]
        result = np.zeros((len(s), *scale.shape[1:] * 2), dtype=s.dtype)
        result[:, n:, :n] = rows
        result[:, :n, n:] = rows.transpose(0, 2, 1)
        i, j = np.arange(n), n + np.arange(self.dampers.shape[-2])
        ratio, part = s[:, None] * scale[:, :n], omega * scale[:, :n]
        turn = 1j * part if np.iscomplexobj(s) else part
        swings = (ratio + turn) * (ratio - turn) if np.iscomplexobj(s) else ratio**2 + part**2
        result[:, i, i] = np.where(self.square >= 0.0, swings, (ratio + part) * (ratio - part))
        result[:, j, j] = -(scale[:, n:] ** 2) / s[:, None]
        return result, scale

    def slopes(self, s: Any) -> Any:
        """Return the diagonal of T', (k, n + r)."""
        of_forces = np.repeat(s[:, None] ** -2, self.dampers.shape[-2], axis=1)
        return np.concatenate((np.repeat(2.0 * s[:, None], len(self.square), axis=1), of_forces), axis=1)

    def batches(self, count: int) -> list[slice]:
        """Return slices of ``count`` points whose matrices fit in memory."""
        size = max(1, BATCH_BYTES // (16 * (len(self.square) + self.dampers.shape[-2]) ** 2))
        return [slice(start, start + size) for start in range(0, count, size)]


def improved(
    equations: DamperForces, values: Complex, uncertainty: Array, rtol: float
) -> tuple[Complex, Complex, Complex, Array, Index]:
    """Improve the eigenvalues ``values`` (k,), all but 0, whose relative error ``uncertainty`` (k,) may exceed
    ``rtol``.

    Returns eigenvalues (k,), modes y (n, k), slopes (k,), which are y^T (2 lambda + Gamma) y, relative errors (k,), and
    numbers of clusters (k,), in which the order of eigenvalues may be another one. Where an eigenvalue was not
    improved, y and slope are 0 and the error is infinite.

    Source: Aberth, Math. Comp. 27 (1973), for the simultaneous steps.
    """
    n = len(equations.square)
    inaccurate = np.nonzero(uncertainty > rtol)[0]
    result = values.copy()
    y, slopes, errors = np.zeros((n, len(values)), dtype=complex), np.zeros_like(values), np.full(len(values), np.inf)
    cluster = np.arange(len(values))
    try:
        result = _separated_values(equations, values, inaccurate, uncertainty)
        cluster = _first_neighbours(result)
        alone = np.bincount(cluster, minlength=len(values))[cluster[inaccurate]] == 1
        single = inaccurate[alone]
        real = result[single].imag == 0.0
        for group, part in ((single[real], result.real), (single[~real], result)):
            for batch in equations.batches(len(group)):
                k = group[batch]
                result[k], y[:, k], slopes[k], errors[k] = _stationary(equations, part[k])
        for number in np.unique(cluster[inaccurate[~alone]]):
            k = np.nonzero(cluster == number)[0]
            result[k], y[:, k], slopes[k], errors[k] = _together(equations, result[k])
    except np.linalg.LinAlgError:
        return values, y, slopes, np.full(len(values), np.inf), cluster
    return result, y, slopes, errors, cluster


def _separated_values(
    equations: DamperForces, values: Complex, inaccurate: Index, uncertainty: Array
) -> Complex:
    """Newton's steps on det Q for some of the eigenvalues, with the other eigenvalues divided out."""
    z = values.copy()
    unsure = inaccurate[uncertainty[inaccurate] >= UNSURE]
    z[unsure] *= 1.0 + 1j * UNSURE * np.cos(unsure)
    active = inaccurate[uncertainty[inaccurate] > CLOSE]
    for _ in range(STEPS):
        if not len(active):
            break
        newton = np.concatenate([_newton(equations, z[active[batch]]) for batch in equations.batches(len(active))])
        distance = z[active, None] - z
        distance[np.arange(len(active)), active] = np.inf
        distance[distance == 0.0] = EPS * np.abs(z).max()
        step = newton / (1.0 - newton * (1.0 / distance).sum(axis=1))
        step = np.where(np.isfinite(step), step, 0.0)
        stays_real = (values[active].imag == 0.0) & (uncertainty[active] < UNSURE)
        z[active] -= np.where(stays_real, step.real, step)
        active = active[np.abs(step) > CLOSE * np.abs(z[active])]
    nearly_real = unsure[np.abs(z[unsure].imag) <= 10.0 * CLOSE * np.abs(z[unsure])]
    z[nearly_real] = z[nearly_real].real
    return z


def _newton(equations: DamperForces, s: Complex) -> Complex:
    """p / p' of p = det Q(s) / s^zeros."""
    equations = equations.near(s)
    inverse, scale = _near(equations, s, np.linalg.inv)
    trace = (np.einsum("kii->ki", inverse) * scale**2 * equations.slopes(s)).sum(axis=1)
    result: Complex = 1.0 / (trace + (equations.dampers.shape[-2] - equations.zeros) / s)
    return result


def _solution(right: Any, matrix: Any) -> Any:
    return np.linalg.solve(matrix, right[:, :, None])[:, :, 0]


def _near(equations: DamperForces, s: Any, solve: Callable[[Any], Any]) -> tuple[Any, Array]:
    """Return the results of ``solve`` for the matrices next to s, and their scale."""
    for factor in OFFSETS[:-1]:
        matrix, scale = equations.matrix(s * factor)
        try:
            return solve(matrix), scale
        except np.linalg.LinAlgError:
            continue
    matrix, scale = equations.matrix(s * OFFSETS[-1])
    return solve(matrix), scale


def _first_neighbours(values: Complex) -> Index:
    """Number of the first of the values that each is connected to by neighbours closer than ``NEIGHBOUR``."""
    near = np.abs(values[:, None] - values) <= NEIGHBOUR * np.abs(values)
    label = part_numbers(near)
    return np.asarray(np.unique(label, return_index=True)[1][label])


def _together(equations: DamperForces, s: Complex) -> tuple[Any, Any, Any, Array]:
    """What ``_stationary`` returns, for a cluster: a basis of all its vectors by inverse iteration, and the vectors by
    the quotient of x^T T x and x^T T' x with this basis as x. Each by itself would end at any of them.
    """
    middle: Any = s.mean(keepdims=True)
    if abs(middle.imag[0]) <= NEIGHBOUR * abs(middle[0]):
        middle = middle.real
    equations = equations.near(middle)
    inverse, scale = _near(equations, middle, np.linalg.inv)
    x: Any = np.cos(np.outer(np.arange(len(inverse[0])), np.arange(1, len(s) + 1)))
    for _ in range(QUOTIENTS):
        x = np.linalg.qr(inverse[0] @ x)[0]
    steps, turn = _pencil(x.T @ equations.matrix(middle)[0][0] @ x, (x.T * (scale**2 * equations.slopes(middle))) @ x)
    s = middle - steps
    _, scale, x, _, _ = _quotient(equations, s, (x @ turn).T * scale)
    x, scale = _near(equations, s, partial(_solution, x * scale**2 * equations.slopes(s)))  # at s instead of the middle
    return _bounded(equations, s, x * scale)


def _pencil(first: Any, second: Any) -> tuple[Any, Any]:
    """Eigenvalues and vectors of a symmetric pencil, which are real where the second matrix is real and definite."""
    sign = np.sign(second[0, 0].real)
    if np.isrealobj(second) and (sign * np.linalg.eigvalsh(second) > 0.0).all():
        values, vectors = eigh(sign * first, sign * second)
        return values, vectors
    values, vectors = np.linalg.eig(np.linalg.solve(second, first))
    return values, vectors


def _stationary(equations: DamperForces, s: Any) -> tuple[Any, Any, Any, Array]:
    """Eigenvalues by the quotient x^T T x / x^T T' x, stationary in x = (y, f); y, slopes and error bounds."""
    equations = equations.near(s)
    x = np.cos(np.arange(len(equations.square) + equations.dampers.shape[-2], dtype=s.dtype)) * np.ones((len(s), 1))
    for k in range(QUOTIENTS):
        x, scale = _near(equations, s, partial(_solution, x))
        x = x / np.abs(x).max(axis=1)[:, None]  # near an eigenvalue, squares of its entries may overflow
        x = x / np.linalg.norm(x, axis=1)[:, None]
        if k:  # s is more accurate than the first vector
            s = s - _quotient(equations, s, x * scale)[-1]
    return _bounded(equations, s, x * scale)


def _quotient(equations: DamperForces, s: Any, motion: Any) -> tuple[Any, Any, Any, Any, Any]:
    """T, its scale, unit vectors x and their slopes x^T T' x in this scale, and steps x^T T x / x^T T' x."""
    matrix, scale = equations.matrix(s)
    x = motion / scale
    x /= np.linalg.norm(x, axis=1)[:, None]
    slope = (x * x * scale**2 * equations.slopes(s)).sum(axis=1)
    return matrix, scale, x, slope, np.einsum("ki,ki->k", x, np.einsum("kij,kj->ki", matrix, x)) / slope


def _bounded(equations: DamperForces, s: Any, motion: Any) -> tuple[Any, Any, Any, Array]:
    """One more step for each of the vectors ``motion`` (k, n + r), and what ``_stationary`` returns."""
    s = s - _quotient(equations, s, motion)[-1]
    matrix, scale, x, slope, step = _quotient(equations, s, motion)
    residual, terms = matrix @ x[:, :, None], np.abs(matrix) @ np.abs(x)[:, :, None]
    # what is wrong with x, by its residual, acts twice: in x and from the left
    bordered = np.zeros((len(s), x.shape[1] + 1, x.shape[1] + 1), dtype=matrix.dtype)
    bordered[:, :-1, :-1] = matrix
    bordered[:, :-1, -1] = bordered[:, -1, :-1] = x * scale**2 * equations.slopes(s) * np.abs(s)[:, None]
    off = np.abs(np.linalg.solve(bordered, np.pad(residual, ((0, 0), (0, 1), (0, 0))))[:, :-1])
    size = ROUNDING * EPS * np.einsum("ki,ki->k", np.abs(x), terms[:, :, 0])
    size += INEXACT * np.einsum("kij,kij->k", off, np.abs(residual) + EPS * terms)
    speed = np.abs(s)
    errors = size / (np.abs(slope) * speed) + np.abs(step) / speed
    y = (x * scale)[:, : len(equations.square)]
    length = np.linalg.norm(y, axis=1)
    return s, (y / length[:, None]).T, slope / length**2, errors
