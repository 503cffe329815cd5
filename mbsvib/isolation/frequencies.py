"""Frequencies of a study: those that are given, checked, or those that resolve every resonance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.api.system import System
from mbsvib.errors import ResponseError
from mbsvib.feedback.loop import resolution
from mbsvib.responses import extrema

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.isolation.linear import Linear

POINTS = 400  # evenly spaced default frequencies; more points are added at resonances
THINNING = 3.0  # distance of the first added point in half-widths, and ratio of successive distances
SAME = 1e-10  # share of a frequency within which points are duplicates
BELOW, ABOVE = 0.02, 20.0  # default band, in parts of the lowest and highest natural frequency


def default(linear: Linear) -> Array:
    """Return ascending frequencies (n,) [Hz] around all poles, for a closed loop also around those of the open loop.

    They are evenly spaced on a logarithmic axis, and denser around resonances.
    """
    system: System = linear if isinstance(linear, System) else linear.open_loop
    size = np.abs(system.poles()) / (2.0 * np.pi)
    size = size[size > 1e-9 * size.max(initial=0.0)]
    if not len(size):
        raise ResponseError("isolation: nothing vibrates, so that no band suggests itself; give frequencies [Hz].")
    low, high = BELOW * float(size.min()), ABOVE * float(size.max())
    poles, _, period = resolution(linear)
    poles = np.concatenate((system.poles(), poles)) / (2.0 * np.pi)
    if period < np.inf:
        count = int(high / period) + 1
        poles = (poles[:, None] + 1j * period * np.arange(-count, count + 1)).reshape(-1)
    even = np.geomspace(low, high, POINTS)
    points = np.unique(np.concatenate((even, _around(poles, even[1] / even[0] - 1.0))))
    points = points[(points >= low) & (points <= high)]
    return points[np.concatenate(([True], np.diff(points) > SAME * points[1:]))]


def _around(poles: Complex, spacing: float) -> Array:
    """Peaks and half-power points of resonances, and points around them up to the even spacing."""
    half, centre = np.abs(poles.real)[:, None], np.abs(poles.imag)[:, None]
    away = THINNING ** np.arange(np.ceil(-np.log(extrema.UNDAMPED) / np.log(THINNING)))
    away = half * np.concatenate(([0.0], away, -away))
    return (centre + away)[(half > extrema.UNDAMPED * centre) & (np.abs(away) <= spacing * centre)]
