"""Frequency responses from named inputs to named outputs: Bode plots, Nyquist plots, and what modes contribute."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import ArrayLike

from mbsvib.common import units
from mbsvib.common.arrays import Array
from mbsvib.common.selection import Names
from mbsvib.plots import _style as style
from mbsvib.plots._curves import Curve, System, Systems, curves, finer, listed, pairs_of, shared_grid
from mbsvib.plots._sheet import Given, in_rows, pairs

LONGEST_LABEL = 24
LONGEST_LEVEL = 14  # beyond which "magnitude" would leave the panel
MOST_MARKS = 25
MOST_MODES, LEAST_SHARE = 6, 1e-3  # modes with curves of their own, and their least share of the largest response


def bode(
    systems: Systems, outputs: Names = None, inputs: Names = None, frequencies: ArrayLike | None = None, *,
    span: tuple[float | None, float | None] = (None, None), labels: Sequence[str] | None = None, wrap: bool = False,
    marks: bool = True, decibels: bool = False, radians: bool = False, shared: bool = True, ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the magnitude and phase of G(i w) from inputs to outputs.

    Parameters
    ----------
    systems : System, ClosedLoop, StateSpace, Controller, control.StateSpace, or sequence of these
        One, or several that are drawn into the same panels.
    outputs, inputs : str or sequence of str, optional
        Names; default: all, if they are not too many.
    frequencies : array-like, shape (n,), optional
        Where to compute [Hz]; default: a grid that resolves every resonance and antiresonance in ``span``.
    span : (float or None, float or None)
        First and last frequency [Hz]; None: from the modes.
    labels : sequence of str, optional
        Names of the systems in the legend; default: their own.
    wrap : bool
        Keep the phase within -180 to 180 degrees, with gaps where it leaps; default: continuous.
    marks : bool
        Mark the natural frequencies by faint lines; only if a single system is drawn.
    decibels : bool
        Magnitude in dB, 20 log10 |G| of the value in SI units, on a linear axis.
    radians : bool
        Frequency axis in rad/s; ``frequencies`` and ``span`` stay in Hz.
    shared : bool
        The same limits of magnitude in all panels of the same unit.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        One panel for each pair of input and output.

    Raises
    ------
    ResponseError
        If a name is unknown, there are more than twelve panels, or a frequency is an undamped pole.
    """
    named = listed(systems, labels)
    flat, columns = pairs_of(named[0][1], outputs, inputs)
    grid = shared_grid([system for _, system in named], flat, frequencies, span)
    lines = [curves(system, flat, grid) for _, system in named]
    magnitudes = _magnitudes(lines[0], decibels)
    with pairs("plots.bode", ax, len(flat), columns) as (paper, couples):
        tops = []
        for number, (top, below) in enumerate(couples):
            drawn = [(label, group[number]) for (label, _), group in zip(named, lines, strict=True)]
            _panel(top, below, drawn, wrap, decibels, radians, paper.first)
            top.set_ylabel(magnitudes[number])
            tops.append((top, units.ratio(drawn[0][1].output_unit, drawn[0][1].source_unit), drawn))
            if number + columns < len(flat):
                below.set_xlabel("")
            if marks and len(named) == 1:
                _mark(top, below, named[0][1].modes().frequencies * (2.0 * np.pi if radians else 1.0))
        if shared:
            _share(tops)
        paper.name([label for label, _ in named], columns - 1)
    return paper.result


def _share(tops: list[tuple[Axes, str, list[tuple[str, Curve]]]]) -> None:
    """Give the panels of each unit the same limits; what is zero but for rounding does not count."""
    for unit in {unit for _, unit, _ in tops}:
        group = [axes for axes, axes_unit, drawn in tops
                 if axes_unit == unit and not all(curve.negligible for _, curve in drawn)]  # fmt: skip
        if len(group) > 1:
            limits = np.array([axes.get_ylim() for axes in group])
            for axes in group:
                axes.set_ylim(limits[:, 0].min(), limits[:, 1].max())


def _panel(
    top: Axes, below: Axes, drawn: list[tuple[str, Curve]], wrap: bool, decibels: bool, radians: bool, first: int
) -> None:
    curve = drawn[0][1]
    phases = []
    turn = 2.0 * np.pi if radians else 1.0
    for i, (label, response) in enumerate(drawn, first):
        magnitude, look = np.abs(response.values), style.line(i)
        magnitude[response.negligible | (magnitude == 0.0)] = np.nan
        top.plot(turn * response.frequencies, 20.0 * np.log10(magnitude) if decibels else magnitude, label=label,
                 **look)  # fmt: skip
        phase = np.where(response.negligible, np.nan, response.phase(wrap))
        phases.append(phase)
        below.plot(turn * response.frequencies, phase, **look)
    _magnitude_axis(top, decibels)
    style.title(top, curve.source, curve.output)
    _phase_axis(below, phases)
    style.frequency_axis(below, turn * curve.frequencies[0], turn * curve.frequencies[-1],
                         "frequency [rad/s]" if radians else "frequency [Hz]")  # fmt: skip
    if not first and all(response.negligible for _, response in drawn):
        style.nothing(top, below)


def _magnitudes(drawn: list[Curve], decibels: bool) -> list[str]:
    """Return the labels of the magnitudes, in one style for all panels: the longest that is short enough in all."""
    ratios = [units.pretty(units.ratio(curve.output_unit, curve.source_unit)) for curve in drawn]
    if decibels:
        levels = ["dB" if unit == "1" else f"dB re 1 {unit}" for unit in ratios]
        word = "magnitude" if max(map(len, levels)) < LONGEST_LEVEL else "|G|"
        return [f"{word} [{level}]" for level in levels]
    full = [f"|{curve.output} / {curve.source}| [{unit}]" for curve, unit in zip(drawn, ratios, strict=True)]
    return full if max(map(len, full)) <= LONGEST_LABEL else [f"magnitude [{unit}]" for unit in ratios]


def _magnitude_axis(axes: Axes, decibels: bool) -> None:
    if decibels or not any(np.isfinite(np.asarray(line.get_ydata(), dtype=float)).any() for line in axes.lines):
        return
    style.logarithmic(axes.yaxis)
    low, high = axes.get_ylim()
    if high < 10.0 * low:
        middle = np.sqrt(low * high)
        axes.set_ylim(middle / 10.0**0.6, middle * 10.0**0.6)


def _phase_axis(axes: Axes, phases: list[Array]) -> None:
    values = np.concatenate(phases)
    values = values[np.isfinite(values)]
    low, high = (values.min(), values.max()) if values.size else (-90.0, 90.0)
    low, high = 90.0 * np.floor(low / 90.0 + 0.02), 90.0 * np.ceil(high / 90.0 - 0.02)
    while high - low < 180.0:
        low, high = (low - 90.0, high) if high - low == 90.0 or high > 0.0 else (low, high + 90.0)
    step = next((step for step in (45.0, 90.0, 180.0, 360.0) if high - low <= 5.0 * step), 720.0)
    axes.yaxis.set_major_locator(MultipleLocator(step if high - low > 180.0 else 90.0))
    axes.set(ylim=(low - 0.05 * (high - low), high + 0.05 * (high - low)), ylabel="phase [deg]")


def _mark(top: Axes, below: Axes, natural: Array) -> None:
    low, high = below.get_xlim()
    marked = np.unique(np.round(natural[(natural > low) & (natural < high)], 9))
    if len(marked) > MOST_MARKS:
        return
    for axes in (top, below):
        for frequency in marked:
            axes.axvline(frequency, color=style.MARK, linewidth=0.6, linestyle=(0, (1, 2)), zorder=0.9)


def nyquist(
    systems: Systems, outputs: Names = None, inputs: Names = None, frequencies: ArrayLike | None = None, *,
    span: tuple[float | None, float | None] = (None, None), labels: Sequence[str] | None = None,
    ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw G(i w) in the complex plane, for positive frequencies full and for negative ones dashed.

    A lightly damped mode is a circle whose diameter is its height at resonance.

    Parameters
    ----------
    systems : System, ClosedLoop, StateSpace, Controller, control.StateSpace, or sequence of these
        One, or several that are drawn into the same panels.
    outputs, inputs : str or sequence of str, optional
        Names; default: all, if they are not too many.
    frequencies : array-like, shape (n,), optional
        Where to compute [Hz]; default: a grid that resolves every circle in ``span``.
    span : (float or None, float or None)
        First and last frequency [Hz]; None: from the modes.
    labels : sequence of str, optional
        Names of the systems in the legend; default: their own.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        One panel for each pair of input and output; a dot is the lowest frequency, a cross the critical point -1
        where the response has no unit.

    Raises
    ------
    ResponseError
        If a name is unknown, there are more than twelve panels, or a frequency is an undamped pole.
    """
    named = listed(systems, labels)
    flat, columns = pairs_of(named[0][1], outputs, inputs)
    grid = shared_grid([system for _, system in named], flat, frequencies, span)
    if frequencies is None:
        grid = finer(grid)
    lines = [curves(system, flat, grid) for _, system in named]
    with in_rows("plots.nyquist", ax, len(flat), columns, (4.6, 3.6)) as paper:
        for number, ((output, source), axes) in enumerate(zip(flat, paper.panels, strict=True)):
            drawn = [group[number] for group in lines]
            largest = max(float(np.abs(curve.values).max()) * (not curve.negligible) for curve in drawn)
            unit = units.ratio(drawn[0].output_unit, drawn[0].source_unit)
            factor, unit = (1.0, unit) if unit == "1" else units.prefix(unit, largest)
            for i, (curve, (label, _)) in enumerate(zip(drawn, named, strict=True), paper.first):
                look = style.line(i) | {"linestyle": "-"}
                values = factor * np.where(curve.negligible, 0.0, curve.values)
                axes.plot(values.real, values.imag, label=label, **look)
                axes.plot(values.real, -values.imag, **(look | {"linestyle": (0, (4, 3)), "linewidth": 0.7}))
                axes.plot(values.real[0], values.imag[0], "o", ms=3.5, color=look["color"])
            for draw in (axes.axhline, axes.axvline):
                draw(0.0, color=style.MARK, linewidth=0.6, zorder=0.9)
            if unit == "1":
                axes.plot([-1.0], [0.0], "+", color=style.COLOURS[1], ms=9.0, zorder=4)
            axes.set_aspect("equal", adjustable="datalim")
            axes.set(xlabel=f"real part [{units.pretty(unit)}]", ylabel=f"imaginary part [{units.pretty(unit)}]")
            style.title(axes, source, output)
            if all(curve.negligible for curve in drawn):
                style.remark(axes, "zero")
        paper.name([label for label, _ in named], columns - 1)
    return paper.result


def mode_contributions(
    system: System, outputs: Names = None, inputs: Names = None, frequencies: ArrayLike | None = None, *,
    span: tuple[float | None, float | None] = (None, None), ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the magnitude of responses and of what each mode contributes to them.

    Parameters
    ----------
    system : System
        The equations of motion.
    outputs, inputs : str or sequence of str, optional
        Names; default: all, if they are not too many.
    frequencies : array-like, shape (n,), optional
        Where to compute [Hz]; default: a grid that resolves every resonance in ``span``.
    span : (float or None, float or None)
        First and last frequency [Hz]; None: from the modes.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        A panel for each pair: the response black, and the six modes with the largest contributions, at least 0.1 % of
        the largest response.

    Raises
    ------
    ResponseError
        If a name is unknown, there are more than twelve panels, or modes do not add up to the response.
    """
    flat, columns = pairs_of(system, outputs, inputs)
    grid = shared_grid([system], flat, frequencies, span)
    with in_rows("plots.mode_contributions", ax, len(flat), columns, (4.0, 3.2)) as paper:
        for axes, pair, curve in zip(paper.panels, flat, curves(system, flat, grid), strict=True):
            style.title(axes, curve.source, curve.output)
            axes.set_ylabel(f"magnitude [{units.pretty(units.ratio(curve.output_unit, curve.source_unit))}]")
            if curve.negligible:
                style.frequency_axis(axes, grid[0], grid[-1])
                style.nothing(axes)
                continue
            parts = np.abs(system.mode_contributions(2.0 * np.pi * grid, *pair)[:, 0, 0])
            largest = parts.max(axis=1)
            top = float(np.abs(curve.values).max())
            shown = [k for k in np.argsort(-largest, kind="stable")[:MOST_MODES] if largest[k] > LEAST_SHARE * top]
            axes.plot(grid, np.abs(curve.values), color=style.INK, linewidth=2.0, label="all")
            for number, k in enumerate(sorted(shown)):
                axes.plot(grid, parts[k], label=f"mode {k + 1}", **style.line(number))
            style.frequency_axis(axes, grid[0], grid[-1])
            style.logarithmic(axes.yaxis)
            axes.set_ylim(bottom=max(axes.get_ylim()[0], 0.1 * float(np.abs(curve.values).min())))
            axes.legend(ncols=2)
    return paper.result
