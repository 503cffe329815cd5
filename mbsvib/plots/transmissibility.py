"""Transmissibility from the base to the body, axis by axis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, Sheet, in_rows
from mbsvib.plots.isolation import named_studies

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

THIN = {"linestyle": "--", "linewidth": 0.7}  # look of what comes from other axes
COUPLED = 1e-9  # share of the largest transmissibility below which an axis is not excited by another one


def transmissibility(
    studies: Any, labels: Sequence[str] | None = None, *, ax: Given | None = None
) -> Figure | Given:
    """Draw the transmissibility of each axis in which the base is shaken, and what comes from the other axes.

    Parameters
    ----------
    studies : Isolation or sequence of Isolation
        What is compared, with the same directions of the base.
    labels : sequence of str, optional
        Names for the legend; default: those of the models, and of their controllers.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        A panel for each axis: its motion over that of the base along it full; thin and dashed the root of the sum of
        squares over all other axes of the base, rotations in metres at the characteristic length.

    Raises
    ------
    ModelError
        If there are no studies, not as many labels, or directions differ.
    """
    named = named_studies(studies, labels, "transmissibility plot")
    axes_drawn = named[0][1].scene.base_directions
    columns = min(len(axes_drawn), 3)
    with in_rows("plots.transmissibility", ax, len(axes_drawn), columns, (4.0, 2.8)) as paper:
        coupled = False
        for panel, (direction, axes) in enumerate(zip(axes_drawn, paper.panels, strict=True)):
            for number, (label, study) in enumerate(named, paper.first):
                row = np.abs(study.scaled[DIRECTIONS.index(direction)])
                others = np.linalg.norm(np.delete(row, panel, axis=0), axis=0)
                axes.plot(study.frequencies, row[panel], label=label, **style.line(number))
                if others.max(initial=0.0) > COUPLED * row.max():
                    axes.plot(study.frequencies, others, **style.line(number) | THIN)
                    coupled = True
            style.frequency_axis(axes, named[0][1].frequencies[0], named[0][1].frequencies[-1],
                                 "frequency [Hz]" if panel + columns >= len(axes_drawn) else "")  # fmt: skip
            style.logarithmic(axes.yaxis)
            axes.set_title(f"base.{direction} → {direction}")
            axes.set_ylabel("transmissibility [1]" if panel % columns == 0 else "")
        names = [label for label, _ in named]
        if len(named) == 1:
            paper.name(names, columns - 1)
        paper.legend(_entries(paper, names, coupled), columns=4)
    return paper.result


def _entries(paper: Sheet[Any], names: Sequence[str], coupled: bool) -> list[Any]:
    """What curves are: those of each study, and thin and dashed ones if there are any."""
    from matplotlib.lines import Line2D

    labels = ["base along this axis"] if len(names) == 1 else names
    looks = [style.line(paper.first + number) for number in range(len(names))]
    entries = [Line2D([], [], label=label, **look) for label, look in zip(labels, looks, strict=True)]
    thin = (looks[0] if len(names) == 1 else {"color": style.INK}) | THIN
    return [*entries, Line2D([], [], label="base along all other axes", **thin)] if coupled else entries
