"""Modes at a glance: natural frequencies and damping ratios; shares of strain and kinetic energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.expected import a_system
from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Array
    from mbsvib.modes import Modes
    from mbsvib.plots._curves import System


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
        circles on the axis.

    Raises
    ------
    ResponseError
        If the system has no degree of freedom.
    """
    if a_system(system, "plots.modes").dof == 0:
        raise ResponseError(f"system '{system.name}' is fully locked: it has no modes to draw.")
    result = system.modes()
    number = np.arange(1.0, system.dof + 1.0)
    with sheet("plots.modes", ax, (style.ALONE, 4.6), 2, height_ratios=[1.5, 1.0]) as paper:
        top, below = paper.panels
        paper.join(paper.panels)
        _stems(top, number, result.frequencies, style.COLOURS[0])
        _stems(below, number, 100.0 * result.damping_ratios, style.COLOURS[1])
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
    if not isinstance(kind, str) or kind not in TITLES:
        raise ResponseError(f"kind = {kind!r}: expected 'strain' or 'kinetic'.")
    if a_system(system, "plots.energy").dof == 0:
        raise ResponseError(f"system '{system.name}' is fully locked: it has no modes to draw.")
    from matplotlib.ticker import MaxNLocator

    rows = largest(*shares(system, system.modes(), kind))
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
    from matplotlib.colors import LinearSegmentedColormap, to_rgb

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
