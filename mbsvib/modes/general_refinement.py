"""Refinement of right and left vectors and eigenvalues on the factors, with error bounds.

y^T T(lambda) x / y^T T'(lambda) x with T = lambda^2 M + lambda C + K is stationary in both vectors: its error is of
second order in theirs. The corrections of the vectors follow from their residuals through the resolvent, the sum over
all eigenvalues of x y^T / (y^T T' x (s - lambda)), without any factorisation. Products are formed from the factors of
M, C and K, and from the parts that have no factors, so that no digits are lost.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.equations.equations import Equations
from mbsvib.linalg.rank import EPS
from mbsvib.modes.energy_state import EnergyState
from mbsvib.modes.pairs import with_neighbours, within_reach

ROUNDS = 3
# Refinement stops after a correction smaller than this: the remaining error is its square.
CONVERGED = 1e-9
# Corrections of vectors that dampers make nearly dependent may be less accurate than these: one that makes the bound of
# an eigenvalue larger than this many times is not taken. Below, bounds differ by rounding.
WORSE = 2.0
# Vectors are not corrected by each other if the quotient of residual and distance is larger than this: they belong to a
# cluster.
MIXED = 0.1
# Vectors in the resolvent are as inexact as those whose errors it bounds: these errors are up to twice as large.
INEXACT = 2.0
# The same for eigenvalues that are closer than the first number, a share of the eigenvalue.
NEIGHBOUR, MERGING = 1e-3, 1e-4
# Projected residuals of vectors of unit energy that are rounding. Near a defective pair they would be amplified;
# elsewhere they are negligible.
NOISE = 16.0 * EPS
# Rounding of the forms, in parts of eps times the sum of their terms' sizes; calibrated in the tests.
ROUNDING = 2.0
# A Newton step larger than this share of the eigenvalue does not correct rounding errors and is rejected.
CORRECTION = 1e-2
# A real part that is smaller than its error, and than this share of the eigenvalue, is set to 0.
UNTOLD = 1e-14


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Eigenvalues ``values`` (h,) but 0, of conjugate pairs (``turns``) the one with positive imaginary part, with
    ``right`` and ``left`` vectors x and y (m, h), ``slopes`` (h,) y^T (2 lambda M + C) x and relative ``errors`` (h,).

    ``kind`` is "hermitian" where y is the conjugate of x for all, and ``axis`` (h,) marks those which are imaginary for
    that reason.
    """

    values: Complex
    right: Complex
    left: Complex
    turns: Bools
    kind: str = ""
    axis: Bools | None = None
    slopes: Complex = field(default_factory=lambda: np.zeros(0, dtype=complex))
    errors: Array = field(default_factory=lambda: np.zeros(0))

    def complete(self) -> tuple[Complex, Complex, Complex, Complex]:
        """Return values, right and left vectors and slopes of all eigenvalues but 0, with conjugates last."""
        parts = (self.values, self.right, self.left, self.slopes)
        values, right, left, slopes = (np.concatenate((a, a[..., self.turns].conj()), axis=-1) for a in parts)
        return values, right, left, slopes


@dataclass(frozen=True, slots=True)
class _Factors:
    w: Array
    d: Array
    k: Array
    c: Array
    g: Array | None
    n: Array | None


def refined(system: Equations, state: EnergyState, start: Spectrum) -> Spectrum:
    """Return eigenvalues and vectors improved on the factors.

    ``start`` holds approximate eigenvalues and vectors; the result also has slopes and error bounds.

    Source: Tisseur & Meerbergen, SIAM Review 43 (2001), for the resolvent of quadratic eigenvalue problems.
    """
    w = system.inertia_factor
    factors = _Factors(w[w.any(axis=1)], system.elastic_rows, system.row_stiffness, system.row_damping,
                       system.gyroscopic, system.circulatory)  # fmt: skip
    eigen = start
    if not len(eigen.values):
        return eigen
    eigen = _quotients(factors, eigen)
    errors = _bounds(factors, state, eigen)
    for _ in range(ROUNDS):
        new, mixed = _improved(factors, state, eigen)
        new_errors = _bounds(factors, state, new)
        better = new_errors <= WORSE * errors
        eigen = _chosen(better, new, eigen)
        errors = new_errors if better.all() else _bounds(factors, state, eigen)
        if mixed < CONVERGED or not better.any():
            break
    values = eigen.values.copy()
    # rounding must not decide whether an undamped motion grows or decays
    values.real[eigen.turns & (np.abs(values.real) <= np.minimum(errors, UNTOLD) * np.abs(values))] = 0.0
    return replace(eigen, values=values, errors=errors)


def _chosen(mask: Bools, new: Spectrum, old: Spectrum) -> Spectrum:
    """The eigenvalues, vectors and slopes of ``new`` where the mask says so, else those of ``old``."""
    parts = {key: np.where(mask, getattr(new, key), getattr(old, key)) for key in ("values", "right", "left", "slopes")}
    return replace(old, **parts)


def _products(f: _Factors, left: Any, right: Any) -> tuple[Any, Any, Any]:
    """left^T (M, C, K) right, for all pairs of columns."""
    wl, wr, dl, dr = f.w @ left, f.w @ right, f.d @ left, f.d @ right
    c, k = (dl * f.c[:, None]).T @ dr, (dl * f.k[:, None]).T @ dr
    if f.g is not None:
        c = c + left.T @ (f.g @ right)
    if f.n is not None:
        k = k + left.T @ (f.n @ right)
    return wl.T @ wr, c, k


def _forms(f: _Factors, left: Any, right: Any) -> tuple[Any, Any, Any]:
    """y^T (M, C, K) x, column by column."""
    wl, wr, dl, dr = f.w @ left, f.w @ right, f.d @ left, f.d @ right
    products = dl * dr
    c, k = f.c @ products, f.k @ products
    if f.g is not None:
        c = c + np.einsum("ij,ij->j", left, f.g @ right)
    if f.n is not None:
        k = k + np.einsum("ij,ij->j", left, f.n @ right)
    return np.einsum("ij,ij->j", wl, wr), c, k


def _axis(eigen: Spectrum) -> Bools:
    if eigen.kind == "hermitian":
        return eigen.turns
    return np.zeros(len(eigen.values), dtype=bool) if eigen.axis is None else eigen.axis


def _quotients(f: _Factors, eigen: Spectrum) -> Spectrum:
    """Eigenvalues by Newton steps on their own quadratics; vectors of unit size in energy, slopes with them."""
    on = _axis(eigen)
    eigen = replace(eigen, right=_sized(f, eigen.values, eigen.right), left=_sized(f, eigen.values, eigen.left))
    value = eigen.values
    a, b, c = _forms(f, eigen.left, eigen.right)
    for _ in range(2):
        slope = 2.0 * value * a + b
        step = np.divide(value * (value * a + b) + c, slope, out=np.zeros_like(slope), where=slope != 0.0)
        new = np.where(np.abs(step) <= CORRECTION * np.abs(value), value - step, value)
        new.real[on] = 0.0
        new.imag[~eigen.turns] = 0.0
        value = new
    return replace(eigen, values=value, slopes=2.0 * value * a + b)


def _sized(f: _Factors, values: Complex, vectors: Complex) -> Complex:
    """Vectors of unit energy."""
    speed, squared_motion = np.abs(values), np.abs(f.d @ vectors) ** 2
    size = np.linalg.norm(f.w @ vectors, axis=0) ** 2 * speed**2 + np.abs(f.k) @ squared_motion
    size += speed * (np.abs(f.c) @ squared_motion)
    if f.g is not None:  # a massless motion that only spin resists
        size += speed * np.einsum("ij,ij->j", np.abs(vectors), np.abs(f.g @ vectors))
    return np.asarray(vectors / np.sqrt(size))


def _improved(f: _Factors, state: EnergyState, eigen: Spectrum) -> tuple[Spectrum, float]:
    """One iteration: eigenvalues, then both vectors by projections of their residuals; and the largest correction."""
    values, right, left, slopes = eigen.complete()
    x, y, h = eigen.right, eigen.left, np.arange(len(eigen.values))
    distance = eigen.values - values[:, None]
    m, c, k = _products(f, left, x)
    share = eigen.values * (eigen.values * m + c) + k
    close_pairs = np.abs(distance) < NEIGHBOUR * np.abs(eigen.values)
    mixing = _mixing(share, slopes[:, None] * distance, h, close_pairs)
    mixed = float(np.abs(mixing).max(initial=0.0))
    x = x - right @ mixing - _still(state, f, eigen, transposed=False)
    if eigen.kind == "hermitian":
        y = x.conj()
    else:
        m, c, k = (part.T for part in _products(f, y, right))
        share = eigen.values * (eigen.values * m + c) + k
        mixing = _mixing(share, slopes[:, None] * distance, h, close_pairs)
        mixed = max(mixed, float(np.abs(mixing).max(initial=0.0)))
        y = y - left @ mixing - _still(state, f, eigen, transposed=True)
        on = _axis(eigen)
        y[:, on] = x[:, on].conj()
    return _quotients(f, replace(eigen, right=x, left=y)), mixed


def _mixing(share: Complex, distance: Complex, index: Index, close_pairs: Bools) -> Complex:
    """Share of each eigenvector (row) in the others (column)."""
    near = np.abs(share) >= np.where(close_pairs, MERGING, MIXED) * np.abs(distance)
    near |= np.abs(share) <= NOISE
    near[index, index] = True
    return np.divide(share, distance, out=np.zeros_like(share), where=~near)


def _residual(f: _Factors, s: Complex, x: Complex, transposed: bool) -> Complex:
    """T(s) x or T(s)^T x, column by column."""
    wx, dx = f.w @ x, f.d @ x
    sign = -1.0 if transposed else 1.0
    result = f.w.T @ (wx * s * s) + f.d.T @ (dx * (f.c[:, None] * s + f.k[:, None]))
    if f.g is not None:
        result = result + sign * (f.g @ x) * s
    if f.n is not None:
        result = result + sign * (f.n @ x)
    return np.asarray(result)


def _still(state: EnergyState, f: _Factors, eigen: Spectrum, transposed: bool) -> Complex:
    """Contribution of the eigenvalues 0 to the corrections of the vectors."""
    if not state.right.shape[1]:
        return np.zeros_like(eigen.right)
    shapes, forces, j = state.show @ state.right, state.force.T @ state.left, state.nilpotent
    if transposed:
        shapes, forces, j = forces, shapes, j.T
    residual = _residual(f, eigen.values, eigen.left if transposed else eigen.right, transposed)
    return np.asarray(shapes @ _at_zero(j, forces.T @ residual, eigen.values))


def _at_zero(nilpotent: Array, forces: Complex, values: Complex) -> Complex:
    """(lambda - J)^-1 forces, column by column."""
    term = forces / values
    result = term.copy()
    for _ in range(len(nilpotent)):
        term = (nilpotent @ term) / values
        result = result + term
        if not term.any():
            break
    return result


def _still_moves(f: _Factors, state: EnergyState, eigen: Spectrum) -> Array:
    """How much the eigenvalues 0 move y^T T x, at most."""
    if not state.right.shape[1]:
        return np.zeros(len(eigen.values))
    ahead = (state.force.T @ state.left).T @ _residual(f, eigen.values, eigen.right, transposed=False)
    back = (state.show @ state.right).T @ _residual(f, eigen.values, eigen.left, transposed=True)
    moved = _at_zero(np.abs(state.nilpotent), np.abs(ahead), np.abs(eigen.values))
    return np.asarray((np.abs(back) * moved).sum(axis=0))


def _bounds(f: _Factors, state: EnergyState, eigen: Spectrum) -> Array:
    """Relative errors: those of the vectors, to second order, and rounding of the forms."""
    values, right, left, slopes = eigen.complete()
    speed = np.abs(eigen.values)
    ml, cl, kl = _products(f, left, eigen.right)
    mr, cr, kr = (part.T for part in _products(f, eigen.left, right))
    left_form = eigen.values * (eigen.values * ml + cl) + kl
    right_form = eigen.values * (eigen.values * mr + cr) + kr
    coupling = np.abs(left_form * right_form)
    h = np.arange(len(eigen.values))
    weight = np.abs(slopes[:, None] * eigen.slopes)
    gap = np.abs(eigen.values - values[:, None])
    coupling[h, h], gap[h, h] = 0.0, np.inf
    with np.errstate(divide="ignore", invalid="ignore"):
        separated = coupling / (weight * gap)
        met = np.sqrt(coupling / weight)
        move = np.where(coupling > 0.0, np.fmin(separated, met), 0.0)
    # vectors of equal eigenvalues need not be at right angles: others that contain one of them feel the next
    root = np.sqrt(np.maximum(np.abs(eigen.slopes), np.finfo(float).tiny))
    angles = np.abs((eigen.values[:, None] + eigen.values) * ml[: len(h)] + cl[: len(h)]) / root[:, None] / root
    np.fill_diagonal(angles, 0.0)
    ahead, back = (_contents(np.abs(form[: len(h)]) / root[:, None] / root, gap[: len(h)])
                   for form in (left_form, right_form))  # fmt: skip
    rounding = _rounding(f, eigen, state.uncertainty)
    diagonal = np.abs(left_form[h, h]) + _still_moves(f, state, eigen)
    slope = np.abs(eigen.slopes)
    total = np.divide(diagonal + rounding, slope, out=np.full_like(slope, np.inf), where=slope > 0.0)
    total += INEXACT * move.sum(axis=0) + (back * (angles @ ahead)).sum(axis=0)
    errors = with_neighbours(speed, total / speed, gap[: len(h)])
    # near an eigenvalue for which Newton's step has not converged, the distance to it is uncertain
    reach = np.where(errors > CORRECTION, INEXACT * errors * speed, 0.0)
    return np.minimum(np.maximum(errors, within_reach(eigen.values, np.minimum(errors, 1.0), reach)), 1.0)


def _contents(share: Array, gap: Array) -> Array:
    """How much of each vector (row) is in the others (column), times the root of the distance of the eigenvalues."""
    np.fill_diagonal(share, 0.0)
    return share / np.sqrt(np.maximum(np.maximum(gap, share), np.finfo(float).tiny))


def _rounding(f: _Factors, eigen: Spectrum, uncertainty: float) -> Array:
    x, y, speed = eigen.right, eigen.left, np.abs(eigen.values)
    ax, ay = np.abs(x), np.abs(y)
    w, d = np.abs(f.w), np.abs(f.d)
    wx, wy, dx, dy = (np.abs(rows @ v) for rows, v in ((f.w, x), (f.w, y), (f.d, x), (f.d, y)))
    inertia = wy * (w @ ax) + (w @ ay) * wx
    elastic = dy * (d @ ax) + (d @ ay) * dx
    k, c = np.abs(f.k), np.abs(f.c)
    total = speed**2 * inertia.sum(axis=0) + speed * (c @ elastic) + k @ elastic
    plain = speed**2 * (wx * wy).sum(axis=0) + speed * (c @ (dx * dy)) + k @ (dx * dy)
    if f.g is not None:
        total = total + speed * np.einsum("ij,ij->j", ay, np.abs(f.g) @ ax)
    if f.n is not None:
        total = total + np.einsum("ij,ij->j", ay, np.abs(f.n) @ ax)
    return np.asarray(ROUNDING * EPS * total + uncertainty * plain)
