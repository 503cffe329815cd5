"""Sets of sensors and actuators with the least loss: all of them, or by exchanges, with a bound that no set can beat.

Losses are convex functions of weights x from 0 to 1, one for each candidate. With sum(x) = k and any point z,

loss(x) >= loss(z) + grad(z) . (x - z) >= loss(z) + (sum of the k least entries of grad(z)) - grad(z) . z

so that the best point z that a solver finds proves a bound, however well it has converged.

Source: Boyd & Vandenberghe, Convex Optimization (2004), sections 3.1.3 and 7.5.
"""

from __future__ import annotations

from itertools import combinations, pairwise
from math import comb
from typing import NamedTuple

import numpy as np
from scipy.optimize import LinearConstraint, minimize

from mbsvib.common.arrays import Array
from mbsvib.isolation.placement_criteria import Criterion
from mbsvib.linalg.rank import SAME_FIGURE

Set = tuple[tuple[int, ...], tuple[int, ...]]

LEAST = 1e-4  # weight of candidates that are not chosen yet, so that information is never singular
FEW = 32  # sets of one side for each of which the other side is bounded
STEPS = 60  # of the solver of the relaxed problem
EXCHANGES = 100


class Found(NamedTuple):
    """Sets in ascending loss, their losses, a bound that no set is below, how many sets there are and were tried."""

    sets: list[Set]
    losses: list[float]
    bound: float
    number: int
    tried: int


def search(criterion: Criterion, sizes: tuple[int, int], chosen: tuple[int, int], best: int, most: int) -> Found:
    """Return the best sets of ``chosen`` of ``sizes`` candidates a side; a side with none chosen acts as a whole.

    ``most``: number of sets up to which all are tried.
    """
    count = comb(sizes[0], chosen[0]) * comb(sizes[1], chosen[1])
    if count > most:
        return _exchanged(criterion, sizes, chosen, best, count)
    sets = [list(combinations(range(n), k)) for n, k in zip(sizes, chosen, strict=True)]
    table = criterion.losses(*[_masks(some, n) for some, n in zip(sets, sizes, strict=True)])
    pairs = [(one, other) for one in sets[0] for other in sets[1]]
    order, losses = _ranked(criterion, pairs, table.ravel().tolist())
    return Found(order[:best], losses[:best], losses[0], count, count)


def _masks(sets: list[tuple[int, ...]], n: int) -> Array:
    """Weights (k, n) of sets; of the empty set alone, all candidates."""
    result = np.zeros((len(sets), n))
    for row, numbers in zip(result, sets, strict=True):
        row[list(numbers) if numbers else slice(None)] = 1.0
    return result


def _ranked(criterion: Criterion, sets: list[Set], losses: list[float]) -> tuple[list[Set], list[float]]:
    """Sets in ascending loss; those of equal loss by the order of the candidates."""
    order = sorted(range(len(sets)), key=lambda k: losses[k])
    groups: list[list[int]] = []
    for k in order:
        if groups and not _less(criterion, losses[groups[-1][0]], losses[k]):
            groups[-1].append(k)
        else:
            groups.append([k])
    flat = [k for group in groups for k in sorted(group, key=lambda k: sets[k])]
    return [sets[k] for k in flat], [losses[k] for k in flat]


def _less(criterion: Criterion, a: float, b: float) -> bool:
    """Whether the loss a is less than b by more than rounding."""
    return a < b and (b == np.inf or b - a > SAME_FIGURE * (1.0 if criterion.logarithmic else b))


def _exchanged(criterion: Criterion, sizes: tuple[int, int], chosen: tuple[int, int], best: int, count: int) -> Found:
    """The best of a greedy choice and of exchanges of one candidate each, and a bound by the relaxed problem."""
    tried: dict[Set, float] = {}

    def losses(sets: list[Set]) -> list[float]:
        """Losses of sets that differ on one side only."""
        new = [one for one in sets if one not in tried]
        if new:
            sides = [_masks(sorted({one[side] for one in new}), sizes[side]) for side in (0, 1)]
            keys = [(a, b) for a in sorted({one[0] for one in new}) for b in sorted({one[1] for one in new})]
            tried.update(zip(keys, criterion.losses(*sides).ravel().tolist(), strict=True))
        return [tried[one] for one in sets]

    current = _greedy(criterion, sizes, chosen)
    losses([current])
    for _ in range(EXCHANGES):
        before = tried[current]
        for side in (0, 1):
            neighbours = _neighbours(current, side, sizes[side])
            if neighbours and _less(criterion, min(losses(neighbours)), tried[current]):
                current = _ranked(criterion, neighbours, losses(neighbours))[0][0]
        if not _less(criterion, tried[current], before):
            break
    order, values = _ranked(criterion, list(tried), list(tried.values()))
    return Found(order[:best], values[:best], min(_bound(criterion, sizes, chosen), values[0]), count, len(tried))


def _greedy(criterion: Criterion, sizes: tuple[int, int], chosen: tuple[int, int]) -> Set:
    """One candidate after the other, each the best beside those that were chosen before."""
    weights = [np.ones(n) for n in sizes]
    result: list[tuple[int, ...]] = [(), ()]
    for side in (0, 1):
        if not chosen[side]:
            continue
        weights[side] = np.full(sizes[side], LEAST)
        while len(result[side]) < chosen[side]:
            left = [k for k in range(sizes[side]) if k not in result[side]]
            several = np.tile(weights[side], (len(left), 1))
            several[np.arange(len(left)), left] = 1.0
            sides = [several if k == side else weights[k][None] for k in (0, 1)]
            values = criterion.losses(*sides).ravel().tolist()
            best = next(k for k, value in zip(left, values, strict=True) if not _less(criterion, min(values), value))
            result[side] += (best,)
            weights[side][best] = 1.0
        weights[side] = _masks([result[side]], sizes[side])[0]
    return tuple(sorted(result[0])), tuple(sorted(result[1]))


def _neighbours(current: Set, side: int, n: int) -> list[Set]:
    """Sets with one candidate of a side exchanged."""
    own = current[side]
    outside = [k for k in range(n) if k not in own]
    swapped = [tuple(sorted({*own} - {out} | {into})) for out in own for into in outside]
    return [(one, current[1]) if side == 0 else (current[0], one) for one in swapped]


def _bound(criterion: Criterion, sizes: tuple[int, int], chosen: tuple[int, int]) -> float:
    """A loss that no set can be below.

    Where the loss is convex in both sides at once, by one problem; else the least over all sets of the side with few,
    or the better one of both sides beside all candidates of the other.
    """
    free = [side for side in (0, 1) if chosen[side]]
    full = [np.ones(n) for n in sizes]
    if criterion.joint or len(free) == 1:
        return _relaxed(criterion, full, chosen, free)
    counts = [comb(n, k) for n, k in zip(sizes, chosen, strict=True)]
    few, other = (0, 1) if counts[0] <= counts[1] else (1, 0)
    best = max(_relaxed(criterion, full, chosen, [side]) for side in (0, 1))
    if counts[few] > FEW:
        return best
    masks = _masks(list(combinations(range(sizes[few]), chosen[few])), sizes[few])
    sides = [[mask, full[1]] if few == 0 else [full[0], mask] for mask in masks]
    return max(best, min(_relaxed(criterion, weights, chosen, [other]) for weights in sides))


def _relaxed(criterion: Criterion, fixed: list[Array], chosen: tuple[int, int], free: list[int]) -> float:
    """The bound by the convex problem in the weights of the ``free`` sides, those of the others are ``fixed``."""
    ends = np.cumsum([0, *[len(fixed[side]) for side in free]])
    parts = [slice(int(a), int(b)) for a, b in pairwise(ends)]
    best = -np.inf

    def at(z: Array) -> tuple[float, Array]:
        nonlocal best
        weights = list(fixed)
        for side, part in zip(free, parts, strict=True):
            weights[side] = np.clip(z[part], LEAST, 1.0)
        value, gradients = criterion.slopes(weights[0], weights[1])
        slope = np.concatenate([gradients[side] for side in free])
        least = sum(np.sort(slope[part])[: chosen[side]].sum() for side, part in zip(free, parts, strict=True))
        point = np.concatenate([weights[side] for side in free])
        if np.isfinite(value):
            best = max(best, float(value + least - slope @ point))
        return value, slope

    start = np.concatenate([np.full(len(fixed[side]), chosen[side] / len(fixed[side])) for side in free])
    unit = abs(at(start)[0]) or 1.0
    sums = np.array([[float(part.start <= k < part.stop) for k in range(len(start))] for part in parts])

    def scaled(z: Array) -> tuple[float, Array]:
        value, slope = at(z)
        return value / unit, slope / unit

    minimize(scaled, start, jac=True, method="SLSQP", bounds=[(LEAST, 1.0)] * len(start),
             constraints=LinearConstraint(sums, sums @ start, sums @ start), options={"maxiter": STEPS})  # fmt: skip
    return best
