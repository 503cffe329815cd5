"""Step responses, from rest to settled, in units that are easy to read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.plots import _choice as choice
from mbsvib.plots import _style as style
from mbsvib.plots import _units as units
from mbsvib.plots.grid import time_grid

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Array
    from mbsvib.plots._choice import Names, Systems
    from mbsvib.plots._system import Linear


NEGLIGIBLE = 1e-11
LONGEST_LABEL = 26
MOST_SWINGS = 150  # of a thick line
BEFORE = 0.03  # of the time shown: the rest before the step


def step(
    systems: Systems, outputs: Names = None, inputs: Names = None, duration: float | None = None, *,
    labels: Sequence[str] | None = None,
) -> Figure:  # fmt: skip
    """Draw responses to a step of one unit of each input at t = 0, from rest.

    Parameters
    ----------
    systems : System, ClosedLoop, StateSpace, Controller, control.StateSpace, or sequence of these
        One, or several that are drawn into the same panels.
    outputs, inputs : str or sequence of str, optional
        Names; default: all, if they are not too many.
    duration : float, optional
        Time shown [s]; default: until the slowest mode has settled, but at most 25 of its periods.
    labels : sequence of str, optional
        Names of the systems in the legend; default: their own.

    Returns
    -------
    matplotlib.figure.Figure
        One panel for each pair of input and output; a dashed line is the static response, where there is one.

    Raises
    ------
    ResponseError
        If a name is unknown, there are more than twelve panels, or the duration is not positive.
    """
    named = choice.listed(systems, labels)
    panels = choice.pairs(named[0][1], outputs, inputs)
    t = time_grid([system for _, system in named], duration)
    factor, unit = units.prefix("s", t[-1])
    responses = [_responses(system, t, {source for row in panels for _, source in row}) for _, system in named]
    rows, columns, count = len(panels), max(map(len, panels)), sum(map(len, panels))
    with style.context():
        figure = style.new_figure(*style.panel_size(rows, columns, 2.6, 3.6))
        places = figure.add_gridspec(rows, columns)
        for i, row in enumerate(panels):
            for j, (output, source) in enumerate(row):
                axes = figure.add_subplot(places[i, j])
                drawn = [(name, system, y[source]) for (name, system), y in zip(named, responses, strict=True)]
                _panel(axes, t * factor, drawn, source, output)
                if (i + 1) * columns + j >= count:
                    axes.set_xlabel(f"time [{unit}]")
        style.name_systems(figure, [label for label, _ in named], figure.axes[len(panels[0]) - 1])
    return figure


def _responses(system: Linear, t: Array, sources: set[str]) -> dict[str, Array]:
    result = {}
    for source in sources:
        choice.pick(system, "input", source)
        u = np.zeros((len(system.inputs), len(t)))
        u[system.inputs.index(source)] = 1.0
        result[source] = system.time_response(t, u, hold="zero")
    return result


def _panel(axes: Axes, t: Array, drawn: list[tuple[str, Linear, Array]], source: str, output: str) -> None:
    shown, largest, negligible = [], 0.0, True
    for name, system, response in drawn:
        choice.pick(system, "output", output)
        number = system.outputs.index(output)
        y = response[number]
        alike = [i for i, unit in enumerate(system.output_units) if unit == system.output_units[number]]
        negligible &= bool(np.abs(y).max() <= NEGLIGIBLE * np.abs(response[alike]).max())
        largest = max(largest, float(np.abs(y).max()))
        shown.append((name, system, y))
    system = drawn[0][1]
    output_unit = system.output_units[system.outputs.index(output)]
    input_unit = system.input_units[system.inputs.index(source)]
    factor, unit = units.prefix(output_unit, 0.0 if negligible else largest)
    before = -BEFORE * t[-1]
    for i, (name, system, y) in enumerate(shown):
        final = static(system, source, output)
        if final is not None:
            axes.axhline(factor * final, color=style.line(i)["color"], linewidth=0.8, alpha=0.6, dashes=(4, 3))
        times, values = np.concatenate([[before, 0.0], t]), factor * np.concatenate([[0.0, 0.0], y])
        swings = np.count_nonzero(np.diff(np.sign(np.diff(y))))
        look = style.line(i, faint=negligible) | ({"linewidth": 0.7} if swings > MOST_SWINGS else {})
        axes.plot(times, values, label=name, **look)
    axes.set_xlim(before, t[-1])
    axes.set_title(f"{source} → {output}")
    short = f"[{units.pretty(unit)}] for 1 {units.pretty(input_unit)}"
    axes.set_ylabel(f"{output} {short}" if len(output) + len(short) < LONGEST_LABEL else short)
    if negligible:
        style.remark(axes, style.zero(y for _, _, y in shown))
    elif system.modes().rigid:
        style.remark(axes, "rigid-body motion: need not settle", top=bool(shown[0][2][-1] > 0.0))


def static(system: Linear, source: str, output: str) -> float | None:
    """Return the response that remains long after a unit step, or None where the system does not settle.

    Parameters
    ----------
    system : System
        The equations of motion.
    source, output : str
        Names of an input and an output.

    Returns
    -------
    float or None
        G(0) [output unit / input unit].
    """
    modes = system.modes()
    if modes.rigid or not modes.stable:
        return None
    i, j = system.inputs.index(source), system.outputs.index(output)
    return float(system.frequency_response([0.0])[j, i, 0].real)
