"""Singular values of a response matrix over frequency: most and least that any direction of the inputs can do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from mbsvib.common import units
from mbsvib.common.arrays import Array
from mbsvib.common.selection import Names
from mbsvib.errors import ResponseError, counted
from mbsvib.linalg.singular_values import singular_values as singular
from mbsvib.plots import _style as style
from mbsvib.plots._curves import MOST_PANELS, Curve, Linear, Systems, curves, listed, pick, shared_grid
from mbsvib.plots._sheet import Given, in_rows

MOST_NAMED, LONGEST_NAMES = 4, 24  # names in a title, and their letters


class UnitGroup(NamedTuple):
    """Outputs of one unit and inputs of one unit, and the unit of the responses between them."""

    outputs: list[str]
    inputs: list[str]
    unit: str


def singular_values(
    systems: Systems, outputs: Names = None, inputs: Names = None, frequencies: ArrayLike | None = None, *,
    span: tuple[float | None, float | None] = (None, None), labels: Sequence[str] | None = None,
    ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the singular values of the matrix G(i w) from inputs to outputs.

    Parameters
    ----------
    systems : System, ClosedLoop, StateSpace, Controller, control.StateSpace, or sequence of these
        One, or several that are drawn into the same panels.
    outputs, inputs : str or sequence of str, optional
        Names or patterns; default: all.
    frequencies : array-like, shape (n,), optional
        Where to compute [Hz]; default: a grid that resolves every resonance in ``span``.
    span : (float or None, float or None)
        First and last frequency [Hz]; None: from the modes.
    labels : sequence of str, optional
        Names of the systems in the legend; default: their own.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        A panel for each unit of outputs and of inputs, as singular values of mixed units mean nothing; the largest ones
        thick, the others thin.

    Raises
    ------
    ResponseError
        If a name is unknown, there are more than twelve panels, or a frequency is an undamped pole.
    """
    named = listed(systems, labels)
    groups = unit_groups(named[0][1], outputs, inputs)
    if len(groups) > MOST_PANELS:
        raise ResponseError(f"singular values: outputs and inputs have {len(groups)} pairs of units, a panel each; a "
                            f"figure holds at most {MOST_PANELS}: choose, for example, "
                            f"outputs={groups[0].outputs!r}, inputs={groups[0].inputs!r}.")  # fmt: skip
    grid = shared_grid([system for _, system in named], [group[:2] for group in groups], frequencies, span)
    columns = min(len({tuple(group.inputs) for group in groups}), 4)
    with in_rows("plots.singular_values", ax, len(groups), columns, (4.0, 2.9)) as paper:
        for axes, group in zip(paper.panels, groups, strict=True):
            _panel(axes, named, group, grid, paper.first)
        for axes in paper.panels[:-columns]:
            axes.set_xlabel("")
        paper.name([label for label, _ in named], columns - 1)
    return paper.result


def unit_groups(system: Linear, outputs: Names, inputs: Names) -> list[UnitGroup]:
    """Return the selected outputs and inputs, one group for each pair of units, those of the first output first."""
    results = _by_unit(pick(system, "output", outputs), system.outputs, system.output_units)
    sources = _by_unit(pick(system, "input", inputs), system.inputs, system.input_units)
    return [UnitGroup(names, ports, units.ratio(result_unit, source_unit))
            for result_unit, names in results.items() for source_unit, ports in sources.items()]  # fmt: skip


def _by_unit(selected: Sequence[str], names: Sequence[str], its_units: Sequence[str]) -> dict[str, list[str]]:
    result: dict[str, list[str]] = {}
    for name in selected:
        result.setdefault(its_units[names.index(name)], []).append(name)
    return result


def _panel(axes: Axes, named: Sequence[tuple[str, Linear]], group: UnitGroup, grid: Array, first: int) -> None:
    """Draw the singular values of one group of ports."""
    pairs = [(result, source) for result in group.outputs for source in group.inputs]
    drawn = [curves(system, pairs, grid) for _, system in named]
    zeros: list[int] = []
    for i, ((label, _), responses) in enumerate(zip(named, drawn, strict=True), first):
        sigma, look = of_curves(responses, len(group.outputs)), style.line(i) | {"linestyle": "-"}
        for k, values in enumerate(np.where(sigma > 0.0, sigma, np.nan)):
            axes.plot(grid, values, **(look | {"linewidth": 1.5 if k == 0 else 0.7}), label=label if k == 0 else None)
        zeros.append(int((~sigma.any(axis=1)).sum()))
    if min(zeros) < min(len(group.outputs), len(group.inputs)):
        style.logarithmic(axes.yaxis)
        if max(zeros):
            style.remark(axes, f"{counted(max(zeros), 'singular value')} of zero")
    else:
        axes.set_ylim(0.0, 1.0)
        style.remark(axes, "zero")
    style.frequency_axis(axes, grid[0], grid[-1])
    axes.set_ylabel(f"singular values [{units.pretty(group.unit)}]")
    style.title(axes, _few(group.inputs), _few(group.outputs))


def of_curves(responses: Sequence[Curve], rows: int) -> Array:
    """Return the singular values (k, n), 0 where they are rounding, of responses given row by row."""
    values = [np.zeros_like(response.values) if response.negligible else response.values for response in responses]
    return singular(np.array(values).reshape(rows, len(responses) // rows, -1))


def _few(names: Sequence[str]) -> str:
    """Return names in a few words."""
    if len(names) <= MOST_NAMED and sum(map(len, names)) <= LONGEST_NAMES:
        return ", ".join(names)
    return f"{names[0]} … {names[-1]} ({len(names)})" if len(names) > 1 else names[0]
