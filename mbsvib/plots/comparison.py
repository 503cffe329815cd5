"""Two models or measurements compared: the MAC of all modes, and the frequencies of pairs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 40  # modes of each that the matrix shows


def comparison(result: Any, *, ax: Given | None = None) -> Figure | Given:
    """Draw the MAC of the modes of two models as a matrix, and how the frequencies of the pairs differ.

    Parameters
    ----------
    result : Comparison
        What ``mbsvib.compare`` returns, with modes of both.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        MAC from 0 to 1, modes counted from 1; relative differences [%].

    Raises
    ------
    ResponseError
        If modes were not compared.
    """
    if not result.pairs:
        raise ResponseError("plots.comparison: no modes were compared; responses alone have no MAC.")
    with sheet("plots.comparison", ax, (style.WIDEST, 4.0), 1, 2) as paper:
        left, right = paper.panels
        mac = result.mac[:MOST, :MOST]
        image = left.imshow(mac, vmin=0.0, vmax=1.0, cmap="Blues", origin="lower", aspect="auto",
                            extent=(0.5, mac.shape[1] + 0.5, 0.5, mac.shape[0] + 0.5))  # fmt: skip
        paper.figure.colorbar(image, ax=left, label="MAC [1]")
        left.grid(False)
        left.set_title("MAC")
        left.set_xlabel(f"mode of {result.names[1]}")
        left.set_ylabel(f"mode of {result.names[0]}")
        numbers = [pair.a for pair in result.pairs]
        values = np.array([100.0 * pair.difference for pair in result.pairs])
        right.bar(numbers, np.where(np.isfinite(values), values, np.nan), color=style.COLOURS[1], width=0.6)
        right.axhline(0.0, color=style.INK, linewidth=0.7)
        right.grid(False, axis="x")
        right.set_title("frequencies")
        right.set_xlabel(f"mode of {result.names[0]}")
        right.set_ylabel("difference [%]")
        for axis in (left.xaxis, left.yaxis, right.xaxis):
            axis.get_major_locator().set_params(integer=True)
        paper.head("Modes compared")
    return paper.result
