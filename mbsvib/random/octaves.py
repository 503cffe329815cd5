"""One-third octaves and the vibration criteria VC-A to VC-G of floors for sensitive equipment."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.expected import reals
from mbsvib.errors import nearest

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array

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
    if not isinstance(name, str) or name not in VC:
        raise check.refuse("vc_curve", "name", name, f"one of {', '.join(VC)}", nearest(str(name), VC).strip())
    f = reals(frequencies, "vc_curve", "frequencies", "frequencies [Hz]")
    relaxed = np.maximum(KNEE / f, 1.0) if name in RELAXED else np.ones_like(f)
    return VC[name] * relaxed


def strictest(middle: Array, velocity: Array) -> str:
    """Return the strictest criterion that velocities in one-third octaves meet, or an empty string."""
    met = [name for name in VC if (velocity <= vc_curve(name, middle)).all()]
    return met[-1] if met else ""
