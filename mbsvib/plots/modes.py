"""Modes at a glance: natural frequencies and damping ratios; shares of strain and kinetic energy; two sets compared."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array
from mbsvib.common.expected import a_system, kind_of, one_of, reals
from mbsvib.errors import ResponseError
from mbsvib.modes import Modes
from mbsvib.modes.pairs import damping_ratios
from mbsvib.plots import _style as style
from mbsvib.plots._curves import System
from mbsvib.plots._sheet import Given, sheet

ModeSet: TypeAlias = System | Modes | ArrayLike


LOG_FROM = 20.0  # ratio of the highest to the lowest value from which an axis is logarithmic


def modes(system: System, *, ax: Given | None = None) -> Figure | Given:
    """Draw the natural frequency and the damping ratio of every mode.

    Parameters
    ----------
    system : System
        The equations of motion.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Frequencies [Hz] above, damping ratios [%] below, over the number of the mode. Rigid-body modes are open
        circles on the axis, and so are damping ratios that are within the error of their eigenvalue.

    Raises
    ------
    ResponseError
        If the system has no degree of freedom.
    """
    result = a_system(system, "plots.modes").modes()
    result.check_any("draw")
    number = np.arange(1.0, system.dof + 1.0)
    with sheet("plots.modes", ax, (style.ALONE, 4.6), 2, height_ratios=[1.5, 1.0]) as paper:
        top, below = paper.panels
        paper.join(paper.panels)
        _stems(top, number, result.frequencies, style.COLOURS[0])
        ratios = damping_ratios(result.pairs, result.pair_errors)
        _stems(below, number, 100.0 * ratios, style.COLOURS[1])
        top.set_ylabel("natural frequency [Hz]")
        below.set(ylabel="damping ratio [%]", xlabel="mode")
        top.set_title("Modes")
        paper.name([f"{system.name}: {system.dof} DOF"])
        below.set_xlim(0.4, system.dof + 0.6)
        below.xaxis.get_major_locator().set_params(integer=True)
        if system.dof <= 20:
            below.set_xticks(number)
        for axes in (top, below):
            axes.grid(False, axis="x")
    return paper.result


def _stems(axes: Axes, number: Array, values: Array, colour: str) -> None:
    drawn = np.isfinite(values)
    rising = drawn & (values > 0.0)
    floor = 0.0
    if rising.any() and values[rising].max() > LOG_FROM * values[rising].min():
        style.logarithmic(axes.yaxis)
        floor = 10.0 ** np.floor(np.log10(values[rising].min()) - 0.1)
        axes.set_ylim(floor, 10.0 ** (np.log10(values[rising].max()) + 0.15))
    width = max(0.6, min(2.0, 120.0 / len(number)))
    size = max(2.0, min(6.0, 300.0 / len(number)))
    heights = np.where(rising, values, floor)
    axes.vlines(number[rising], floor, heights[rising], color=colour, linewidth=width, alpha=0.45)
    axes.plot(number[rising], values[rising], "o", color=colour, markersize=size)
    rest = drawn & ~rising
    at = np.where(axes.get_yscale() == "log", floor, values)[rest]
    if rest.any():
        axes.plot(number[rest], at, "o", color=colour, markersize=size, mfc="white", clip_on=False, zorder=3)
    if axes.get_yscale() == "linear" and not (values[drawn] < 0.0).any():
        axes.set_ylim(0.0, 1.12 * values[drawn].max() if rising.any() else 1.0)


LEAST_SHARE = 0.005  # of an element in any mode, else it counts among the others
MOST_ELEMENTS = 40
MOST_MODES = 60
OTHERS = "all others"
VISIBLE = 5e-3  # least sum of the shares of all others: less is thinner than a line
TITLES = {"strain": "Strain energy", "kinetic": "Kinetic energy"}
MOST_NUMBERED = 20  # modes whose shares are written as numbers


def energy(system: System, kind: str = "strain", *, ax: Given | None = None) -> Figure | Given:
    """Draw the shares of elements in the energy of each mode.

    Parameters
    ----------
    system : System
        The equations of motion.
    kind : str
        "strain" for springs, and loads that stiffen or soften; "kinetic" for bodies.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        A map of elements over the first 60 modes: shares [%] as colours, and as numbers up to 20 modes. What softens is
        below zero.

    Raises
    ------
    ResponseError
        If there is no such kind, or no mode.
    """
    one_of(kind, TITLES, "plots.energy", "kind")
    modes = a_system(system, "plots.energy").modes()
    modes.check_any("draw")
    rows = largest(*shares(system, modes, kind))
    count = min(len(system.modes()), MOST_MODES)
    percent = 100.0 * np.nan_to_num(np.array([values[:count] for _, values in rows]).reshape(len(rows), count))
    size = float(np.clip(2.2 + 0.42 * count, 5.0, style.WIDEST)), 1.3 + 0.22 * max(len(rows), 4)
    with sheet("plots.energy", ax, size) as paper:
        axes = paper.panels[0]
        lowest, highest = percent.min(initial=0.0), percent.max(initial=1.0)
        image = axes.imshow(percent, cmap=_colours(lowest, highest), vmin=lowest, vmax=highest, aspect="auto",
                            extent=(0.5, count + 0.5, len(rows) - 0.5, -0.5))  # fmt: skip
        if count <= MOST_NUMBERED:
            for (row, mode), share in np.ndenumerate(percent):
                if abs(share) >= 0.5:
                    axes.text(mode + 1, row, f"{share:.0f}", ha="center", va="center", fontsize=7.5,
                              color="white" if abs(share) > 0.55 * max(highest, -lowest) else style.INK)  # fmt: skip
        axes.grid(False)
        axes.tick_params(length=0)
        axes.set_yticks(range(len(rows)), [name for name, _ in rows])
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        if count <= MOST_NUMBERED:
            axes.set_xticks(range(1, count + 1))
        axes.set_xlabel("mode")
        paper.figure.colorbar(image, ax=axes, shrink=0.9, aspect=30, label=f"share of {TITLES[kind].lower()} [%]")
        axes.set_title(f"{TITLES[kind]} of modes")
        paper.name([system.name])
        paper.left_out(count, len(system.modes()), "modes")
    return paper.result


def _colours(lowest: float, highest: float) -> Colormap:
    """White at zero, blue above and red below it, as strong for shares of the same size."""
    size = max(highest, -lowest)

    def colour(share: float, full: str) -> tuple[float, float, float]:
        red, green, blue = (1.0 + (part - 1.0) * abs(share) / size for part in to_rgb(full))
        return red, green, blue

    ends = colour(lowest, style.COLOURS[1]), colour(highest, style.COLOURS[0])
    zero = -lowest / (highest - lowest)
    return LinearSegmentedColormap.from_list("shares", [(0.0, ends[0]), (zero, (1.0, 1.0, 1.0)), (1.0, ends[1])])


def shares(system: System, modes: Modes, kind: str) -> tuple[list[str], Array]:
    """Return the names of elements and their shares (elements, modes) in the "strain" or "kinetic" energy of each mode.
    """
    if kind == "kinetic":
        by_body = modes.kinetic_energy
        return [*by_body], np.array([*by_body.values()]).reshape(len(by_body), len(modes))
    stiffness = system.stiffness_shares(modes)
    names = [name if kind == "elastic" else f"{name} ({kind})"
             for name, kind in zip(stiffness.elements, stiffness.kinds, strict=True)]  # fmt: skip
    return names, stiffness.shares


def largest(names: Sequence[str], values: Array) -> list[tuple[str, Array]]:
    """Return the elements with significant shares in ``values`` (elements, modes), and the sum of all others."""
    size = np.nanmax(np.abs(values), axis=1, initial=0.0)
    selected = [i for i in np.argsort(-size, kind="stable") if size[i] >= LEAST_SHARE][:MOST_ELEMENTS]
    rows = [(names[i], values[i]) for i in sorted(selected)]
    rest = np.delete(values, selected, axis=0).sum(axis=0)
    return [*rows, (OTHERS, rest)] if np.abs(rest).max(initial=0.0) > VISIBLE else rows


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
