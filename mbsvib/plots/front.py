"""Pareto fronts of designs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.common import units
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOG_FROM = 4.0  # ratio of the highest to the lowest value from which an axis is logarithmic


def front(data: Any, *, ax: Given | None = None) -> Figure | Given:
    """Draw a Pareto front.

    Parameters
    ----------
    data : Front
        What ``mbsvib.isolation.Passive.front`` returned.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        The objective over the bounded quantity; hollow points are not optimal.
    """
    with sheet("plots.front", ax) as paper:
        axes = paper.panels[0]
        axes.plot(data.price, data.objective, color=style.COLOURS[0], linewidth=0.8)
        for values, axis in ((data.price, axes.xaxis), (data.objective, axes.yaxis)):
            if values.min() > 0.0 and values.max() > LOG_FROM * values.min():
                style.logarithmic(axis)
        for price, value, design in zip(data.price, data.objective, data.designs, strict=True):
            axes.plot([price], [value], "o", color=style.COLOURS[0], mfc=None if design.success else "white")
        axes.set_xlabel(units.pretty(data.labels[1]))
        axes.set_ylabel(units.pretty(data.labels[0]))
        axes.set_title("Pareto front")
        paper.name([data.designs[0].model.name])
    return paper.result
