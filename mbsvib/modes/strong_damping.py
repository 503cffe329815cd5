"""Eigenvalues under strong damping, with the forces of the dampers as unknowns.

If dampers nearly lock a motion, rounding errors of Gamma = L^T L exceed the terms of the other motions, whose
eigenvalues lose their digits. The forces f = lambda L y stay of the order of the other terms of these motions, so that
with

    T(lambda) (y, f) = [[lambda^2 + Omega^2, L^T], [L, -1 / lambda]] (y, f) = 0,    det T = det Q (-lambda)^-r

scaled to entries of the order of one, no digits are lost. Inaccurate eigenvalues are improved together, by steps that
keep them apart from all others (Aberth), and each then by the quotient that is stationary in y and f.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.memory import BATCH_BYTES
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex


# Eigenvalues with some correct digits need one to three steps; the others seldom more than ten.
STEPS = 30
# After steps this small the quotients take over: each squares the error.
CLOSE = 1e-7
# An eigenvalue as uncertain as this may be real or complex: the iteration starts off the real axis.
UNSURE = 1e-3
# Each squares the error of the one before.
QUOTIENTS = 4
# Factors of s by which the matrix is evaluated off an eigenvalue, where it is regular; the first that works is used.
OFFSETS = (1.0 + 5.0 * EPS, 1.0 + 70.0 * EPS, 1.0 + 900.0 * EPS, 1.0 + 1e4 * EPS)
# Rounding of a solution with an equilibrated matrix, and of the products, each some times eps; calibrated in the tests.
ROUNDING = 4.0


@dataclass(frozen=True, slots=True)
class DamperForces:
    """The equations with the dampers' forces: ``square`` (n,) of the undamped frequencies, rows ``dampers`` (r, n) of
    L, and how often 0 is an eigenvalue (rigid-body modes that come to rest).
    """

    square: Array
    dampers: Array
    zeros: int

    def matrix(self, s: Any) -> tuple[Any, Array]:
        """Return S T S with entries of the order of one, (k, n + r, n + r), and the scale S (k, n + r)."""
        n, size, omega = len(self.square), np.abs(s)[:, None], np.sqrt(np.abs(self.square))
        scale = np.empty((len(s), n + len(self.dampers)))
        scale[:, :n] = 1.0 / np.maximum(size, omega)
        rows = self.dampers * scale[:, None, :n]
        scale[:, n:] = 1.0 / np.maximum(np.abs(rows).max(axis=2), 1.0 / np.sqrt(size))
        rows *= scale[:, n:, None]
        result = np.zeros((len(s), *scale.shape[1:] * 2), dtype=s.dtype)
        result[:, n:, :n] = rows
        result[:, :n, n:] = rows.transpose(0, 2, 1)
        i, j = np.arange(n), n + np.arange(len(self.dampers))
        ratio, part = s[:, None] * scale[:, :n], omega * scale[:, :n]
        turn = 1j * part if np.iscomplexobj(s) else part
        swings = (ratio + turn) * (ratio - turn) if np.iscomplexobj(s) else ratio**2 + part**2
        result[:, i, i] = np.where(self.square >= 0.0, swings, (ratio + part) * (ratio - part))
        result[:, j, j] = -(scale[:, n:] ** 2) / s[:, None]
        return result, scale

    def slopes(self, s: Any) -> Any:
        """Return the diagonal of T', (k, n + r)."""
        of_forces = np.repeat(s[:, None] ** -2, len(self.dampers), axis=1)
        return np.concatenate((np.repeat(2.0 * s[:, None], len(self.square), axis=1), of_forces), axis=1)

    def batches(self, count: int) -> list[slice]:
        """Return slices of ``count`` points whose matrices fit in memory."""
        size = max(1, BATCH_BYTES // (16 * (len(self.square) + len(self.dampers)) ** 2))
        return [slice(start, start + size) for start in range(0, count, size)]


def forces(square: Array, dampers: Array, zeros: int) -> DamperForces:
    """Return the equations with no more rows than motions of dampers L (rows, n), by a QR that keeps digits of small
    rows.
    """
    qr, order, _ = pivoted_qr(dampers[np.argsort(-np.abs(dampers).max(axis=1), kind="stable")])
    root = np.triu(qr[: dampers.shape[1]])[:, np.argsort(order)]
    return DamperForces(square, root[root.any(axis=1)], zeros)


def improved(
    equations: DamperForces, values: Complex, uncertainty: Array, rtol: float
) -> tuple[Complex, Complex, Complex, Array]:
    """Improve the eigenvalues ``values`` (k,), all but 0, whose relative error ``uncertainty`` (k,) may exceed
    ``rtol``.

    Returns eigenvalues (k,), modes y (n, k), slopes (k,), which are y^T (2 lambda + Gamma) y, and relative errors (k,).
    Where an eigenvalue was not improved, y and slope are 0 and the error is infinite.

    Source: Aberth, Math. Comp. 27 (1973), for the simultaneous steps.
    """
    n = len(equations.square)
    inaccurate = np.nonzero(uncertainty > rtol)[0]
    result = values.copy()
    y, slopes, errors = np.zeros((n, len(values)), dtype=complex), np.zeros_like(values), np.full(len(values), np.inf)
    try:
        result = _separated_values(equations, values, inaccurate, uncertainty)
        real = result[inaccurate].imag == 0.0
        for group, part in ((inaccurate[real], result.real), (inaccurate[~real], result)):
            for batch in equations.batches(len(group)):
                k = group[batch]
                result[k], y[:, k], slopes[k], errors[k] = _stationary(equations, part[k])
    except np.linalg.LinAlgError:
        return values, y, slopes, np.full(len(values), np.inf)
    return result, y, slopes, errors


def _separated_values(
    equations: DamperForces, values: Complex, inaccurate: NDArray[np.intp], uncertainty: Array
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
    inverse, scale = _near(equations, s, np.linalg.inv)
    trace = (np.einsum("kii->ki", inverse) * scale**2 * equations.slopes(s)).sum(axis=1)
    result: Complex = 1.0 / (trace + (len(equations.dampers) - equations.zeros) / s)
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


def _stationary(equations: DamperForces, s: Any) -> tuple[Any, Any, Any, Array]:
    """Eigenvalues by the quotient x^T T x / x^T T' x, stationary in x = (y, f); y, slopes and error bounds."""
    n = len(equations.square)
    x = np.ones((len(s), n + len(equations.dampers)), dtype=s.dtype)
    for _ in range(QUOTIENTS):
        x = _near(equations, s, partial(_solution, x))[0]
        x /= np.linalg.norm(x, axis=1)[:, None]
        matrix, scale = equations.matrix(s)
        slope = (x * x * scale**2 * equations.slopes(s)).sum(axis=1)
        step = np.einsum("ki,ki->k", x, np.einsum("kij,kj->ki", matrix, x)) / slope
        s = s - step
    matrix, scale = equations.matrix(s)
    residual, terms = matrix @ x[:, :, None], np.abs(matrix) @ np.abs(x)[:, :, None]
    # what is wrong with x, by its residual, acts twice: in x and from the left
    off = np.abs(_near(equations, s, partial(_solution, residual[:, :, 0]))[0])
    size = ROUNDING * EPS * np.einsum("ki,ki->k", np.abs(x), terms[:, :, 0])
    size += np.einsum("ki,ki->k", off, (np.abs(residual) + EPS * terms)[:, :, 0])
    speed = np.abs(s)
    errors = size / (np.abs(slope) * speed) + np.abs(step) / speed
    y = x[:, :n] * scale[:, :n]
    length = np.linalg.norm(y, axis=1)
    return s, (y / length[:, None]).T, slope / length**2, errors
