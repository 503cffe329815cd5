"""Root loci of a gain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from mbsvib.plots import _style as style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mbsvib.common.arrays import Complex, Index

ROUNDS = (0.1, 0.2, 0.4, 0.7)  # lines of one damping ratio
ROOM = 0.04  # half of a label's width, in parts of the height


class RootLocus(Protocol):
    """Data of a root locus; ``mbsvib.isolation.root_locus`` returns one."""

    @property
    def name(self) -> str:
        """Name of the controller."""

    @property
    def curves(self) -> Complex:
        """Poles [1/s] in columns that follow them, (gains, poles), those of open loops first."""

    @property
    def modes(self) -> Index:
        """Columns of poles that start with a positive imaginary part."""

    @property
    def best_poles(self) -> Complex:
        """Poles [1/s] at the best gain, (poles,)."""

    @property
    def zeros(self) -> Complex:
        """Where poles go as the gain grows [1/s]."""

    def summary(self, scale: float = 1.0) -> tuple[str, str]:
        """Return the effect of the best gain, in two lines; gains are multiplied by the scale."""


def root_locus(locus: RootLocus, scale: float = 1.0) -> Figure:
    """Draw how poles move as a gain grows.

    Parameters
    ----------
    locus : RootLocus
        What ``mbsvib.isolation.root_locus`` returned.
    scale : float
        What gains are multiplied by in the label.

    Returns
    -------
    matplotlib.figure.Figure
        Upper half of the plane of poles in Hz; crosses are open loops, circles zeros, dots the best gain of the least
        damped vibration; faint rays have one damping ratio. The title tells the least damping of what vibrates without
        the controller and at the best gain.
    """
    with style.context():
        figure = style.new_figure(5.2, 5.2)
        axes = figure.subplots()
        poles = locus.curves / (2.0 * np.pi)
        largest = np.abs(poles[:, locus.modes]).max(initial=0.0) if len(locus.modes) else np.abs(poles).max()
        top = 1.15 * float(np.abs(poles[0]).max()) or float(largest) or 1.0
        marked = locus.best_poles / (2.0 * np.pi)
        for number, column in enumerate(locus.modes.tolist()):
            path, colour = poles[:, column], style.COLOURS[number % len(style.COLOURS)]
            axes.plot(path.real, np.abs(path.imag), color=colour)
            axes.plot(path.real[:1], path.imag[:1], "x", color=colour, markersize=6.0)
            axes.plot([marked[column].real], [np.abs(marked[column].imag)], "o", color=colour, markersize=4.0)
        zeros = locus.zeros[locus.zeros.imag >= 0.0] / (2.0 * np.pi)
        axes.plot(zeros.real, zeros.imag, "o", color=style.INK, mfc="none", markersize=6.0)
        left = min(-0.25 * top, 1.08 * float(np.maximum(poles.real[:, locus.modes], -top).min(initial=0.0)))
        right = max(0.05 * top, 1.08 * float(np.minimum(poles.real[:, locus.modes], top).max(initial=0.0)))
        _rays(axes, top, left)
        axes.set_xlim(left, right)
        axes.set_ylim(0.0, top)
        axes.axvline(0.0, color=style.MARK, linewidth=0.8)
        axes.set_aspect("equal")
        axes.set_xlabel("real part / 2 pi [1/s]")
        axes.set_ylabel("imaginary part / 2 pi [Hz]")
        figure.suptitle(f"{locus.name}: " + "\n".join(locus.summary(scale)), x=0.02, ha="left", fontsize=10.5)
    return figure


def _rays(axes: Axes, top: float, left: float) -> None:
    for ratio in ROUNDS:
        slope = np.sqrt(1.0 - ratio**2) / ratio
        axes.plot([0.0, -2.0 * top], [0.0, 2.0 * top * slope], color=style.FAINT, linewidth=0.8, zorder=0)
        x = -0.93 * top / slope
        if x - ROOM * top > left:
            axes.text(x, 0.93 * top, f"{100.0 * ratio:g} %", color=style.MARK, fontsize=7.5, ha="center")
