"""Spectral radius of a master's step against its size, and the largest step at which it is stable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib_export.cosimulation.masters import Loop

_ROUNDING = 1e-7  # eigenvalues of rigid-body motions come in pairs, which rounding takes apart
_FEW = 60  # numbers in z up to which steps are tried close to each other, so that no unstable range is jumped over
_SHORT = 0.1  # of the shortest time constant: where the search begins, as longer steps may be stable again
_MOST, _LEAST, _DIGITS = 1e2, 1e-6, 10  # of the step asked for: where the search ends; halvings of the last range


def radius(loop: Loop, method: str) -> float:
    """Return the spectral radius of a step [1]; for iteration the contraction factor, if that is larger."""
    largest = _largest(loop.matrix(method))
    return max(largest, _largest(loop.contraction())) if method == "iteration" else largest


def _largest(matrix: np.ndarray) -> float:
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0)) if np.isfinite(matrix).all() else np.inf


def is_stable(spectral_radius: float, growth: float, h: float) -> bool:
    """Return whether a spectral radius is no more than that of the loop itself, whose poles end at ``growth`` [1/s]."""
    return bool(spectral_radius <= np.exp(min(max(growth, 0.0) * h, 50.0)) + _ROUNDING)


def largest_stable_step(make: Callable[[float], Loop], method: str, step: float, growth: float) -> float:
    """Return the largest step [s], to 0.1 %, such that a master is stable with this and all shorter steps.

    ``make``: step [s] -> Loop. ``step``: requested step [s]. ``growth``: largest real part of the closed loop's poles
    [1/s]. Returns infinity if 100 times the requested step is still stable, 0 if a millionth of it is not.
    """

    def stable(h: float) -> bool:
        return is_stable(radius(make(h), method), growth, h)

    loop = make(step)
    fastest = max(_largest(matrix) for matrix in (loop.plant.A, loop.controller.A, loop.monolithic()[0]))
    factor = 1.25 if sum(loop.sizes) <= _FEW else 2.0
    h = max(min(step, _SHORT / fastest), _LEAST * step) if fastest > 0.0 else step
    if stable(h):
        while stable(h * factor):
            h *= factor
            if h > _MOST * step:
                return float("inf")
        good, bad = h, h * factor
    else:
        while not stable(h / factor):
            h /= factor
            if h < _LEAST * step:
                return 0.0
        good, bad = h / factor, h
    for _ in range(_DIGITS):
        h = (good + bad) / 2
        good, bad = (h, bad) if stable(h) else (good, h)
    return good


def within(step: float, largest: float) -> bool:
    """Return whether a step is no more than the largest stable one, which is known to 0.1 %."""
    return step <= largest * (1.0 + 2.0 * 2.0**-_DIGITS)
