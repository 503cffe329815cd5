"""Two models or measurements compared: the MAC of all modes, and the frequencies of pairs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 40  # modes of each that the matrix shows


def comparison(result: Any) -> Figure:
    """Draw the MAC of the modes of two models as a matrix, and how the frequencies of the pairs differ.

    Parameters
    ----------
    result : Comparison
        What ``mbsvib.compare`` returns, with modes of both.

    Returns
    -------
    matplotlib.figure.Figure
        MAC from 0 to 1, modes counted from 1; relative differences [%].

    Raises
    ------
    ResponseError
        If modes were not compared.
    """
    if not result.pairs:
        raise ResponseError("plots.comparison: no modes were compared; responses alone have no MAC.")
    with style.context():
        figure = style.new_figure(style.WIDEST * 0.8, 4.0)
        left, right = figure.subplots(1, 2)
        mac = result.mac[:MOST, :MOST]
        image = left.imshow(mac, vmin=0.0, vmax=1.0, cmap="Blues", origin="lower", aspect="auto",
                            extent=(0.5, mac.shape[1] + 0.5, 0.5, mac.shape[0] + 0.5))  # fmt: skip
        figure.colorbar(image, ax=left, label="MAC [1]")
        left.grid(False)
        left.set_title(f"{result.names[0]} (up), {result.names[1]} (right)")
        left.set_xlabel("mode")
        left.set_ylabel("mode")
        numbers = [pair.a for pair in result.pairs]
        values = np.array([100.0 * pair.difference for pair in result.pairs])
        right.bar(numbers, np.where(np.isfinite(values), values, np.nan), color=style.COLOURS[1], width=0.6)
        right.axhline(0.0, color=style.INK, linewidth=0.7)
        right.grid(False, axis="x")
        right.set_title(f"frequencies of {result.names[1]} against {result.names[0]}")
        right.set_xlabel("mode")
        right.set_ylabel("difference [%]")
        for axis in (left.xaxis, left.yaxis, right.xaxis):
            axis.get_major_locator().set_params(integer=True)
        style.head(figure, "Modes compared")
    return figure
