"""Paths of equilibria: the holding force and the natural frequencies over a joint coordinate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from mbsvib.common.arrays import Array
from mbsvib.common.expected import a_result
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

if TYPE_CHECKING:
    from mbsvib.equilibrium.equilibrium_path import EquilibriumPath

# Modes that are drawn, and markers of special points.
LOWEST = 6
MARKERS = {"limit": ("o", "limit point"), "turning": ("s", "turning point"), "branch": ("D", "another path crosses")}


def path(data: EquilibriumPath[Any], *, ax: Given | None = None) -> Figure | Given:
    """Draw a path of equilibria: the holding force above, natural frequencies below, over the coordinate.

    Parameters
    ----------
    data : EquilibriumPath
        What ``Model.path`` returned.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Full lines are stable under the holding force, dashed ones are not; special points have markers. At most the six
        lowest frequencies are drawn.
    """
    a_result(data, "stable_held", "plots.path", "data", "what model.path(...) returns")
    with sheet("plots.path", ax, (style.ALONE, 5.4), 2, height_ratios=(3, 2)) as paper:
        above, below = paper.panels
        paper.join(paper.panels)
        # a step between a stable and an unstable point belongs to the one that is not on the border of both
        stable = data.curve_stable[:-1] | data.curve_stable[1:]
        for requested, dash, label in ((True, "-", "stable"), (False, "--", "unstable")):
            if (stable == requested).any():
                ends = np.stack((data.curve[:-1], data.curve[1:], np.full_like(data.curve[1:], np.nan)), axis=1)
                ends[stable != requested] = np.nan
                above.plot(*ends.reshape(-1, 2).T, color=style.COLOURS[0], linestyle=dash, label=label)
        for kind, (marker, label) in MARKERS.items():
            at = [(point.value, point.force) for point in data.points if point.kind == kind]
            if at:
                above.plot(*zip(*at, strict=True), marker, color=style.INK, mfc="white", markersize=5.0, label=label)
        values, rows = _frequency_lines(data)
        for mode in range(min(LOWEST, rows.shape[1])):
            below.plot(values, rows[:, mode], ".-", color=style.COLOURS[mode % len(style.COLOURS)], markersize=3.0)
        above.axhline(0.0, color=style.MARK, linewidth=0.6)
        below.set_ylim(bottom=0.0)
        above.set_ylabel(f"holding {'moment [N m]' if data.unit == 'rad' else 'force [N]'}")
        below.set(ylabel="natural frequency [Hz]", xlabel=f"{data.coordinate} [{data.unit}]")
        above.set_title("Path of equilibria")
        paper.name([data.name])
        paper.left_out(min(LOWEST, rows.shape[1]), rows.shape[1], "frequencies")
        paper.legend(columns=5)
    return paper.result


def _frequency_lines(data: EquilibriumPath[Any]) -> tuple[Array, Array]:
    """Coordinates (k,) and natural frequencies (k, modes) to draw, with NaN where lines end.

    Lines end where the number of stable modes changes, as this renumbers the modes; at a limit point, where this
    happens, the lowest frequency is 0.
    """
    nothing = np.full(data.frequencies.shape[1], np.nan)
    rest = np.where(np.arange(len(nothing)) == 0, 0.0, np.nan)
    count = np.isfinite(data.frequencies).sum(axis=1)
    values: list[float] = []
    rows: list[Array] = []
    for k, row in enumerate(data.frequencies):
        limits = [point.value for point in data.points if point.kind == "limit" and point.before == k]
        if k and (limits or count[k] != count[k - 1]):
            lost = int(count[k - 1]) - int(count[k])
            through = lost == 0 and bool(data.stable[k - 1] and data.stable[k])  # unstable in between only
            ends = limits[:1] if lost == 1 or through else []
            starts = limits[-1:] if lost == -1 or through else []
            values += [*ends, np.nan, *starts]
            rows += [rest] * len(ends) + [nothing] + [rest] * len(starts)
        values.append(float(data.values[k]))
        rows.append(row)
    return np.array(values), np.array(rows).reshape(len(rows), len(nothing))
