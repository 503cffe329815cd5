"""Poles and zeros in the complex plane, and root loci of a gain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from mbsvib.common.expected import a_result, reals
from mbsvib.common.selection import Names
from mbsvib.errors import ResponseError
from mbsvib.feedback.pole_track import has_moved
from mbsvib.plots import _style as style
from mbsvib.plots._curves import Systems, listed, pick
from mbsvib.plots._sheet import Given, sheet

ROUNDS = (0.1, 0.2, 0.4, 0.7)  # lines of one damping ratio
ROOM = 0.05  # half of a label's width, in parts of the height or, with unequal axes, of the width
LABEL_HEIGHT = 0.93  # of labels of damping ratios, in parts of the height

Limits: TypeAlias = "tuple[float, float] | None"


def root_locus(
    locus: Any, scale: float = 1.0, *, real: Limits = None, imaginary: Limits = None, equal: bool | None = None,
    ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw how poles move as a gain grows.

    Parameters
    ----------
    locus : RootLocus
        What ``mbsvib.isolation.root_locus`` returned.
    scale : float
        What gains are multiplied by in the label.
    real, imaginary : (float, float), optional
        First and last value of each axis [Hz]; default: all open-loop poles that the gain moves.
    equal : bool, optional
        The same scale on both axes, so that angles are true; default: only if no limits are given. Unequal axes show
        the paths of slow poles beside fast ones.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Upper half of the plane of poles in Hz; crosses are open loops, circles zeros, dots the best gain of the least
        damped vibration; faint rays have one damping ratio. The axis
        states how many modes are outside, the legend the smallest damping without the controller and at the best gain.

    Raises
    ------
    ResponseError
        If limits are not two finite, ascending numbers.
    """
    a_result(locus, "curves", "plots.root_locus", "locus", "what isolation.root_locus(...) returns")
    across, upward = (limits_of(values, field, "plots.root_locus")
                      for values, field in ((real, "real"), (imaginary, "imaginary")))
    same = (across is None and upward is None) if equal is None else equal
    with sheet("plots.root_locus", ax, (5.2, 5.2)) as paper:
        axes = paper.panels[0]
        poles = locus.curves / (2.0 * np.pi)
        moving = has_moved(poles) if has_moved(poles).any() else np.ones(poles.shape[1], dtype=bool)
        shown = np.intersect1d(locus.modes, np.flatnonzero(moving))
        largest = np.abs(poles[:, shown]).max(initial=0.0) if len(shown) else np.abs(poles[:, moving]).max()
        top = 1.15 * float(np.abs(poles[0, moving]).max()) or float(largest) or 1.0
        marked = locus.best_poles / (2.0 * np.pi)
        for column in np.setdiff1d(np.arange(poles.shape[1]), locus.modes).tolist():  # integrators may begin to swing
            path = poles[:, column]
            above = np.where(path.imag >= 0.0, path.imag, np.nan)
            axes.plot(path.real, above, color=style.MARK, linewidth=1.0, zorder=1.8)
        for number, column in enumerate(locus.modes.tolist()):
            path, colour = poles[:, column], style.COLOURS[number % len(style.COLOURS)]
            axes.plot(path.real, np.abs(path.imag), color=colour)
            axes.plot(path.real[:1], path.imag[:1], "x", color=colour, markersize=6.0)
            axes.plot([marked[column].real], [np.abs(marked[column].imag)], "o", color=colour, markersize=4.0)
        zeros = locus.zeros[locus.zeros.imag >= 0.0] / (2.0 * np.pi)
        axes.plot(zeros.real, zeros.imag, "o", color=style.INK, mfc="none", markersize=6.0)
        left = min(-0.25 * top, 1.08 * float(np.maximum(poles.real[:, shown], -top).min(initial=0.0)))
        right = max(0.05 * top, 1.08 * float(np.minimum(poles.real[:, shown], top).max(initial=0.0)))
        left, right = across or (left, right)
        bottom, top = upward or (0.0, top)
        axes.set(xlim=(left, right), ylim=(bottom, top))
        axes.axvline(0.0, color=style.MARK, linewidth=0.8)
        axes.set_aspect("equal" if same else "auto")
        damping_rays(axes)
        beginnings = poles[0, locus.modes]
        outside = int(((beginnings.real < left) | (beginnings.imag > top)).sum())
        note = f"\n({outside} of {len(beginnings)} modes are outside)" if outside else ""
        axes.set(xlabel="real part / 2 pi [1/s]" + note, ylabel="imaginary part / 2 pi [Hz]", title=locus.name)
        paper.legend(draw_legend(), columns=3, title="\n".join(locus.summary(scale)))
    return paper.result


def draw_legend() -> list[Line2D]:
    """Return what explains the marks of a root locus."""
    return [Line2D([], [], color=style.INK, linestyle="none", marker=marker, markersize=size, mfc=face, label=words)
            for marker, size, face, words in (("x", 6.0, None, "open loops"), ("o", 4.0, None, "best gain"),
                                              ("o", 6.0, "none", "zeros"))]  # fmt: skip


def limits_of(values: Limits, field: str, who: str) -> Limits:
    """Return the limits of an axis as they are given, if they are two finite, ascending numbers."""
    if values is None:
        return None
    expected = "the first and last value of the axis [Hz], ascending"
    ends = reals(values, who, field, expected)
    if ends.shape != (2,) or not np.isfinite(ends).all() or ends[0] >= ends[1]:
        raise ResponseError(f"{who}: {field} is {values!r}; expected {expected}, such as (0.0, 20.0).")
    return float(ends[0]), float(ends[1])


def damping_rays(axes: Axes) -> None:
    """Draw lines of one damping ratio within the limits of axes, with labels where they pass below the upper edge."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    to_axes = axes.transData - axes.transAxes
    room = ROOM * ((top - bottom) / (right - left) if axes.get_aspect() == 1.0 else 1.0)
    reach = 2.0 * max(abs(left), abs(right), abs(top), abs(bottom))
    radius = np.concatenate(([0.0], np.geomspace(1e-6, 1.0, 200))) * reach / min(ROUNDS)
    labels: list[float] = []
    for ratio in ROUNDS:
        ray = np.column_stack((-ratio * radius, np.sqrt(1.0 - ratio**2) * radius))
        axes.plot(*ray.T, color=style.FAINT, linewidth=0.8, zorder=0, scalex=False, scaley=False)
        across, upward = to_axes.transform(ray).T
        x = float(np.interp(LABEL_HEIGHT, upward, across))
        if room < x < 1.0 - room and all(abs(x - other) > 2.0 * room for other in labels):
            labels.append(x)
            real, imaginary = to_axes.inverted().transform((x, LABEL_HEIGHT)).tolist()
            axes.text(real, imaginary, f"{100.0 * ratio:g} %", color=style.MARK, fontsize=7.5, ha="center")


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

    named = listed(systems, labels)
    with sheet("plots.pole_zero_map", ax, (5.6, 5.2)) as paper:
        axes = paper.panels[0]
        shown = []
        for number, (label, system) in enumerate(named, paper.first):
            colour = style.COLOURS[number % len(style.COLOURS)]
            picked = (pick(system, "output", outputs), pick(system, "input", inputs))
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
        axes.set(xlim=(left, right), ylim=(bottom - 0.02 * (top - bottom) if same and upward is None else bottom, top))
        axes.axvline(0.0, color=style.MARK, linewidth=0.8)
        axes.set_aspect("equal" if same else "auto")
        damping_rays(axes)
        axes.set(xlabel="real part / 2 pi [1/s]", ylabel="imaginary part / 2 pi [Hz]")
        paper.legend(loc="outside upper left", columns=2)
    return paper.result
