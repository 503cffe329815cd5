"""Pareto fronts of designs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from mbsvib.common import units
from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Array
    from mbsvib.mechanism.mechanism import Mechanism


class Design(Protocol):
    """Data of one design."""

    @property
    def model(self) -> Mechanism:
        """The mechanism."""

    @property
    def success(self) -> bool:
        """Whether it is optimal."""


class Front(Protocol):
    """Data of a Pareto front; ``mbsvib.isolation.Passive.front`` returns one."""

    @property
    def labels(self) -> tuple[str, str]:
        """Labels of the objective and of the bounded quantity."""

    @property
    def objective(self) -> Array:
        """Objective of each design, shape (n,)."""

    @property
    def price(self) -> Array:
        """The bounded quantity of each design, shape (n,)."""

    @property
    def designs(self) -> Sequence[Design]:
        """The n designs."""

LOG_FROM = 4.0  # ratio of the highest to the lowest value from which an axis is logarithmic


def front(data: Front) -> Figure:
    """Draw a Pareto front.

    Parameters
    ----------
    data : Front
        What ``Passive.front`` returned.

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
