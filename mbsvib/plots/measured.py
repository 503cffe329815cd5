"""Measured responses, their standard deviation, and those of a model over them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import units
from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Complex

MOST = 12  # panels


def measured(data: Any, model: Complex | None, label: str = "model") -> Figure:
    """Draw magnitude and phase of measured responses, with one standard deviation, and a model's over them.

    Parameters
    ----------
    data : Measurement
        What is drawn, at most twelve pairs.
    model : array, shape (outputs, inputs, n), or None
        Responses of a model at the same lines and of the same quantities.
    label : str
        Name of the model in the legend.

    Returns
    -------
    matplotlib.figure.Figure
        One panel for each pair of input and output.

    Raises
    ------
    ResponseError
        If there are more than twelve pairs, or nothing was measured.
    """
    pairs = [(int(i), int(j)) for i, j in np.argwhere(data.is_measured)]
    if not 0 < len(pairs) <= MOST:
        raise ResponseError(f"plot: {len(pairs)} measured pairs; expected 1 to {MOST}: data[outputs, inputs].plot().")
    columns = min(len(pairs), 3)
    rows = -(-len(pairs) // columns)
    f = data.frequencies
    shown = f > 0.0
    with style.context():
        figure = style.new_figure(*style.panel_size(rows, columns, 3.4, 4.8))
        cells = figure.add_gridspec(2 * rows, columns, height_ratios=[2.0, 1.15] * rows)
        for k, (i, j) in enumerate(pairs):
            top = figure.add_subplot(cells[2 * (k // columns), k % columns])
            below = figure.add_subplot(cells[2 * (k // columns) + 1, k % columns], sharex=top)
            curves = [("measured", data.responses[i, j])] + ([] if model is None else [(label, model[i, j])])
            for n, (name, values) in enumerate(curves):
                top.plot(f[shown], np.abs(values)[shown], label=name, **style.line(n))
                below.plot(f[shown], np.degrees(np.angle(values))[shown], **style.line(n))
            if data.variance is not None:
                sd = np.sqrt(data.variance[i, j])
                top.plot(f[shown], sd[shown], color=style.MARK, linewidth=0.8, label="standard deviation")
            top.set_yscale("log")
            unit = units.pretty(units.ratio(data.output_units[i], data.input_units[j]))
            top.set_ylabel(f"magnitude{f' [{unit}]' if data.output_units[i] else ''}")
            top.set_title(f"{data.inputs[j]} → {data.outputs[i]}")
            top.tick_params(labelbottom=False, which="both")
            below.set_ylabel("phase [deg]")
            below.set_ylim(-190.0, 190.0)
            below.set_yticks([-180.0, -90.0, 0.0, 90.0, 180.0])
            style.frequency_axis(below, f[shown][0], f[shown][-1], "frequency [Hz]")
        style.legend(figure, figure.axes[0].get_legend_handles_labels()[0], "outside lower center", 3)
    return figure
