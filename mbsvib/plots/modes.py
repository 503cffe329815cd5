"""Modes at a glance: natural frequencies and damping ratios."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.expected import a_system
from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Array
    from mbsvib.plots._system import System


LOG_FROM = 20.0  # ratio of the highest to the lowest value from which an axis is logarithmic


def modes(system: System, *, ax: Given | None = None) -> Figure | Given:
    """Draw the natural frequency and the damping ratio of every mode.

    Parameters
    ----------
    system : System
        The equations of motion.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Frequencies [Hz] above, damping ratios [%] below, over the number of the mode. Rigid-body modes are open
        circles on the axis.

    Raises
    ------
    ResponseError
        If the system has no degree of freedom.
    """
    if a_system(system, "plots.modes").dof == 0:
        raise ResponseError(f"system '{system.name}' is fully locked: it has no modes to draw.")
    result = system.modes()
    number = np.arange(1.0, system.dof + 1.0)
    with sheet("plots.modes", ax, (style.ALONE, 4.6), 2, height_ratios=[1.5, 1.0]) as paper:
        top, below = paper.panels
        paper.join(paper.panels)
        _stems(top, number, result.frequencies, style.COLOURS[0])
        _stems(below, number, 100.0 * result.damping_ratios, style.COLOURS[1])
        top.set_ylabel("natural frequency [Hz]")
        below.set_ylabel("damping ratio [%]")
        below.set_xlabel("mode")
        top.set_title("Modes")
        paper.name([f"{system.name}: {system.dof} DOF"])
        below.set_xlim(0.4, system.dof + 0.6)
        below.xaxis.get_major_locator().set_params(integer=True)
        if system.dof <= 20:
            below.set_xticks(number)
        for axes in (top, below):
            axes.grid(False, axis="x")
    return paper.result


def _stems(axes: Axes, number: Array, values: Array, colour: str) -> None:
    drawn = np.isfinite(values)
    rising = drawn & (values > 0.0)
    floor = 0.0
    if rising.any() and values[rising].max() > LOG_FROM * values[rising].min():
        style.logarithmic(axes.yaxis)
        floor = 10.0 ** np.floor(np.log10(values[rising].min()) - 0.1)
        axes.set_ylim(floor, 10.0 ** (np.log10(values[rising].max()) + 0.15))
    width = max(0.6, min(2.0, 120.0 / len(number)))
    size = max(2.0, min(6.0, 300.0 / len(number)))
    heights = np.where(rising, values, floor)
    axes.vlines(number[rising], floor, heights[rising], color=colour, linewidth=width, alpha=0.45)
    axes.plot(number[rising], values[rising], "o", color=colour, markersize=size)
    rest = drawn & ~rising
    at = np.where(axes.get_yscale() == "log", floor, values)[rest]
    if rest.any():
        axes.plot(number[rest], at, "o", color=colour, markersize=size, mfc="white", clip_on=False, zorder=3)
    if axes.get_yscale() == "linear" and not (values[drawn] < 0.0).any():
        axes.set_ylim(0.0, 1.12 * values[drawn].max() if rising.any() else 1.0)
