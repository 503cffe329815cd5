"""Trade-offs of several quantities: each against each, with the designs that none is better than."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

from mbsvib.common import units
from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# Quantities that are drawn, and panels in a row.
MOST, COLUMNS = 4, 3


def trade_off(data: Any) -> Figure:
    """Draw a trade-off: a panel for each pair of quantities.

    Parameters
    ----------
    data : TradeOff
        What ``studies.trade_off`` returned.

    Returns
    -------
    matplotlib.figure.Figure
        Designs as points; of three quantities, colours are the third one. Cross: the least of both on their own, which
        no design reaches. Star: the model that was given. At most four quantities are drawn.
    """
    pairs = list(combinations(list(data.values)[:MOST], 2))
    columns = min(len(pairs), COLUMNS)
    rows = -(-len(pairs) // columns)
    with style.context():
        figure = style.new_figure(*((5.2, 3.8) if len(pairs) == 1 else (3.4 * columns, 3.4 * rows)))
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, pair in zip(panels, pairs, strict=False):
            _panel(figure, axes, data, pair)
        if len(pairs) == 1:
            panels[0].set_title("Trade-off")
            style.name_aside(panels[0], data.name)
        else:
            style.head(figure, f"Trade-off of {data.name}")
        style.legend(figure, panels[0].get_legend_handles_labels()[0], "outside lower center", 3)
    return figure


def _panel(figure: Figure, axes: Axes, data: Any, pair: tuple[str, str]) -> None:
    x, y = pair
    third = [name for name in data.values if name not in pair]
    if len(third) == 1:
        points = axes.scatter(data.values[x], data.values[y], c=data.values[third[0]], s=22, cmap="viridis",
                              label="designs", zorder=3)  # fmt: skip
        figure.colorbar(points, ax=axes, label=units.pretty(data.labels[third[0]]), location="top")
    else:
        axes.plot(data.values[x], data.values[y], ".-" if not third else ".", color=style.COLOURS[0], label="designs")
    axes.plot(data.ideal[x], data.ideal[y], "x", color=style.INK, label="least of each on its own")
    axes.plot(data.began[x], data.began[y], "*", color=style.COLOURS[1], markersize=9, zorder=2, label="given model")
    axes.set_xlabel(units.pretty(data.labels[x]))
    axes.set_ylabel(units.pretty(data.labels[y]))
