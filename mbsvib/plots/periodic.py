"""Linear periodic equations: frequencies over the cycle, and Floquet multipliers against the unit circle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.cycles.periodic import Periodic


def periodic(data: Periodic, *, ax: Given | None = None) -> Figure | Given:
    """Draw the frozen frequencies of small motions about a cycle, and their Floquet multipliers.

    Parameters
    ----------
    data : Periodic
        What ``cycle.periodic`` returned.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Left: |lambda| / 2 pi of the equations with the coefficients of each sample, dashed that of mean coefficients.
        Right: Floquet multipliers; deviations grow by those outside the unit circle.
    """
    values = data.multipliers()
    with sheet("plots.periodic", ax, (7.6, 3.4), 1, 2, width_ratios=(3, 2)) as paper:
        left, right = paper.panels
        for k, line in enumerate(np.abs(data.frozen.T[::2]) / (2.0 * np.pi)):
            left.plot(data.time, line, color=style.COLOURS[k % len(style.COLOURS)])
            left.axhline(float(np.abs(data.averaged[2 * k])) / (2.0 * np.pi), linestyle="--", linewidth=0.8,
                         color=style.COLOURS[k % len(style.COLOURS)])  # fmt: skip
        left.set_xlabel("time [s]")
        left.set_ylabel("frozen frequency [Hz]")
        left.set_ylim(bottom=0.0)
        turn = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 181))
        right.plot(turn.real, turn.imag, color=style.MARK, linewidth=0.8)
        grows = np.abs(values) > 1.0
        right.plot(values.real[~grows], values.imag[~grows], "o", color=style.COLOURS[0])
        right.plot(values.real[grows], values.imag[grows], "s", color=style.COLOURS[1])
        right.set_aspect("equal", adjustable="datalim")
        right.set_xlabel("real part [1]")
        right.set_ylabel("imaginary part [1]")
        right.set_title(f"multipliers: {'unstable' if grows.any() and not data.stable else 'stable'}")
        paper.name([data.name])
    return paper.result
