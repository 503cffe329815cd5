"""Poles and zeros in the complex plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.plots import _choice as choice
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet
from mbsvib.plots.root_locus import damping_rays, limits_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from mbsvib.common.selection import Names
    from mbsvib.plots._choice import Systems
    from mbsvib.plots.root_locus import Limits

AT_REST = 1e-9  # poles below this share of the largest do not count for the limits of axes
WIDE = 10.0  # ratio of magnitudes of poles above which linear axes hide the smallest


def pole_zero_map(
    systems: Systems, outputs: Names = None, inputs: Names = None, *, real: Limits = None, imaginary: Limits = None,
    equal: bool | None = None, labels: Sequence[str] | None = None, ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw poles as crosses and the zeros from inputs to outputs as circles.

    Parameters
    ----------
    systems : System, ClosedLoop, StateSpace, Controller, control.StateSpace, control.TransferFunction, or sequence
        One, or several that are drawn into the same plane.
    outputs, inputs : str or sequence of str, optional
        Names or patterns of the ports that the zeros belong to; default: all.
    real, imaginary : (float, float), optional
        First and last value of each axis [Hz]; default: all poles.
    equal : bool, optional
        The same linear scale on both axes, so that angles are true; default: only if no limits are given and the
        magnitudes of the poles spread by less than ten times. Magnitudes that spread more are drawn on scales that are
        logarithmic but near zero (asinh), unless limits are given.
    labels : sequence of str, optional
        Names of the systems in the legend; default: their own.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Upper half of the plane in Hz; faint rays have one damping ratio.

    Raises
    ------
    ResponseError
        If a name is unknown, or limits are not two finite, ascending numbers.
    """
    across, upward = limits_of(real, "real", "plots.pole_zero_map"), limits_of(imaginary, "imaginary",
                                                                              "plots.pole_zero_map")  # fmt: skip
    from matplotlib.ticker import NullLocator

    named = choice.listed(systems, labels)
    with sheet("plots.pole_zero_map", ax, (5.6, 5.2)) as paper:
        axes = paper.panels[0]
        shown = []
        for number, (label, system) in enumerate(named, paper.first):
            colour = style.COLOURS[number % len(style.COLOURS)]
            picked = (choice.pick(system, "output", outputs), choice.pick(system, "input", inputs))
            for values, mark, word in ((system.poles(), "x", "poles"),
                                       (system.transmission_zeros(*picked), "o", "zeros")):  # fmt: skip
                upper = values[values.imag >= 0.0] / (2.0 * np.pi)
                name = f"{label}, {word}" if len(named) > 1 else word
                axes.plot(upper.real, upper.imag, mark, color=colour, mfc="none", markersize=6.0, label=name)
                if mark == "x":
                    shown.append(upper)
        poles = np.concatenate(shown)
        sizes = np.abs(poles[np.abs(poles) > AT_REST * np.abs(poles).max(initial=0.0)])
        limited = across is not None or upward is not None
        wide = bool(sizes.size) and float(sizes.max()) > WIDE * float(sizes.min())
        same = not (limited or wide) if equal is None else equal
        size = 1.15 * float(sizes.max(initial=0.0)) or 1.0
        edge = -0.5 * float(sizes.min()) if wide and not same and not limited else -0.25 * size
        left = min(edge, 1.1 * float(poles.real.min(initial=0.0)))
        right = max(-0.3 * edge, 1.1 * float(poles.real.max(initial=0.0)))
        left, right = across or (left, right)
        bottom, top = upward or (0.0, max(1.15 * float(poles.imag.max(initial=0.0)), 0.25 * size))
        if wide and not same and not limited:
            width = float(sizes.min())
            decades = 10.0 ** np.arange(np.ceil(np.log10(width / 3.0)), np.floor(np.log10(size)) + 1.0)
            ticks = [*(-decades[::-1]).tolist(), 0.0, *decades.tolist()]
            axes.set_xscale("asinh", linear_width=width)
            axes.set_yscale("asinh", linear_width=width)
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_ticks(ticks, [f"{tick:g}".replace("-", "\N{MINUS SIGN}") for tick in ticks])
                axis.set_minor_locator(NullLocator())
            bottom = -0.15 * width if upward is None else bottom
        axes.set_xlim(left, right)
        axes.set_ylim(bottom - 0.02 * (top - bottom) if same and upward is None else bottom, top)
        axes.axvline(0.0, color=style.MARK, linewidth=0.8)
        axes.set_aspect("equal" if same else "auto")
        damping_rays(axes)
        axes.set_xlabel("real part / 2 pi [1/s]")
        axes.set_ylabel("imaginary part / 2 pi [Hz]")
        paper.legend(loc="outside upper left", columns=2)
    return paper.result
