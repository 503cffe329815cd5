"""Times of a response until it has decayed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.plots._choice import listed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.plots._system import Linear


PERIODS = 25.0
DECAY_TIMES = 5.0  # time constants: 0.7 % is left
MOST_TIMES = 20_000


def time_grid(systems: Linear | Sequence[Linear], duration: float | None = None) -> Array:
    """Return evenly spaced times that show a step response.

    Until the slowest mode has settled (five time constants) or 25 of the longest period have passed, whichever is
    sooner; 20 points for the shortest period that can be seen at that scale.

    Parameters
    ----------
    systems : System or sequence of System
        Whose modes decide; rigid-body modes have no time of their own.
    duration : float, optional
        Last time [s] instead.

    Returns
    -------
    array, shape (n,)
        Times from 0 [s].

    Raises
    ------
    ResponseError
        If the duration is not positive.
    """
    poles = np.concatenate([np.zeros(0, complex), *(np.asarray(one.poles()) for _, one in listed(systems, None))])
    poles = poles[(poles != 0.0) & (poles.imag >= 0.0)]
    if duration is None:
        decaying = -poles.real[poles.real < 0.0]
        swinging = poles.imag[poles.imag > 0.0]
        decay_time = DECAY_TIMES / decaying.min() if decaying.size else np.inf
        periods = PERIODS * 2.0 * np.pi / swinging.min() if swinging.size else np.inf
        duration = min(decay_time, periods)
        if not np.isfinite(duration):
            duration = 1.0
    if not 0.0 < duration < np.inf:
        raise ResponseError(f"duration = {duration!r} s: expected a positive, finite time.")
    fastest = np.abs(poles).max(initial=0.0) / (2.0 * np.pi)
    count = int(min(MOST_TIMES, max(1_000.0, 20.0 * fastest * duration)))
    return np.linspace(0.0, float(duration), count + 1)
