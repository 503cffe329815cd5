"""Closed loops over frequency: Bode and Nyquist plots of the loop gain of each actuator, sensitivity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import kind_of
from mbsvib.common.selection import Names, selected
from mbsvib.errors import ResponseError
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.feedback.margins import Margins
from mbsvib.plots import _style as style
from mbsvib.plots._curves import MOST_PANELS, columns_of, finer, positive_frequencies
from mbsvib.plots._sheet import Given, in_rows, pairs, sheet
from mbsvib.responses.frequency_grid import resolving_frequencies
from mbsvib.responses.frequency_grid import span as range_of


def closed(loop: Any, who: str) -> FeedbackLoop:
    """Return a closed loop; refuse anything else."""
    if kind_of(loop) not in ("closed loop", "sampled loop") or not hasattr(loop, "sensitivity"):
        raise ResponseError(f"{who}: loop = {type(loop).__name__}; expected a closed loop, as system.feedback(...) "
                            f"returns it.")  # fmt: skip
    result: FeedbackLoop = loop
    return result


def grid_of(
    loop: FeedbackLoop, frequencies: ArrayLike | None, span: tuple[float | None, float | None], who: str
) -> Array:
    """Return frequencies [Hz]: as given, or such that no pole of the plant, the controllers or the loop is missed."""
    if frequencies is not None:
        return positive_frequencies(frequencies, who)
    poles = np.concatenate((loop.resolution.poles, loop.open_loop.poles()))
    low, high = range_of(poles, *span)
    return resolving_frequencies(np.concatenate((poles, np.linalg.eigvals(loop.law.A))), poles, low,
                  min(high, 0.499 * loop.resolution.period))  # fmt: skip


def gains(
    loop: FeedbackLoop, actuators: Names, frequencies: ArrayLike | None, span: tuple[float | None, float | None],
    who: str, circles: bool = False,
) -> tuple[list[int], Array, Complex]:  # fmt: skip
    """Return the numbers of the actuators to draw, frequencies (n,) [Hz], and the gain L (actuators, n) of each loop
    with the others closed, 1 + L = 1 / S; ``circles``: on a finer grid, where none is given.
    """
    which = selected(actuators, closed(loop, who).actuators, "actuator", loop.name, ())
    if not 0 < len(which) <= MOST_PANELS:
        raise ResponseError(f"{len(which)} actuators; a figure holds 1 to {MOST_PANELS} panels: choose some by "
                            f"actuators=[...] out of {', '.join(loop.actuators)}.")  # fmt: skip
    grid = grid_of(loop, frequencies, span, who)
    grid = finer(grid) if circles and frequencies is None else grid
    s = loop.sensitivity(2.0 * np.pi * grid)
    return which, grid, np.array([1.0 / s[i, i] - 1.0 for i in which])


def loop_gain(
    loop: FeedbackLoop, actuators: Names = None, frequencies: ArrayLike | None = None, *,
    span: tuple[float | None, float | None] = (None, None), decibels: bool = False, ax: Given | None = None,
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
    which, grid, values = gains(loop, actuators, frequencies, span, "plots.loop_gain")
    margins, columns = loop.margins(), columns_of(len(which))
    with pairs("plots.loop_gain", ax, len(which), columns) as (paper, panels):
        for number, (i, (top, below)) in enumerate(zip(which, panels, strict=True)):
            _magnitude(top, grid, values[number], margins, i, decibels)
            _phase(below, grid, values[number], margins, i)
            style.title(top, loop.actuators[i])
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
    return ",\n".join(words)


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
    style.phase_axis(axes)


# Largest distance from the critical point up to which all of a loop gain is shown, and what is shown of larger ones.
WHOLE, FARTHEST = 12.0, 4.0


def loop_nyquist(
    loop: FeedbackLoop, actuators: Names = None, frequencies: ArrayLike | None = None, *,
    span: tuple[float | None, float | None] = (None, None), ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the loop gain at each actuator with the other loops closed in the complex plane.

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
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        A panel for each actuator: the loop gain for positive frequencies full and for negative ones dashed, the
        critical point -1, the unit circle, and the circle around -1 that the loop gain does not enter, of the radius of
        the modulus margin.

    Raises
    ------
    ResponseError
        If it is no closed loop, a name is unknown, or there are more than twelve panels.
    """
    which, _, values = gains(loop, actuators, frequencies, span, "plots.loop_nyquist", circles=True)
    margins = loop.margins()
    around = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 200))
    with in_rows("plots.loop_nyquist", ax, len(which), columns_of(len(which)), (4.6, 3.6)) as paper:
        for number, (i, axes) in enumerate(zip(which, paper.panels, strict=True)):
            gain, look = values[number], style.line(0)
            axes.plot(gain.real, gain.imag, **look)
            axes.plot(gain.real, -gain.imag, **(look | {"linestyle": (0, (4, 3)), "linewidth": 0.7}))
            axes.plot(around.real, around.imag, color=style.MARK, linewidth=0.7)
            axes.plot([-1.0], [0.0], "+", color=style.COLOURS[1], ms=9.0, zorder=4)
            if margins.stable:
                radius = float(margins.modulus_each[i])
                circle = -1.0 + radius * around
                axes.plot(circle.real, circle.imag, color=style.COLOURS[1], linewidth=0.9,
                          label=f"modulus margin {radius:.3g}")  # fmt: skip
                axes.legend(loc="upper left")
            else:
                style.remark(axes, "unstable", top=True)
            reach = max(1.6, 1.1 * float(np.abs(gain + 1.0).max()))
            reach = reach if reach <= WHOLE else FARTHEST
            axes.set(xlim=(-1.0 - reach, -1.0 + reach), ylim=(-reach, reach), aspect="equal", xlabel="real part [1]",
                     ylabel="imaginary part [1]")
            style.title(axes, loop.actuators[i])
        paper.head(f"Loop gain of {loop.name}")
    return paper.result


LEVEL = 1e-3  # share by which a peak is above the ends of its curve


def sensitivity(
    loop: FeedbackLoop | Sequence[FeedbackLoop], frequencies: ArrayLike | None = None, *,
    span: tuple[float | None, float | None] = (None, None), labels: Sequence[str] | None = None,
    decibels: bool = False, ax: Given | None = None,
) -> Figure | Given:  # fmt: skip
    """Draw the largest singular values of the sensitivity S and the complementary sensitivity T over frequency.

    S = (1 - K G)^-1 at the actuators, T = 1 - S

    Parameters
    ----------
    loop : ClosedLoop, SampledLoop or sequence of these
        Plants with controllers, as ``system.feedback`` returns them.
    frequencies : array-like, shape (n,), optional
        Where to compute [Hz]; default: a grid that resolves every resonance in ``span``.
    span : (float or None, float or None)
        First and last frequency [Hz]; None: from the poles.
    labels : sequence of str, optional
        Names of the loops in the legend; default: their controllers.
    decibels : bool
        Magnitude in dB.
    ax : Axes or sequence of Axes, optional
        Where to draw, a panel each, row by row; default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure, or ``ax``
        Two panels; the legend has the peak of each curve, or at which end of the range it is highest, and whether the
        loop is unstable. The inverse of the peak of S of a stable loop is the modulus margin of one
        actuator, and at most that of several, which their units do not change.

    Raises
    ------
    ResponseError
        If one is no closed loop, or there are not as many labels as loops.
    """
    several = list(loop) if isinstance(loop, Sequence) else [loop]
    group = [closed(loop, "plots.sensitivity") for loop in several]
    names = [loop.title for loop in group] if labels is None else list(labels)
    if len(names) != len(group) or not group:
        raise ResponseError(f"plots.sensitivity: {len(names)} labels for {len(group)} loops; give one for each.")
    with sheet("plots.sensitivity", ax, (style.WIDEST, 4.2), 1, 2) as paper:
        panels = paper.panels
        paper.join(panels, "y")
        ends = [np.inf, 0.0]
        for number, (name, loop) in enumerate(zip(names, group, strict=True), paper.first):
            f = grid_of(loop, frequencies, span, "plots.sensitivity")
            s = loop.sensitivity(2.0 * np.pi * f).transpose(2, 0, 1)
            ends = [min(ends[0], f[0]), max(ends[1], f[-1])]
            verdict = "" if loop.margins().stable else " (unstable)"
            both = [np.asarray(np.linalg.svd(matrices, compute_uv=False)[:, 0], dtype=float)
                    for matrices in (s, np.eye(len(loop.actuators)) - s)]  # fmt: skip
            words = "\n".join(f"{kind}: {_highest(f, largest, decibels)}"
                              for kind, largest in zip("ST", both, strict=True))  # fmt: skip
            for axes, largest in zip(panels, both, strict=True):
                axes.plot(f, 20.0 * np.log10(largest) if decibels else largest, **style.line(number),
                          label=f"{name}{verdict}: {words}")  # fmt: skip
        for axes, title in zip(panels, ("sensitivity S", "complementary sensitivity T"), strict=True):
            style.frequency_axis(axes, ends[0], ends[1])
            if not decibels:
                style.logarithmic(axes.yaxis)
            axes.axhline(0.0 if decibels else 1.0, color=style.MARK, linewidth=0.8)
            axes.set_title(title)
        panels[0].set_ylabel("largest singular value [dB]" if decibels else "largest singular value [1]")
        paper.legend(columns=2)
    return paper.result


def _highest(f: Array, largest: Array, decibels: bool) -> str:
    """Return the peak of a curve in words; curves that end as high as anywhere have none."""
    top = float(largest.max())
    words = f"{round(20.0 * np.log10(top), 2) + 0.0:.3g} dB" if decibels else f"{top:.3g}"
    ends = [end for end, value in (("low", largest[0]), ("high", largest[-1])) if value >= (1.0 - LEVEL) * top]
    if len(ends) == 2:
        return f"no peak, {words} at both ends"
    if ends:
        return f"no peak, {words} towards {ends[0]} frequencies"
    return f"peak {words} at {f[largest.argmax()]:.4g} Hz"
