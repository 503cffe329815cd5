"""Frequencies of lines and grids within a band: its ends belong to it, however they were rounded."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Bools

# A frequency beyond the end of a band by this share is the end: files and clocks round to ten digits or so, and lines
# are no closer than 1e-8 of their frequency.
BAND_END = 1e-9


def within(frequencies: NDArray[Any], low: float, high: float) -> Bools:
    """Tell which frequencies (n,) are in a band, in any unit that all have in common."""
    return np.asarray((frequencies >= low * (1.0 - BAND_END)) & (frequencies <= high * (1.0 + BAND_END)))
