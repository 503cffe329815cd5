"""Classical damping: the test whether damping couples the undamped modes, and the eigenvalues if it does not."""

from __future__ import annotations

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.equations.equations import Equations
from mbsvib.linalg.rank import EPS
from mbsvib.modes.undamped import CLEAN, Undamped

# Damping couples two modes if |Gamma_ij| exceeds this share of sqrt(Gamma_ii Gamma_jj); smaller entries are neglected.
CLASSICAL = 1e-13
# Off-diagonal entries of commuting damping are at most this factor times the mixing of the shapes.
PLAIN = 1e3
NO_DAMPER = "no damper"
IN_DOUBT = "in doubt"
COMMUTES = "damping commutes with mass and stiffness"


def classical_damping(system: Equations, basis: Undamped, follows_stiffness: bool) -> tuple[str, Array]:
    """Return why damping is classical ("" if it is not, ``IN_DOUBT`` if the basis mixes too much to decide), and Gamma
    as its diagonal (m,) or the full matrix (m, m); ``follows_stiffness`` is the result of ``proportional``.
    """
    c, k = system.row_damping, system.row_stiffness
    if not np.count_nonzero(c):
        return NO_DAMPER, np.zeros(system.dof)
    if follows_stiffness:
        return "damping proportional to stiffness", float(np.add.reduce(c / k) / len(c)) * basis.square
    half = system.elastic_rows.dot(basis.shapes) * np.sqrt(np.abs(c))[:, None]
    negative = np.count_nonzero(c < 0.0)
    gamma = half.T.dot(half * np.sign(c)[:, None] if negative else half)
    size = np.einsum("ij,ij->j", half, half) if negative else gamma.diagonal()
    limit = np.sqrt(size[:, None] * size)
    limit.reshape(-1)[:: len(limit) + 1] = np.inf
    amount = np.abs(gamma)
    in_doubt = PLAIN * basis.mixed if basis.mixed > CLEAN else 0.0
    if np.count_nonzero(amount > max(CLASSICAL, in_doubt) * limit):
        return "", gamma
    if in_doubt and np.count_nonzero(amount > CLASSICAL * limit):
        return IN_DOUBT, gamma
    return COMMUTES, gamma.diagonal().copy()


def proportional(c: Array, k: Array) -> bool:
    """Return whether every damping is the same multiple of its stiffness (or all zero), which needs no modes.

    ``c``, ``k`` (rows,): damping and stiffness of the elastic rows.
    """
    if not np.count_nonzero(c):
        return True
    if np.count_nonzero(k) < len(k):
        return False
    ratio = c / k
    return bool(ratio[ratio.argmax()] - ratio[ratio.argmin()] <= 4.0 * EPS * abs(ratio[0]))


def quadratic_roots(square: Array, gamma: Array) -> Complex:
    """Return both roots of lambda^2 + gamma lambda + square = 0 for every mode, (m, 2), without cancellation."""
    half = 0.5 * gamma
    omega: Array = np.sqrt(np.abs(square))
    inside = (half - omega) * (half + omega)
    if np.count_nonzero(square > 0.0) < len(square):
        inside = np.where(square > 0.0, inside, half * half - square)
    root = np.sqrt(np.abs(inside))
    pairs: Complex = np.empty((len(square), 2), dtype=complex)
    if np.count_nonzero(inside < 0.0) == len(inside):
        pairs.real, pairs.imag[:, 0] = 0.0 - half[:, None], root
        np.negative(root, out=pairs.imag[:, 1])
        return pairs
    big = -(half + np.where(half >= 0.0, root, -root))
    small = np.divide(square, big, out=np.zeros_like(big), where=big != 0.0)
    oscillates = inside < 0.0
    pairs[:, 0] = np.where(oscillates, -half + 1j * root, small)
    pairs[:, 1] = np.where(oscillates, -half - 1j * root, big)
    return pairs


def damper_rows(system: Equations, shapes: Array) -> tuple[Array, Array] | None:
    """Return rows L (dampers, m), L^T L = Gamma in a basis, and sizes of their terms; None with negative dampers."""
    used = system.row_damping != 0.0
    if (system.row_damping < 0.0).any():
        return None
    rows, weights = system.elastic_rows[used], np.sqrt(system.row_damping[used])[:, None]
    return (rows @ shapes) * weights, (np.abs(rows) @ np.abs(shapes)) * weights


def rounding_of_sums(rows: Array, damping: Array, shapes: Array) -> Array:
    """Return the rounding of the diagonal of Phi^T D^T diag(c) D Phi, (..., m): dampers of both signs may cancel."""
    terms = np.abs(rows @ shapes) * (np.abs(rows) @ np.abs(shapes))
    return np.asarray(4.0 * EPS * np.einsum("...s,...sm->...m", np.abs(damping), terms))


def classical_errors(pairs: Complex, basis: Undamped, gamma: Array, sum_rounding: Array | None) -> Array:
    """Return the relative errors of the roots, to first order: those of omega, of gamma, and of gamma's own sum."""
    size, gap = np.abs(pairs), np.abs(pairs[:, 0] - pairs[:, 1])[:, None]
    sensitivity = 2.0 * np.abs(basis.square) + np.abs(gamma) * np.maximum(size[:, 0], size[:, 1])
    # stiffness of both signs may cancel to an omega of exactly zero, whose relative error is not finite
    error = np.multiply(basis.errors, sensitivity, out=np.zeros(len(sensitivity)), where=sensitivity > 0.0)[:, None]
    if sum_rounding is not None:
        error = error + sum_rounding[:, None] * size
    # a root moves by spread / gap, at critical damping with the square root of a perturbation
    weight = np.maximum(gap, np.sqrt(error)) * size
    relative: Array = np.divide(error, weight, out=np.zeros(size.shape), where=weight > 0.0)
    relative += 2.0 * EPS * (size > 0.0)
    return relative
