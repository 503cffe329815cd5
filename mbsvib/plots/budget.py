"""Error budgets over frequency: densities and cumulative root mean squares of an output, by source."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mbsvib.common.arrays import Array
from mbsvib.common.units import pretty
from mbsvib.errors import counted
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

MOST = 5  # sources with curves of their own
# Shares of the largest root of a density, and of the rms, down to which figures show curves.
DEPTH, CUMULATIVE_DEPTH = 1e-5, 1e-3
ALIKE = 1e-6  # relative difference below which sources share a curve


def budget_figure(
    title: str, unit: str, frequencies: Array, total: tuple[Array, Array], sources: Mapping[str, tuple[Array, Array]],
    contributions: Mapping[str, float], rms: float, ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the root of the density of an output, and its cumulative root mean square, with those of its sources.

    ``frequencies`` (n,) [Hz]; ``total``, ``sources``: density (n,) [unit^2/Hz] and cumulative rms (n,) [unit] of all
    sources and of each, the largest first; ``contributions``: the rms of each; ``rms``: that of all.
    """
    groups = _alike(sources)
    least = CUMULATIVE_DEPTH * max([value for value in contributions.values() if value < np.inf], default=0.0)
    shown = [source for source in groups if contributions[source] > least][:MOST]
    unit = pretty(unit)
    with sheet("plot", ax, (style.WIDEST, 4.2), 1, 2) as paper:
        panels = paper.panels
        look: dict[str, Any] = {"color": style.INK, "linewidth": 2.0}
        curves = [(_label(["all"], rms, unit), total, look)]
        curves += [(_label(groups[source], contributions[source], unit), sources[source], style.line(k))
                   for k, source in enumerate(shown)]  # fmt: skip
        highest = [float(np.sqrt(total[0].max())), float(total[1].max())]
        for label, (density, cumulative), look in curves:
            for axes, values in zip(panels, (np.sqrt(density), cumulative), strict=True):
                visible = np.where(values > 0.0, values, np.nan)
                axes.plot(frequencies, visible, label=label, **look)
        for axes, top, depth in zip(panels, highest, (DEPTH, CUMULATIVE_DEPTH), strict=True):
            style.frequency_axis(axes, frequencies[0], frequencies[-1])
            style.logarithmic(axes.yaxis)
            if 0.0 < top < np.inf:
                axes.set_ylim(depth * top, 3.0 * top)
        panels[0].set(title=title, ylabel=f"root of the density [{unit}/√Hz]")
        panels[1].set(title="cumulative rms", ylabel=f"rms up to the frequency [{unit}]")
        left = len(sources) - sum(len(groups[source]) for source in shown)
        paper.legend(title=f"{counted(left, 'smaller source')} not shown" if left else None)
    return paper.result


def _label(group: list[str], contribution: float, unit: str) -> str:
    more = f" and {len(group) - 1} alike" if len(group) > 1 else ""
    return f"{group[0]}{more}: {contribution:.3g} {unit}{' each' if more else ''}".rstrip()


def _alike(sources: Mapping[str, tuple[Array, Array]]) -> dict[str, list[str]]:
    """Return the sources by the first of those that have the same density but for rounding."""
    groups: dict[str, list[str]] = {}
    for name, (density, _) in sources.items():
        near = ALIKE * float(density.max(initial=0.0))
        first = next((k for k in groups if np.allclose(sources[k][0], density, rtol=ALIKE, atol=near * ALIKE)), name)
        groups.setdefault(first, []).append(name)
    return groups
