"""Delay margins of sampled loops: between samples, a delay of the forces is not a turn of the loop gain's phase.

A delay by whole periods is one, so that all delays of an actuator have the loop gain of their remainder. Frequencies at
which its size is 1 move with the remainder, and so do their phases, which k periods turn by k w T: where one passes
that of -1, a pole passes the circle, and Newton's method finds the delay. Poles also leave the circle at half the rate,
where the loop gain is real, and at whole periods, where that of an acceleration jumps (``sampled_jumps``).
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from math import ceil
from typing import NamedTuple
from warnings import warn

import numpy as np
from scipy.optimize import brentq, root

from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import AccuracyWarning
from mbsvib.feedback.closing import closed_space, transfer
from mbsvib.feedback.sampled_equations import HeldMechanism, SampledEquations, held_mechanism, split_delay
from mbsvib.feedback.sampled_jumps import BEFORE, NONE, first_jump
from mbsvib.linalg.rank import EPS
from mbsvib.responses.extrema import Band, panels

STEP = 0.15  # [rad] between two remainders, at the highest frequency at which the loop gain is SMALL or more
SMALL, COARSE = 0.5, 5  # COARSE: remainders at which this frequency is looked for
PEAK = 0.05  # distance from 1 of the highest loop gain at a remainder, beside which it may be above 1
LAST = 1.0 - BEFORE  # largest remainder
FINEST = 1e-3  # periods between remainders, where frequencies of loop gain 1 meet
AT_HALF = 64  # remainders for half the rate
SOLVED, TRIES = 1e-9, 40  # size of 1 + L that is 0, and values in search of it
NEARLY = 1e-3  # that of an arc whose ends have met
PERIODS = 10_000  # at which jumps are looked for
TURNS, FIRST = 10_000, 16  # of a phase that are looked at, and how many of them at first


Point = tuple[float, float]  # remainder and frequency


class Arcs(NamedTuple):
    """Pairs of neighbouring remainders (n, 2) [periods], frequencies (n, 2) [Hz] at which the loop gain is 1 there, and
    its phases (n, 2) [rad] there, from that of -1 on.
    """

    remainders: Array
    frequencies: Array
    phases: Array


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
    frequency [Hz]; infinite and NaN if there is none. An AccuracyWarning says so if a lesser one may have been missed.
    """
    period, held = loop.period, held_mechanism(loop.plant.space, loop.ports[1], loop.rate, loop.delay)
    gain = partial(late_loop_gain, loop, held, actuator)
    ends = panels(_poles_of_others(loop, held, actuator), low, high, (), loop.resolution.longest, loop.rate)
    arcs = _arcs(gain, ends, loop)
    best, looked = _first_crossing(gain, arcs, loop, (low, high))
    if high == 0.5 * loop.rate:
        best = min(best, _at_half_the_rate(gain, loop))
    if loop.plant.space.D[np.ix_(loop.ports[0], [loop.ports[1][actuator]])].any():
        last = loop.late + min(best[0] * loop.rate, PERIODS)
        jump, jumps = first_jump(lambda late, f: gain(late, 2.0 * np.pi * f), int(np.ceil(last)), ends, loop)
        best, looked = min(best, jump), min(looked, PERIODS * period) if jumps else looked
    if best[0] > looked:
        warn(f"margins: '{loop.actuators[actuator]}' stays stable with delays up to {looked:.3g} s; not all of the "
             f"longer ones were looked at.", AccuracyWarning, stacklevel=2)  # fmt: skip
    return best


def _band(gain: partial[Complex], late: float, ends: Array) -> Band:
    return Band(lambda f: gain(late, 2.0 * np.pi * f), ends)


def _arcs(gain: partial[Complex], ends: Array, loop: SampledEquations) -> Arcs:
    """Arcs between remainders, of which there are more where the highest loop gain is near 1, and where arcs end."""
    bands: dict[float, Band] = {}
    at: dict[float, Array] = {}

    def look(remainder: float) -> None:
        band = bands[remainder] = _band(gain, remainder * loop.period - loop.delay, ends)
        at[remainder] = band.crossings(lambda values: np.abs(values) - 1.0)

    def highest(remainder: float) -> float:
        return bands[remainder].highest(np.abs)[1]

    for remainder in np.linspace(0.0, LAST, COARSE).tolist():
        look(remainder)
    large = np.max([np.abs(band.nodes).max(axis=1) for band in bands.values()], axis=0) >= SMALL
    turn = 2.0 * np.pi * float(ends[1:][large].max(initial=0.0)) * loop.period
    grid = np.linspace(0.0, LAST, 1 + (COARSE - 1) * max(1, ceil(turn / STEP / (COARSE - 1)))).tolist()
    for remainder in set(grid) - set(at):
        look(remainder)
    size = np.array([np.abs(bands[x].nodes).max() for x in grid])
    for k in 1 + np.flatnonzero((size[1:-1] >= np.maximum(size[:-2], size[2:])) & (np.abs(size[1:-1] - 1.0) <= PEAK)):
        before, here, after = (highest(x) for x in grid[k - 1 : k + 2])
        if 2.0 * here > before + after:
            look(grid[k] + 0.5 * (after - before) / (2.0 * here - before - after) * grid[1])
    waiting, found = [*pairwise(sorted(at))], []
    while waiting:
        left, right = waiting.pop()
        if len(at[left]) != len(at[right]) and right - left > FINEST:
            middle = 0.5 * (left + right)
            look(middle)
            waiting += [(left, middle), (middle, right)]
        else:
            found += _joined((left, at[left]), (right, at[right]))
    remainders, f = np.array(found).reshape(-1, 2, 2).transpose(2, 0, 1)
    phases = np.zeros(f.shape)
    for x in np.unique(remainders):
        here = remainders == x
        phases[here] = np.angle(-gain(x * loop.period - loop.delay, 2.0 * np.pi * f[here]))
    phases[:, 1] = phases[:, 0] + np.angle(np.exp(1j * (phases[:, 1] - phases[:, 0])))
    return Arcs(remainders, f, phases)


def _joined(left: tuple[float, Array], right: tuple[float, Array]) -> list[tuple[Point, Point]]:
    """Both ends of arcs, each a remainder and a frequency, between the frequencies at two remainders.

    Where there are more at one, two neighbours of these have met in between: the nearest ones are the ends of one arc.
    """
    (a, few), (b, many) = sorted((left, right), key=lambda side: len(side[1]))
    met, middle = [], 0.5 * (a + b)
    while len(many) > len(few) + 1:
        i = int(np.diff(many).argmin())
        met.append(((middle, float(many[i])), (middle, float(many[i + 1]))))
        many = np.delete(many, [i, i + 1])
    return met + [((a, float(f)), (b, float(g))) for f, g in zip(few, many, strict=False)]


def _first_crossing(
    gain: partial[Complex], arcs: Arcs, loop: SampledEquations, band: tuple[float, float]
) -> tuple[tuple[float, float], float]:
    """The least delay [s] and the frequency [Hz] at which L = -1 on an arc; and up to which delay all were looked at.

    Within m turns of the phase, that of -1 is passed by a whole number k of periods: a - k f T = m, with the phase a.
    """
    phase, turn = arcs.phases / (2.0 * np.pi), arcs.frequencies * loop.period
    delay = loop.late
    least = np.ceil(delay - arcs.remainders.max(axis=1, initial=0.0))
    first = np.floor((phase - least[:, None] * turn).max(axis=1, initial=-np.inf))
    best, looked, start, size = NONE, np.inf if not len(phase) else 0.0, 0, FIRST
    while start < TURNS and best[0] > looked:
        m = first - np.arange(start, start := min(start + size, TURNS))[:, None]
        size *= 4
        passed = (phase - m[..., None]) / turn
        k = np.maximum(np.ceil(passed.min(axis=2)), least)
        j, i = np.nonzero(k <= passed.max(axis=2))
        before, after = (phase[i] - k[j, i, None] * turn[i]).T
        share = np.clip((m[j, i] - before) / np.where(after == before, 1.0, after - before), 0.0, 1.0)
        at, f = (values[i, 0] + share * (values[i, 1] - values[i, 0]) for values in (arcs.remainders, arcs.frequencies))
        late = (k[j, i] + at - delay) * loop.period
        for n in np.argsort(late):
            if late[n] > best[0] + loop.period:
                break
            solved = _solved(gain, f[n], late[n], loop)
            best = min(best, solved) if band[0] <= solved[1] <= band[1] else best
        looked = float((passed[-1].min(axis=1) - delay).min(initial=np.inf)) * loop.period
    return best, looked


def _poles_of_others(loop: SampledEquations, held: HeldMechanism, actuator: int) -> Complex:
    """Poles [1/s] / 2 pi of the loop gain of an actuator, those of the loops of all others."""
    (a, b, c, d), (y, _) = loop.discrete, loop.ports
    rest = [k for k in range(len(loop.actuators)) if k != actuator]
    plant = held.a, held.forces[:, rest], held.outputs, np.zeros((len(held.outputs), len(rest)))
    z = np.linalg.eigvals(closed_space(plant, (a, b, c[rest], d[rest]), y, list(range(len(rest)))).a)
    return np.asarray(loop.rate * np.log(z[np.abs(z) > EPS].astype(complex)) / (2.0 * np.pi))


def _solved(gain: partial[Complex], f: float, late: float, loop: SampledEquations) -> tuple[float, float]:
    """The delay [s] and the frequency [Hz] nearby at which L = -1, with the same number of whole periods.

    Where the loop gain is hardly above 1 the solution is hardly one; that of the arc is then known to its length.
    """
    whole = split_delay(loop.rate, late + loop.delay)[0]
    least, most = ((whole + share) * loop.period - loop.delay for share in (0.0, LAST))
    scale = np.array([f, loop.period])

    def residual(x: Array) -> Array:
        at, delay = x * scale
        value = 1.0 + gain(min(max(delay, least), most), np.array([2.0 * np.pi * at]))[0]
        return np.array([value.real, value.imag])

    start = np.array([1.0, late * loop.rate])
    solution = root(residual, start, method="lm", tol=1e-13, options={"maxiter": TRIES})
    at, delay = (float(value) for value in solution.x * scale)
    if np.abs(solution.fun).max() <= SOLVED and max(0.0, least) <= delay <= most and 0.0 < at <= 0.5 * loop.rate:
        return delay, at
    return (max(late, 0.0), f) if np.abs(residual(start)).max() <= NEARLY else NONE


def _at_half_the_rate(gain: partial[Complex], loop: SampledEquations) -> tuple[float, float]:
    """The least delay [s] up to two periods at which L = -1 at half the rate, where a period changes its sign."""
    half = np.array([np.pi * loop.rate])
    first = loop.late
    delays = np.floor(first) + np.add.outer(np.arange(3.0), np.linspace(0.0, LAST, AT_HALF)).ravel()
    delays = np.concatenate(([first], delays[delays > first]))
    lates, whole = delays * loop.period - loop.delay, np.floor(delays)
    values = [1.0 + float(gain(late, half)[0].real) for late in lates]
    for k in np.flatnonzero((np.diff(np.sign(values)) != 0) & (whole[1:] == whole[:-1])):  # else it jumps
        return float(brentq(lambda late: 1.0 + float(gain(late, half)[0].real), *lates[k : k + 2])), 0.5 * loop.rate
    return NONE
