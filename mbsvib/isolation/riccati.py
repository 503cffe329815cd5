"""Riccati's equation of optimal gains, from the factors of its weights, whatever the units of states and controls."""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack, schur

from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import ResponseError
from mbsvib.linalg.lyapunov import Lyapunov
from mbsvib.linalg.spectrum import spectrum

# Solutions that give the units of states; Newton's steps, at most, and the relative change at which they end.
SCALINGS, NEWTON_STEPS, CONVERGED = 2, 4, 1e-9


class _Terms(NamedTuple):
    """Cost |F x + G u|^2 + u^T E u of x' = A x + B u in other terms: with R = G^T G + E,

    free = A - B R^-1 G^T F,  drive = R^-1 B^T,  direct = R^-1 G^T F,  weight^T weight = F^T (1 - G R^-1 G^T) F
    """

    a: Array
    b: Array
    f: Array
    free: Array
    drive: Array
    direct: Array
    weight: Array

    def in_units(self, unit: Array) -> _Terms:
        """Return the terms for states in other units (n,)."""
        rows = unit[:, None]
        return _Terms(self.a * unit / rows, self.b / rows, self.f * unit, self.free * unit / rows, self.drive / unit,
                      self.direct * unit, self.weight * unit)  # fmt: skip

    def gain(self, cost: Array) -> Array:
        """Return R^-1 (B^T X + G^T F)."""
        return self.drive @ cost + self.direct

    def residual(self, cost: Array) -> float:
        """Return the size of what a solution X leaves of Riccati's equation."""
        half = cost @ self.free
        return float(np.linalg.norm(half + half.T + self.weight.T @ self.weight - cost @ self.b @ self.drive @ cost))


def riccati(
    a: Array, b: Array, performance: tuple[Array, Array], effort: Array, who: str = "lqg"
) -> tuple[Array, Array]:  # fmt: skip
    """Return the stabilising solution X of Riccati's equation, and the gain K of u = -K x that minimises
    the integral of |F x + G u|^2 + u^T E u under x' = A x + B u.

    ``performance``: F (k, n) and G (k, m). ``effort`` (m,): diagonal of E, positive; or all 0, if columns of G are
    independent. ``who``: names the caller in errors.

    X = U2 U1^-1 from the decaying invariant subspace (U1, U2) of the Hamiltonian matrix. Its complex Schur form can be
    ordered whatever eigenvalues coincide, as those of a symmetric platform do; the real one, all that
    ``scipy.linalg.solve_continuous_are`` has, not always. Units of states are those in which X has a diagonal of ones.

    Source: A. J. Laub, A Schur method for solving algebraic Riccati equations, IEEE Trans. Automatic Control 24 (1979);
    D. L. Kleinman, On an iterative technique for Riccati equation computations, the same 13 (1968), for the last step.
    """
    terms = _terms(a, b, *performance, effort)
    unit = _balanced(terms)
    terms = terms.in_units(unit)
    cost, complete = _by_subspace(terms, who)
    for _ in range(SCALINGS):
        size = np.abs(cost.diagonal())
        change = np.exp2(-np.round(0.5 * np.log2(np.where(size > 0.0, size, 1.0))))
        if (change == 1.0).all():
            break
        terms, unit = terms.in_units(change), unit * change
        cost, complete = _by_subspace(terms, who)
    if not complete:  # rounding moves uncontrollable poles to either side of the imaginary axis
        raise _none(who)
    cost, gain = _refined(terms, cost, (performance[1], effort), who)
    return cost / np.outer(unit, unit), np.asarray(gain / unit)


def _terms(a: Array, b: Array, f: Array, g: Array, effort: Array) -> _Terms:
    """The terms, without differences of squares: by the singular values s of G E^-1/2, 1 - s^2 / (1 + s^2)."""
    costs = bool(effort.any())
    root = np.sqrt(effort) if costs else np.linalg.norm(g, axis=0)
    left, values, right = np.linalg.svd(g / root)
    kept, passed, count = np.ones(len(root)), np.ones(len(f)), len(values)
    kept[:count] = 1.0 / (costs + values**2)
    passed[:count] = costs * kept[:count]
    inverse = right.T * kept / root[:, None]
    seen = left.T @ f
    direct = inverse[:, :count] @ (values[:, None] * seen[:count])
    drive = inverse @ (right / root) @ b.T
    return _Terms(a, b, f, a - b @ direct, drive, direct, np.sqrt(passed)[:, None] * seen)


def _balanced(terms: _Terms) -> Array:
    """Units of states (n,), powers of two, in which rows and columns of the Hamiltonian matrix are of like size.

    Source: P. Benner, Symplectic balancing of Hamiltonian matrices, SIAM J. Sci. Comput. 22 (2001) 1885: those of
    LAPACK's gebal, states and costates made reciprocal.
    """
    n = len(terms.a)
    matrix = np.abs(np.block([[terms.free, terms.b @ terms.drive],
                              [terms.weight.T @ terms.weight, terms.free.T]]))  # fmt: skip
    np.fill_diagonal(matrix, 0.0)
    power = np.log2(lapack.dgebal(matrix, scale=1)[3])
    return np.asarray(np.exp2(np.round(0.5 * (power[:n] - power[n:]))))


def _by_subspace(terms: _Terms, who: str) -> tuple[Array, bool]:
    """X by the decaying subspace, and whether this has a dimension for each state."""
    n, weight, push = len(terms.a), terms.weight.T @ terms.weight, terms.b @ terms.drive
    sizes = float(np.linalg.norm(weight)), float(np.linalg.norm(push))
    size = np.sqrt(sizes[0] / sizes[1]) if all(sizes) else 1.0
    matrix = np.block([[terms.free, -size * push], [-weight / size, -terms.free.T]])
    try:
        basis, count = _decaying(matrix)
        cost = size * np.linalg.solve(basis[:n, :n].T, basis[n:, :n].T).real
    except np.linalg.LinAlgError as error:
        raise _none(who) from error
    return np.asarray(0.5 * (cost + cost.T)), count == n


def _decaying(matrix: Array) -> tuple[Complex, int]:
    """A basis (2 n, 2 n), decaying vectors first, and their number; complex where those of the real Schur form, which
    takes less time, cannot be ordered.
    """
    with suppress(np.linalg.LinAlgError):
        _, basis, count = schur(matrix, sort="lhp")
        if 2 * count == len(matrix):
            return basis, count
    _, basis, count = schur(matrix, "complex", sort="lhp")
    return basis, count


def _refined(terms: _Terms, cost: Array, weights: tuple[Array, Array], who: str) -> tuple[Array, Array]:
    """X and its gain after Newton's steps, the cost of each gain, as far as they leave less of the equation: without
    the rounding of Hamiltonian matrices with fast modes. A gain that does not stabilise is refused.
    """
    (g, effort), left = weights, terms.residual(cost)
    with np.errstate(all="ignore"):  # the cost of a gain that does not stabilise may be infinite
        for _ in range(NEWTON_STEPS):
            gain = terms.gain(cost)
            shown = terms.f - g @ gain
            new = Lyapunov(terms.a - terms.b @ gain).observed(shown.T @ shown + gain.T @ (effort[:, None] * gain))
            residual, change = terms.residual(new), np.abs(new - cost).max(initial=0.0)
            if not residual < left:
                break
            cost, left = new, residual
            if change <= CONVERGED * np.abs(cost).max(initial=0.0):
                break
    gain = terms.gain(cost)
    if not spectrum(terms.a - terms.b @ gain).decaying.all():
        raise _none(who)
    return cost, gain


def _none(who: str) -> ResponseError:
    return ResponseError(f"{who}: no stabilising controller was found; a mode may be out of reach of the actuators or "
                         "sensors, or effort and noise are too small against the rest.")  # fmt: skip
