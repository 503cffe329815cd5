"""Loops that are open are closed by Gauss-Newton steps of least norm.

x <- x - J^+ g

with the gaps g and their exact Jacobian J, pseudo-inverted with a rank tolerance, since loops are redundant: what is
asked for twice has one answer, and of all coordinates that close the loops those nearest to the start are taken.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array
from mbsvib.kinematics.closing import CLOSED
from mbsvib.linalg.qr import minimum_norm_solution

Mask = NDArray[np.bool_]

STEPS = 200
# Singular values below this share of the largest one belong to rows that repeat others, but for printed digits. Where
# such a step reduces no gap, as where links are stretched, weak directions are left out of it.
RANK, WEAK = 1e-6, (1e-2, 0.3)
# The longest step [rad, sizes] while loops are open, and the shortest share of a step that is still tried.
LONGEST, SHORTEST = 0.3, 1e-3
# Loops that are open by less [rad, sizes] take full steps.
NEAR = 1e-2
# A file whose digits are rounded leaves gaps below this [rad, sizes], which are remarked; larger ones are refused.
PRINTED = 1e-4
# Where no step reduces the gap, as in a stretched pose, other starts are tried, each this far [rad, sizes] off.
OTHER_STARTS = (0.05, 0.2, 0.6)

Evaluate = Callable[["Array"], tuple["Array", "Array"]]


def close(evaluate: Evaluate, start: Array, free: Mask) -> Array:
    """Return coordinates (n,) near ``start`` that close all loops, or those of the smallest gaps that were found.

    ``evaluate`` returns the gaps (rows,) and their Jacobian (rows, n), both in units of 1 rad and the size; ``free``
    (n,) tells which coordinates may change.
    """
    best, least = _descended(evaluate, start.astype(float), free)
    aside = np.where(free, np.cos(np.arange(1.0, len(start) + 1.0)), 0.0)
    for off in OTHER_STARTS:
        if least <= PRINTED:
            break
        found, gap = _descended(evaluate, start + off * aside, free)
        if gap < least:
            best, least = found, gap
    return best


def _descended(evaluate: Evaluate, x: Array, free: Mask) -> tuple[Array, float]:
    """Coordinates after steps from ``x`` until loops are closed or steps reduce no gap, and the largest gap there."""
    gap, slopes = evaluate(x)
    for _ in range(STEPS):
        if np.abs(gap).max(initial=0.0) <= CLOSED or not free.any():
            break
        for rank in (RANK, *WEAK):
            step = np.zeros(len(x))
            step[free] = -minimum_norm_solution(slopes[:, free], gap, rank)
            after = _shortened(evaluate, x, step, float(np.linalg.norm(gap)))
            if after is not None:
                break
        else:
            break
        x, gap, slopes = after
    return x, float(np.abs(gap).max(initial=0.0))


def _shortened(evaluate: Evaluate, x: Array, step: Array, size: float) -> tuple[Array, Array, Array] | None:
    """The coordinates, gaps and Jacobian after as much of a step as reduces gaps of ``size``; None if none does."""
    longest = float(np.abs(step).max())
    share = 1.0 if size < NEAR or longest <= LONGEST else LONGEST / longest
    while share >= SHORTEST:
        gap, slopes = evaluate(x + share * step)
        if np.linalg.norm(gap) < size:
            return x + share * step, gap, slopes
        share *= 0.5
    return None
