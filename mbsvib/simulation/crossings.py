"""Times at which something passes a value: found between samples, then refined by the integrator itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array

# Newton's method in time: corrections at most, and the share of an interval that counts as reached.
CORRECTIONS, REACHED = 12, 1e-14
# Values this far from the one asked for, as a share of the largest, are on it.
ON_IT = 1e-15


def crossings(
    time: Array, values: Array, rates: Array, level: float, at: Callable[[int, float], tuple[float, float]]
) -> Array:
    """Return the times at which a quantity passes a level.

    Between samples the cubic through values and rates tells where; a quantity that passes twice between two samples is
    found where this cubic does so. Without rates, a change of sign tells, and the root is bracketed.

    ``time``, ``values``, ``rates`` (n,): samples of the quantity; rates may be NaN. ``at``: (sample k, time) -> value
    and rate at a time after this sample, by the integrator. Returns (k,): times [s], ascending.
    """
    result: list[float] = []
    size = max(float(np.abs(values - level).max(initial=0.0)), 1e-300)
    for k in range(len(time) - 1):
        step = time[k + 1] - time[k]
        a, b = values[k] - level, values[k + 1] - level
        # p(s) = a + c s + d s^2 + e s^3
        c, end = rates[k] * step, rates[k + 1] * step
        e = c + end - 2.0 * (b - a)
        d = b - a - c - e
        roots = np.roots([e, d, c, a]) if np.isfinite([c, end]).all() else np.zeros(0)
        real = np.sort(roots.real[np.abs(roots.imag) < 1e-9])
        inside = [float(s) for s in real if -1e-9 < s <= 1.0 + 1e-9]
        if a * b < 0.0 and not inside:
            inside = [a / (a - b)]
        for s in inside:
            if abs(a) <= ON_IT * size and s < 1e-6:
                crossing = float(time[k])
            elif not np.isfinite([c, end]).all():
                crossing = float(brentq(lambda t, k=k: at(k, t)[0] - level, time[k], time[k + 1], xtol=REACHED * step))
            else:
                refined = _refined(float(time[k]), float(step), s, k, level, at)
                if refined is None:
                    continue
                crossing = refined
            if not result or crossing - result[-1] > 1e-9 * step:
                result.append(crossing)
    return np.array(result)


def _refined(
    start: float, step: float, share: float, k: int, level: float, at: Callable[[int, float], tuple[float, float]]
) -> float | None:
    """The root next to a share of an interval, or None if there is none in it."""
    time = start + min(max(share, 1e-6), 1.0) * step
    for _ in range(CORRECTIONS):
        value, rate = at(k, time)
        if rate == 0.0:
            return None
        correction = (value - level) / rate
        newton_time = time - correction
        if not start - 1e-6 * step <= newton_time <= start + 1.000001 * step:
            return None
        time = max(newton_time, start + 1e-12 * step)
        if abs(correction) <= REACHED * max(abs(time), step):
            return time
    return time if abs(correction) < 1e-9 * step else None
