"""Times at which something passes a value: found between samples, then refined by the integrator itself.

Between two instants a quantity is the cubic p through its values and rates, or a straight line where rates are not
told. Two instants between show by how much it is off, e(s) <= E 16 s^2 (1 - s)^2 of the share s. Intervals in which
both the value and the slope of p are within this error somewhere are split there, until the passes are certain.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import brentq

from mbsvib.common.arrays import Array
from mbsvib.simulation.stepping import Sample

# Newton's method in time: corrections at most, and the share of an interval that counts as reached.
CORRECTIONS, REACHED = 12, 1e-14
# Values this far from the one asked for, as a share of the largest, are on it.
ON_IT = 1e-15
# Corrections around a time at which both sides of a level are looked at: several, as each is an error of the run.
AROUND = 4.0
# Where an interval is split: no simple fractions, so that whole periods in it do not go unnoticed.
BETWEEN = 0.5 * (3.0 - 5.0**0.5), 0.5 * (5.0**0.5 - 1.0)
# What the error at these instants is multiplied by, and the share of the largest value at which it is rounding.
MARGIN, ROUNDING = 4.0, 1e-12
SPLITS = 25
# The error of a cubic, as a share of its range, that a smooth motion leaves.
SMOOTH = 0.05
# Shares of an interval at which value and slope are compared with their errors.
SHARES = np.linspace(0.0, 1.0, 33)


@dataclass(frozen=True)
class Instant:
    """A quantity at a time [s]: its value and rate, NaN where it is not told, and the state of the run."""

    time: float
    value: float
    rate: float
    sample: Sample


@dataclass(frozen=True)
class Course:
    """How a quantity goes on from an instant to a time, by the integrator, and whether the motion between two instants
    is so smooth that cubics show it.
    """

    onward: Callable[[Instant, float], Instant]
    smooth: Callable[[Instant, Instant], bool]


def crossings(instants: Sequence[Instant], level: float, course: Course) -> Array:
    """Return the times (k,) [s], ascending, at which a quantity passes a level, from samples of it."""
    result: list[float] = []
    size = max((abs(instant.value - level) for instant in instants), default=0.0)
    for start, end in pairwise(instants):
        for first, last in _resolved(start, end, (level, size), course, SPLITS):
            for time in _roots(first, last, (level, size), course):
                if not result or time - result[-1] > 1e-9 * (last.time - first.time):
                    result.append(time)
    return np.array(result)


def _interpolated(start: Instant, end: Instant, level: float) -> Polynomial:
    """The quantity less the level over the share of an interval."""
    step, a, b = end.time - start.time, start.value - level, end.value - level
    c, last = start.rate * step, end.rate * step
    if not np.isfinite([c, last]).all():
        return Polynomial([a, b - a])
    cubic = c + last - 2.0 * (b - a)
    return Polynomial([a, c, b - a - c - cubic, cubic])


def _resolved(
    start: Instant, end: Instant, goal: tuple[float, float], course: Course, splits: int
) -> list[tuple[Instant, Instant]]:
    """Parts of an interval on each of which the interpolation passes the level as often as the quantity."""
    step, p = end.time - start.time, _interpolated(start, end, goal[0])
    if p.degree() == 3 and not _unclear(p, SMOOTH * float(np.ptp(p(SHARES)))) and course.smooth(start, end):
        return [(start, end)]
    first = course.onward(start, start.time + BETWEEN[0] * step)
    between = first, course.onward(first, start.time + BETWEEN[1] * step)
    off = [instant.value - goal[0] - float(p(share)) for share, instant in zip(BETWEEN, between, strict=True)]
    if p.degree() == 3:
        off += [0.5 * (step * instant.rate - float(p.deriv()(share)))
                for share, instant in zip(BETWEEN, between, strict=True)]  # fmt: skip
    error = MARGIN * float(np.abs(off).max())
    if not splits or error <= ROUNDING * goal[1] or not _unclear(p, error):
        return [(start, end)]
    return [part for ends in pairwise((start, *between, end)) for part in _resolved(*ends, goal, course, splits - 1)]


def _unclear(p: Polynomial, error: float) -> bool:
    """Whether both the value and the slope of an interpolation are within their errors somewhere."""
    flat = np.concatenate((p.deriv().roots(), p.deriv(2).roots())).real  # extrema and points of inflection
    shares = np.concatenate((SHARES, flat[(flat > 0.0) & (flat < 1.0)]))
    shape = (4.0 * shares * (1.0 - shares)) ** (2 if p.degree() == 3 else 1)
    return bool(((np.abs(p(shares)) <= error * shape) & (np.abs(p.deriv()(shares)) <= MARGIN * error)).any())


def _roots(start: Instant, end: Instant, goal: tuple[float, float], course: Course) -> list[float]:
    """Times in an interval at which the interpolation passes the level, refined by the integrator."""
    level, size = goal
    step, p = end.time - start.time, _interpolated(start, end, level)
    roots = p.roots()
    shares = np.sort(roots.real[np.abs(roots.imag) < 1e-9])
    shares = shares[(shares > -1e-9) & (shares <= 1.0 + 1e-9)]
    a, b = start.value - level, end.value - level
    if a * b < 0.0 and not len(shares):
        shares = np.array([a / (a - b)])
    result = []
    for share in shares.tolist():
        if abs(a) <= ON_IT * size and share < 1e-6:
            result.append(start.time)
        elif p.degree() < 3:
            result.append(_bracketed(start, end, level, course))
        else:
            time = _refined(start, step, share, level, course)
            result += [] if time is None else [time]
    if a * b < 0.0 and not result:  # the error of the run hides the root from Newton's method
        result.append(_bracketed(start, end, level, course))
    return result


def _bracketed(start: Instant, end: Instant, level: float, course: Course) -> float:
    """The root in an interval whose ends are on both sides of the level."""
    def off(time: float) -> float:
        return (start if time == start.time else end if time == end.time else course.onward(start, time)).value - level

    return float(brentq(off, start.time, end.time, xtol=REACHED * (end.time - start.time)))


def _refined(start: Instant, step: float, share: float, level: float, course: Course) -> float | None:
    """The root next to a share of an interval, or None if there is none in it."""
    time = start.time + min(max(share, 1e-6), 1.0) * step
    for _ in range(CORRECTIONS):
        instant = course.onward(start, time)
        if instant.rate == 0.0:
            return None
        correction = (instant.value - level) / instant.rate
        newton_time = time - correction
        if not start.time - 1e-6 * step <= newton_time <= start.time + 1.000001 * step:
            return None
        time = max(newton_time, start.time + 1e-12 * step)
        if abs(correction) <= REACHED * max(abs(time), step):
            return time
    return time if abs(correction) < 1e-9 * step or _passes(start, step, time, abs(correction), level, course) else None


def _passes(start: Instant, step: float, time: float, off: float, level: float, course: Course) -> bool:
    """Tell whether a quantity is on both sides of a level around a time that the error of the run leaves ``off``."""
    early, late = max(time - AROUND * off, start.time), min(time + AROUND * off, start.time + step)
    before = start.value if early == start.time else course.onward(start, early).value
    return (before - level) * (course.onward(start, late).value - level) < 0.0
