"""Trade-offs of several quantities: each against each, with the designs that none is better than."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

from mbsvib.common import units
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, in_rows

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# Quantities that are drawn, and panels in a row.
MOST, COLUMNS = 4, 3


def trade_off(data: Any, *, ax: Given | None = None) -> Figure | Given:
    """Draw a trade-off: a panel for each pair of quantities.

    Parameters
    ----------
    data : TradeOff
        What ``studies.trade_off`` returned.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Designs as points; of three quantities, colours are the third one. Cross: the least of both on their own, which
        no design reaches. Star: the model that was given. At most four quantities are drawn.
    """
    pairs = list(combinations(list(data.values)[:MOST], 2))
    columns = min(len(pairs), COLUMNS)
    with in_rows("plots.trade_off", ax, len(pairs), columns, (4.0, 3.2)) as paper:
        for axes, pair in zip(paper.panels, pairs, strict=True):
            _panel(axes, data, pair)
        paper.head(f"Trade-off of {data.name}")
        paper.legend()
    return paper.result


def _panel(axes: Axes, data: Any, pair: tuple[str, str]) -> None:
    from matplotlib.ticker import MaxNLocator

    x, y = pair
    third = [name for name in data.values if name not in pair]
    if len(third) == 1:
        points = axes.scatter(data.values[x], data.values[y], c=data.values[third[0]], s=22, cmap="viridis",
                              label="designs", zorder=3)  # fmt: skip
        axes.figure.colorbar(points, ax=axes, label=units.pretty(data.labels[third[0]]), location="top",
                             ticks=MaxNLocator(3))  # fmt: skip
    else:
        axes.plot(data.values[x], data.values[y], ".-" if not third else ".", color=style.COLOURS[0], label="designs")
    axes.plot(data.ideal[x], data.ideal[y], "x", color=style.INK, label="least of each on its own")
    axes.plot(data.began[x], data.began[y], "*", color=style.COLOURS[1], markersize=9, zorder=2, label="given model")
    axes.set_xlabel(units.pretty(data.labels[x]))
    axes.set_ylabel(units.pretty(data.labels[y]))
    axes.locator_params(axis="x", nbins=3)
