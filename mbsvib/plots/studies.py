"""Results of studies: numbers over variables, trade-offs, Pareto fronts, sets of sensors, Campbell diagrams, root loci
and tolerances."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from mbsvib.common import units
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import a_result
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, Sheet, in_rows, sheet

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
            axes.set(xlabel=_with_unit(varied[0], units), ylabel=words)
            if in_ratios(columns[varied[0]]):
                style.logarithmic(axes.xaxis)
        elif len(varied) == 2 and grid:
            shape = [len(axis) for axis in axes_values.values()]
            _map(axes, [axes_values[variable] for variable in varied], flat[:, 0].reshape(shape).squeeze(),
                 words if flat.shape[1] == 1 else f"mode {entries[0]}: {words}" if entries else f"entry 1 of {words}")
            axes.set(xlabel=_with_unit(varied[1], units), ylabel=_with_unit(varied[0], units))
            for axis, variable in zip((axes.xaxis, axes.yaxis), reversed(varied), strict=True):
                if in_ratios(axes_values[variable]):
                    style.logarithmic(axis)
        else:
            histograms(axes, flat)
            axes.set(xlabel=words, ylabel="number of points")
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


# Quantities that are drawn, and panels in a row.
MOST, COLUMNS = 4, 3


def trade_off(data: Any, *, ax: Given | None = None) -> Figure | Given:
    """Draw a trade-off: a panel for each pair of quantities.

    Parameters
    ----------
    data : TradeOff
        What ``studies.trade_off`` returned.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Designs as points; of three quantities, colours are the third one. Cross: the least of both on their own, which
        no design reaches. Star: the model that was given. At most four quantities are drawn.
    """
    pairs = list(combinations(list(data.values)[:MOST], 2))
    columns = min(len(pairs), COLUMNS)
    with in_rows("plots.trade_off", ax, len(pairs), columns, (4.0, 3.2)) as paper:
        for axes, pair in zip(paper.panels, pairs, strict=True):
            _panel(axes, data, pair)
        paper.head(f"Trade-off of {data.name}")
        paper.legend()
    return paper.result


def _panel(axes: Axes, data: Any, pair: tuple[str, str]) -> None:
    x, y = pair
    third = [name for name in data.values if name not in pair]
    if len(third) == 1:
        points = axes.scatter(data.values[x], data.values[y], c=data.values[third[0]], s=22, cmap="viridis",
                              label="designs", zorder=3)  # fmt: skip
        axes.figure.colorbar(points, ax=axes, label=units.pretty(data.labels[third[0]]), location="top",
                             ticks=MaxNLocator(3))  # fmt: skip
    else:
        axes.plot(data.values[x], data.values[y], ".-" if not third else ".", color=style.COLOURS[0], label="designs")
    axes.plot(data.ideal[x], data.ideal[y], "x", color=style.INK, label="least of each on its own")
    axes.plot(data.began[x], data.began[y], "*", color=style.COLOURS[1], markersize=9, zorder=2, label="given model")
    axes.set(xlabel=units.pretty(data.labels[x]), ylabel=units.pretty(data.labels[y]))
    axes.locator_params(axis="x", nbins=3)


LOG_FROM = 4.0  # ratio of the highest to the lowest value from which an axis is logarithmic


def front(data: Any, *, ax: Given | None = None) -> Figure | Given:
    """Draw a Pareto front.

    Parameters
    ----------
    data : Front
        What ``mbsvib.isolation.Passive.front`` returned.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        The objective over the bounded quantity; hollow points are not optimal.
    """
    a_result(data, "price", "plots.front", "data", "what isolation.passive(...).front(...) returns")
    with sheet("plots.front", ax) as paper:
        axes = paper.panels[0]
        axes.plot(data.price, data.objective, color=style.COLOURS[0], linewidth=0.8)
        for values, axis in ((data.price, axes.xaxis), (data.objective, axes.yaxis)):
            if values.min() > 0.0 and values.max() > LOG_FROM * values.min():
                style.logarithmic(axis)
        for price, value, design in zip(data.price, data.objective, data.designs, strict=True):
            axes.plot([price], [value], "o", color=style.COLOURS[0], mfc=None if design.success else "white")
        axes.set(xlabel=units.pretty(data.labels[1]), ylabel=units.pretty(data.labels[0]), title="Pareto front")
        paper.name([data.designs[0].model.name])
    return paper.result


CANDIDATES = 24  # candidates with a row


def placement_figure(
    name: str, criterion: str, sets: Sequence[Sequence[str]], scores: Sequence[float], bound: float, label: str,
    candidates: Sequence[str], ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the scores of sets, the best first, and below these a row for each candidate that one of them has."""
    used = [one for one in dict.fromkeys(candidates) if any(one in some for some in sets)]
    shown = used[:CANDIDATES]
    ranks = range(1, len(sets) + 1)
    size = float(np.clip(1.6 + 0.34 * len(sets), 4.6, style.WIDEST)), 2.6 + 0.22 * len(shown)
    with sheet("plot", ax, size, 2, height_ratios=[2.2, 0.22 * len(shown) + 0.3]) as paper:
        top, below = paper.panels
        paper.join(paper.panels)
        top.bar(ranks, scores, color=style.COLOURS[0], width=0.6)
        top.axhline(bound, color=style.INK, linewidth=0.9, linestyle="--", label=f"no set is better: {bound:.4g}")
        top.set_ylabel(label)
        top.set_ylim(0.0, 1.25 * max(bound, max((score for score in scores if score < float("inf")), default=1.0)))
        top.legend(loc="upper right")
        top.set_title(criterion[0].upper() + criterion[1:])
        paper.name([name])
        for row, candidate in enumerate(shown):
            at = [rank for rank, some in zip(ranks, sets, strict=True) if candidate in some]
            below.plot(at, [row] * len(at), "s", color=style.COLOURS[1], markersize=6)
        below.set_yticks(range(len(shown)), shown)
        below.set_ylim(len(shown) - 0.5, -0.5)
        below.set_xticks(list(ranks))
        below.set_xlabel("number of the set, the best first")
        below.grid(visible=True, axis="y", linewidth=0.4)
        paper.left_out(len(shown), len(used), "candidates")
    return paper.result


FEWEST, ABOVE = 8, 4.0  # modes that are drawn by default, and up to which multiple of the highest line
LINES: dict[str, Any] = {"forward": "-", "backward": (0, (5, 1.5)), "": (0, (1.5, 1))}


def campbell(
    data: Any, orders: Sequence[float] = (1.0,), modes: int | None = None, *, ax: Given | None = None
) -> Figure | Given:
    """Draw a Campbell diagram: damped frequencies over the speed.

    Parameters
    ----------
    data : Campbell
        What ``mbsvib.studies.campbell.campbell`` returned.
    orders : sequence of float
        Lines frequency = order x speed / 2 pi to draw.
    modes : int, optional
        How many of the lowest modes; default: at least 8, and all that come within four times the highest line.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Forward whirl full, backward dashed, motions without whirl dotted; critical speeds are circles, unstable modes
        are marked by crosses.
    """
    a_result(data, "speeds", "plots.campbell", "data", "what mbsvib.campbell.campbell(...) returns")
    with sheet("plots.campbell", ax) as paper:
        axes = paper.panels[0]
        count = _lowest(data, orders) if modes is None else modes
        for mode in range(min(count, data.frequencies.shape[1])):
            frequency = data.frequencies[:, mode]
            colour = style.COLOURS[mode % len(style.COLOURS)]
            for direction, dash in LINES.items():
                # a piece belongs to the direction at its end: at rest most modes have none
                same = data.directions[1:, mode] == direction
                pieces = np.where(np.stack((same, same)), np.stack((frequency[:-1], frequency[1:])), np.nan)
                if same.any():
                    x = np.stack((data.speeds[:-1], data.speeds[1:], np.full(len(same), np.nan))).T.reshape(-1)
                    y = np.stack((*pieces, np.full(len(same), np.nan))).T.reshape(-1)
                    axes.plot(x, y, color=colour, linestyle=dash)
            grows = data.growing[:, mode]
            if grows.any():
                axes.plot(data.speeds[grows], frequency[grows], "x", color=colour, markersize=4.0)
        top = 1.08 * float(data.frequencies[:, :count].max(initial=0.0)) or 1.0
        for order in orders:
            axes.plot(data.speeds, order * np.abs(data.speeds) / (2.0 * np.pi), color=style.MARK, linewidth=0.8)
        for point in data.critical:
            axes.plot([point.speed], [point.frequency], "o", color=style.INK, markersize=5.0, mfc="white", zorder=3)
        axes.set(ylim=(0.0, top), xlim=(float(data.speeds[0]), float(data.speeds[-1])), xlabel="speed [rad/s]",
                 ylabel="damped frequency [Hz]", title="Campbell diagram")  # fmt: skip
        met = {direction for row in data.directions[1:] for direction in row}
        handles = [Line2D([], [], color=style.INK, linestyle=dash, linewidth=1.2, label=direction or "no whirl")
                   for direction, dash in LINES.items() if direction in met]  # fmt: skip
        if data.growing.any():
            handles.append(Line2D([], [], marker="x", linestyle="none", color=style.INK, markersize=4.0,
                                  label="unstable"))  # fmt: skip
        handles += [Line2D([], [], color=style.MARK, linewidth=0.8, label=f"{order:g} × speed") for order in orders]
        if data.critical:
            handles.append(Line2D([], [], marker="o", linestyle="none", color=style.INK, markersize=5.0, mfc="white",
                                  label="critical speed"))  # fmt: skip
        paper.legend(handles)
        paper.name([data.name])
        if modes is None:
            paper.left_out(count, data.frequencies.shape[1], "modes", "ask for more by modes=...")
    return paper.result


def _lowest(data: Any, orders: Sequence[float]) -> int:
    """Return how many of the lowest modes are drawn: those of beams reach far above all speeds."""
    line = max((abs(order) for order in orders), default=0.0) * float(np.abs(data.speeds).max()) / (2.0 * np.pi)
    near = data.frequencies.min(axis=0) <= ABOVE * line
    return max(FEWEST, int(near.nonzero()[0].max(initial=-1)) + 1)


MOST_DOTS = 60  # points of a sweep that are marked one by one on its lines


def root_locus(
    eigenvalues: Complex, modes: Sequence[str], variables: Iterable[str], name: str, *, samples: bool,
    ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the eigenvalues of the first 12 modes over the points of a sweep, in the upper half of the complex plane.

    ``eigenvalues`` (n, modes): those without negative imaginary parts [1/s]. ``samples``: whether neighbours in the
    array are not neighbours in the variables, so that no line joins them.
    """
    with sheet("root_locus", ax) as paper:
        axes = paper.panels[0]
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
        axes.set(xlabel="real part [1/s]", ylabel="imaginary part [rad/s]")
        axes.legend(title="mode")
        axes.set_title("Eigenvalues")
        paper.name([f"{name}, {', '.join(variables)}"])
        paper.left_out(min(len(modes), MOST_LINES), len(modes), "modes", "choose by modes=")
    return paper.result


def tolerances(
    labels: Sequence[str], sampled: Array, linear: Array, nominal: Array, name: str, ax: Given | None = None
) -> Figure | Given:
    """Draw histograms of a tolerance analysis: samples as areas, first-order values as lines, nominal values dashed.

    ``sampled``, ``linear`` (n, k): numbers of the samples, and their first-order values. ``nominal`` (k,): numbers of
    the nominal model.
    """
    with in_rows("plot", ax, len(labels), min(3, len(labels)), (4.0, 2.3)) as paper:
        for i, (axes, label) in enumerate(zip(paper.panels, labels, strict=True)):
            shown, first = (table[np.isfinite(table[:, i]), i] for table in (sampled, linear))
            low, high = np.quantile(np.concatenate((shown, first)), (0.0005, 0.9995))
            edges = np.linspace(low, high, bins(len(shown)) + 1)
            axes.hist(shown, bins=edges, color=style.COLOURS[5], label="samples")
            if len(first):
                axes.hist(first, bins=edges, histtype="step", color=style.COLOURS[1], label="first order")
            axes.axvline(nominal[i], color=style.INK, linewidth=0.9, linestyle="--", label="nominal")
            axes.set(xlabel=label, ylabel="number of samples")
            axes.locator_params(axis="x", nbins=4)
        paper.legend()
        paper.head(f"Tolerances of {name}")
    return paper.result
