"""Nyquist plots of loop gains, with the critical point and the modulus margin of each actuator."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.plots import _loops as loops
from mbsvib.plots import _style as style
from mbsvib.plots._curves import finer
from mbsvib.plots._sheet import Given, in_rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from mbsvib.common.selection import Names
    from mbsvib.feedback.feedback_loop import FeedbackLoop

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
    loop = loops.closed(loop, "plots.loop_nyquist")
    which, grid = loops.numbers(loop, actuators), loops.grid(loop, frequencies, span, "plots.loop_nyquist")
    if frequencies is None:
        grid = finer(grid)
    values, margins = loops.gains(loop, which, grid), loop.margins()
    around = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 200))
    with in_rows("plots.loop_nyquist", ax, len(which), loops.columns_of(len(which)), (4.6, 3.6)) as paper:
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
            axes.set_xlim(-1.0 - reach, -1.0 + reach)
            axes.set_ylim(-reach, reach)
            axes.set_aspect("equal")
            axes.set_xlabel("real part [1]")
            axes.set_ylabel("imaginary part [1]")
            axes.set_title(loop.actuators[i])
        paper.head(f"Loop gain of {loop.name}")
    return paper.result
