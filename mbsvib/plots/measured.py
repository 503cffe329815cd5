"""Measured responses with their standard deviation, or time records, and those of a model over them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mbsvib.common import units
from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, pairs, sheet

MOST = 12  # panels


def measured(data: Any, model: Complex | None, label: str = "model", *, ax: Given | None = None) -> Figure | Given:
    """Draw magnitude and phase of a Measurement, with one standard deviation, and a model's over them.

    ``model`` (outputs, inputs, n): its responses at the same lines and of the same quantities, with the name ``label``
    in the legend. One panel for each of at most twelve measured pairs of input and output.
    """
    drawn = [(int(i), int(j)) for i, j in np.argwhere(data.is_measured)]
    if not 0 < len(drawn) <= MOST:
        raise ResponseError(f"plot: {len(drawn)} measured pairs; expected 1 to {MOST}: data[outputs, inputs].plot().")
    columns = min(len(drawn), 3)
    f = data.frequencies
    shown = f > 0.0
    if not shown.any():
        raise ResponseError("plot: no line above 0 Hz; expected one at least, for an axis of frequencies.")
    with pairs("plot", ax, len(drawn), columns) as (paper, panels):
        for (i, j), (top, below) in zip(drawn, panels, strict=True):
            curves = [("measured", data.responses[i, j])] + ([] if model is None else [(label, model[i, j])])
            for n, (name, values) in enumerate(curves, paper.first):
                top.plot(f[shown], np.abs(values)[shown], label=name, **style.line(n))
                below.plot(f[shown], np.degrees(np.angle(values))[shown], **style.line(n))
            if data.variance is not None:
                sd = np.sqrt(data.variance[i, j])
                top.plot(f[shown], sd[shown], color=style.MARK, linewidth=0.8, label="standard deviation")
            style.logarithmic(top.yaxis)
            unit = units.pretty(units.ratio(data.output_units[i], data.input_units[j]))
            top.set_ylabel(f"magnitude{f' [{unit}]' if data.output_units[i] else ''}")
            style.title(top, data.inputs[j], data.outputs[i])
            style.phase_axis(below)
            style.frequency_axis(below, f[shown][0], f[shown][-1])
        paper.legend()
    return paper.result


def recorded(data: Any, records: Array, model: Array, label: str, *, ax: Given | None = None) -> Figure | Given:
    """Draw Records over time, a model's over them, and below what is left, a panel for each of at most twelve outputs.

    ``records``, ``model`` (outputs, N): what was measured, and what a model makes of it, with the name ``label``.
    """
    names = list(data.outputs)
    if len(names) > MOST:
        raise ResponseError(f"plot: {len(names)} outputs; expected 1 to {MOST}.")
    t = np.arange(data.samples) * data.t
    with sheet("plot", ax, (style.ALONE, 1.9 * len(names) + 0.8), len(names)) as paper:
        paper.join(paper.panels)
        for axes, name, unit, *curves in zip(paper.panels, names, data.output_units, records, model, records - model,
                                             strict=True):  # fmt: skip
            for n, (words, values) in enumerate(zip(("measured", label, "difference"), curves, strict=True),
                                                paper.first):  # fmt: skip
                axes.plot(t, values, label=words, **style.line(n))
            axes.set_ylabel(f"{name}{f' [{units.pretty(unit)}]' if unit else ''}")
        paper.panels[-1].set(xlabel="time [s]", xlim=(t[0], t[-1]))
        paper.legend()
    return paper.result
