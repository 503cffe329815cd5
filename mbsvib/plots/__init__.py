"""Figures: responses, modes, energies and the mechanism itself, with names and units from the system.

Each function returns a new ``matplotlib.figure.Figure``: no pyplot, no window, no global state. Save it by
``figure.savefig("bode.png")``. With ``ax=``, one of matplotlib's axes or a sequence of them, it draws there and returns
what was given. ``STYLE`` has the settings of all figures, for your own: ``plt.style.use(plots.STYLE)``. Matplotlib is
imported by the first figure that is drawn.
"""

from mbsvib.plots._style import STYLE
from mbsvib.plots.bode import bode
from mbsvib.plots.campbell import campbell
from mbsvib.plots.comparison import comparison
from mbsvib.plots.cycle import cycle
from mbsvib.plots.energy import energy
from mbsvib.plots.front import front
from mbsvib.plots.grid import time_grid
from mbsvib.plots.isolation import isolation
from mbsvib.plots.loop_gain import loop_gain
from mbsvib.plots.loop_nyquist import loop_nyquist
from mbsvib.plots.mechanism import mechanism
from mbsvib.plots.mode_comparison import mode_comparison
from mbsvib.plots.mode_contributions import mode_contributions
from mbsvib.plots.mode_strips import mode_strips
from mbsvib.plots.modes import modes
from mbsvib.plots.nyquist import nyquist
from mbsvib.plots.path import path
from mbsvib.plots.periodic import periodic
from mbsvib.plots.pole_zero_map import pole_zero_map
from mbsvib.plots.root_locus import root_locus
from mbsvib.plots.sensitivity import sensitivity
from mbsvib.plots.singular_values import singular_values
from mbsvib.plots.step import step
from mbsvib.plots.topology import topology
from mbsvib.plots.trade_off import trade_off
from mbsvib.plots.transmissibility import transmissibility

__all__ = [
    "STYLE",
    "bode",
    "campbell",
    "comparison",
    "cycle",
    "energy",
    "front",
    "isolation",
    "loop_gain",
    "loop_nyquist",
    "mechanism",
    "mode_comparison",
    "mode_contributions",
    "mode_strips",
    "modes",
    "nyquist",
    "path",
    "periodic",
    "pole_zero_map",
    "root_locus",
    "sensitivity",
    "singular_values",
    "step",
    "time_grid",
    "topology",
    "trade_off",
    "transmissibility",
]


def __dir__() -> list[str]:
    """The public names."""
    return __all__
