"""Whole periods at which the loop gain of a sampled loop passes -1 by jumping, where an acceleration is fed back: the
force acts after the next sample is taken, and no longer before it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from mbsvib.common.arrays import Array, Complex
from mbsvib.feedback.sampled_equations import SampledEquations
from mbsvib.responses.extrema import Band

BEFORE = 1e-7  # periods before a whole one
AMONG = 20  # samples of an interval and of a turn at which jumps are looked for
CHUNK = 50  # whole periods at first; four times as many each time
NONE = np.inf, np.nan
Sides = tuple[Complex, Complex]


def first_jump(
    gain: Callable[[float, Array], Complex], last: int, ends: Array, loop: SampledEquations
) -> tuple[tuple[float, float], bool]:
    """Return the least delay [s], up to ``last`` whole periods, at which poles leave the circle by a jump of the loop
    gain, and its frequency [Hz]; and whether there is one, however late, as the loop gain is above 1 on a side.

    ``gain`` takes the delay [s] beyond that of the loop, and frequencies (n,) [Hz] between those of ``ends``.
    """
    first, rate = int(loop.late) + 1, loop.rate
    late = first / rate - loop.delay

    def sides(f: Array) -> Sides:
        """L on both sides of the first jump."""
        return gain(late - BEFORE / rate, f), gain(late, f)

    marks = [Band(partial(gain, side), ends).crossings(lambda values: np.abs(values) - 1.0)
             for side in (late - BEFORE / rate, late)]  # fmt: skip
    intervals = [(low, high) for low, high in pairwise(np.unique(np.concatenate((*marks, ends[[0, -1]]))))
                 if max(np.abs(side[0]) for side in sides(np.array([0.5 * (low + high)]))) > 1.0]  # fmt: skip
    half = sides(np.array([0.5 * rate])) if ends[-1] == 0.5 * rate else None
    start, size = first, CHUNK
    while intervals and start < last:
        wholes = range(start, min(start + size, last))
        grids = [np.linspace(low, high, AMONG + int(AMONG * wholes[-1] * (high - low) / rate))
                 for low, high in intervals]  # fmt: skip
        parts = [(grid, sides(grid)) for grid in grids]
        for whole in wholes:
            turn = whole - first
            apart = half is not None and np.prod([1.0 + (-1.0) ** turn * side[0].real for side in half]) < 0.0
            f, turns = _poles(parts, sides, turn / rate)
            if turns or apart:
                return (whole / rate - loop.delay, 0.5 * rate if apart else f), True
        start, size = wholes[-1] + 1, 4 * size
    return NONE, bool(intervals)


def _poles(parts: list[tuple[Array, Sides]], sides: Callable[[Array], Sides], turn: float) -> tuple[float, float]:
    """A frequency [Hz], and the number of poles that leave the circle by a jump after a turn by f times ``turn`` [s].

    -1 is between the values on both sides, by a share s from 0 to 1, where Im (1 + L) conj(dL) = 0; each such
    frequency is one pole in or out.
    """

    def product(f: Array, values: Sides) -> tuple[Array, Array]:
        """Im (1 + L) conj(dL), and s."""
        before, after = (side * np.exp(-2j * np.pi * f * turn) for side in values)
        value = (1.0 + before) * (after - before).conj()
        return value.imag, -value.real / np.abs(after - before) ** 2

    def at(f: float) -> tuple[float, float]:
        imaginary, share = product(np.array([f]), sides(np.array([f])))
        return float(imaginary[0]), float(share[0])

    turns, where = 0.0, np.nan
    for grid, values in parts:
        imaginary, share = product(grid, values)
        change = (imaginary[1:] >= 0.0) != (imaginary[:-1] >= 0.0)
        between = (np.minimum(share[1:], share[:-1]) <= 1.0) & (np.maximum(share[1:], share[:-1]) >= 0.0)
        for k in np.flatnonzero(change & between):
            f = float(brentq(lambda f: at(f)[0], *grid[k : k + 2]))
            if 0.0 <= at(f)[1] <= 1.0:
                turns, where = turns + float(np.sign(imaginary[k + 1] - imaginary[k])), f
    return where, turns
