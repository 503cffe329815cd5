"""Frequencies that resolve every resonance and antiresonance of a response.

|G| is a product of distances from i w to zeros, divided by a product of those to poles. If neighbouring frequencies are
no farther apart than a share of each of these distances, no factor can change much between them. So the points are
densest at the imaginary part of each pole and zero, in steps of a share of its half-width there. The steps grow by a
constant ratio until they reach the even spacing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import real
from mbsvib.common.selection import Names
from mbsvib.errors import ResponseError
from mbsvib.responses.finite_zeros import NoResponseError

PER_DECADE = 150
# Neighbouring points are no farther apart than half the distance of the nearer one to a root; within its half-power
# points a quarter, so that a peak, wherever it lies between two of them, exceeds one by 0.8 % at most: sqrt(1 + 1/64).
SHARE = 0.5
STEP = float(np.log1p(SHARE))  # of asinh(distance / half-width)
WITHIN = 1.0  # half-widths in which steps are half as long
# Points closer than this share are duplicates up to rounding.
SAME = 1e-13
# Double precision cannot resolve the peak or dip of a root of less damping: points keep a distance from it.
UNDAMPED = 1e-12
CLOSEST = 1e-6  # share of its frequency at which they stop
EXCLUDED = 1e-9  # share of the frequency of an undamped pole in which no point lies


def frequency_grid(
    linear: Any, poles: Complex, n: int | None = None, *, f_min: float | None = None, f_max: float | None = None,
    highest: float = np.inf,
) -> Array:  # fmt: skip
    """Return angular frequencies [rad/s] that resolve every resonance and antiresonance of linear equations, ascending.

    The points next to a frequency f are nowhere farther apart than half the distance |2 pi i f - r| to the nearest
    pole or zero r of any single response, and half of that within its half-power points, each of which is a point, as
    is the peak. Undamped poles and zeros are approached to a millionth of their frequency.

    ``linear``: the equations whose zeros count. ``n``: number of points on an even logarithmic spacing, to which the
    others are added; default: 150 a decade. ``highest`` [Hz] limits the last frequency, unless ``f_max`` is given.
    """
    low, high = span(poles, f_min, f_max)
    high = min(high, highest) if f_max is None else high
    return 2.0 * np.pi * resolving_frequencies(roots(linear, poles), poles, low, high, n)


def resonant_grid(poles: Complex) -> Array:
    """Return angular frequencies [rad/s] that resolve every resonance of some poles [1/s], ascending: a number of them
    that does not depend on outputs and inputs.
    """
    return 2.0 * np.pi * resolving_frequencies(poles, poles, *span(poles, None, None))


def roots(linear: Any, poles: Complex) -> Complex:
    """Return some poles, and the zeros [1/s] of each single response of linear equations."""
    zeros = [zeros_of(linear, output, source) for source in linear.inputs for output in linear.outputs]
    return np.concatenate([poles, *zeros])


def zeros_of(linear: Any, output: Names, source: Names) -> Complex:
    """Return the zeros [1/s] of a single response of linear equations; none where it is zero at all frequencies."""
    try:
        return np.asarray(linear.transmission_zeros(output, source))
    except NoResponseError:
        return np.zeros(0, dtype=complex)


def resolving_frequencies(roots: Complex, poles: Complex, low: float, high: float, n: int | None = None) -> Array:
    """Return frequencies from ``low`` to ``high`` [Hz] that follow each of some poles and zeros ``roots`` [1/s],
    ascending.

    ``poles``: those of them that points must avoid if they are undamped. ``n``: number of evenly spaced points among
    them; default: 150 a decade.
    """
    decades = np.log10(high) - np.log10(low)
    count = max(2, round(PER_DECADE * decades) + 1) if n is None else n
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 2:
        raise ResponseError(f"frequency_grid: n = {n!r}; expected at least 2 points, the first and the last.")
    even = np.geomspace(low, high, count)
    # corner frequencies of roots far from the axis also limit the spacing to a share of the frequency
    fine = np.geomspace(low, high, max(count, int(np.ceil(np.log(10.0) * decades / np.log1p(SHARE))) + 1))
    spacing = float(fine[1] / fine[0] - 1.0)
    oscillating = np.unique(np.abs(roots.real) + 1j * np.abs(roots.imag))
    oscillating = oscillating[oscillating.imag > UNDAMPED * np.abs(oscillating)]
    around = [_around(root.real, root.imag, spacing) for root in oscillating.tolist()]
    grid = np.concatenate([even, fine if len(fine) > count else even[:0], *(a / (2.0 * np.pi) for a in around)])
    grid = np.unique(grid[(grid >= low) & (grid <= high)])
    for pole in np.unique(np.abs(poles[np.abs(poles.real) <= UNDAMPED * np.abs(poles)])) / (2.0 * np.pi):
        grid = grid[np.abs(grid - pole) > EXCLUDED * pole]
    return grid[np.concatenate(([True], np.diff(grid) > SAME * grid[1:]))] if len(grid) else grid


def _around(half_width: float, center: float, spacing: float) -> Array:
    """Angular frequencies around a root at -half_width + i center, out to where even spacing is close enough."""
    undamped = half_width <= UNDAMPED * center
    unit = CLOSEST * center if undamped else half_width
    reach = np.arcsinh(max(2.0 * spacing / SHARE * center, 4.0 * unit) / unit)
    steps = np.arange(1.0, np.ceil(reach / STEP) + 1.0) * STEP
    inner = np.arange(STEP / 2.0, np.arcsinh(WITHIN) + STEP, STEP)
    away = unit * np.sinh(np.concatenate((steps, inner)))
    if undamped:
        away = unit + away
        return np.concatenate((center - unit - away, center + unit + away, [center - unit, center + unit]))
    natural = np.hypot(half_width, center)
    peak = np.sqrt(abs(center**2 - half_width**2))  # of the displacement of a single mode
    points = np.array([center, center - half_width, center + half_width, natural, peak])
    return np.concatenate((center - away, center + away, points))


_LIMITS = "frequency_grid", "f_min or f_max", "0 < first < last, both finite [Hz]"


def span(poles: Complex, f_min: float | None, f_max: float | None) -> tuple[float, float]:
    """Return the first and last frequency [Hz]: as given, or from the natural frequencies of ``poles`` (poles,) [1/s].
    """
    natural = np.abs(poles[poles != 0.0]) / (2.0 * np.pi)
    lowest, highest = (natural.min(), natural.max()) if natural.size else (1.0, 1.0)
    low = _rounded(0.1 * lowest, down=True) if f_min is None else real(f_min, *_LIMITS)
    high = _rounded(3.0 * highest, down=False) if f_max is None else real(f_max, *_LIMITS)
    if f_min is None and low >= high:
        low = 0.01 * high
    if f_max is None and high <= low:
        high = 100.0 * low
    if not (0.0 < low < high < np.inf):
        raise ResponseError(f"frequencies from {low:g} to {high:g} Hz: expected 0 < first < last, both finite.")
    return low, high


def _rounded(value: float, down: bool) -> float:
    power = 10.0 ** np.floor(np.log10(value))
    marks = np.array([1.0, 2.0, 5.0, 10.0]) * power
    return float(marks[marks <= value * (1 + 1e-12)][-1] if down else marks[marks >= value * (1 - 1e-12)][0])
