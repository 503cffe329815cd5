"""Numbers over the variables of a study or a family: lines, maps, histograms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, Sheet, sheet

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array

MOST_LINES = 12
RATIO = 1e-6  # relative difference of ratios that are equal
BINS = 10, 60  # fewest and most in a histogram


def over_variables(
    values: NDArray[Any], label: str, columns: Mapping[str, Array], axes_values: Mapping[str, Array], *, grid: bool,
    units: Mapping[str, str], name: str, entries: Sequence[str] = (), ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw real numbers over the variables of a sweep.

    ``values`` (n,) or (n, ...): what is drawn. ``columns`` (n,): variables by point. ``grid``: whether points are all
    combinations of these. ``entries``: names or numbers of the modes that the entries of a vector belong to; default:
    the numbers of the entries. Returns lines over one variable, a map over two (of the first entry of a vector),
    histograms over more.
    """
    varied = [variable for variable, axis in axes_values.items() if len(np.unique(axis)) > 1]
    flat = values.reshape(len(values), -1).astype(float)
    words = _with_unit(label, units)
    with sheet("plot", ax) as paper:
        axes = paper.panels[0]
        if len(varied) == 1:
            _lines(paper, columns[varied[0]], flat, entries)
            axes.set_xlabel(_with_unit(varied[0], units))
            axes.set_ylabel(words)
            if in_ratios(columns[varied[0]]):
                style.logarithmic(axes.xaxis)
        elif len(varied) == 2 and grid:
            shape = [len(axis) for axis in axes_values.values()]
            _map(axes, [axes_values[variable] for variable in varied], flat[:, 0].reshape(shape).squeeze(),
                 words if flat.shape[1] == 1 else f"mode {entries[0]}: {words}" if entries else f"entry 1 of {words}")
            axes.set_xlabel(_with_unit(varied[1], units))
            axes.set_ylabel(_with_unit(varied[0], units))
            for axis, variable in zip((axes.xaxis, axes.yaxis), reversed(varied), strict=True):
                if in_ratios(axes_values[variable]):
                    style.logarithmic(axis)
        else:
            histograms(axes, flat)
            axes.set_xlabel(words)
            axes.set_ylabel("number of points")
        axes.set_title(label)
        paper.name([name])
    return paper.result


def in_ratios(values: Array) -> bool:
    """Return whether values ascend or descend in equal ratios, as ``--log`` and ``geomspace`` make them."""
    steps = np.log(values) if len(values) > 2 and (values > 0.0).all() else np.zeros(1)
    ratios = np.diff(steps)
    return bool(len(ratios) and ratios.any() and np.ptp(ratios) <= RATIO * np.abs(ratios).max())


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


def _lines(paper: Sheet[Any], x: NDArray[Any], flat: NDArray[Any], names: Sequence[str] = ()) -> None:
    order = np.argsort(x, kind="stable")
    samples = not ((np.diff(x) >= 0.0).all() or (np.diff(x) <= 0.0).all())
    dots: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 3.0} if samples else {}
    for i in range(min(flat.shape[1], MOST_LINES)):
        label = names[i] if names else f"{i + 1}"
        paper.panels[0].plot(x[order], flat[order, i], label=label, **(style.line(i) | dots))
    if flat.shape[1] > 1:
        singular, plural = ("mode", "modes") if names else ("entry", "entries")
        paper.legend(loc="outside right upper", columns=1, title=_counted(singular, plural, flat.shape[1]))


def _map(axes: Axes, grid: Sequence[Array], values: Array, words: str) -> None:
    """Colours of values (rows, columns) over the two axes of a grid, whose values may be in any order."""
    first, second = grid
    rows, columns = np.argsort(first), np.argsort(second)
    image = axes.pcolormesh(second[columns], first[rows], values[np.ix_(rows, columns)], shading="nearest",
                            cmap="viridis", rasterized=True)  # fmt: skip
    axes.grid(False)
    axes.figure.colorbar(image, ax=axes, label=words)


def _counted(singular: str, plural: str, count: int) -> str:
    """Return what lines are; how many of them are shown, if not all."""
    return singular if count <= MOST_LINES else f"{MOST_LINES} of {count} {plural}"


def _with_unit(name: str, units: Mapping[str, str]) -> str:
    return f"{name} [{units[name]}]" if name in units else name
