"""Natural frequencies of two systems beside each other, and their differences in percent."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from mbsvib.common.expected import a_system, reals
from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array
    from mbsvib.plots._system import System

    Frequencies: TypeAlias = System | ArrayLike

LOG_FROM = 20.0  # ratio of the highest to the lowest frequency from which the axis is logarithmic
MOST_TICKS = 20


def mode_comparison(reference: Frequencies, other: Frequencies, labels: Sequence[str] | None = None) -> Figure:
    """Draw natural frequencies over the order of the modes, and by how much the second set differs from the first.

    100 (f_other - f_reference) / f_reference

    Parameters
    ----------
    reference, other : System or array-like, shape (n,)
        Two systems, or natural frequencies [Hz] in ascending order, as measured or as another program has them. Where
        the numbers of modes differ, those are compared that both have.
    labels : sequence of str, optional
        Names in the legend; default: those of the systems, "reference" and "other" for frequencies.

    Returns
    -------
    matplotlib.figure.Figure
        Frequencies [Hz] above, differences [%] below. Rigid-body modes have no difference in percent.

    Raises
    ------
    ResponseError
        If there is no mode, frequencies are not ascending, or there are not two labels.
    """
    names = [getattr(part, "name", default) for part, default in ((reference, "reference"), (other, "other"))]
    if labels is not None:
        names = list(labels)
        if len(names) != 2:
            raise ResponseError(f"plots.mode_comparison: {len(names)} labels; expected two, one for each set of modes.")
    first, second = _frequencies(reference, "reference"), _frequencies(other, "other")
    count = min(len(first), len(second))
    number = np.arange(1.0, max(len(first), len(second)) + 1.0)
    oscillates = first[:count] > 0.0
    difference = np.full(count, np.nan)
    difference[oscillates] = 100.0 * (second[:count] - first[:count])[oscillates] / first[:count][oscillates]
    with style.context():
        figure = style.new_figure(6.4, 4.6)
        top, below = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0])
        for i, (values, name, marker) in enumerate(((first, names[0], "o"), (second, names[1], "x"))):
            top.plot(number[: len(values)], values, marker, color=style.COLOURS[i], label=name, fillstyle="none",
                     markersize=6.5, markeredgewidth=1.3)  # fmt: skip
        rising = np.concatenate((first[first > 0.0], second[second > 0.0]))
        if rising.size and rising.max() > LOG_FROM * rising.min():
            top.set_yscale("log")
        top.set_ylabel("natural frequency [Hz]")
        top.set_title("Modes compared")
        top.legend(loc="upper left")
        below.bar(number[:count], difference, width=0.6, color=style.COLOURS[1])
        below.axhline(0.0, color=style.INK, linewidth=0.7)
        below.set_ylabel("difference [%]")
        below.set_xlabel("mode")
        below.set_xlim(0.4, len(number) + 0.6)
        below.xaxis.get_major_locator().set_params(integer=True)
        if len(number) <= MOST_TICKS:
            below.set_xticks(number)
        for axes in (top, below):
            axes.grid(False, axis="x")
    return figure


def _frequencies(source: Frequencies, what: str) -> Array:
    """Natural frequencies [Hz] in ascending order."""
    if hasattr(source, "modes"):
        values = np.asarray(a_system(source, "plots.mode_comparison", what).modes().frequencies)
    else:
        values = reals(source, "plots.mode_comparison", what, "a System, or ascending frequencies [Hz]")
        if values.ndim != 1 or not np.isfinite(values).all() or (np.diff(values) < 0.0).any() or (values < 0.0).any():
            raise ResponseError(f"plots.mode_comparison: {what} = {np.array2string(values, threshold=6)}; expected "
                                f"natural frequencies [Hz] in ascending order, none negative.")  # fmt: skip
    if not len(values):
        raise ResponseError(f"plots.mode_comparison: {what} has no modes; there is nothing to compare.")
    return values
