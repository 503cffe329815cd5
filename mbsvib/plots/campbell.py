"""Campbell diagrams."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

FEWEST, ABOVE = 8, 4.0  # modes that are drawn by default, and up to which multiple of the highest line
LINES: dict[str, Any] = {"forward": "-", "backward": (0, (5, 1.5)), "": (0, (1.5, 1))}


def campbell(
    data: Any, orders: Sequence[float] = (1.0,), modes: int | None = None, *, ax: Given | None = None
) -> Figure | Given:
    """Draw a Campbell diagram: damped frequencies over the speed.

    Parameters
    ----------
    data : Campbell
        What ``mbsvib.studies.campbell.campbell`` returned.
    orders : sequence of float
        Lines frequency = order x speed / 2 pi to draw.
    modes : int, optional
        How many of the lowest modes; default: at least 8, and all that come within four times the highest line.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Forward whirl full, backward dashed, motions without whirl dotted; critical speeds are circles, unstable modes
        are marked by crosses.
    """
    from matplotlib.lines import Line2D

    with sheet("plots.campbell", ax) as paper:
        axes = paper.panels[0]
        count = _lowest(data, orders) if modes is None else modes
        for mode in range(min(count, data.frequencies.shape[1])):
            frequency = data.frequencies[:, mode]
            colour = style.COLOURS[mode % len(style.COLOURS)]
            for direction, dash in LINES.items():
                # a piece belongs to the direction at its end: at rest most modes have none
                same = data.directions[1:, mode] == direction
                pieces = np.where(np.stack((same, same)), np.stack((frequency[:-1], frequency[1:])), np.nan)
                if same.any():
                    x = np.stack((data.speeds[:-1], data.speeds[1:], np.full(len(same), np.nan))).T.reshape(-1)
                    y = np.stack((*pieces, np.full(len(same), np.nan))).T.reshape(-1)
                    axes.plot(x, y, color=colour, linestyle=dash)
            grows = data.growing[:, mode]
            if grows.any():
                axes.plot(data.speeds[grows], frequency[grows], "x", color=colour, markersize=4.0)
        top = 1.08 * float(data.frequencies[:, :count].max(initial=0.0)) or 1.0
        for order in orders:
            axes.plot(data.speeds, order * np.abs(data.speeds) / (2.0 * np.pi), color=style.MARK, linewidth=0.8)
        for point in data.critical:
            axes.plot([point.speed], [point.frequency], "o", color=style.INK, markersize=5.0, mfc="white", zorder=3)
        axes.set_ylim(0.0, top)
        axes.set_xlim(float(data.speeds[0]), float(data.speeds[-1]))
        axes.set_xlabel("speed [rad/s]")
        axes.set_ylabel("damped frequency [Hz]")
        axes.set_title("Campbell diagram")
        met = {direction for row in data.directions[1:] for direction in row}
        handles = [Line2D([], [], color=style.INK, linestyle=dash, linewidth=1.2, label=direction or "no whirl")
                   for direction, dash in LINES.items() if direction in met]  # fmt: skip
        if data.growing.any():
            handles.append(Line2D([], [], marker="x", linestyle="none", color=style.INK, markersize=4.0,
                                  label="unstable"))  # fmt: skip
        handles += [Line2D([], [], color=style.MARK, linewidth=0.8, label=f"{order:g} × speed") for order in orders]
        if data.critical:
            handles.append(Line2D([], [], marker="o", linestyle="none", color=style.INK, markersize=5.0, mfc="white",
                                  label="critical speed"))  # fmt: skip
        paper.legend(handles)
        paper.name([data.name])
        if modes is None:
            paper.left_out(count, data.frequencies.shape[1], "modes", "ask for more by modes=...")
    return paper.result


def _lowest(data: Any, orders: Sequence[float]) -> int:
    """Return how many of the lowest modes are drawn: those of beams reach far above all speeds."""
    line = max((abs(order) for order in orders), default=0.0) * float(np.abs(data.speeds).max()) / (2.0 * np.pi)
    near = data.frequencies.min(axis=0) <= ABOVE * line
    return max(FEWEST, int(near.nonzero()[0].max(initial=-1)) + 1)
