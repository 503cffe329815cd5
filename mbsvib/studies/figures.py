"""Figures of studies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ModelError
from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from mbsvib.studies.results import Sweep
    from mbsvib.studies.scatter import Tolerances
    from mbsvib.studies.tracks import Tracks

MOST_LINES = 12
BINS = 60


def sweep(data: Sweep, label: str | None = None) -> Figure:
    """Draw one result of a sweep.

    Parameters
    ----------
    data : Sweep
        The sweep.
    label : str, optional
        The result; default: the first of real numbers.

    Returns
    -------
    matplotlib.figure.Figure
        Lines over one variable, a map over two (of the first entry of a vector), histograms over more.

    Raises
    ------
    ModelError
        If there is no result of real numbers to draw.
    """
    real = (key for key, found in data.results.items() if found.dtype.kind in "biuf")
    name = next(real, next(iter(data.results), "")) if label is None else label
    values = data[name]
    if values.dtype.kind not in "biuf":
        raise ModelError(f"plot of '{data.name}': '{name}' is not of real numbers; draw results of real numbers.",
                         element=name, field="label")  # fmt: skip
    varied = [variable for variable, axis in data.axes.items() if len(np.unique(axis)) > 1]
    flat = values.reshape(len(data), -1).astype(float)
    with style.context():
        figure = style.new_figure(6.4, 4.2)
        axes = figure.subplots()
        if len(varied) == 1:
            _lines(axes, data.parameters[varied[0]], flat, getattr(data, "modes", ()))
            axes.set_xlabel(_said(varied[0], data))
            axes.set_ylabel(_said(name, data))
        elif len(varied) == 2 and len(data.shape) > 1:
            said = _said(name, data)
            _map(figure, axes, data, varied, flat[:, 0], said if flat.shape[1] == 1 else f"entry 1 of {said}")
        else:
            histograms(axes, flat)
            axes.set_xlabel(_said(name, data))
            axes.set_ylabel("points [-]")
        over = ", ".join(varied[:3]) + (", ..." if len(varied) > 3 else "")
        title(axes, f"{name} over {over or 'nothing'}", data.name)
    return figure


def histograms(axes: Axes, values: NDArray[Any]) -> None:
    """Draw histograms of columns that are far from each other on one axis, each in bins of its own."""
    for i in range(min(values.shape[1], MOST_LINES)):
        column = values[np.isfinite(values[:, i]), i]
        axes.hist(column, bins=BINS, color=style.COLOURS[i % len(style.COLOURS)], alpha=0.75, label=f"{i + 1}")
    if values.shape[1] > 1:
        axes.legend(title="entry")


def title(axes: Axes, words: str, name: str) -> None:
    """Write a title, and the model's name where there is room."""
    axes.set_title(words)
    if len(words) + len(name) < 55:
        axes.set_title(name, loc="right", color=style.MARK, fontsize=8.5)


def root_locus(data: Tracks) -> Figure:
    """Draw the eigenvalues of tracked modes.

    Parameters
    ----------
    data : Tracks
        The modes.

    Returns
    -------
    matplotlib.figure.Figure
        The upper half of the complex plane, a line for each mode.
    """
    values = data["eigenvalues"]
    samples = len(data.shape) > 1
    with style.context():
        figure = style.new_figure(6.4, 4.2)
        axes = figure.subplots()
        for i, (name, track) in enumerate(zip(data.modes, values.T[:MOST_LINES], strict=False)):
            look = style.line(i)
            dots: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 3.0} if samples else {}
            axes.plot(track.real, track.imag, label=name, **(look | dots))
            if not samples:
                good = np.flatnonzero(np.isfinite(track))
                for at, marker in ((good[0], "o"), (good[-1], "s")):
                    axes.plot(track[at].real, track[at].imag, marker, color=look["color"], markersize=4.5, mfc="white")
        axes.axvline(0.0, color=style.MARK, linewidth=0.8, zorder=0)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("real part [1/s]")
        axes.set_ylabel("imaginary part [rad/s]")
        axes.legend(title="mode")
        title(axes, f"Eigenvalues over {', '.join(data.parameters)}", data.name)
    return figure


def tolerances(data: Tolerances, label: str | None = None) -> Figure:
    """Draw histograms of a tolerance analysis.

    Parameters
    ----------
    data : Tolerances
        The analysis.
    label : str, optional
        Which number; default: the first twelve.

    Returns
    -------
    matplotlib.figure.Figure
        Samples as areas, what first order says of them as lines, the nominal value as a dashed one.
    """
    which = list(range(min(len(data.labels), MOST_LINES))) if label is None else [data.index(label)]
    columns = min(3, len(which))
    with style.context():
        rows = -(-len(which) // columns)
        figure = style.new_figure(*((6.4, 4.2) if len(which) == 1 else (3.2 * columns, 2.2 * rows)))
        panels = figure.subplots(rows, columns, squeeze=False)
        for axes in panels.flat[len(which) :]:
            axes.set_visible(False)
        for axes, i in zip(panels.flat, which, strict=False):
            sampled = data.sampled[np.isfinite(data.sampled[:, i]), i]
            linear = data.linear[np.isfinite(data.linear[:, i]), i]
            both = np.concatenate((sampled, linear))
            low, high = np.quantile(both, (0.0005, 0.9995))
            edges = np.linspace(low, high, BINS + 1)
            axes.hist(sampled, bins=edges, color=style.COLOURS[5], label="samples")
            if len(linear):
                axes.hist(linear, bins=edges, histtype="step", color=style.COLOURS[1], label="first order")
            axes.axvline(data.nominal[i], color=style.INK, linewidth=0.9, linestyle="--", label="nominal")
            name, _, unit = data.labels[i].partition(" [")
            axes.set_xlabel(f"{name} [{unit or '-]'}")
            axes.set_ylabel("samples [-]")
            axes.locator_params(axis="x", nbins=4)
        panels.flat[0].legend(fontsize=7.0)
        figure.suptitle(f"Tolerances of {data.name}", x=0.02, ha="left", fontsize=10.5)
    return figure


def _lines(axes: Axes, x: NDArray[Any], flat: NDArray[Any], names: Sequence[str] = ()) -> None:
    order = np.argsort(x, kind="stable")
    samples = not ((np.diff(x) >= 0.0).all() or (np.diff(x) <= 0.0).all())
    for i in range(min(flat.shape[1], MOST_LINES)):
        dots: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 3.0} if samples else {}
        axes.plot(x[order], flat[order, i], label=names[i] if names else f"{i + 1}", **(style.line(i) | dots))
    if flat.shape[1] > 1:
        axes.legend(title="mode" if names else "entry", ncols=2)


def _map(figure: Figure, axes: Axes, data: Sweep, varied: list[str], values: NDArray[Any], words: str) -> None:
    shape = [len(axis) for axis in data.axes.values()]
    table = values.reshape(shape).squeeze()
    first, second = (data.axes[name] for name in varied)
    rows, columns = np.argsort(first), np.argsort(second)
    image = axes.pcolormesh(second[columns], first[rows], table[np.ix_(rows, columns)], shading="nearest",
                            cmap="viridis", rasterized=True)  # fmt: skip
    axes.grid(False)
    figure.colorbar(image, ax=axes, label=words)
    axes.set_xlabel(_said(varied[1], data))
    axes.set_ylabel(_said(varied[0], data))


def _said(name: str, data: Sweep) -> str:
    return f"{name} [{data.units.get(name, '-')}]"
