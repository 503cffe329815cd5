"""Energy shares of modes: strain energy by element, kinetic energy by body."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.expected import a_system
from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Array
    from mbsvib.modes import Modes
    from mbsvib.plots._system import System


LEAST_SHARE = 0.005  # of an element in any mode, else it counts among the others
MOST_ELEMENTS = 24
MOST_MODES = 60
OTHERS = "all others"
VISIBLE = 5e-3  # least sum of the shares of all others: less is thinner than a line
TITLES = {"strain": "Strain energy", "kinetic": "Kinetic energy"}
HATCHES = ("", "//", "..", "xx")


def energy(system: System, kind: str = "strain") -> Figure:
    """Draw the shares of elements in the energy of each mode.

    Parameters
    ----------
    system : System
        The equations of motion.
    kind : str
        "strain" for springs, and loads that stiffen or soften; "kinetic" for bodies.

    Returns
    -------
    matplotlib.figure.Figure
        One stacked bar [%] for each of the first 60 modes; what softens goes below zero.

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
    number = np.arange(1.0, count + 1.0)
    up, down = np.zeros(count), np.zeros(count)
    with style.context():
        figure = style.new_figure(7.2, 3.8)
        axes = figure.subplots()
        for i, (name, values) in enumerate(rows):
            height = 100.0 * np.nan_to_num(values[:count])
            bottom = np.where(height < 0.0, down, up)
            colour = style.FAINT if name == OTHERS else style.COLOURS[i % len(style.COLOURS)]
            axes.bar(number, height, 0.72, bottom, color=colour, label=name, edgecolor="white", linewidth=0.4,
                     hatch=HATCHES[i // len(style.COLOURS) % len(HATCHES)])  # fmt: skip
            up += np.maximum(height, 0.0)
            down += np.minimum(height, 0.0)
        axes.grid(False, axis="x")
        axes.set_xlim(0.4, count + 0.6)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        if count <= 20:
            axes.set_xticks(number)
        axes.set_xlabel("mode")
        axes.set_ylabel(f"share of {TITLES[kind].lower()} [%]")
        axes.set_title(f"{TITLES[kind]} of modes")
        axes.set_title(system.name, loc="right", color=style.MARK, fontsize=8.5)
        style.tell_left_out(figure, count, len(system.modes()), "modes")
        if rows:
            figure.legend(loc="outside right upper", ncols=1 if len(rows) <= 16 else 2)
    return figure


def shares(system: System, modes: Modes, kind: str) -> tuple[list[str], Array]:
    """Return the names of elements and their shares in the energy of each mode, (elements, modes).

    Parameters
    ----------
    system : System
        The equations of motion.
    modes : Modes
        Its modes.
    kind : str
        "strain" or "kinetic".

    Returns
    -------
    tuple of list of str and array
        Names and shares.
    """
    if kind == "kinetic":
        by_body = modes.kinetic_energy
        return [*by_body], np.array([*by_body.values()]).reshape(len(by_body), len(modes))
    stiffness = system.stiffness_shares(modes)
    names = [name if kind == "elastic" else f"{name} ({kind})"
             for name, kind in zip(stiffness.elements, stiffness.kinds, strict=True)]  # fmt: skip
    return names, stiffness.shares


def largest(names: Sequence[str], values: Array) -> list[tuple[str, Array]]:
    """Return the elements with significant shares, in their order, and the sum of all others.

    Parameters
    ----------
    names : sequence of str
        Elements.
    values : array, shape (elements, modes)
        Their shares in each mode.

    Returns
    -------
    list of (str, array)
        Names and shares.
    """
    size = np.nanmax(np.abs(values), axis=1, initial=0.0)
    selected = [i for i in np.argsort(-size, kind="stable") if size[i] >= LEAST_SHARE][:MOST_ELEMENTS]
    rows = [(names[i], values[i]) for i in sorted(selected)]
    rest = np.delete(values, selected, axis=0).sum(axis=0)
    return [*rows, (OTHERS, rest)] if np.abs(rest).max(initial=0.0) > VISIBLE else rows
