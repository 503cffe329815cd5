"""Nyquist plots: a response as a curve in the complex plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common import units
from mbsvib.plots import _choice as choice
from mbsvib.plots import _style as style
from mbsvib.plots._curves import curves, finer, shared_grid
from mbsvib.plots._sheet import Given, in_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from mbsvib.common.selection import Names
    from mbsvib.plots._choice import Systems


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
    named = choice.listed(systems, labels)
    panels = choice.pairs(named[0][1], outputs, inputs)
    flat = [pair for row in panels for pair in row]
    grid = shared_grid([system for _, system in named], flat, frequencies, span)
    if frequencies is None:
        grid = finer(grid)
    lines = [curves(system, flat, grid) for _, system in named]
    columns = max(map(len, panels))
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
            axes.set_xlabel(f"real part [{units.pretty(unit)}]")
            axes.set_ylabel(f"imaginary part [{units.pretty(unit)}]")
            axes.set_title(f"{source} → {output}")
            if all(curve.negligible for curve in drawn):
                style.remark(axes, "zero")
        paper.name([label for label, _ in named], columns - 1)
    return paper.result
