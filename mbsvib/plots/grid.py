"""Where to compute: frequencies that do not clip a peak, and times that show a response until it settles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.system import System

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

PER_DECADE = 150
PERIODS = 25.0
SETTLED = 5.0  # time constants: 0.7 % is left
MOST_TIMES = 20_000
_UNDAMPED = 1e-9


def upper_eigenvalues(systems: Sequence[System]) -> NDArray[np.complex128]:
    """Return the eigenvalues [1/s] of all ``systems`` that are neither zero nor the lower half of a pair."""
    values = np.concatenate([np.zeros(0, complex), *(np.asarray(system.modes().eigenvalues) for system in systems)])
    upper: NDArray[np.complex128] = values[(values != 0.0) & (values.imag >= 0.0)]
    return upper


def frequency_grid(
    systems: System | Sequence[System], span: tuple[float | None, float | None] = (None, None)
) -> Array:
    """Return frequencies for a Bode plot: evenly spaced on a logarithmic axis, and dense around each resonance.

    Every mode gets its natural, damped and resonance frequency, the half-power points f (1 -+ zeta) and points that
    thin out from there to the even spacing. Around an undamped mode they stop short of the pole.

    Parameters
    ----------
    systems : System or sequence of System
        Whose modes decide.
    span : (float or None, float or None)
        First and last frequency [Hz]; None: a tenth of the lowest and three times the highest natural frequency,
        rounded outwards to 1, 2 or 5.

    Returns
    -------
    array, shape (n,)
        Ascending frequencies [Hz].

    Raises
    ------
    ResponseError
        If the span is not two positive frequencies in ascending order.
    """
    poles = upper_eigenvalues([systems] if isinstance(systems, System) else systems)
    low, high = _span(np.abs(poles) / (2.0 * np.pi), span)
    count = max(2, round(PER_DECADE * np.log10(high / low)) + 1)
    even = np.geomspace(low, high, count)
    spacing = max(np.log(even[1] / even[0]), 1e-12)
    extra = [_around(pole, spacing) for pole in poles if pole.imag > 0.0]
    grid = np.concatenate([even, *extra])
    grid = np.unique(grid[(grid >= low) & (grid <= high)])
    for pole in poles:
        natural = abs(pole) / (2.0 * np.pi)
        if -pole.real <= _UNDAMPED * abs(pole):
            grid = grid[np.abs(grid / natural - 1.0) > _UNDAMPED]
    return grid


def _around(pole: complex, spacing: float) -> Array:
    natural, damping = abs(pole) / (2.0 * np.pi), abs(pole.real) / abs(pole)
    if damping <= _UNDAMPED:
        away = np.geomspace(1e-2, 1.0, 12) * min(spacing, 0.1)
        return natural * np.concatenate([1.0 - away, 1.0 + away])
    steps = np.sinh(np.linspace(0.0, np.arcsinh(max(spacing / damping, 4.0)), 13)) * damping
    steps = np.union1d(steps, damping)
    around = natural * np.exp(np.concatenate([-steps, steps]))
    own = [natural, pole.imag / (2.0 * np.pi), natural * (1.0 - damping), natural * (1.0 + damping)]
    if damping < np.sqrt(0.5):
        own.append(natural * np.sqrt(1.0 - 2.0 * damping**2))
    return np.concatenate([around, own])


def _span(natural: Array, span: tuple[float | None, float | None]) -> tuple[float, float]:
    lowest, highest = (natural.min(), natural.max()) if natural.size else (1.0, 1.0)
    low = _rounded(0.1 * lowest, down=True) if span[0] is None else float(span[0])
    high = _rounded(3.0 * highest, down=False) if span[1] is None else float(span[1])
    if span[0] is None and low >= high:
        low = 0.01 * high
    if span[1] is None and high <= low:
        high = 100.0 * low
    if not (0.0 < low < high < np.inf):
        raise ResponseError(f"frequencies from {low:g} to {high:g} Hz: expected 0 < first < last, both finite.")
    return low, high


def _rounded(value: float, down: bool) -> float:
    power = 10.0 ** np.floor(np.log10(value))
    marks = np.array([1.0, 2.0, 5.0, 10.0]) * power
    return float(marks[marks <= value * (1 + 1e-12)][-1] if down else marks[marks >= value * (1 - 1e-12)][0])


def time_grid(systems: System | Sequence[System], duration: float | None = None) -> Array:
    """Return evenly spaced times that show a step response.

    Until the slowest mode has settled (five time constants) or 25 of the longest period have passed, whichever is
    sooner; 20 points for the shortest period that can be seen at that scale.

    Parameters
    ----------
    systems : System or sequence of System
        Whose modes decide; rigid-body modes have no time of their own.
    duration : float, optional
        Last time [s] instead.

    Returns
    -------
    array, shape (n,)
        Times from 0 [s].

    Raises
    ------
    ResponseError
        If the duration is not positive.
    """
    poles = upper_eigenvalues([systems] if isinstance(systems, System) else systems)
    if duration is None:
        decaying = -poles.real[poles.real < 0.0]
        swinging = poles.imag[poles.imag > 0.0]
        settled = SETTLED / decaying.min() if decaying.size else np.inf
        periods = PERIODS * 2.0 * np.pi / swinging.min() if swinging.size else np.inf
        duration = min(settled, periods)
        if not np.isfinite(duration):
            duration = 1.0
    if not 0.0 < duration < np.inf:
        raise ResponseError(f"duration = {duration!r} s: expected a positive, finite time.")
    fastest = np.abs(poles).max(initial=0.0) / (2.0 * np.pi)
    count = int(min(MOST_TIMES, max(1_000.0, 20.0 * fastest * duration)))
    return np.linspace(0.0, float(duration), count + 1)
