"""Two sets of modes compared: frequencies and damping ratios beside each other with their differences, and the MAC."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from mbsvib.common.expected import a_system, kind_of, reals
from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array
    from mbsvib.modes.result import Modes
    from mbsvib.plots._curves import System

    ModeSet: TypeAlias = System | Modes | ArrayLike

LOG_FROM = 20.0  # ratio of the highest to the lowest value from which the axis is logarithmic
MOST_TICKS = 20
MOST_IN_MATRIX = 40  # modes of each that the matrix of MAC shows
EXPECTED = "a System, its modes, ascending frequencies [Hz], or frequencies and damping ratios, shape (2, n)"


class Values(NamedTuple):
    """Natural frequencies [Hz] (n,), and damping ratios (n,) where they are known."""

    frequencies: Array
    ratios: Array | None


def mode_comparison(
    reference: ModeSet, other: ModeSet, labels: Sequence[str] | None = None, *, ax: Given | None = None
) -> Figure | Given:
    """Draw natural frequencies and damping ratios over the order of the modes, and how the second set differs.

    100 (f_other - f_reference) / f_reference, and the same of the damping ratios

    Parameters
    ----------
    reference, other : System, Modes or array-like, shape (n,) or (2, n)
        Two systems or sets of modes, or natural frequencies [Hz] in ascending order, as measured or as another program
        has them, with damping ratios [1] as the second row where they are known. Where the numbers of modes differ,
        those are compared that both have.
    labels : sequence of str, optional
        Names in the legend; default: those of the systems, "reference" and "other" for frequencies.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Frequencies [Hz] and, if both have them, damping ratios [%] above; relative differences [%] below. Rigid-body
        modes, and modes that are not damped in the reference, have no relative difference.

    Raises
    ------
    ResponseError
        If there is no mode, frequencies are not ascending, or there are not two labels.

    Source
    ------
    Jiang, W., Chen, X. D. (2011), Vibration and sensitivity analysis of spatial multibody systems based on constraint
    topology transformation, in: Advances in Vibration Analysis Research, figures 10 and 13.
    """
    names = [getattr(part, "name", default) for part, default in ((reference, "reference"), (other, "other"))]
    if labels is not None:
        names = list(labels)
        if len(names) != 2:
            raise ResponseError(f"plots.mode_comparison: {len(names)} labels; expected two, one for each set of modes.")
    sets = [_values(reference, "reference"), _values(other, "other")]
    columns = [("natural frequency [Hz]", [modes.frequencies for modes in sets])]
    ratios = [100.0 * modes.ratios for modes in sets if modes.ratios is not None]
    if len(ratios) == 2:
        columns.append(("damping ratio [%]", [np.where(np.isfinite(values), values, np.nan) for values in ratios]))
    most = max(len(modes.frequencies) for modes in sets)
    size = style.ALONE if len(columns) == 1 else style.WIDEST, 4.6
    with sheet("plots.mode_comparison", ax, size, 2, len(columns), height_ratios=[1.6, 1.0]) as paper:
        panels = np.array(paper.panels).reshape(2, -1)
        for (title, pair), (top, below) in zip(columns, panels.T, strict=True):
            paper.join((top, below))
            _above(top, pair, names)
            top.set_ylabel(title)
            below.bar(*_difference(*pair), width=0.6, color=style.COLOURS[1])
            below.axhline(0.0, color=style.INK, linewidth=0.7)
            below.set(ylabel="difference [%]", xlabel="mode")
            for axes in (top, below):
                axes.grid(False, axis="x")
            below.set_xlim(0.4, most + 0.6)
            below.xaxis.get_major_locator().set_params(integer=True)
            if most <= MOST_TICKS:
                below.set_xticks(np.arange(1.0, most + 1.0))
        paper.legend(columns=2)
        paper.head("Modes compared")
    return paper.result


def _above(axes: Axes, pair: Sequence[Array], names: Sequence[str]) -> None:
    """Draw the values of both sets."""
    for i, (values, name, marker) in enumerate(zip(pair, names, ("o", "x"), strict=True)):
        axes.plot(np.arange(1.0, len(values) + 1.0), values, marker, color=style.COLOURS[i], label=name,
                  fillstyle="none", markersize=6.5, markeredgewidth=1.3)  # fmt: skip
    both = np.concatenate(list(pair))
    rising = both[both > 0.0]
    if rising.size and rising.max() > LOG_FROM * rising.min() and not (both < 0.0).any():
        style.logarithmic(axes.yaxis)
    elif not (both < 0.0).any():
        axes.set_ylim(0.0, 1.1 * float(rising.max()) if rising.size else 1.0)


def _difference(first: Array, second: Array) -> tuple[Array, Array]:
    """Return the numbers of the modes that both sets have, and relative differences [%]; NaN where there is none."""
    count = min(len(first), len(second))
    reference, compared_values = first[:count], second[:count]
    result = np.full(count, np.nan)
    compared = np.isfinite(reference) & np.isfinite(compared_values) & (reference != 0.0)
    result[compared] = 100.0 * (compared_values - reference)[compared] / np.abs(reference[compared])
    return np.arange(1.0, count + 1.0), result


def _values(source: Any, field: str) -> Values:
    """Natural frequencies [Hz] in ascending order, and damping ratios."""
    if hasattr(source, "damping_ratios") or kind_of(source) is not None:
        modes = source if kind_of(source) is None else a_system(source, "plots.mode_comparison", field).modes()
        result = Values(np.asarray(modes.frequencies), np.asarray(modes.damping_ratios))
    else:
        rows = reals(source, "plots.mode_comparison", field, EXPECTED)
        result = Values(*rows) if rows.ndim == 2 and len(rows) == 2 else Values(rows, None)
        values = result.frequencies
        if values.ndim != 1 or not np.isfinite(rows).all() or (np.diff(values) < 0.0).any() or (values < 0.0).any():
            raise ResponseError(f"plots.mode_comparison: {field} = {np.array2string(rows, threshold=6)}; expected "
                                f"natural frequencies [Hz] in ascending order, none negative, and damping ratios as a "
                                f"second row where they are known.")  # fmt: skip
    if not len(result.frequencies):
        raise ResponseError(f"plots.mode_comparison: {field} has no modes; there is nothing to compare.")
    return result


def comparison(result: Any, *, ax: Given | None = None) -> Figure | Given:
    """Draw the MAC of the modes of two models as a matrix, and how the frequencies of the pairs differ.

    Parameters
    ----------
    result : Comparison
        What ``mbsvib.compare`` returns, with modes of both.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        MAC from 0 to 1, modes counted from 1; relative differences [%].

    Raises
    ------
    ResponseError
        If modes were not compared.
    """
    if not result.pairs:
        raise ResponseError("plots.comparison: no modes were compared; responses alone have no MAC.")
    with sheet("plots.comparison", ax, (style.WIDEST, 4.0), 1, 2) as paper:
        left, right = paper.panels
        mac = result.mac[:MOST_IN_MATRIX, :MOST_IN_MATRIX]
        image = left.imshow(mac, vmin=0.0, vmax=1.0, cmap="Blues", origin="lower", aspect="auto",
                            extent=(0.5, mac.shape[1] + 0.5, 0.5, mac.shape[0] + 0.5))  # fmt: skip
        paper.figure.colorbar(image, ax=left, label="MAC [1]")
        left.grid(False)
        left.set(title="MAC", xlabel=f"mode of {result.names[1]}", ylabel=f"mode of {result.names[0]}")
        numbers = [pair.a for pair in result.pairs]
        values = np.array([100.0 * pair.difference for pair in result.pairs])
        right.bar(numbers, np.where(np.isfinite(values), values, np.nan), color=style.COLOURS[1], width=0.6)
        right.axhline(0.0, color=style.INK, linewidth=0.7)
        right.grid(False, axis="x")
        right.set(title="frequencies", xlabel=f"mode of {result.names[0]}", ylabel="difference [%]")
        for axis in (left.xaxis, left.yaxis, right.xaxis):
            axis.get_major_locator().set_params(integer=True)
        paper.head("Modes compared")
    return paper.result
