"""Curves from standards: vibration criteria of floors in one-third octaves, seismic background, roads."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array
from mbsvib.common.expected import one_of, positive, reals
from mbsvib.errors import ModelError
from mbsvib.responses.densities import Table

# Plateaus [m/s]: each half the one before, rounded as the source has them
VC = {"VC-A": 50e-6, "VC-B": 25e-6, "VC-C": 12.5e-6, "VC-D": 6.25e-6, "VC-E": 3.12e-6, "VC-F": 1.56e-6, "VC-G": 0.78e-6}
RELAXED, KNEE = ("VC-A", "VC-B"), 8.0
LOWEST, HIGHEST = 1.0, 80.0


def centres(low: float = LOWEST, high: float = HIGHEST) -> Array:
    """Return the exact centre frequencies 10^(n/10) (bands,) [Hz] of one-third octaves.

    ``low``, ``high``: nominal centre frequencies of the first and the last band [Hz].

    Source: IEC 61260-1, base-ten octaves.
    """
    numbers = np.arange(round(10.0 * np.log10(low)), round(10.0 * np.log10(high)) + 1)
    return np.asarray(10.0 ** (numbers / 10.0))


def edges(middle: ArrayLike) -> Array:
    """Return the edges (bands + 1,) [Hz] of adjacent one-third octaves with centre frequencies ``middle`` [Hz]."""
    middle = np.asarray(middle, dtype=float)
    return np.concatenate((middle * 10.0**-0.05, middle[-1:] * 10.0**0.05))


def vc_curve(name: str, frequencies: ArrayLike) -> Array:
    """Return the rms velocity that a vibration criterion allows in one-third octaves.

    Parameters
    ----------
    name : str
        VC-A to VC-G.
    frequencies : array-like, shape (n,)
        Middle frequencies [Hz].

    Returns
    -------
    array, shape (n,)
        Velocities [m/s]. VC-A and VC-B allow more below 8 Hz, where they are lines of constant acceleration.

    Raises
    ------
    ModelError
        If there is no such criterion.
    ResponseError
        If frequencies are not numbers.

    Source: H. Amick et al., "Evolving criteria for research facilities: vibration", SPIE 5933 (2005); IEST-RP-CC012.
    """
    allowed = VC[one_of(name, VC, "vc_curve", "name", ModelError)]
    f = reals(frequencies, "vc_curve", "frequencies", "frequencies [Hz]")
    relaxed = np.maximum(KNEE / f, 1.0) if name in RELAXED else np.ones_like(f)
    return allowed * relaxed


def strictest(middle: Array, velocity: Array) -> str:
    """Return the strictest criterion that velocities in one-third octaves meet, or an empty string."""
    met = [name for name in VC if (velocity <= vc_curve(name, middle)).all()]
    return met[-1] if met else ""


# How often displacements are differentiated
ORDER = {"displacement": 0, "velocity": 1, "acceleration": 2}
_UNITS = ("m", "m/s", "m/s^2")
# Periods T [s] from which 10 log10 of the density in (m/s^2)^2/Hz is A + B log10 T, until the next period
_LAST_PERIOD = 1e5
_NLNM = (
    (0.10, -162.36, 5.64), (0.17, -166.7, 0.0), (0.40, -170.0, -8.30), (0.80, -166.4, 28.90), (1.24, -168.6, 52.48),
    (2.40, -159.98, 29.81), (4.30, -141.1, 0.0), (5.0, -71.36, -99.77), (6.0, -97.26, -66.49), (10.0, -132.18, -31.57),
    (12.0, -205.27, 36.16), (15.6, -37.65, -104.33), (21.9, -114.37, -47.10), (31.6, -160.58, -16.28),
    (45.0, -187.50, 0.0), (70.0, -216.47, 15.70), (101.0, -185.0, 0.0), (154.0, -168.34, -7.61),
    (328.0, -217.43, 11.90), (600.0, -258.28, 26.60), (10000.0, -346.88, 48.75),
)  # fmt: skip
_NHNM = (
    (0.10, -108.73, -17.23), (0.22, -150.34, -80.50), (0.32, -122.31, -23.87), (0.80, -116.85, 32.51),
    (3.80, -108.48, 18.08), (4.60, -74.66, -32.95), (6.30, 0.66, -127.18), (7.90, -93.37, -22.42),
    (15.40, 73.54, -162.98), (20.0, -151.52, 10.01), (354.8, -206.66, 31.63),
)  # fmt: skip
_PETERSON = {"NLNM": _NLNM, "NHNM": _NHNM}
# Displacement densities [m^3] at 0.1 cycles/m: geometric means of the classes
_ROADS = {name: 16e-6 * 4.0**k for k, name in enumerate("ABCDEFGH")}
# The reference, and the span of spatial frequencies [cycles/m]
ROAD_REFERENCE, ROAD_SPAN = 0.1, (0.011, 2.83)


def vc_spectrum(name: str, quantity: str = "acceleration") -> Table:
    """Return the density of floor vibration that just meets a vibration criterion in each one-third octave.

    S_v(f) = v^2 / (f ln 10^(1/10)), with v the rms velocity that the criterion allows

    Parameters
    ----------
    name : str
        VC-A to VC-G.
    quantity : str
        "acceleration" (of base inputs), "velocity" or "displacement".

    Returns
    -------
    Table
        One-sided density from 0.89 to 90 Hz, the edges of the bands at 1 and 80 Hz.

    Raises
    ------
    ModelError
        If there is no such criterion.
    ResponseError
        If the quantity is another one.

    Source: H. Amick et al., "Evolving criteria for research facilities: vibration", SPIE 5933 (2005).
    """
    edge = 10.0**0.05
    f = np.array([LOWEST / edge, HIGHEST * edge])
    if name in RELAXED:
        f = np.insert(f, 1, KNEE)
    velocity = vc_curve(name, f)
    return _as(f, velocity**2 / (f * np.log(10.0) / 10.0), "velocity", quantity, "vc_spectrum")


def seismic_spectrum(name: str, quantity: str = "acceleration") -> Table:
    """Return the seismic background at the quietest or the noisiest sites.

    10 log10 S_a = A + B log10 T, with S_a in (m/s^2)^2/Hz and the period T

    Parameters
    ----------
    name : str
        "NLNM", the new low noise model, or "NHNM", the new high noise model.
    quantity : str
        "acceleration" (of base inputs), "velocity" or "displacement".

    Returns
    -------
    Table
        One-sided density from 10 uHz to 10 Hz.

    Raises
    ------
    ResponseError
        If there is no such model or quantity.

    Source: J. Peterson, Observations and modeling of seismic background noise, USGS Open-File Report 93-322 (1993).
    """
    period, constant, slope = np.array(_PETERSON[one_of(name, _PETERSON, "seismic_spectrum", "name")]).T
    period, last = np.append(period, _LAST_PERIOD), np.minimum(np.arange(len(period) + 1), len(period) - 1)
    level = constant[last] + slope[last] * np.log10(period)
    return _as(1.0 / period[::-1], 10.0 ** (0.1 * level[::-1]), "acceleration", quantity, "seismic_spectrum")


def road_spectrum(name: str, speed: float, quantity: str = "displacement") -> Table:
    """Return the density of the height of a road under a wheel.

    S(f) = G(n) / v,  G(n) = G(0.1) (n / 0.1)^-2,  n = f / v, for spatial frequencies n from 0.011 to 2.83 cycles/m

    Parameters
    ----------
    name : str
        Class of the road, "A" (very good) to "H": the geometric mean of the class.
    speed : float
        v [m/s].
    quantity : str
        "displacement", "velocity" or "acceleration".

    Returns
    -------
    Table
        One-sided density over the frequency.

    Raises
    ------
    ResponseError
        If there is no such class or quantity, or the speed is not positive.

    Source: ISO 8608:2016, table C.2.
    """
    roughness = road_roughness(name, "road_spectrum")
    speed, n = positive("road_spectrum", "speed", speed, "a speed [m/s]"), np.array(ROAD_SPAN)
    return _as(n * speed, roughness * (n / ROAD_REFERENCE) ** -2.0 / speed, "displacement", quantity, "road_spectrum")


def road_roughness(name: str, who: str) -> float:
    """Return the displacement density G(0.1) [m^3] of a class of roads; ``who`` asks for it, in messages."""
    return _ROADS[one_of(name, _ROADS, who, "name")]


def _as(f: Array, values: Array, given: str, quantity: str, who: str) -> Table:
    """A table of another quantity: densities are times (2 pi f)^2 for each derivative."""
    order = ORDER[one_of(quantity, ORDER, who, "quantity")]
    return Table(f, values * (2.0 * np.pi * f) ** (2.0 * (order - ORDER[given])), _UNITS[order])
