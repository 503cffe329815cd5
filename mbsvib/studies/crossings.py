"""Speeds at which frequencies are multiples of the speed.

In ascending order frequencies are continuous functions of the speed, whatever becomes of the shapes of modes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise

import numpy as np

from mbsvib.common.arrays import Array

Frequencies = Callable[[float], Array]

# Speeds are found to this relative accuracy.
XTOL = 1e-13
# Intervals between speeds are divided where a frequency may meet the line. The bottom of a dip towards it is found to a
# share of its length, slopes over another share of the speed; so many steps of Newton's method at most follow.
PARTS, BOTTOM, STEP, NEWTON_STEPS = 4, 1e-6, 1e-6, 4
# Crossings of one frequency that are closer than this are one, found more than once by rounding.
SAME = 1e-9


def crossings(near: Frequencies, exact: Frequencies, w: Array, times: float) -> Iterator[tuple[float, int]]:
    """Yield the speeds at which frequencies are ``times`` |speed|, and their places in ascending order.

    ``near`` and ``exact`` return all frequencies at a speed, in ascending order [rad/s], the first faster. ``w`` (n,):
    ascending speeds; the search is from the first to the last, in steps that need not be small.
    """
    beside = STEP * (w[-1] - w[0]) * np.array([-1.0, 1.0])  # of standstill, where |speed| has a corner
    ends = np.union1d(w[w != 0.0], beside[(beside > w[0]) & (beside < w[-1])])
    if not len(ends):
        return
    gaps = np.array([near(speed) - times * abs(speed) for speed in ends.tolist()])
    length = np.diff(ends)[:, None]
    steep = 2.0 * float((np.abs(np.diff(gaps, axis=0)) / length).max(initial=abs(times)))
    may_meet = (np.minimum(np.abs(gaps[:-1]), np.abs(gaps[1:])) < steep * length).any(axis=1)
    divided = [np.linspace(ends[k], ends[k + 1], PARTS + 1) for k in np.flatnonzero(may_meet)]
    w = np.unique(np.concatenate([ends, *divided]))
    w = w[w != 0.0]
    table = np.array([near(speed) - times * abs(speed) for speed in w.tolist()])
    for rank, row in enumerate(table.T):

        def off(speed: float, frequencies: Frequencies = near, rank: int = rank) -> float:
            return float(frequencies(float(speed))[rank] - times * abs(speed))

        last = np.inf
        for speed in sorted(_improved(partial(off, frequencies=exact), start) for start in _roots(off, w, row)):
            if abs(speed - last) > SAME * abs(speed):
                yield speed, rank
            last = speed


def _improved(off: Callable[[float], float], speed: float) -> float:
    """The zero next to a speed, by Newton's method with central differences; the speed itself in a dip's bottom."""
    for _ in range(NEWTON_STEPS):
        step = STEP * speed
        slope = (off(speed + step) - off(speed - step)) / (2.0 * step)
        if abs(slope) <= STEP:
            break
        change = off(speed) / slope
        speed -= change
        if abs(change) <= STEP * abs(speed):  # the nearer to a zero, the less the slope has to be accurate
            break
    return speed


def _roots(off: Callable[[float], float], w: Array, gaps: Array) -> Iterator[float]:
    """The zeros of one distance from the line, from its values at some speeds."""
    from scipy.optimize import brentq, minimize_scalar

    points = list(zip(w.tolist(), gaps.tolist(), strict=True))
    for k in range(len(w)):
        low, high = max(k - 1, 0), min(k + 1, len(w) - 1)
        side, size = np.sign(gaps[low : high + 1]), np.abs(gaps[low : high + 1])
        if low < high and (side == side[0]).all() and size[k - low] == size.min() < 2.0 * np.ptp(size):
            found = minimize_scalar(lambda speed, sign=side[0]: sign * off(speed), bounds=(w[low], w[high]),
                                    method="bounded", options={"xatol": BOTTOM * (w[high] - w[low])})  # fmt: skip
            points.append((float(found.x), float(side[0] * found.fun)))  # the bottom of a dip
    points.sort()
    yield from [speed for speed, gap in points if gap == 0.0]
    for (low, first), (high, last) in pairwise(points):
        if first * last < 0.0:
            yield float(brentq(off, low, high, xtol=XTOL * (high - low), rtol=4.0 * XTOL))
