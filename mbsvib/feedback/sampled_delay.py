"""Delay margins of sampled loops: between samples, a delay of the forces is not a turn of the loop gain's phase.

A delay by whole periods is one, so that all delays of an actuator have the loop gain of their remainder. Where it is 1
at some remainders, Newton's method starts. Poles also leave the circle at half the rate, where the loop gain is real,
and at whole periods, where that of an acceleration jumps, as the force acts after the next sample is taken.
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq, root

from mbsvib.common.arrays import Array, Complex
from mbsvib.feedback.closing import closed_space, transfer
from mbsvib.feedback.sampled_equations import HeldMechanism, SampledEquations, held_mechanism, split_delay
from mbsvib.linalg.rank import EPS
from mbsvib.responses.extrema import Band, panels

STEP = 0.15  # [rad] between two remainders, at the highest frequency at which the loop gain is SMALL or more
SMALL, NEAR = 0.5, 1.25  # NEAR: size of 1 + L from which Newton's method may find 0
REACH = 0.9  # loop gain in a panel from which a jump may reach -1
SOLVED, TRIES = 1e-9, 40  # size of 1 + L that is 0, and values in search of it
BEFORE = 1e-7  # periods before a whole one
JUMPS = 200  # at most, that are looked at
AMONG = 20  # samples of a panel and of a turn at which jumps are looked for
NONE = np.inf, np.nan


def late_loop_gain(loop: SampledEquations, held: HeldMechanism, actuator: int, late: float, w: Array) -> Complex:
    """Return the loop gain (n,) of an actuator that acts ``late`` [s] after the others, their loops closed.

    1 + L = det(1 - K G) / det(1 - K G without the column of the actuator); ``held``: the mechanism under all forces.
    """
    z, u = np.exp(1j * w / loop.rate), loop.ports[1]
    periods, remainder = split_delay(loop.rate, loop.delay + late)
    alone = held_mechanism(loop.plant.space, [u[actuator]], loop.rate, remainder)
    law, one = transfer(loop.discrete, z), np.eye(len(u))
    column = -(law @ _to_sensors(loop, alone, z)) * z[:, None, None] ** -periods
    if len(u) == 1:
        return np.asarray(column[:, 0, 0])
    others = one - law @ _to_sensors(loop, held, z)
    others[:, :, actuator] = one[actuator]
    return np.asarray(np.linalg.solve(others, column)[:, actuator, 0])


def _to_sensors(loop: SampledEquations, held: HeldMechanism, z: Complex) -> Complex:
    outputs = held.outputs[loop.ports[0]]
    return transfer((held.a, held.forces, outputs, np.zeros((len(outputs), held.forces.shape[1]))), z)


def sampled_delay_margin(loop: SampledEquations, actuator: int, low: float, high: float) -> tuple[float, float]:
    """Return the least delay [s] by which a stable loop gets unstable in a band, ``low`` to ``high`` [Hz], and its
    frequency [Hz]; infinite and NaN if there is none.
    """
    period, held = loop.period, held_mechanism(loop.plant.space, loop.ports[1], loop.rate, loop.delay)
    gain = partial(late_loop_gain, loop, held, actuator)
    ends = panels(_poles_of_others(loop, held, actuator), low, high, (), loop.resolution.longest, loop.rate)
    best, band = NONE, _band(gain, 0.0, ends)
    largest = float(ends[1:][np.abs(band.nodes).max(axis=1) >= SMALL].max(initial=0.0))
    lates = period * np.linspace(0.0, 1.0, 1 + max(1, int(np.ceil(2.0 * np.pi * largest * period / STEP))))
    for late in lates[:-1]:
        band = _band(gain, late, ends) if late else band
        unit = band.crossings(lambda values: np.abs(values) - 1.0)
        turns = np.mod(np.angle(-band.response(unit)), 2.0 * np.pi) / (2.0 * np.pi * unit * period)
        for f, turn in zip(unit, turns, strict=True):
            whole = np.unique([0.0, np.floor(turn), np.ceil(turn)])
            near = 2.0 * np.abs(np.sin(np.pi * f * period * (turn - whole))) <= NEAR
            for start in late + period * whole[near]:
                if start < best[0] + period:
                    at = _solved(gain, f, start, loop)
                    best = min(best, at) if low <= at[1] <= high else best
    if high == 0.5 * loop.rate:
        best = min(best, _at_half_the_rate(gain, lates, loop))
    if loop.plant.space.D[np.ix_(loop.ports[0], [loop.ports[1][actuator]])].any():
        first, last = np.floor(loop.delay * loop.rate) + 1.0, np.ceil((loop.delay + best[0]) * loop.rate)
        wholes = np.arange(first, min(last, first + JUMPS))
        best = min(best, _jump(gain, wholes, ends, loop)) if len(wholes) else best
    return best


def _band(gain: partial[Complex], late: float, ends: Array) -> Band:
    return Band(lambda f: gain(late, 2.0 * np.pi * f), ends)


def _poles_of_others(loop: SampledEquations, held: HeldMechanism, actuator: int) -> Complex:
    """Poles [1/s] / 2 pi of the loop gain of an actuator, those of the loops of all others."""
    (a, b, c, d), (y, _) = loop.discrete, loop.ports
    rest = [k for k in range(len(loop.actuators)) if k != actuator]
    plant = held.a, held.forces[:, rest], held.outputs, np.zeros((len(held.outputs), len(rest)))
    z = np.linalg.eigvals(closed_space(plant, (a, b, c[rest], d[rest]), y, list(range(len(rest)))).a)
    return np.asarray(loop.rate * np.log(z[np.abs(z) > EPS].astype(complex)) / (2.0 * np.pi))


def _solved(gain: partial[Complex], f: float, late: float, loop: SampledEquations) -> tuple[float, float]:
    """The delay [s] and the frequency [Hz] nearby at which L = -1."""
    scale = np.array([f, loop.period])

    def residual(x: Array) -> Array:
        at, delay = x * scale
        value = 1.0 + gain(max(delay, -loop.delay), np.array([2.0 * np.pi * at]))[0]
        return np.array([value.real, value.imag])

    solution = root(residual, np.array([1.0, late * loop.rate]), method="lm", tol=1e-13, options={"maxiter": TRIES})
    at, delay = (float(value) for value in solution.x * scale)
    solved = np.abs(solution.fun).max() <= SOLVED and delay >= 0.0 and 0.0 < at <= 0.5 * loop.rate
    return (delay, at) if solved else NONE


def _at_half_the_rate(gain: partial[Complex], lates: Array, loop: SampledEquations) -> tuple[float, float]:
    """The least delay [s] up to two periods at which L = -1 at half the rate, where a period changes its sign."""
    half = np.array([np.pi * loop.rate])
    lates = np.concatenate((lates[:-1], lates + loop.period))
    whole = np.floor((loop.delay + lates) * loop.rate + BEFORE)
    values = [1.0 + float(gain(late, half)[0].real) for late in lates]
    for k in np.flatnonzero(np.diff(np.sign(values)) != 0):
        if whole[k] == whole[k + 1]:  # else it jumps, or the next remainders are near enough
            return float(brentq(lambda late: 1.0 + float(gain(late, half)[0].real), *lates[k : k + 2])), 0.5 * loop.rate
    return NONE


def _jump(gain: partial[Complex], wholes: Array, ends: Array, loop: SampledEquations) -> tuple[float, float]:
    """The delay [s] to the first whole number of periods at which the loop gain passes -1 by jumping; a frequency [Hz].

    -1 is between the values on both sides, by a share s from 0 to 1, where Im (1 + L) conj(dL) = 0; each such
    frequency is one pole in or out. More whole periods turn both sides.
    """
    rate, most = loop.rate, wholes[-1]

    def sides(f: Array) -> tuple[Complex, Complex]:
        """L on both sides of the first jump."""
        before, after = (gain(wholes[0] / rate - loop.delay - early / rate, 2.0 * np.pi * f) for early in (BEFORE, 0.0))
        return before, after

    def product(f: Array, values: tuple[Complex, Complex], whole: float) -> tuple[Array, Array]:
        """Im (1 + L) conj(dL), and s."""
        before, after = (side * np.exp(-2j * np.pi * f * (whole - wholes[0]) / rate) for side in values)
        value = (1.0 + before) * (after - before).conj()
        return value.imag, -value.real / np.abs(after - before) ** 2

    def at(f: float, whole: float) -> tuple[float, float]:
        imaginary, share = product(np.array([f]), sides(np.array([f])), whole)
        return float(imaginary[0]), float(share[0])

    reach = [pair for pair in pairwise(ends) if np.abs(sides(np.linspace(*pair, AMONG))).max() >= REACH]
    if not reach:
        return NONE
    grid = np.unique(np.concatenate([np.linspace(low, high, AMONG + int(AMONG * most * (high - low) / rate))
                                     for low, high in reach]))  # fmt: skip
    values = sides(grid)
    for whole in wholes:
        imaginary, share = product(grid, values, whole)
        turns = 0.0
        for k in np.flatnonzero((imaginary[1:] >= 0.0) != (imaginary[:-1] >= 0.0)):
            if min(share[k : k + 2]) <= 1.0 and max(share[k : k + 2]) >= 0.0:
                f = float(brentq(lambda f, n=whole: at(f, n)[0], *grid[k : k + 2]))
                inside = 0.0 <= at(f, whole)[1] <= 1.0
                turns += inside * np.sign(imaginary[k + 1] - imaginary[k])
        sign = (-1.0) ** (whole - wholes[0])  # at half the rate
        ends_apart = grid[-1] == 0.5 * rate and np.prod([1.0 + sign * side[-1].real for side in values]) < 0.0
        if turns or ends_apart:
            return whole / rate - loop.delay, 0.5 * rate if ends_apart else f
    return NONE
