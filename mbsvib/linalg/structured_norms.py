"""Structured singular values: bounds by scalings D and G, found by interior points.

Of diagonal complex blocks the bound is min over D of sigma(D M D^-1), D = diag(d), d > 0: no units matter. It is exact
for up to three blocks.

Source: M. G. Safonov, IEE Proc. D 129 (1982) 251; J. C. Doyle, IEE Proc. D 129 (1982) 242; E. E. Osborne, J. ACM 7
(1960) 338, for balancing; those of ``isolation.structured_singular_values``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mbsvib.common.arrays import Array, Complex

_GAP = 1e-7  # of the squared bound: the scalings leave no more than this much below the level
_ZERO = 1e-12  # squared bound of a matrix of norm 1 that is as good as zero
_STEPS = 600  # of Newton's method, for all levels together; 60 to 150 are usual
_SPARE, _CENTRING = 1e-6, 10  # level above the least, at which multipliers are centred by so many steps
_CENTRED = 0.3  # Newton decrement below which scalings are near enough to the centre for the next level
_SHARE = 0.1  # of the way down to the bound of these scalings that the next level leaves
_LARGEST = 1e4  # of G for matrices of norm 1; more helps real parameters only where mu is next to its jump
_SWEEPS, _EVEN = 100, 1e-12  # of balancing, which ends when no factor changes by more
_BALANCED = 1e-9  # slope of the largest singular value below which balanced scalings are the best
_ROUNDS, _PEAKS = 20, 8  # of the search for the highest peak, and peaks that each looks at
_RIDGE = 1e-14  # added to second derivatives of unit diagonal, which rounding may leave singular


def structured_norms(m: Complex, masks: Array, real: list[int]) -> Array:
    """Return bounds (points,) for matrices (points, n, n) of any size, whose blocks all act on each other.

    ``masks`` (blocks, n): 1 where an entry belongs to a block; ``real``: numbers of blocks that are real parameters.
    """
    size = np.abs(m).max(axis=(1, 2))
    result, nonzero = np.zeros(len(m)), size > 0.0
    if nonzero.any():
        normal = _scaled(m[nonzero] / size[nonzero, None, None], _balance(m[nonzero], masks) @ masks)
        norm = np.linalg.norm(normal, 2, axis=(1, 2))
        result[nonzero] = _bounds(normal / norm[:, None, None], masks, real)[0] * norm * size[nonzero]
    return result


def balanced_norms(m: Complex) -> Array:
    """Return sigma(D M D^-1) (points,) with balanced rows and columns: bounds for diagonal blocks, the least of two."""
    if m.shape[1] == 1:
        return np.asarray(np.abs(m[:, 0, 0]))
    m = _cyclic(m)
    return scaled_norms(m, _balance(m, np.eye(m.shape[1])))


def scaled_norms(m: Complex, d: Array) -> Array:
    """Return bounds sigma(D M D^-1) (points,) for diagonal blocks by scalings d (n,) or (points, n)."""
    return np.asarray(np.linalg.svd(_scaled(m, d), compute_uv=False)[:, 0])


def diagonal_norms(m: Complex) -> tuple[Array, Array, Complex]:
    """Return the least bounds (points,) for diagonal blocks, their scalings d (points, n) and their slopes.

    Slopes W (points, n, n): d bound = Re tr(W dM). They count repeated singular values as the least bound does.
    """
    m = _cyclic(m)
    d = _balance(m, np.eye(m.shape[1]))
    normal = _scaled(m, d)
    u, sigma, vh = np.linalg.svd(normal)
    bound, v = sigma[:, 0].copy(), _adjoint(vh[:, :1])
    slopes = v * u[:, None, :, 0].conj()
    # of M = u sigma v^H + ...: d sigma / d ln d = sigma (|u|^2 - |v|^2)
    more = (np.abs(np.abs(u[:, :, 0]) ** 2 - np.abs(v[:, :, 0]) ** 2) > _BALANCED).any(axis=1) & (bound > 0.0)
    if more.any():
        share, root, slopes[more] = _best(normal[more] / bound[more, None, None])
        bound[more] *= share
        d[more] *= root
    return bound, d, _scaled(slopes, 1.0 / d)


def _best(m: Complex) -> tuple[Array, Array, Complex]:
    """The least bounds for diagonal blocks of matrices of norm 1, their scalings, and the slopes of D M D^-1.

    W = Z N^H / tr(Z N^H N) of N = D M D^-1, with the multipliers Z of level - N^H N > 0.
    """
    masks = np.eye(m.shape[1])
    x = _bounds(m, masks, [])[1]
    d = np.sqrt(x)
    bound = scaled_norms(m, d)
    forms, weight = _slopes(m, masks, [])
    level = np.maximum(bound**2 * (1.0 + _SPARE), _ZERO)[:, None, None, None] * weight - forms
    for _ in range(_CENTRING):
        step, decrement = _newton(*_derivatives(x, level, len(masks)))
        x = x + step / (1.0 + decrement)[:, None]
    room = np.einsum("pv,pvij->pij", x, level)
    slopes = np.asarray(np.linalg.solve(room, _adjoint(m) * x[:, None]), dtype=complex)
    slopes *= (bound / np.einsum("pij,pji->p", slopes, m).real)[:, None, None]
    return bound, d, _scaled(slopes, d)


def highest_norm(
    count: int, maxima: Callable[[Callable[[Complex], Array]], tuple[Array, Array]], at: Callable[[Array], Complex]
) -> tuple[float, float]:
    """Return where matrices over frequency have the highest of the least bounds for diagonal blocks, and this bound.

    ``count`` of blocks; ``maxima`` of a function of matrices: frequencies and values of its peaks, the highest among
    them; ``at``: matrices at frequencies. Any scalings give bounds at all frequencies. Balanced ones are the best of
    two blocks; of more, the best at peaks are added until they lower no peak by more than a share of 1e-7.
    """
    scalings: list[Array] = []
    where, least = 0.0, 0.0

    def bounds(m: Complex) -> Array:
        m = _cyclic(m)
        result = balanced_norms(m)
        for d in scalings:
            above = np.flatnonzero(result > least)
            result[above] = np.minimum(result[above], scaled_norms(m[above], d))
        return result

    for _ in range(_ROUNDS):
        frequencies, peaks = maxima(bounds)
        order = np.argsort(-peaks)[: np.count_nonzero(peaks > least * (1.0 + _GAP))][:_PEAKS]
        if not len(order):
            return where, least
        highest = float(frequencies[order[0]]), float(peaks[order[0]])
        if count <= 2:
            return highest
        best, d, _ = diagonal_norms(at(frequencies[order]))
        scalings.extend(d)
        if best.max() > least:
            where, least = float(frequencies[order][best.argmax()]), float(best.max())
    return highest


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


def _balance(m: Complex, masks: Array) -> Array:
    """Factors d (points, blocks) by which rows and columns of each block have the same norm outside of it, by Osborne's
    iteration.
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


def _scaled(m: Complex, d: Array) -> Complex:
    """D M D^-1."""
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
