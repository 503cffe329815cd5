"""Structured singular values: bounds by scalings D and G, found by interior points.

Source: E. E. Osborne, J. ACM 7 (1960) 338, for balancing; those of ``isolation.structured_singular_values``.
"""

from __future__ import annotations

import numpy as np

from mbsvib.common.arrays import Array, Complex

_GAP = 1e-7  # of the squared bound: the scalings leave no more than this much below the level
_ZERO = 1e-12  # squared bound of a matrix of norm 1 that is as good as zero
_STEPS = 600  # of Newton's method, for all levels together; 60 to 150 are usual
_SPARE, _CENTRING = 1e-6, 10  # level above the least, at which multipliers are centred by so many steps
_CENTRED = 0.3  # Newton decrement below which scalings are near enough to the centre for the next level
_SHARE = 0.1  # of the way down to the bound of these scalings that the next level leaves
_LARGEST = 1e4  # of G for matrices of norm 1; more helps real parameters only where mu is next to its jump
_SWEEPS, _EVEN = 30, 1e-3  # of balancing, which ends when no factor changes by more
_RIDGE = 1e-14  # added to second derivatives of unit diagonal, which rounding may leave singular


def structured_norms(m: Complex, masks: Array, real: list[int]) -> Array:
    """Return bounds (points,) for matrices (points, n, n) of any size, whose blocks all act on each other.

    ``masks`` (blocks, n): 1 where an entry belongs to a block; ``real``: numbers of blocks that are real parameters.
    """
    size = np.abs(m).max(axis=(1, 2))
    result, nonzero = np.zeros(len(m)), size > 0.0
    if nonzero.any():
        normal = scaled(m[nonzero] / size[nonzero, None, None], balance(m[nonzero], masks) @ masks)
        norm = np.linalg.norm(normal, 2, axis=(1, 2))
        result[nonzero] = _bounds(normal / norm[:, None, None], masks, real)[0] * norm * size[nonzero]
    return result


def best_scalings(m: Complex) -> tuple[Array, Array, Complex]:
    """Return the least norms of D M D^-1 of matrices of norm 1 (points, n, n), diagonal d, and slopes of D M D^-1.

    W = Z N^H / tr(Z N^H N) of N = D M D^-1, with the multipliers Z of level - N^H N > 0.
    """
    masks = np.eye(m.shape[1])
    x = _bounds(m, masks, [])[1]
    d = np.sqrt(x)
    bound = np.linalg.norm(scaled(m, d), 2, axis=(1, 2))
    forms, weight = _slopes(m, masks, [])
    level = np.maximum(bound**2 * (1.0 + _SPARE), _ZERO)[:, None, None, None] * weight - forms
    for _ in range(_CENTRING):
        step, decrement = _newton(*_derivatives(x, level, len(masks)))
        x = x + step / (1.0 + decrement)[:, None]
    room = np.einsum("pv,pvij->pij", x, level)
    slopes = np.asarray(np.linalg.solve(room, _adjoint(m) * x[:, None]), dtype=complex)
    slopes *= (bound / np.einsum("pij,pji->p", slopes, m).real)[:, None, None]
    return bound, d, scaled(slopes, d)


def balance(m: Complex, masks: Array) -> Array:
    """Return factors d (points, blocks) by which rows and columns of each block have the same norm outside of it, by
    Osborne's iteration.
    """
    size = np.abs(m)
    largest = size.max(axis=(1, 2), keepdims=True, initial=0.0)
    power = masks @ (size / np.where(largest > 0.0, largest, 1.0)) ** 2 @ masks.T
    count = np.arange(len(masks))
    power[:, count, count] = 0.0
    result = np.ones(power.shape[:2])
    for _ in range(_SWEEPS):
        before = result.copy()
        for k in count.tolist():
            row, column = power[:, k].sum(axis=1), power[:, :, k].sum(axis=1)
            ratio = np.ones(len(m))
            np.divide(column, row, out=ratio, where=(row > 0.0) & (column > 0.0))
            factor = np.sqrt(ratio)
            power[:, k] *= factor[:, None]
            power[:, :, k] /= factor[:, None]
            result[:, k] *= np.sqrt(factor)
        if (np.abs(result - before) <= _EVEN * before).all():
            break
    return result


def scaled(m: Complex, d: Array) -> Complex:
    """Return D M D^-1."""
    return np.asarray(d[..., :, None] * m / d[..., None, :])


def _bounds(m: Complex, masks: Array, real: list[int]) -> tuple[Array, Array]:
    """The least beta for matrices of norm 1 (points, n, n), never below the infimum, and x = (d, g) that prove it.

    Centres of {D, G : N(D, G) < level D, 0 < D < 1, |G| < L} by damped Newton steps, which stay inside; from each
    centre the level is lowered, until no room is left.
    """
    count = len(masks)
    slopes, weight = _slopes(m, masks, real)
    x = np.tile(np.concatenate((np.full(count, 0.5), np.zeros(len(real)))), (len(m), 1))
    level, best, proof = np.full(len(m), 2.0), np.ones(len(m)), x.copy()
    at = np.arange(len(m))
    for _ in range(_STEPS):
        if not len(at):
            break
        step, decrement = _newton(*_derivatives(x[at], level[at, None, None, None] * weight - slopes[at], count))
        after = x[at] + step / (1.0 + decrement)[:, None]
        bound = _level(after, slopes[at], masks)
        inside = (bound < level[at]) & (after[:, :count] < 1.0).all(axis=1)  # always, but for rounding
        inside &= (np.abs(after[:, count:]) < _LARGEST).all(axis=1)
        x[at[inside]], bound = after[inside], np.where(inside, bound, level[at])
        better = bound < best[at]
        best[at[better]], proof[at[better]] = bound[better], x[at[better]]
        centred = decrement < _CENTRED
        room = level[at] - bound
        done = ~inside | (centred & (room <= _GAP * level[at])) | (bound < _ZERO)
        level[at] = np.where(centred, bound + _SHARE * room, level[at])
        at = at[~done]
    return np.sqrt(np.maximum(best, 0.0)), proof


def _slopes(m: Complex, masks: Array, real: list[int]) -> tuple[Complex, Array]:
    """Derivatives of N = M* D M + i (G M - M* G) and of D to the entries d, g: (points, variables, n, n)."""
    units = masks[:, :, None] * np.eye(m.shape[1])
    turned = 1j * (units[real] @ m[:, None])
    slopes = np.concatenate((_adjoint(m)[:, None] @ units @ m[:, None], turned + _adjoint(turned)), axis=1)
    return slopes, np.concatenate((units, np.zeros_like(units[real])))


def _derivatives(x: Array, slopes: Complex, count: int) -> tuple[Array, Array]:
    """Gradient and Hessian of -log det(level D - N) - log det D (1 - D) - log det(L^2 - G^2) at x = (d, g)."""
    values, vectors = np.linalg.eigh(np.einsum("pv,pvij->pij", x, slopes))
    values = np.maximum(values, np.finfo(float).eps * values[:, -1:])
    root = (vectors / np.sqrt(values)[:, None])[:, None]  # R with R R* the inverse
    parts = _adjoint(root) @ slopes @ root
    flat = parts.reshape(*parts.shape[:2], -1)
    least = np.zeros(x.shape[1])
    least[count:] = -_LARGEST
    most = np.where(np.arange(x.shape[1]) < count, 1.0, _LARGEST)
    below, above = 1.0 / (x - least), 1.0 / (most - x)
    first = -np.einsum("pvii->pv", parts).real - below + above
    second = (np.conj(flat) @ np.swapaxes(flat, 1, 2)).real
    return first, second + (below**2 + above**2)[:, :, None] * np.eye(x.shape[1])


def _adjoint(matrix: Complex) -> Complex:
    return np.conj(np.swapaxes(matrix, -1, -2))


def _newton(first: Array, second: Array) -> tuple[Array, Array]:
    """Newton's step from derivatives, and its decrement, sqrt(-step' first)."""
    size = np.sqrt(np.einsum("pvv->pv", second))
    scaled = second / (size[:, :, None] * size[:, None]) + _RIDGE * np.eye(first.shape[1])
    step = -np.linalg.solve(scaled, (first / size)[:, :, None])[:, :, 0] / size
    return step, np.sqrt(np.maximum(-np.einsum("pv,pv->p", step, first), 0.0))


def _level(x: Array, slopes: Complex, masks: Array) -> Array:
    """The largest eigenvalue of D^-1/2 N D^-1/2, infinite where D is not positive."""
    d = x[:, : len(masks)]
    root = 1.0 / np.sqrt(np.where(d > 0.0, d, 1.0) @ masks)
    total = np.einsum("pv,pvij->pij", x, slopes)
    return np.where((d > 0.0).all(axis=1), np.linalg.eigvalsh(root[:, :, None] * total * root[:, None])[:, -1], np.inf)
