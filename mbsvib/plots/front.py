"""Pareto fronts of designs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.common import units
from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOG_FROM = 4.0  # ratio of the highest to the lowest value from which an axis is logarithmic


def front(data: Any) -> Figure:
    """Draw a Pareto front.

    Parameters
    ----------
    data : Front
        What ``mbsvib.isolation.Passive.front`` returned.

    Returns
    -------
    matplotlib.figure.Figure
        The objective over the bounded quantity; hollow points are not optimal.
    """
    with style.context():
        figure = style.new_figure(5.2, 3.8)
        axes = figure.subplots()
        axes.plot(data.price, data.objective, color=style.COLOURS[0], linewidth=0.8)
        for values, scale in ((data.price, axes.set_xscale), (data.objective, axes.set_yscale)):
            if values.min() > 0.0 and values.max() > LOG_FROM * values.min():
                scale("log")
        for price, value, design in zip(data.price, data.objective, data.designs, strict=True):
            axes.plot([price], [value], "o", color=style.COLOURS[0], mfc=None if design.success else "white")
        axes.set_xlabel(units.pretty(data.labels[1]))
        axes.set_ylabel(units.pretty(data.labels[0]))
        axes.set_title("Pareto front")
        style.name_aside(axes, data.designs[0].model.name)
    return figure
