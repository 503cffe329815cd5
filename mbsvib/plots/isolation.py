"""Transmissibility and compliance over frequency; transmissibility from the base to the body, axis by axis."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.expected import a_result
from mbsvib.errors import ModelError
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, Sheet, in_rows, sheet

SHADE = 0.15  # opacity of the band of singular values


def isolation(studies: Any, labels: Sequence[str] | None = None, *, ax: Given | None = None) -> Figure | Given:
    """Draw transmissibility and compliance over frequency.

    Parameters
    ----------
    studies : Isolation or sequence of Isolation
        What is compared, for one with the range of its singular values.
    labels : sequence of str, optional
        Names for the legend; default: those of the models, and of their controllers.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        The Frobenius index above, the largest compliance below; circles mark where isolation begins.

    Raises
    ------
    ModelError
        If there are no studies, or not as many labels.
    """
    named = named_studies(studies, labels, "plots.isolation")
    with sheet("plots.isolation", ax, (style.ALONE, 5.2), 2) as paper:
        top, below = paper.panels
        paper.join(paper.panels)
        ends, crossed = [float("inf"), 0.0], False
        for number, (name, study) in enumerate(named):
            f, look = study.frequencies, style.line(paper.first + number)
            if len(named) == 1:
                values = study.singular_values
                top.fill_between(f, values[-1], values[0], color=look["color"], alpha=SHADE, linewidth=0.0)
            top.plot(f, study.index, label=name, **look)
            below.plot(f, study.compliance_values[0], **look)
            ends = [min(ends[0], f[0]), max(ends[1], f[-1])]
            if f[0] < study.crossover < f[-1]:
                crossed = True
                top.plot([study.crossover], [1.0], "o", color=look["color"], mfc="white", markersize=5.0, zorder=3)
        top.axhline(1.0, color=style.MARK, linewidth=0.8)
        top.set_ylabel("transmissibility [1]")
        below.set_ylabel("largest compliance [m/N]")
        style.frequency_axis(below, ends[0], ends[1])
        style.logarithmic(top.yaxis, below.yaxis)
        top.set_title(f"Isolation of {named[0][1].scene.body} from {named[0][1].scene.base}")
        _explain(paper, [name for name, _ in named], crossed)
    return paper.result


def _explain(paper: Sheet[Any], names: Sequence[str], crossed: bool) -> None:
    """Say what curves, the band of a single study and circles are."""
    looks = [style.line(paper.first + number) for number in range(len(names))]
    alone = len(names) == 1
    handles: list[Any] = [Line2D([], [], label="Frobenius index" if alone else name, **look)
                          for name, look in zip(names, looks, strict=True)]  # fmt: skip
    if alone:
        handles.append(Patch(color=looks[0]["color"], alpha=SHADE, linewidth=0.0,
                             label="from smallest to largest singular value"))  # fmt: skip
    if crossed:
        handles.append(Line2D([], [], linestyle="none", marker="o", color=style.INK, mfc="white", markersize=5.0,
                              label="isolation begins"))  # fmt: skip
    if alone:
        paper.name(names)
        paper.legend(handles)
    else:
        paper.legend(handles, loc="outside upper right", columns=5)


def named_studies(studies: Any, labels: Sequence[str] | None, who: str) -> list[tuple[str, Any]]:
    """Return studies with their names in a legend; those of one figure have the same directions of the base."""
    listed = list(studies) if isinstance(studies, Iterable) else [studies]
    for study in listed:
        a_result(study, "transmissibility", who, "studies", "what isolation.study(...) or loop.isolation() returns")
    names = [study.linear.name for study in listed] if labels is None else list(labels)
    if not listed or len(names) != len(listed):
        raise ModelError(f"{who}: {len(listed)} studies and {len(names)} labels; expected at least one study, and a "
                         f"label for each.", field="labels")  # fmt: skip
    if len({study.scene.base_directions for study in listed}) > 1:
        raise ModelError(f"{who}: the bases of the studies are shaken in different directions; expected the same.",
                         field="studies")  # fmt: skip
    return list(zip(names, listed, strict=True))


THIN = {"linestyle": "--", "linewidth": 0.7}  # look of what comes from other axes
COUPLED = 1e-9  # share of the largest transmissibility below which an axis is not excited by another one


def transmissibility(studies: Any, labels: Sequence[str] | None = None, *, ax: Given | None = None) -> Figure | Given:
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
    named = named_studies(studies, labels, "plots.transmissibility")
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
    labels = ["base along this axis"] if len(names) == 1 else names
    looks = [style.line(paper.first + number) for number in range(len(names))]
    entries = [Line2D([], [], label=label, **look) for label, look in zip(labels, looks, strict=True)]
    thin = (looks[0] if len(names) == 1 else {"color": style.INK}) | THIN
    return [*entries, Line2D([], [], label="base along all other axes", **thin)] if coupled else entries
