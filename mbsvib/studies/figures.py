"""Figures of studies, drawn from plain arrays: sweeps, root loci, tolerances."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex

MOST_LINES = 12
MOST_DOTS = 60  # points of a sweep that are marked one by one on its lines
BINS = 10, 60  # fewest and most in a histogram


def over_variables(
    values: NDArray[Any], label: str, columns: Mapping[str, Array], axes_values: Mapping[str, Array], *, grid: bool,
    units: Mapping[str, str], name: str, entries: Sequence[str] = (),
) -> Figure:  # fmt: skip
    """Draw real numbers over the variables of a sweep.

    ``values`` (n,) or (n, ...): what is drawn. ``columns`` (n,): variables by point. ``grid``: whether points are all
    combinations of these. ``entries``: names or numbers of the modes that the entries of a vector belong to; default:
    the numbers of the entries. Returns lines over one variable, a map over two (of the first entry of a vector),
    histograms over more.
    """
    varied = [variable for variable, axis in axes_values.items() if len(np.unique(axis)) > 1]
    flat = values.reshape(len(values), -1).astype(float)
    words = _with_unit(label, units)
    with style.context():
        figure = style.new_figure(6.4, 4.2)
        axes = figure.subplots()
        if len(varied) == 1:
            _lines(axes, columns[varied[0]], flat, entries)
            axes.set_xlabel(_with_unit(varied[0], units))
            axes.set_ylabel(words)
        elif len(varied) == 2 and grid:
            shape = [len(axis) for axis in axes_values.values()]
            _map(figure, axes, [axes_values[variable] for variable in varied], flat[:, 0].reshape(shape).squeeze(),
                 words if flat.shape[1] == 1 else f"mode {entries[0]}: {words}" if entries else f"entry 1 of {words}")
            axes.set_xlabel(_with_unit(varied[1], units))
            axes.set_ylabel(_with_unit(varied[0], units))
        else:
            histograms(axes, flat)
            axes.set_xlabel(words)
            axes.set_ylabel("number of points")
        over = ", ".join(varied[:3]) + (", ..." if len(varied) > 3 else "")
        title(axes, f"{label} over {over or 'nothing'}", name)
    return figure


def histograms(axes: Axes, values: NDArray[Any]) -> None:
    """Draw histograms of columns with distant values on one axis, with separate bins for each."""
    for i in range(min(values.shape[1], MOST_LINES)):
        column = values[np.isfinite(values[:, i]), i]
        colour = style.COLOURS[i % len(style.COLOURS)]
        axes.hist(column, bins=bins(len(column)), color=colour, alpha=0.75, label=f"{i + 1}")
    if values.shape[1] > 1:
        axes.legend(title=_counted("entry", "entries", values.shape[1]))


def bins(count: int) -> int:
    """Return into how many bins a histogram sorts so many numbers: twice the root of their number."""
    return int(np.clip(2.0 * count**0.5, *BINS))


def title(axes: Axes, words: str, name: str) -> None:
    """Write a title, and the model's name where there is room."""
    axes.set_title(style.wrapped(axes.figure, words, style.ROOM))
    if len(words) + len(name) < 55:
        style.name_aside(axes, name)


def root_locus(
    eigenvalues: Complex, modes: Sequence[str], variables: Iterable[str], name: str, *, samples: bool
) -> Figure:
    """Draw the eigenvalues of the first 12 modes over the points of a sweep, in the upper half of the complex plane.

    ``eigenvalues`` (n, modes): those without negative imaginary parts [1/s]. ``samples``: whether neighbours in the
    array are not neighbours in the variables, so that no line joins them.
    """
    with style.context():
        figure = style.new_figure(6.4, 4.2)
        axes = figure.subplots()
        for i, (mode, track) in enumerate(zip(modes, eigenvalues.T[:MOST_LINES], strict=False)):
            line = style.line(i)
            dots: dict[str, Any] = {"marker": ".", "markersize": 3.0} if samples or len(track) <= MOST_DOTS else {}
            if samples:
                dots["linestyle"] = "none"
            axes.plot(track.real, track.imag, label=mode, **(line | dots))
            if not samples:
                good = np.flatnonzero(np.isfinite(track))
                for at, marker in ((good[0], "o"), (good[-1], "s")):
                    axes.plot(track[at].real, track[at].imag, marker, color=line["color"], markersize=4.5, mfc="white")
        axes.axvline(0.0, color=style.MARK, linewidth=0.8, zorder=0)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("real part [1/s]")
        axes.set_ylabel("imaginary part [rad/s]")
        axes.legend(title="mode")
        title(axes, f"Eigenvalues over {', '.join(variables)}", name)
        style.tell_left_out(figure, min(len(modes), MOST_LINES), len(modes), "modes", "choose by modes=")
    return figure


def tolerances(labels: Sequence[str], sampled: Array, linear: Array, nominal: Array, name: str) -> Figure:
    """Draw histograms of a tolerance analysis: samples as areas, first-order values as lines, nominal values dashed.

    ``sampled``, ``linear`` (n, k): numbers of the samples, and their first-order values. ``nominal`` (k,): numbers of
    the nominal model.
    """
    count = len(labels)
    columns = min(3, count)
    with style.context():
        rows = -(-count // columns)
        figure = style.new_figure(*((6.4, 4.2) if count == 1 else (3.2 * columns, 2.2 * rows)))
        panels = figure.subplots(rows, columns, squeeze=False)
        for axes in panels.flat[count:]:
            axes.set_visible(False)
        for i, (axes, label) in enumerate(zip(panels.flat, labels, strict=False)):
            shown, first = (table[np.isfinite(table[:, i]), i] for table in (sampled, linear))
            low, high = np.quantile(np.concatenate((shown, first)), (0.0005, 0.9995))
            edges = np.linspace(low, high, bins(len(shown)) + 1)
            axes.hist(shown, bins=edges, color=style.COLOURS[5], label="samples")
            if len(first):
                axes.hist(first, bins=edges, histtype="step", color=style.COLOURS[1], label="first order")
            axes.axvline(nominal[i], color=style.INK, linewidth=0.9, linestyle="--", label="nominal")
            axes.set_xlabel(label)
            axes.set_ylabel("number of samples")
            axes.locator_params(axis="x", nbins=4)
        panels.flat[0].legend(fontsize=7.0)
        style.head(figure, f"Tolerances of {name}")
    return figure


def _lines(axes: Axes, x: NDArray[Any], flat: NDArray[Any], names: Sequence[str] = ()) -> None:
    order = np.argsort(x, kind="stable")
    samples = not ((np.diff(x) >= 0.0).all() or (np.diff(x) <= 0.0).all())
    for i in range(min(flat.shape[1], MOST_LINES)):
        dots: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 3.0} if samples else {}
        axes.plot(x[order], flat[order, i], label=names[i] if names else f"{i + 1}", **(style.line(i) | dots))
    if flat.shape[1] > 1:
        singular, plural = ("mode", "modes") if names else ("entry", "entries")
        axes.figure.legend(title=_counted(singular, plural, flat.shape[1]), loc="outside right upper")


def _map(figure: Figure, axes: Axes, grid: Sequence[Array], values: Array, words: str) -> None:
    """Colours of values (rows, columns) over the two axes of a grid, whose values may be in any order."""
    first, second = grid
    rows, columns = np.argsort(first), np.argsort(second)
    image = axes.pcolormesh(second[columns], first[rows], values[np.ix_(rows, columns)], shading="nearest",
                            cmap="viridis", rasterized=True)  # fmt: skip
    axes.grid(False)
    figure.colorbar(image, ax=axes, label=words)


def _counted(singular: str, plural: str, count: int) -> str:
    """Return what lines are; how many of them are shown, if not all."""
    return singular if count <= MOST_LINES else f"{MOST_LINES} of {count} {plural}"


def _with_unit(name: str, units: Mapping[str, str]) -> str:
    return f"{name} [{units[name]}]" if name in units else name
