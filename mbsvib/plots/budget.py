"""Error budgets over frequency: densities and cumulative root mean squares of an output, by source."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.units import pretty
from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Array

MOST = 5  # sources with curves of their own
DEPTH = 1e-5  # of the largest root of a density, and of the rms, down to which figures show curves


def budget_figure(
    name: str, output: str, unit: str, frequencies: Array, total: tuple[Array, Array],
    sources: Mapping[str, tuple[Array, Array]], contributions: Mapping[str, float],
) -> Figure:  # fmt: skip
    """Draw the root of the density of an output, and its cumulative root mean square, with those of its sources.

    ``frequencies`` (n,) [Hz]; ``total``, ``sources``: density (n,) [unit^2/Hz] and cumulative rms (n,) [unit] of all
    sources and of each, the largest first; ``contributions``: the rms of each.
    """
    shown = list(sources)[:MOST]
    with style.context():
        figure = style.new_figure(style.WIDEST * 0.85, 4.4)
        panels = figure.subplots(1, 2)
        curves = [("all", total, {"color": style.INK, "linewidth": 2.0})]
        curves += [(source, sources[source], style.line(k)) for k, source in enumerate(shown)]
        highest = [float(np.sqrt(total[0].max())), float(total[1].max())]
        for label, (density, cumulative), look in curves:
            for axes, values in zip(panels, (np.sqrt(density), cumulative), strict=True):
                visible = np.where(values > 0.0, values, np.nan)
                axes.plot(frequencies, visible, label=label, **look)
        for axes, top in zip(panels, highest, strict=True):
            style.frequency_axis(axes, frequencies[0], frequencies[-1])
            axes.set_yscale("log")
            if 0.0 < top < np.inf:
                axes.set_ylim(DEPTH * top, 3.0 * top)
        unit = pretty(unit)
        panels[0].set_title(f"{output} of {name}")
        panels[0].set_ylabel(f"root of the density [{unit}/√Hz]")
        panels[1].set_title("cumulative")
        panels[1].set_ylabel(f"rms from the first frequency on [{unit}]")
        left = len(sources) - len(shown)
        title = f"{left} smaller sources are not shown" if left else None
        handles = [f"{label}: {contributions[label]:.3g} {unit}" if label in contributions else label
                   for label, *_ in curves]  # fmt: skip
        figure.legend(panels[0].get_lines(), handles, loc="outside lower center", ncols=3, title=title)
    return figure
