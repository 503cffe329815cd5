"""Singular values of a response matrix over frequency: most and least that any direction of the inputs can do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common import units
from mbsvib.errors import ResponseError
from mbsvib.plots import _choice as choice
from mbsvib.plots import _style as style
from mbsvib.plots._curves import shared_grid

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from mbsvib.common.selection import Names
    from mbsvib.plots._choice import Systems
    from mbsvib.plots._system import Linear


def singular_values(
    systems: Systems, outputs: Names = None, inputs: Names = None, frequencies: ArrayLike | None = None, *,
    span: tuple[float | None, float | None] = (None, None), labels: Sequence[str] | None = None,
) -> Figure:  # fmt: skip
    """Draw the singular values of the matrix G(i w) from inputs to outputs.

    Parameters
    ----------
    systems : System, ClosedLoop, StateSpace, Controller, control.StateSpace, or sequence of these
        One, or several that are drawn into the same panel.
    outputs, inputs : str or sequence of str, optional
        Names, all of one unit each; default: those that have the unit of the first.
    frequencies : array-like, shape (n,), optional
        Where to compute [Hz]; default: a grid that resolves every resonance in ``span``.
    span : (float or None, float or None)
        First and last frequency [Hz]; None: from the modes.
    labels : sequence of str, optional
        Names of the systems in the legend; default: their own.

    Returns
    -------
    matplotlib.figure.Figure
        The largest ones thick, the others thin.

    Raises
    ------
    ResponseError
        If a name is unknown, units are mixed, or a frequency is an undamped pole.
    """
    named = choice.listed(systems, labels)
    sources, source_unit = _alike(named[0][1], "input", inputs)
    results, result_unit = _alike(named[0][1], "output", outputs)
    pairs = [(result, source) for source in sources for result in results]
    grid = shared_grid([system for _, system in named], pairs, frequencies, span)
    with style.context():
        figure = style.new_figure(6.4, 4.0)
        axes = figure.subplots()
        for i, (label, system) in enumerate(named):
            rows = [system.outputs.index(choice.pick(system, "output", name)[0]) for name in results]
            columns = [system.inputs.index(choice.pick(system, "input", name)[0]) for name in sources]
            G = system.frequency_response(2.0 * np.pi * grid)[np.ix_(rows, columns)]
            sigma = np.linalg.svd(np.moveaxis(G, 2, 0), compute_uv=False)
            colour = style.line(i)["color"]
            for k, values in enumerate(np.where(sigma > 0.0, sigma, np.nan).T):
                axes.plot(grid, values, color=colour, linewidth=1.5 if k == 0 else 0.7,
                          label=label if k == 0 else None)  # fmt: skip
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlim(grid[0], grid[-1])
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel(f"singular values [{units.pretty(units.ratio(result_unit, source_unit))}]")
        axes.set_title(f"{_few(sources)} → {_few(results)}")
        style.name_systems(figure, [label for label, _ in named], axes)
    return figure


def _few(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 4 else f"{names[0]}, {names[1]}, … ({len(names)})"


def _alike(system: Linear, kind: str, names: Names) -> tuple[list[str], str]:
    """Names that have one unit, and this unit."""
    known = dict(zip(*((system.inputs, system.input_units) if kind == "input" else
                       (system.outputs, system.output_units)), strict=True))  # fmt: skip
    selected = choice.pick(system, kind, names)
    unit = known[selected[0]]
    if names is None:
        return [name for name in selected if known[name] == unit], unit
    odd = next((name for name in selected if known[name] != unit), None)
    if odd is not None:
        raise ResponseError(f"singular values: {kind} {selected[0]!r} is in {unit}, {odd!r} in {known[odd]}; singular "
                            f"values of mixed units mean nothing. Name {kind}s of one unit.")  # fmt: skip
    return selected, unit
