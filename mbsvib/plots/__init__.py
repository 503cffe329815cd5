"""Figures: responses, modes, energies and the mechanism itself, with names and units from the system.

Each function returns a new ``matplotlib.figure.Figure``: no pyplot, no window, no global state. Save it by
``figure.savefig("bode.png")``. With ``ax=``, one of matplotlib's axes or a sequence of them, it draws there and returns
what was given. ``STYLE`` has the settings of all figures, for your own: ``plt.style.use(plots.STYLE)``. Matplotlib is
imported by the first figure that is drawn.
"""

from functools import partial

from mbsvib.common.misplaced import missing
from mbsvib.plots._style import STYLE
from mbsvib.plots.bode import bode, mode_contributions, nyquist
from mbsvib.plots.cycle import cycle, periodic
from mbsvib.plots.isolation import isolation, transmissibility
from mbsvib.plots.loops import loop_gain, loop_nyquist, sensitivity
from mbsvib.plots.mechanism import mechanism
from mbsvib.plots.mode_strips import mode_strips
from mbsvib.plots.modes import comparison, energy, mode_comparison, modes
from mbsvib.plots.path import path
from mbsvib.plots.root_locus import pole_zero_map, root_locus
from mbsvib.plots.singular_values import singular_values
from mbsvib.plots.step import step, time_grid
from mbsvib.plots.studies import campbell, front, trade_off
from mbsvib.plots.topology import topology

__all__ = [
    "STYLE", "bode", "campbell", "comparison", "cycle", "energy", "front", "isolation", "loop_gain", "loop_nyquist",
    "mechanism", "mode_comparison", "mode_contributions", "mode_strips", "modes", "nyquist", "path", "periodic",
    "pole_zero_map", "root_locus", "sensitivity", "singular_values", "step", "time_grid", "topology", "trade_off",
    "transmissibility",
]  # fmt: skip
__dir__ = __all__.copy
__getattr__ = partial(missing, __name__)
