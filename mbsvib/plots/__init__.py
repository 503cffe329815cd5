"""Figures: Bode plots, step responses and modes, with names and units from the system.

Each function returns a ``matplotlib.figure.Figure`` that belongs to nobody else: no pyplot, no window, no global
state. Save it by ``figure.savefig("bode.png")``. Matplotlib is imported by the first figure that is drawn.
"""

from mbsvib.plots.bode import bode
from mbsvib.plots.campbell import campbell
from mbsvib.plots.grid import time_grid
from mbsvib.plots.modes import modes
from mbsvib.plots.step import step

__all__ = ["bode", "campbell", "modes", "step", "time_grid"]
