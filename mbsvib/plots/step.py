"""Step responses from rest to their final value, with rise, overshoot and settling marked; times until they decay."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mbsvib.common import units
from mbsvib.common.arrays import Array
from mbsvib.common.selection import Names
from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style
from mbsvib.plots._curves import Linear, Systems, listed, negligible, pairs_of, pick, zeros
from mbsvib.plots._sheet import Given, in_rows

if TYPE_CHECKING:
    from mbsvib.responses.step_info import StepInfo


LONGER = 1.2  # time shown, in settling times
NEAR_POLE = 0.97  # times natural frequencies: at undamped ones there is no response
PERIODS = 400.0  # of the slowest vibration; more of them make a solid band
RISE = (0.1, 0.9)  # shares of the final value
NO_OVERSHOOT = 1e-6  # per cent: rounding

SAMPLED = 0.05  # share of a peak by which samples may miss it


class Response(NamedTuple):
    """A response as it is drawn: times [s] and values (n,), and the factors of both in the units of the axes."""

    t: Array
    y: Array
    time_factor: float
    factor: float


def infos(systems: Sequence[Linear], outputs: list[str], inputs: list[str]) -> list[StepInfo | None]:
    """Return the figures of step responses of each system, None for those that do not settle or have no such sum."""
    result: list[StepInfo | None] = []
    for system in systems:
        try:
            result.append(system.step_info(outputs, inputs))
        except ResponseError:  # unstable, at rest nowhere, or poles that coincide
            result.append(None)
    return result


def rounding(system: Linear) -> NDArray[np.bool_]:
    """Return which responses (outputs, inputs) are rounding next to all natural frequencies."""
    poles = np.abs(system.poles())
    omega = np.unique(NEAR_POLE * poles[poles > 0.0])
    return negligible(system, np.abs(system.frequency_response(omega if omega.size else np.ones(1))).max(axis=2))


def until_settled(
    systems: Sequence[Linear], known: Sequence[StepInfo | None], zero: Sequence[NDArray[np.bool_]]
) -> float | None:
    """Return the time [s] to show until all responses but those of ``zero`` settle; None if one does not in time."""
    last = 0.0
    for system, info, none in zip(systems, known, zero, strict=True):
        if info is None:
            return None
        counted_pairs = ~none[np.ix_([system.outputs.index(name) for name in info.outputs],
                            [system.inputs.index(name) for name in info.inputs])]  # fmt: skip
        peaks = np.where(info.overshoot > NO_OVERSHOOT, info.peak_time, 0.0)
        last = max(last, *(float(times[counted_pairs].max(initial=0.0)) for times in (info.settling_time, peaks)))
    turns = [abs(value.imag) for system in systems for value in system.poles() if value.imag]
    if not last or (turns and LONGER * last * min(turns) / (2.0 * np.pi) > PERIODS):
        return None
    return LONGER * last


def mark(axes: Axes, info: StepInfo, pair: tuple[str, str], response: Response) -> None:
    """Mark rise, peak and settling of a ``pair`` (output, input), and write them into a corner of its panel."""
    i, j = info.outputs.index(pair[0]), info.inputs.index(pair[1])
    final, settling = float(info.final[i, j]), float(info.settling_time[i, j])
    t, y = response.t * response.time_factor, response.y * response.factor
    towards = np.sign(final) * response.y
    colour, words = style.COLOURS[1], []
    if np.isfinite(info.rise_time[i, j]):
        words.append(f"rise time {_time(info.rise_time[i, j])}")
        for share in RISE:
            if towards.max() >= share * abs(final):
                at = max(int(np.argmax(towards >= share * abs(final))), 1)
                when = np.interp(share * abs(final), towards[at - 1 : at + 1], t[at - 1 : at + 1])
                axes.plot(when, share * final * response.factor, ".", color=colour, markersize=4.5, zorder=2.5)
        over = float(info.overshoot[i, j])
        words.append(f"overshoot {over:.3g} %" if over > NO_OVERSHOOT else "no overshoot")
        if over > NO_OVERSHOOT:
            at, peak = int(np.argmax(towards)), float(info.peak[i, j])
            peak_point = t[at], y[at]
            if abs(towards[at] - peak) < SAMPLED * peak:  # the other extremum may be the larger one
                peak_point = info.peak_time[i, j] * response.time_factor, np.sign(final) * peak * response.factor
            axes.plot(*peak_point, "o", color=colour, markersize=4.5, zorder=2.5)
        low, high = (response.factor * final * (1.0 + side * info.band) for side in (-1.0, 1.0))
        axes.axhspan(low, high, color=colour, alpha=0.15, linewidth=0.0)
    within = settling <= response.t[-1]
    if within:
        axes.axvline(settling * response.time_factor, color=colour, linewidth=0.9, linestyle=(0, (1.5, 1.5)))
    words.append(f"settling time {_time(settling)}" + ("" if within else " (not shown)"))
    height, side = (0.95, "top") if final < 0.0 else (0.05, "bottom")
    axes.text(0.985, height, "\n".join(words), transform=axes.transAxes, ha="right", va=side, fontsize=8.0, zorder=3.0,
              bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.5})  # fmt: skip


def _time(value: float) -> str:
    """Return a time in words with three digits."""
    factor, unit = units.prefix("s", value)
    return f"{factor * value:.3g} {unit}"


PERIODS_TO_DECAY = 25.0
DECAY_TIMES = 5.0  # time constants: 0.7 % is left
MOST_TIMES = 20_000


def time_grid(systems: Linear | Sequence[Linear], duration: float | None = None) -> Array:
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
    poles = np.concatenate([np.zeros(0, complex), *(np.asarray(one.poles()) for _, one in listed(systems, None))])
    poles = poles[(poles != 0.0) & (poles.imag >= 0.0)]
    if duration is None:
        decaying = -poles.real[poles.real < 0.0]
        swinging = poles.imag[poles.imag > 0.0]
        decay_time = DECAY_TIMES / decaying.min() if decaying.size else np.inf
        periods = PERIODS_TO_DECAY * 2.0 * np.pi / swinging.min() if swinging.size else np.inf
        duration = min(decay_time, periods)
        if not np.isfinite(duration):
            duration = 1.0
    if not 0.0 < duration < np.inf:
        raise ResponseError(f"duration = {duration!r} s: expected a positive, finite time.")
    fastest = np.abs(poles).max(initial=0.0) / (2.0 * np.pi)
    count = int(min(MOST_TIMES, max(1_000.0, 20.0 * fastest * duration)))
    return np.linspace(0.0, float(duration), count + 1)


LONGEST_LABEL = 26
MOST_SWINGS = 150  # of a thick line
BEFORE = 0.03  # of the time shown: the rest before the step


class Drawn(NamedTuple):
    """A response y (n,) of a system with its label, and whether it is zero but for rounding."""

    name: str
    system: Linear
    y: Array
    zero: bool


def step(
    systems: Systems, outputs: Names = None, inputs: Names = None, duration: float | None = None, *,
    labels: Sequence[str] | None = None, ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw responses to a step of one unit of each input at t = 0, from rest.

    Parameters
    ----------
    systems : System, ClosedLoop, StateSpace, Controller, control.StateSpace, or sequence of these
        One, or several that are drawn into the same panels.
    outputs, inputs : str or sequence of str, optional
        Names; default: all, if they are not too many.
    duration : float, optional
        Time shown [s]; default: until all responses have settled. Where one does not, or only after 400 periods: five
        time constants of the slowest mode, but at most 25 of its periods.
    labels : sequence of str, optional
        Names of the systems in the legend; default: their own.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        One panel for each pair of input and output; a dashed line is the static response, where there is one. For a
        single system that settles, marks show rise (10 % to 90 % of the final value), peak and settling (the band of
        2 %), as of ``system.step_info()``.

    Raises
    ------
    ResponseError
        If a name is unknown, there are more than twelve panels, or the duration is not positive.
    """
    named = listed(systems, labels)
    flat, columns = pairs_of(named[0][1], outputs, inputs)
    group = [system for _, system in named]
    known = infos(group, *(list(dict.fromkeys(names)) for names in zip(*flat, strict=True)))
    zero = [rounding(system) for system in group]
    t = time_grid(group, until_settled(group, known, zero) if duration is None else duration)
    factor, unit = units.prefix("s", t[-1])
    responses = [_responses(system, t, {source for _, source in flat}) for system in group]
    with in_rows("plots.step", ax, len(flat), columns, (3.6, 2.6)) as paper:
        for number, ((output, source), axes) in enumerate(zip(flat, paper.panels, strict=True)):
            drawn = [Drawn(name, system, y[source][system.outputs.index(output)],
                           bool(none[system.outputs.index(output), system.inputs.index(source)]))
                     for (name, system), y, none in zip(named, responses, zero, strict=True)]  # fmt: skip
            scale = _panel(axes, t * factor, drawn, source, output, paper.first)
            if len(group) == 1 and known[0] is not None and scale is not None:
                mark(axes, known[0], (output, source), Response(t, drawn[0].y, factor, scale))
            if number + columns >= len(flat):
                axes.set_xlabel(f"time [{unit}]")
        paper.name([label for label, _ in named], columns - 1)
    return paper.result


def _responses(system: Linear, t: Array, sources: set[str]) -> dict[str, Array]:
    result = {}
    for source in sources:
        pick(system, "input", source)
        u = np.zeros((len(system.inputs), len(t)))
        u[system.inputs.index(source)] = 1.0
        result[source] = system.time_response(t, u, hold="zero")
        result[source][zeros(system)[:, system.inputs.index(source)]] = 0.0
    return result


def _panel(axes: Axes, t: Array, drawn: list[Drawn], source: str, output: str, first: int) -> float | None:
    """Draw one pair; return the factor of its values, or None where they are rounding."""
    negligible = all(curve.zero for curve in drawn)
    largest = max(float(np.abs(curve.y).max()) for curve in drawn)
    system = drawn[0].system
    output_unit = system.output_units[system.outputs.index(output)]
    input_unit = system.input_units[system.inputs.index(source)]
    factor, unit = units.prefix(output_unit, 0.0 if negligible else largest)
    before = -BEFORE * t[-1]
    for i, (name, system, y, zero) in enumerate(drawn, first):
        final = static(system, source, output)
        if final is not None and not zero:
            axes.axhline(factor * final, color=style.line(i)["color"], linewidth=0.8, alpha=0.6, dashes=(4, 3))
        times = np.concatenate([[before, 0.0], t])
        values = factor * np.concatenate([[0.0, 0.0], np.where(zero, 0.0, y)])
        swings = np.count_nonzero(np.diff(np.sign(np.diff(y))))
        look = style.line(i) | ({"linewidth": 0.7} if swings > MOST_SWINGS else {})
        axes.plot(times, values, label=name, **look)
    axes.set_xlim(before, t[-1])
    style.title(axes, source, output)
    short = f"[{units.pretty(unit) or 1}]" + (f" for 1 {units.pretty(input_unit)}" if input_unit else "")
    axes.set_ylabel(f"{output} {short}" if len(output) + len(short) < LONGEST_LABEL else short)
    if negligible and not first:
        style.nothing(axes)
    elif drawn[0].system.modes().rigid:
        style.remark(axes, "rigid-body motion: need not settle", top=bool(drawn[0].y[-1] > 0.0))
    return None if negligible else factor


def static(system: Linear, source: str, output: str) -> float | None:
    """Return the static response G(0) [output unit / input unit] to a unit step; None if the system does not settle."""
    modes = system.modes()
    if modes.rigid or not modes.stable:
        return None
    i, j = system.inputs.index(source), system.outputs.index(output)
    try:
        return float(system.frequency_response([0.0])[j, i, 0].real)
    except ResponseError:  # a pole at 0 Hz of what a loop is made of
        return None
