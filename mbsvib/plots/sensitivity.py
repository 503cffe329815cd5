"""Sensitivity and complementary sensitivity of closed loops over frequency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.plots import _loops as loops
from mbsvib.plots import _style as style
from mbsvib.plots._sheet import Given, sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array
    from mbsvib.feedback.feedback_loop import FeedbackLoop

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
        loop is unstable. The peak of S of a stable loop is the inverse of the modulus margin of all loops together.

    Raises
    ------
    ResponseError
        If one is no closed loop, or there are not as many labels as loops.
    """
    several = list(loop) if isinstance(loop, Sequence) else [loop]
    group = [loops.closed(loop, "plots.sensitivity") for loop in several]
    names = [loop.title for loop in group] if labels is None else list(labels)
    if len(names) != len(group) or not group:
        raise ResponseError(f"plots.sensitivity: {len(names)} labels for {len(group)} loops; give one for each.")
    with sheet("plots.sensitivity", ax, (style.WIDEST, 4.2), 1, 2) as paper:
        panels = paper.panels
        paper.join(panels, "y")
        ends = [np.inf, 0.0]
        for number, (name, loop) in enumerate(zip(names, group, strict=True), paper.first):
            f = loops.grid(loop, frequencies, span, "plots.sensitivity")
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
