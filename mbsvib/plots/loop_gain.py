"""Bode plots of loop gains, with the gain and phase margins of each actuator."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.plots import _loops as loops
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, pairs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.common.selection import Names
    from mbsvib.feedback.feedback_loop import FeedbackLoop
    from mbsvib.feedback.margins import Margins


def loop_gain(
    loop: FeedbackLoop, actuators: Names = None, frequencies: ArrayLike | None = None, *,
    span: tuple[float | None, float | None] = (None, None), decibels: bool = False,
    ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the loop gain at each actuator with the other loops closed, and mark its margins.

    1 + L_i(i w) = 1 / S_ii(i w), S = (1 - K G)^-1, with the critical point -1

    Parameters
    ----------
    loop : ClosedLoop or SampledLoop
        A plant with controllers, as ``system.feedback`` returns it.
    actuators : str or sequence of str, optional
        Names or patterns; default: all.
    frequencies : array-like, shape (n,), optional
        Where to compute [Hz]; default: a grid that resolves every resonance in ``span``.
    span : (float or None, float or None)
        First and last frequency [Hz]; None: from the poles.
    decibels : bool
        Magnitude in dB.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Magnitude and phase for each actuator. Vertical lines are the margins: from |L| to 1 where the phase is -180
        degrees, and from the phase to -180 degrees where |L| is 1.

    Raises
    ------
    ResponseError
        If it is no closed loop, a name is unknown, or there are more than twelve panels.
    """
    loop = loops.closed(loop, "plots.loop_gain")
    which, grid = loops.numbers(loop, actuators), loops.grid(loop, frequencies, span, "plots.loop_gain")
    values, margins = loops.gains(loop, which, grid), loop.margins()
    columns = loops.columns_of(len(which))
    with pairs("plots.loop_gain", ax, len(which), columns) as (paper, panels):
        for number, (i, (top, below)) in enumerate(zip(which, panels, strict=True)):
            _magnitude(top, grid, values[number], margins, i, decibels)
            _phase(below, grid, values[number], margins, i)
            top.set_title(loop.actuators[i])
            if number + columns < len(which):
                below.set_xlabel("")
        paper.head(f"Loop gain of {loop.name}")
    return paper.result


def margin_text(margins: Margins, i: int) -> str:
    """Return the margins of one actuator in a few words."""
    if not margins.stable:
        return "unstable"
    low, high = margins.lower[i], margins.gain[i]
    words = [f"gain margin {low:.3g} … {'∞' if np.isinf(high) else f'{high:.3g}'}"]
    words.append(f"phase margin {margins.phase[i]:.3g} deg" if np.isfinite(margins.phase[i]) else "any phase")
    return ", ".join(words)


def _magnitude(axes: Axes, f: Array, values: Complex, margins: Margins, i: int, decibels: bool) -> None:
    size = np.abs(values)
    size[size == 0.0] = np.nan
    axes.plot(f, 20.0 * np.log10(size) if decibels else size, **style.line(0), label=margin_text(margins, i))
    if not decibels:
        style.logarithmic(axes.yaxis)
    axes.axhline(0.0 if decibels else 1.0, color=style.MARK, linewidth=0.8)
    if margins.stable:
        for factor, at in ((margins.lower[i], margins.lower_at[i]), (margins.gain[i], margins.gain_at[i])):
            if f[0] <= at <= f[-1] and factor > 0.0:
                ends = np.array([1.0 / factor, 1.0])
                axes.plot([at, at], 20.0 * np.log10(ends) if decibels else ends, "o-", color=style.COLOURS[1], ms=3.0)
    axes.set_ylabel("loop gain [dB]" if decibels else "loop gain [1]")
    axes.legend(handlelength=0.0, borderaxespad=0.2)


def _phase(axes: Axes, f: Array, values: Complex, margins: Margins, i: int) -> None:
    phase = np.degrees(np.angle(values))
    broken = np.where(np.abs(np.diff(phase, append=phase[-1])) > 180.0, np.nan, phase)
    axes.plot(f, broken, **style.line(0))
    for critical in (-180.0, 180.0):
        axes.axhline(critical, color=style.MARK, linewidth=0.8)
    at = margins.phase_at[i]
    if margins.stable and f[0] <= at <= f[-1]:
        near = float(np.interp(np.log(at), np.log(f), np.unwrap(np.angle(values))))
        near = np.degrees((near + np.pi) % (2.0 * np.pi) - np.pi)
        axes.plot([at, at], [near, np.copysign(180.0, near)], "o-", color=style.COLOURS[1], ms=3.0)
    style.frequency_axis(axes, f[0], f[-1])
    axes.set_yticks([-180.0, -90.0, 0.0, 90.0, 180.0])
    axes.set_ylim(-190.0, 190.0)
    axes.set_ylabel("phase [deg]")
