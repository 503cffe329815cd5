"""Figures of isolation: transmissibility and compliance, root loci, Pareto fronts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ModelError
from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mbsvib.isolation.figures import Isolation
    from mbsvib.isolation.pareto import Front
    from mbsvib.isolation.root_locus import RootLocus

ROUNDS = (0.1, 0.2, 0.4, 0.7)  # lines of one damping ratio
ROOM = 0.04  # half of a label's width, in parts of the height


def isolation(studies: Isolation | Sequence[Isolation], labels: Sequence[str] | None = None) -> Figure:
    """Draw transmissibility and compliance over frequency.

    Parameters
    ----------
    studies : Isolation or sequence of Isolation
        What is compared, for one with the range of its singular values.
    labels : sequence of str, optional
        Names for the legend; default: those of the models.

    Returns
    -------
    matplotlib.figure.Figure
        The Frobenius index above, the largest compliance below; circles mark where isolation begins.

    Raises
    ------
    ModelError
        If there are no studies, or not as many labels.
    """
    from mbsvib.isolation.figures import Isolation

    listed = [studies] if isinstance(studies, Isolation) else list(studies)
    names = [study.name for study in listed] if labels is None else list(labels)
    if not listed or len(names) != len(listed):
        raise ModelError(f"isolation plot: {len(listed)} studies and {len(names)} labels; expected at least one study, "
                         f"and a label for each.", field="labels")  # fmt: skip
    with style.context():
        figure = style.new_figure(6.4, 5.6)
        top, below = figure.subplots(2, 1, sharex=True)
        for number, (study, name) in enumerate(zip(listed, names, strict=True)):
            f, look = study.frequencies, style.line(number)
            if len(listed) == 1:
                values = study.singular_values
                top.fill_between(f, values[-1], values[0], color=look["color"], alpha=0.15, linewidth=0.0)
            top.loglog(f, study.index, label=name, **look)
            below.loglog(f, study.compliance_values[0], **look)
            if f[0] < study.crossover < f[-1]:
                top.plot([study.crossover], [1.0], "o", color=look["color"], mfc="white", markersize=5.0, zorder=3)
        top.axhline(1.0, color=style.MARK, linewidth=0.8)
        top.set_ylabel("index of transmissibility [-]")
        below.set_ylabel("largest compliance [m/N]")
        below.set_xlabel("frequency [Hz]")
        top.set_title(f"Isolation of {listed[0].scene.body} from {listed[0].scene.base}")
        style.name_systems(figure, names, top)
    return figure


def root_locus(locus: RootLocus, scale: float = 1.0) -> Figure:
    """Draw how poles move as a gain grows.

    Parameters
    ----------
    locus : RootLocus
        What ``mbsvib.isolation.root_locus`` returned.
    scale : float
        What gains are multiplied by in the label.

    Returns
    -------
    matplotlib.figure.Figure
        Upper half of the plane of poles in Hz; crosses are open loops, circles zeros, dots the best gain of the least
        damped vibration; faint rays have one damping ratio. The title tells the least damping of what vibrates without
        the law and at the best gain.
    """
    with style.context():
        figure = style.new_figure(5.2, 5.2)
        axes = figure.subplots()
        poles = locus.curves / (2.0 * np.pi)
        largest = np.abs(poles[:, locus.modes]).max(initial=0.0) if len(locus.modes) else np.abs(poles).max()
        top = 1.15 * float(np.abs(poles[0]).max()) or float(largest) or 1.0
        marked = locus.best_poles / (2.0 * np.pi)
        for number, column in enumerate(locus.modes.tolist()):
            path, colour = poles[:, column], style.COLOURS[number % len(style.COLOURS)]
            axes.plot(path.real, np.abs(path.imag), color=colour)
            axes.plot(path.real[:1], path.imag[:1], "x", color=colour, markersize=6.0)
            axes.plot([marked[column].real], [np.abs(marked[column].imag)], "o", color=colour, markersize=4.0)
        zeros = locus.zeros[locus.zeros.imag >= 0.0] / (2.0 * np.pi)
        axes.plot(zeros.real, zeros.imag, "o", color=style.INK, mfc="none", markersize=6.0)
        left = min(-0.25 * top, 1.08 * float(np.maximum(poles.real[:, locus.modes], -top).min(initial=0.0)))
        right = max(0.05 * top, 1.08 * float(np.minimum(poles.real[:, locus.modes], top).max(initial=0.0)))
        _rays(axes, top, left)
        axes.set_xlim(left, right)
        axes.set_ylim(0.0, top)
        axes.axvline(0.0, color=style.MARK, linewidth=0.8)
        axes.set_aspect("equal")
        axes.set_xlabel("real part / 2 pi [1/s]")
        axes.set_ylabel("imaginary part / 2 pi [Hz]")
        figure.suptitle(f"{locus.name}: " + "\n".join(locus.summary(scale)), x=0.02, ha="left", fontsize=10.5)
    return figure


def front(data: Front) -> Figure:
    """Draw a Pareto front.

    Parameters
    ----------
    data : Front
        What ``Passive.front`` returned.

    Returns
    -------
    matplotlib.figure.Figure
        The objective over its price; hollow points are not optimal.
    """
    with style.context():
        figure = style.new_figure(5.2, 3.8)
        axes = figure.subplots()
        axes.loglog(data.price, data.objective, color=style.COLOURS[0], linewidth=0.8)
        for price, value, design in zip(data.price, data.objective, data.designs, strict=True):
            axes.plot([price], [value], "o", color=style.COLOURS[0], mfc=None if design.success else "white")
        axes.set_xlabel(data.labels[1])
        axes.set_ylabel(data.labels[0])
        axes.set_title("Pareto front")
        axes.set_title(data.designs[0].model.name, loc="right", color=style.MARK, fontsize=8.5)
    return figure


def _rays(axes: Axes, top: float, left: float) -> None:
    for ratio in ROUNDS:
        slope = np.sqrt(1.0 - ratio**2) / ratio
        axes.plot([0.0, -2.0 * top], [0.0, 2.0 * top * slope], color=style.FAINT, linewidth=0.8, zorder=0)
        x = -0.93 * top / slope
        if x - ROOM * top > left:
            axes.text(x, 0.93 * top, f"{100.0 * ratio:g} %", color=style.MARK, fontsize=7.5, ha="center")
