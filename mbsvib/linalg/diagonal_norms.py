"""The least norm of D M D^-1 over positive diagonal D: a bound of mu for diagonal complex blocks, in any units.

mu(M) = 1 / min {max_i |delta_i| : det(1 - M diag(delta)) = 0} <= min_D |D M D^-1|,  equal for up to three blocks

log |D M D^-1| is convex in log d. Where the largest singular value is a single one, with vectors u and v, its slopes
are |u_i|^2 - |v_i|^2; where all of these are 0, D is best. Where several meet, interior points find it.

Source: M. G. Safonov, IEE Proc. D 129 (1982) 251; J. C. Doyle, IEE Proc. D 129 (1982) 242.
"""

from __future__ import annotations

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.structured_norms import balance, best_scalings, scaled

STEPS, HALVINGS, FLAT = 20, 12, 1e-7  # of Newton's method; slopes that are 0
NONE, LONGEST = 1e-12, 2.0  # share of the largest curvature that is none, as along (1, 1, ...); step of a logarithm
HIGHEST = 1.0 - 1e-9  # share of the largest of some norms from which on a norm is searched for


def scaled_norms(m: Complex, d: Array) -> Array:
    """Return |D M D^-1| (points,) of matrices (points, n, n) with d (n,) or (points, n)."""
    return np.asarray(np.linalg.svd(scaled(m, d), compute_uv=False)[:, 0])


def highest_norms(m: Complex) -> Array:
    """Return min_D |D M D^-1| (points,) where it may be the highest of all points, else bounds that are below that."""
    if m.shape[1] == 1:
        return np.asarray(np.abs(m[:, 0, 0]))
    m = _cyclic(m)
    result = np.linalg.norm(m, axis=(1, 2))
    reached = float(np.abs(np.einsum("pii->pi", m)).max(initial=0.0))  # D changes no diagonal entry
    high = np.flatnonzero(result > reached)
    even = scaled(m[high], balance(m[high], np.eye(m.shape[1])))
    value = scaled_norms(even, np.ones(m.shape[1]))
    if len(high) and m.shape[1] > 2:  # balanced matrices of two rows have the least norm
        top = int(value.argmax())  # what is best for the highest one is good for those about it
        best, d, _ = _least(even[[top]])
        value, reached = np.minimum(value, scaled_norms(even, d[0])), max(reached, HIGHEST * float(best[0]))
        left = np.flatnonzero(value > reached)
        x, found = _newton(even[left] / value[left, None, None])
        value[left] = np.minimum(value[left], scaled_norms(even[left], np.exp(x)))
        reached = max(reached, float(value[left[found]].max(initial=0.0)))
        left = left[~found & (value[left] > reached)]
        value[left] = np.minimum(value[left], _least(even[left], met=True)[0])
    result[high] = value
    return np.asarray(result)


def diagonal_norms(m: Complex) -> tuple[Array, Array, Complex]:
    """Return min_D |D M D^-1| (points,) of matrices (points, n, n), their d (points, n) and their slopes.

    Slopes W (points, n, n): d norm = Re tr(W dM). They count singular values that meet as the least norm does.
    """
    m = _cyclic(m)
    d = balance(m, np.eye(m.shape[1]))
    value, factors, slopes = _least(scaled(m, d))
    d = d * factors
    return value, d, scaled(slopes, 1.0 / d)


def _least(m: Complex, met: bool = False) -> tuple[Array, Array, Complex]:
    """The same of balanced matrices, with the slopes of D M D^-1; ``met``: where singular values are known to meet."""
    norm = np.linalg.norm(m, 2, axis=(1, 2))
    some = norm > 0.0
    unit = m / np.where(some, norm, 1.0)[:, None, None]
    d, found = np.ones(m.shape[:2]), ~some
    if some.any() and not met:
        x, found[some] = _newton(unit[some])
        d[some] = np.exp(x)
    u, size, vh = np.linalg.svd(scaled(unit, d))
    value, slopes = size[:, 0].copy(), vh[:, 0].conj()[:, :, None] * u[:, None, :, 0].conj()
    rest = ~found
    if rest.any():
        value[rest], d[rest], slopes[rest] = best_scalings(unit[rest])
    return value * norm, d, slopes


def _cyclic(m: Complex) -> Complex:
    """Matrices (points, n, n) without entries that are in no cycle: no determinant depends on them."""
    linked = m != 0.0
    some = ~linked.all(axis=(1, 2))
    if not some.any():
        return m
    reach = linked[some] | np.eye(m.shape[1], dtype=bool)
    for _ in range(int(np.ceil(np.log2(m.shape[1])))):
        reach = reach @ reach
    result = m.copy()
    result[some] = np.where(reach & reach.swapaxes(1, 2), m[some], 0.0)
    return result


def _newton(m: Complex) -> tuple[Array, Bools]:
    """ln d (points, n) of least norms of balanced matrices, and where these are found: not where singular values meet.
    """
    x, found, left = np.zeros(m.shape[:2]), np.zeros(len(m), dtype=bool), np.arange(len(m))
    value, slope, curvature = _derivatives(m)
    for _ in range(STEPS):
        flat = np.abs(slope).max(axis=1, initial=0.0) <= FLAT
        found[left[flat]] = True
        left, value, slope, curvature = left[~flat], value[~flat], slope[~flat], curvature[~flat]
        if not len(left):
            break
        rate, axes = np.linalg.eigh(curvature)
        along, curved = np.einsum("pij,pi->pj", axes, slope), rate > NONE * rate[:, -1:]
        step = -np.einsum("pij,pj->pi", axes, np.where(curved, along, 0.0) / np.where(curved, rate, 1.0))
        step /= np.maximum(1.0, np.abs(step).max(axis=1, keepdims=True) / LONGEST)
        lower = np.zeros(len(left), dtype=bool)
        for _ in range(HALVINGS):
            again = np.flatnonzero(~lower)
            after = _derivatives(scaled(m[left[again]], np.exp(x[left[again]] + step[again])))
            less = after[0] < value[again]
            at = again[less]
            value[at], slope[at], curvature[at] = (part[less] for part in after)
            lower[at] = True
            if less.all():
                break
            step[~lower] *= 0.5
        x[left[lower]] += step[lower]
        left, value, slope, curvature = left[lower], value[lower], slope[lower], curvature[lower]
    return x, found


def _derivatives(m: Complex) -> tuple[Array, Array, Array]:
    """ln |D M D^-1| (points,), its gradient (points, n) and second derivatives (points, n, n) to ln d at d = 1.

    They are those of the largest eigenvalue of A = E^-1 M^H E^2 M E^-1, E = D.
    """
    u, size, vh = np.linalg.svd(m)
    adjoint = m.conj().swapaxes(1, 2)
    first, v, square = u[:, :, 0], vh[:, 0].conj(), size**2
    output, source = np.abs(first) ** 2, np.abs(v) ** 2
    within = v.conj()[:, :, None] * (adjoint @ m) * v[:, None, :]
    across = (v.conj()[:, :, None] * adjoint * (size[:, :1] * first)[:, None, :]).real
    second = 2.0 * within.real - 4.0 * (across + across.swapaxes(1, 2))
    second += 2.0 * square[:, :1, None] * (source + 2.0 * output)[:, :, None] * np.eye(m.shape[1])
    others = 2.0 * (size[:, :1] * size[:, 1:])[:, None] * first.conj()[:, :, None] * u[:, :, 1:]
    others = others - (square[:, :1] + square[:, 1:])[:, None] * v.conj()[:, :, None] * vh[:, 1:].conj().swapaxes(1, 2)
    gap = np.maximum(square[:, :1] - square[:, 1:], EPS * square[:, :1])[:, None]
    second = second + 2.0 * ((others / gap) @ others.conj().swapaxes(1, 2)).real
    slope = output - source
    return np.log(size[:, 0]), slope, 0.5 * second / square[:, :1, None] - 2.0 * slope[:, :, None] * slope[:, None, :]
