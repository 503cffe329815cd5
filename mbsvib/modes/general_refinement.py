"""Right and left vectors and eigenvalues improved on the factors, with bounds of what is left.

y^T T(lambda) x / y^T T'(lambda) x with T = lambda^2 M + lambda C + K is stationary in both vectors: it squares their
errors. What vectors lack follows from their residual through the resolvent, the sum over all eigenvalues of
x y^T / (y^T T' x (s - lambda)), without any factorisation. Products are formed from the factors of M, C and K and
from the parts that have none, so that no digit is lost which they have.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.modes.energy_state import EnergyState


ROUNDS = 3
# Corrections of vectors by less leave errors that are squares of it.
SETTLED = 1e-9
# Vectors share what they do if the quotient of residual and distance is larger: eigenvalues that rounding moves as one;
# beside a neighbour nearer than this share of the eigenvalue, already if it is larger than the last.
MIXED = 0.1
NEIGHBOUR = 1e-3
MERGING = 1e-4
# Residuals that vectors of unit energy see of each other by rounding alone: where a defective pair is near, they would
# be blown up, and elsewhere they do not count.
NOISE = 16.0 * EPS
# Rounding of the forms, in parts of eps times the sum of their terms' sizes; calibrated in the tests.
ROUNDING = 2.0
# A step larger than this share of the eigenvalue is no correction of rounding.
CORRECTION = 1e-2
# A real part that is smaller than its error, and than this share of the eigenvalue, is none.
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
    turns: NDArray[np.bool_]
    kind: str = ""
    axis: NDArray[np.bool_] | None = None
    slopes: Complex = field(default_factory=lambda: np.zeros(0, dtype=complex))
    errors: Array = field(default_factory=lambda: np.zeros(0))

    def whole(self) -> tuple[Complex, Complex, Complex, Complex]:
        """Return values, right and left vectors and slopes of all eigenvalues but 0, conjugates behind."""
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

    Parameters
    ----------
    system : Equations
        The equations of motion.
    state : EnergyState
        What belongs to eigenvalues 0.
    start : Spectrum
        Eigenvalues and vectors, roughly.

    Returns
    -------
    Spectrum
        The same with slopes and error bounds.

    Source: Tisseur & Meerbergen, SIAM Review 43 (2001), for the resolvent of quadratic eigenvalue problems.
    """
    w = system.inertia_factor
    factors = _Factors(w[w.any(axis=1)], system.elastic_rows, system.stiffness, system.damping, system.gyroscopic,
                       system.circulatory)  # fmt: skip
    found = start
    if not len(found.values):
        return found
    for _ in range(ROUNDS):
        found, mixed = _improved(factors, state, found)
        if mixed < SETTLED:
            break
    errors = _bounds(factors, state, found)
    values = found.values.copy()
    # rounding must not tell whether a motion that no damper feels grows or decays
    values.real[found.turns & (np.abs(values.real) <= np.minimum(errors, UNTOLD) * np.abs(values))] = 0.0
    return replace(found, values=values, errors=errors)


def _products(f: _Factors, left: Any, right: Any) -> tuple[Any, Any, Any]:
    """left^T (M, C, K) right for all columns with all."""
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
    each = dl * dr
    c, k = f.c @ each, f.k @ each
    if f.g is not None:
        c = c + np.einsum("ij,ij->j", left, f.g @ right)
    if f.n is not None:
        k = k + np.einsum("ij,ij->j", left, f.n @ right)
    return np.einsum("ij,ij->j", wl, wr), c, k


def _axis(found: Spectrum) -> NDArray[np.bool_]:
    if found.kind == "hermitian":
        return found.turns
    return np.zeros(len(found.values), dtype=bool) if found.axis is None else found.axis


def _quotients(f: _Factors, found: Spectrum) -> Spectrum:
    """Eigenvalues by Newton steps on their own quadratics; vectors of unit size in energy, slopes with them."""
    on = _axis(found)
    found = replace(found, right=_sized(f, found.values, found.right), left=_sized(f, found.values, found.left))
    value = found.values
    a, b, c = _forms(f, found.left, found.right)
    for _ in range(2):
        slope = 2.0 * value * a + b
        step = np.divide(value * (value * a + b) + c, slope, out=np.zeros_like(slope), where=slope != 0.0)
        new = np.where(np.abs(step) <= CORRECTION * np.abs(value), value - step, value)
        new.real[on] = 0.0
        new.imag[~found.turns] = 0.0
        value = new
    return replace(found, values=value, slopes=2.0 * value * a + b)


def _sized(f: _Factors, values: Complex, vectors: Complex) -> Complex:
    """Vectors of unit energy."""
    speed, felt = np.abs(values), np.abs(f.d @ vectors) ** 2
    size = np.linalg.norm(f.w @ vectors, axis=0) ** 2 * speed**2 + np.abs(f.k) @ felt + speed * (np.abs(f.c) @ felt)
    if f.g is not None:  # a massless motion that spin alone holds
        size += speed * np.einsum("ij,ij->j", np.abs(vectors), np.abs(f.g @ vectors))
    return np.asarray(vectors / np.sqrt(size))


def _improved(f: _Factors, state: EnergyState, found: Spectrum) -> tuple[Spectrum, float]:
    """One round: eigenvalues, then both vectors by what all others see of their residuals; and how much that was."""
    found = _quotients(f, found)
    values, right, left, slopes = found.whole()
    x, y, h = found.right, found.left, np.arange(len(found.values))
    distance = found.values - values[:, None]
    m, c, k = _products(f, left, x)
    share = found.values * (found.values * m + c) + k
    beside = np.abs(distance) < NEIGHBOUR * np.abs(found.values)
    mixing = _mixing(share, slopes[:, None] * distance, h, beside)
    mixed = float(np.abs(mixing).max(initial=0.0))
    x = x - right @ mixing - _still(state, f, found, transposed=False)
    if found.kind == "hermitian":
        y = x.conj()
    else:
        m, c, k = (part.T for part in _products(f, y, right))
        share = found.values * (found.values * m + c) + k
        mixing = _mixing(share, slopes[:, None] * distance, h, beside)
        mixed = max(mixed, float(np.abs(mixing).max(initial=0.0)))
        y = y - left @ mixing - _still(state, f, found, transposed=True)
        on = _axis(found)
        y[:, on] = x[:, on].conj()
    return _quotients(f, replace(found, right=x, left=y)), mixed


def _mixing(share: Complex, distance: Complex, own: NDArray[np.intp], beside: NDArray[np.bool_]) -> Complex:
    """How much of each eigenvector (row) is in the others (column)."""
    near = np.abs(share) >= np.where(beside, MERGING, MIXED) * np.abs(distance)
    near |= np.abs(share) <= NOISE
    near[own, own] = True
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


def _still(state: EnergyState, f: _Factors, found: Spectrum, transposed: bool) -> Complex:
    """What the eigenvalues 0 add to the corrections of the vectors."""
    if not state.right.shape[1]:
        return np.zeros_like(found.right)
    shapes, seen, j = state.show @ state.right, state.force.T @ state.left, state.nilpotent
    if transposed:
        shapes, seen, j = seen, shapes, j.T
    term = (seen.T @ _residual(f, found.values, found.left if transposed else found.right, transposed)) / found.values
    result = term.copy()
    for _ in range(len(j)):
        term = (j @ term) / found.values
        result = result + term
        if not term.any():
            break
    return np.asarray(shapes @ result)


def _bounds(f: _Factors, state: EnergyState, found: Spectrum) -> Array:
    """Relative errors: what vectors may still lack, to second order, and rounding of the forms."""
    values, right, left, slopes = found.whole()
    speed = np.abs(found.values)
    ml, cl, kl = _products(f, left, found.right)
    mr, cr, kr = (part.T for part in _products(f, found.left, right))
    one = found.values * (found.values * ml + cl) + kl
    two = found.values * (found.values * mr + cr) + kr
    both = np.abs(one * two)
    h = np.arange(len(found.values))
    weight = np.abs(slopes[:, None] * found.slopes)
    gap = np.abs(found.values - values[:, None])
    both[h, h] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = both / (weight * gap)
        met = np.sqrt(both / weight)
        move = np.where(both > 0.0, np.fmin(apart, met), 0.0)
    rounding = _rounding(f, found, state.doubt)
    own = np.abs(one[h, h])
    slope = np.abs(found.slopes)
    total = np.divide(own + rounding, slope, out=np.full_like(slope, np.inf), where=slope > 0.0) + move.sum(axis=0)
    return np.asarray(np.minimum(total / speed, 1.0))


def _rounding(f: _Factors, found: Spectrum, doubt: float) -> Array:
    x, y, speed = found.right, found.left, np.abs(found.values)
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
    return np.asarray(ROUNDING * EPS * total + doubt * plain)
