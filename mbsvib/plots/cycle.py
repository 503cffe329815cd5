"""Cycles of running machines: torque, shaking force and moment, and the linear periodic equations about the cycle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mbsvib.common.arrays import Array
from mbsvib.common.expected import a_result
from mbsvib.cycles.result import CycleData
from mbsvib.errors import ResponseError
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

if TYPE_CHECKING:
    from mbsvib.cycles.periodic import Periodic


# Components below this share of the largest are rounding, and the motion is planar.
PLANAR = 1e-9
MOST_DRIVES = 7


def cycle(
    cycles: CycleData | Sequence[CycleData], *, labels: Sequence[str] | None = None, ax: Given | None = None
) -> Figure | Given:
    """Draw what drives must supply and the ground feels over a cycle.

    Parameters
    ----------
    cycles : Cycle or sequence of Cycle
        What ``Model.cycle`` returned; several are drawn into the same panels.
    labels : sequence of str, optional
        Names of the cycles in the legend; default: those of their models.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Torques, shaking force and moment over the first drive; of a planar motion, the moment is that about the normal
        of its plane. On the right, the shaking force in the plane of its two largest components.

    Raises
    ------
    ResponseError
        If there is no cycle, or the labels are not as many.
    """
    several: list[CycleData] = [cycles] if isinstance(cycles, CycleData) else list(cycles)
    if not several:
        raise ResponseError("cycle: cycles = []; expected what model.cycle(...) returned, one or several.")
    names = [data.machine.model.name for data in several] if labels is None else list(labels)
    if len(names) != len(several):
        raise ResponseError(f"cycle: labels = {names}; expected {len(several)}, one for each cycle.")
    cells = [*((row, 0) for row in range(3)), (slice(0, 3), 1)]
    with sheet("plots.cycle", ax, (style.WIDEST, 5.6), cells=cells, width_ratios=(3, 2)) as paper:
        *panels, hodograph = paper.panels
        paper.join(panels)
        plane = _plane(several)
        for i, (name, data) in enumerate(zip(names, several, strict=True)):
            line, x = style.line(i), _over(data)
            for k, drive in enumerate(data.drives[:MOST_DRIVES]):
                by_drive = len(data.drives) > 1 and len(several) == 1
                label = drive if len(data.drives) > 1 else name
                panels[0].plot(x, data.torques[drive], **(style.line(k) if by_drive else line), label=label)
            panels[1].plot(x, np.linalg.norm(data.shaking_force, axis=1), **line, label=name)
            panels[2].plot(x, _moment(data), **line, label=name)
            closed = np.concatenate((data.shaking_force, data.shaking_force[:1]))[:, plane]
            hodograph.plot(*closed.T, **line, label=name)
        _named(several[0], panels, hodograph, plane)
        drives = max(len(data.drives) for data in several)
        paper.left_out(min(drives, MOST_DRIVES), drives, "drives", "the others are in cycle.torques")
        if len(several) > 1:
            paper.name(names)
        elif len(several[0].drives) > 1:
            panels[0].legend(ncols=2)
    return paper.result


def _over(data: CycleData) -> Array:
    """Values of the drive [deg, m], or numbers of samples where there are several."""
    if len(data.drives) > 1:
        return np.arange(len(data.shaking_force), dtype=float)
    return np.degrees(data.angles) if _turns(data.drives[0]) else data.angles


def _turns(drive: str) -> bool:
    return drive.rpartition(".")[2].startswith("r")


def _plane(several: Sequence[CycleData]) -> list[int]:
    """The two largest components of the shaking force, in order."""
    size = np.max([np.abs(data.shaking_force).max(axis=0) for data in several], axis=0)
    return sorted(np.argsort(-size, kind="stable")[:2].tolist())


def _moment(data: CycleData) -> Array:
    """The component of the moment that is the only one, else its size."""
    size = np.abs(data.shaking_moment).max(axis=0)
    most = int(size.argmax())
    if np.delete(size, most).max() <= PLANAR * size[most]:
        return data.shaking_moment[:, most]
    return np.asarray(np.linalg.norm(data.shaking_moment, axis=1))


def _named(first: CycleData, panels: Sequence[Axes], hodograph: Axes, plane: Sequence[int]) -> None:
    drives = first.drives
    over = f"{drives[0]} [{'deg' if _turns(drives[0]) else 'm'}]" if len(drives) == 1 else "sample"
    mixed = "force of drive [N]" if len(drives) == 1 else "torque [N m, N]"
    panels[0].set_ylabel("torque [N m]" if all(map(_turns, drives)) else mixed)
    panels[1].set_ylabel("shaking force [N]")
    panels[2].set(ylabel="shaking moment [N m]", xlabel=over)
    if len(drives) == 1 and _turns(drives[0]) and np.ptp(first.angles) > 0.5 * np.pi:
        panels[2].xaxis.set_major_locator(MaxNLocator(nbins=9, steps=[1, 3, 4.5, 6, 9, 10]))
    x, y = ("xyz"[k] for k in plane)
    hodograph.set(xlabel=f"shaking force along {x} [N]", ylabel=f"shaking force along {y} [N]")
    hodograph.set_aspect("equal", adjustable="datalim")
    hodograph.axhline(0.0, color=style.MARK, linewidth=0.6)
    hodograph.axvline(0.0, color=style.MARK, linewidth=0.6)


def periodic(data: Periodic, *, ax: Given | None = None) -> Figure | Given:
    """Draw the frozen frequencies of small motions about a cycle, and their Floquet multipliers.

    Parameters
    ----------
    data : Periodic
        What ``cycle.periodic`` returned.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Left: |lambda| / 2 pi of the equations with the coefficients of each sample, dashed that of mean coefficients.
        Right: Floquet multipliers; deviations grow by those outside the unit circle.
    """
    a_result(data, "multipliers", "plots.periodic", "data", "what cycle.periodic(...) returns")
    values = data.multipliers()
    with sheet("plots.periodic", ax, (7.6, 3.4), 1, 2, width_ratios=(3, 2)) as paper:
        left, right = paper.panels
        for k, line in enumerate(np.abs(data.frozen.T[::2]) / (2.0 * np.pi)):
            left.plot(data.time, line, color=style.COLOURS[k % len(style.COLOURS)])
            left.axhline(float(np.abs(data.averaged[2 * k])) / (2.0 * np.pi), linestyle="--", linewidth=0.8,
                         color=style.COLOURS[k % len(style.COLOURS)])  # fmt: skip
        left.set(xlabel="time [s]", ylabel="frozen frequency [Hz]")
        left.set_ylim(bottom=0.0)
        turn = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 181))
        right.plot(turn.real, turn.imag, color=style.MARK, linewidth=0.8)
        grows = np.abs(values) > 1.0
        right.plot(values.real[~grows], values.imag[~grows], "o", color=style.COLOURS[0])
        right.plot(values.real[grows], values.imag[grows], "s", color=style.COLOURS[1])
        right.set_aspect("equal", adjustable="datalim")
        right.set(xlabel="real part [1]", ylabel="imaginary part [1]",
                  title=f"multipliers: {'unstable' if grows.any() and not data.stable else 'stable'}")  # fmt: skip
        paper.name([data.name])
    return paper.result
