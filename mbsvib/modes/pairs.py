"""What pairs of eigenvalues say of their modes: frequency, damping, growth; any axes in front."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.linalg.rank import EPS

# A real part below the estimated error of its eigenvalue is rounding, but never one above this share of the eigenvalue.
ROUNDED = 1e-9
# Eigenvalues that are nearer than this share may have vectors that are mixtures of theirs.
TOGETHER = 1e-9
# The least divisor.
TINY = float(np.finfo(float).tiny)


def of_all(pairs: Any, single: Bools | None) -> Any:
    """Return the values of all eigenvalues, one after the other, from those of pairs (..., k, 2); modes that are
    ``single`` (..., k) have one.
    """
    if single is None:
        return pairs.reshape(-1)
    return pairs[np.stack((np.ones_like(single), ~single), axis=-1)]


def natural_frequencies(pairs: Complex) -> Array:
    """Return |lambda|, of a real pair the geometric mean [rad/s], (...,), of pairs (..., 2)."""
    return np.asarray(np.sqrt(np.abs(pairs[..., 0] * pairs[..., 1])))


def damping_ratios(pairs: Complex, errors: Array | None = None) -> Array:
    """Return -Re(lambda) / |lambda| (...,) of pairs (..., 2): -1 if one diverges, of damped rigid motions infinite; 0
    where both are rounding, for relative ``errors`` (..., 2).
    """
    pairs = pairs if errors is None else without_rounding(pairs, errors)
    first, second = pairs[..., 0], pairs[..., 1]
    total, natural = 0.0 - (first + second).real, natural_frequencies(pairs)
    ratio = np.divide(total, 2.0 * natural, out=np.where(total > 0.0, np.inf, 0.0), where=natural > 0.0)
    return np.where((first * second).real < 0.0, -1.0, ratio)


def growing(values: Complex, errors: Array) -> Bools:
    """Tell which eigenvalues have real parts that are positive by more than rounding, for their relative errors."""
    return np.asarray(values.real > np.minimum(errors, ROUNDED) * np.abs(values))


def without_rounding(pairs: Complex, errors: Array) -> Complex:
    """Return ``pairs`` (..., 2) of eigenvalues, their real parts 0 where both are rounding, for their ``errors``."""
    damped = (growing(pairs, errors) | growing(-pairs, errors)).any(axis=-1, keepdims=True)
    return np.where(damped, pairs, 1j * pairs.imag)


def with_neighbours(size: Array, errors: Array, gap: Array) -> Array:
    """Return relative ``errors`` (..., n) of eigenvalues of some ``size`` (..., n) as neighbours make them.

    ``gap`` (..., k, n): distances from all eigenvalues, infinite from themselves: those of these n first, then of their
    conjugates. What moves two eigenvalues by e and f couples them by up to sqrt(e f), which moves each by up to
    e f / gap, and by no more than sqrt(e f).
    """
    move, conjugates = errors * size, gap.shape[-2] - gap.shape[-1]
    both = np.concatenate((move, move[..., :conjugates]), axis=-1)[..., None] * move[..., None, :]
    moved = both / np.maximum(np.maximum(gap, np.sqrt(both)), TINY)
    return np.asarray(errors + np.add.reduce(moved, axis=-2) / size)


def within_reach(values: Complex, uncertainty: Array, reach: Array) -> Array:
    """Return how uncertain ``values`` (..., n) are as vectors of others mix with theirs, (..., n): those nearer than
    what is wrong with the others, by their relative ``uncertainty`` (..., n) or ``reach`` (..., n).
    """
    distance = np.abs(values[..., None] - values[..., None, :])
    within = distance <= np.maximum(uncertainty * np.abs(values), reach)[..., None]
    return np.asarray(np.where(within, uncertainty[..., None] ** 2, 0.0).max(axis=-2))


def nearness(
    gap: Array, values: Complex, y: Complex, products: tuple[Complex, Complex], slopes: Complex
) -> Array | None:
    """Return how much errors grow as the vectors of near eigenvalues are nearly parallel, (..., n): 1 / (1 - cosine), 1
    for eigenvalues without such a neighbour; None if all are.

    ``gap`` (..., n, n): distances of the values, infinite from themselves; ``products``: M y and C y (..., m, n);
    ``slopes``: y^T (2 lambda M + C) y. Vectors of different eigenvalues are at right angles in
    (lambda_1 + lambda_2) M + C.
    """
    near = gap <= TOGETHER * np.abs(values)[..., None, :]
    if not np.count_nonzero(near):
        return None
    *variant, row, column = near.nonzero()
    first, second = (*variant, row), (*variant, column)
    inertia, damping = (part.swapaxes(-1, -2)[second] for part in products)
    image = (values[first] + values[second])[:, None] * inertia + damping
    share = np.abs(np.einsum("ij,ij->i", y.swapaxes(-1, -2)[first], image))
    length = np.sqrt(np.abs(slopes[first] * slopes[second]))
    growth, result = length / np.maximum(np.abs(length - share), np.maximum(EPS * length, TINY)), np.ones(values.shape)
    np.maximum.at(result, first, growth)
    return result


def pair_numbers(values: Complex, y: Complex, free: int, rigid: int) -> Index:
    """Return the numbers of paired eigenvalues, (n, 2): those with Im > 0, which come first, with themselves, as they
    represent their conjugates; 0 (-1) with a real one for each damped rigid-body mode; other real ones by shape.
    """
    complex_count = int(np.count_nonzero(values.imag))
    upper, real = np.arange(complex_count).repeat(2).reshape(-1, 2), list(range(complex_count, len(values)))
    if not real:
        return upper
    share = np.linalg.norm(y[free:rigid, real], axis=0) if rigid > free else np.zeros(0)
    braked = [real[i] for i in np.argsort(-share, kind="stable")[: rigid - free].tolist()]
    remaining = sorted(set(real) - set(braked), key=lambda i: (abs(values[i]), i))
    pairs = [(-1, i) for i in braked] + upper.tolist()
    while remaining:
        slow = remaining.pop(0)
        mac = np.abs(y[:, remaining].real.T @ y[:, slow].real)
        pairs.append((slow, remaining.pop(int(np.argmax(mac)))))
    return np.array(pairs, dtype=np.intp)
