"""What each mode contributes to frequency responses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common import units
from mbsvib.plots import _style as style
from mbsvib.plots._curves import curves, pairs_of, shared_grid
from mbsvib.plots._sheet import Given, in_rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from mbsvib.common.selection import Names
    from mbsvib.plots._curves import System

MOST, LEAST = 6, 1e-3  # modes with curves of their own, and their least share of the largest response


def mode_contributions(
    system: System, outputs: Names = None, inputs: Names = None, frequencies: ArrayLike | None = None, *,
    span: tuple[float | None, float | None] = (None, None), ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the magnitude of responses and of what each mode contributes to them.

    Parameters
    ----------
    system : System
        The equations of motion.
    outputs, inputs : str or sequence of str, optional
        Names; default: all, if they are not too many.
    frequencies : array-like, shape (n,), optional
        Where to compute [Hz]; default: a grid that resolves every resonance in ``span``.
    span : (float or None, float or None)
        First and last frequency [Hz]; None: from the modes.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        A panel for each pair: the response black, and the six modes with the largest contributions, at least 0.1 % of
        the largest response.

    Raises
    ------
    ResponseError
        If a name is unknown, there are more than twelve panels, or modes do not add up to the response.
    """
    panels = pairs_of(system, outputs, inputs)
    flat = [pair for row in panels for pair in row]
    grid = shared_grid([system], flat, frequencies, span)
    columns = max(map(len, panels))
    with in_rows("plots.mode_contributions", ax, len(flat), columns, (4.0, 3.2)) as paper:
        for axes, pair, curve in zip(paper.panels, flat, curves(system, flat, grid), strict=True):
            axes.set_title(f"{curve.source} → {curve.output}")
            axes.set_ylabel(f"magnitude [{units.pretty(units.ratio(curve.output_unit, curve.source_unit))}]")
            if curve.negligible:
                style.frequency_axis(axes, grid[0], grid[-1])
                style.nothing(axes)
                continue
            parts = np.abs(system.mode_contributions(2.0 * np.pi * grid, *pair)[:, 0, 0])
            largest = parts.max(axis=1)
            top = float(np.abs(curve.values).max())
            shown = [k for k in np.argsort(-largest, kind="stable")[:MOST] if largest[k] > LEAST * top]
            axes.plot(grid, np.abs(curve.values), color=style.INK, linewidth=2.0, label="all")
            for number, k in enumerate(sorted(shown)):
                axes.plot(grid, parts[k], label=f"mode {k + 1}", **style.line(number))
            style.frequency_axis(axes, grid[0], grid[-1])
            style.logarithmic(axes.yaxis)
            axes.set_ylim(bottom=max(axes.get_ylim()[0], 0.1 * float(np.abs(curve.values).min())))
            axes.legend(ncols=2)
    return paper.result
