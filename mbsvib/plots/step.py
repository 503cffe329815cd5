"""Step responses, from rest to settled, in units that are easy to read; rise, overshoot and settling marked."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsvib.common import units
from mbsvib.errors import ResponseError
from mbsvib.plots import _choice as choice
from mbsvib.plots import _step_marks as marks
from mbsvib.plots import _style as style
from mbsvib.plots._curves import zeros
from mbsvib.plots._sheet import Given, in_rows
from mbsvib.plots.grid import time_grid

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Array
    from mbsvib.common.selection import Names
    from mbsvib.plots._choice import Systems
    from mbsvib.plots._system import Linear


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
        2 %), as ``system.step_info()`` tells them.

    Raises
    ------
    ResponseError
        If a name is unknown, there are more than twelve panels, or the duration is not positive.
    """
    named = choice.listed(systems, labels)
    panels = choice.pairs(named[0][1], outputs, inputs)
    group, flat = [system for _, system in named], [pair for row in panels for pair in row]
    known = marks.infos(group, *(list(dict.fromkeys(names)) for names in zip(*flat, strict=True)))
    zero = [marks.rounding(system) for system in group]
    t = time_grid(group, marks.until_settled(group, known, zero) if duration is None else duration)
    factor, unit = units.prefix("s", t[-1])
    responses = [_responses(system, t, {source for row in panels for _, source in row}) for system in group]
    columns = max(map(len, panels))
    with in_rows("plots.step", ax, len(flat), columns, (3.6, 2.6)) as paper:
        for number, ((output, source), axes) in enumerate(zip(flat, paper.panels, strict=True)):
            drawn = [Drawn(name, system, y[source][system.outputs.index(output)],
                           bool(none[system.outputs.index(output), system.inputs.index(source)]))
                     for (name, system), y, none in zip(named, responses, zero, strict=True)]  # fmt: skip
            scale = _panel(axes, t * factor, drawn, source, output, paper.first)
            if len(group) == 1 and known[0] is not None and scale is not None:
                marks.mark(axes, known[0], (output, source), marks.Response(t, drawn[0].y, factor, scale))
            if number + columns >= len(flat):
                axes.set_xlabel(f"time [{unit}]")
        paper.name([label for label, _ in named], columns - 1)
    return paper.result


def _responses(system: Linear, t: Array, sources: set[str]) -> dict[str, Array]:
    result = {}
    for source in sources:
        choice.pick(system, "input", source)
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
    axes.set_title(f"{source} → {output}")
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
