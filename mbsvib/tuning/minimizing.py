"""Minimisation of functions that are not smooth where several peaks are equally high.

BFGS with a line search for the weak Wolfe conditions by bisection. Where not even the gradient leads down, several
peaks meet: the shortest combination of gradients nearby, one of each, leads down from all of them.

Source: Lewis & Overton, Nonsmooth optimization via quasi-Newton methods, Math. Program. 141 (2013) 135; Burke, Lewis &
Overton, A robust gradient sampling algorithm, SIAM J. Optim. 15 (2005) 751, for combinations of gradients.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array

    Function = Callable[[Array], tuple[float, Array]]

DECREASE, SLOPE = 1e-4, 0.5  # weak Wolfe conditions
BISECTIONS = 45  # of a line search: steps down to 1e-13
NOTHING = 1e-14  # a line search ends where steps would gain less than this share of the value: rounding
STALL, PROGRESS = 25, 1e-8  # the search ends if so many steps gain less than this share of the value,
LEARNT = 5, 2  # or, of few unknowns, so many and so many for each, in which curvatures are learnt
LONGEST = 2.0  # first step of a search, in units of the unknowns
RADII = (1e-2, 1e-4)  # distances of gradients that are combined, in units of the unknowns
MORE = 2  # gradients than unknowns are combined at most: as many are enough for any direction
FLAT = 1e-3  # a combination of gradients below this share of the gradient is none: no direction leads down


@dataclass(frozen=True)
class Descent:
    """Where a search ended: unknowns ``x``, value ``f``, and the values after all steps, ``history``."""

    x: Array
    f: float
    history: tuple[float, ...]


def bfgs(given: Function, x: Array, steps: int, enough: float = -np.inf) -> Descent:
    """Return the end of a descent from ``x`` of at most so many steps, or once the value is below ``enough``.

    ``given``: the function: value, inf where there is none, and gradient.
    """

    def function(point: Array) -> tuple[float, Array]:
        with np.errstate(all="ignore"):  # far points of line searches overflow
            try:
                return given(point)
            except np.linalg.LinAlgError:
                return np.inf, np.zeros(len(point))

    f, g = function(x)
    history, inverse, first = [f], np.eye(len(x)), True
    stall = min(STALL, LEARNT[0] + LEARNT[1] * len(x))
    for _ in range(steps):
        size = float(np.linalg.norm(g))
        if not np.isfinite(f) or f < enough or size == 0.0:
            break
        step = -inverse @ g
        if not g @ step < 0.0:
            inverse, step = np.eye(len(x)), -g
        if first:
            step = step * min(1.0, LONGEST / size)
        accepted = _line(function, x, f, g, step)
        if accepted is None and first:
            accepted = _bundled(function, x, f, g)
            inverse = np.eye(len(x))
        if accepted is None:
            if first:
                break
            inverse, first = np.eye(len(x)), True
            if len(history) > 1 and history[-1] == history[-2]:
                break
            history.append(f)
            continue
        new_x, new_f, new_g = accepted
        s, y = new_x - x, new_g - g
        product = float(s @ y)
        if product > 0.0:
            if first:
                inverse = inverse * product / float(y @ y)
            rho, one = 1.0 / product, np.eye(len(x))
            left = one - rho * np.outer(s, y)
            inverse, first = left @ inverse @ left.T + rho * np.outer(s, s), False
        x, f, g = new_x, new_f, new_g
        history.append(f)
        if len(history) > stall and history[-1 - stall] - f <= PROGRESS * abs(f):
            break
    return Descent(x, f, tuple(history))


def _line(function: Function, x: Array, f: float, g: Array, step: Array) -> tuple[Array, float, Array] | None:
    """Point, value and gradient of a step along a line; None if nothing below ``f`` was found."""
    low, high, t, slope = 0.0, np.inf, 1.0, float(g @ step)
    best = None
    for _ in range(BISECTIONS):
        point = x + t * step
        value, gradient = function(point)
        if not value <= f + DECREASE * t * slope:
            high = t
        else:
            if best is None or value < best[1]:
                best = point, value, gradient
            if gradient @ step >= SLOPE * slope:
                return point, value, gradient
            low = t
        t = 0.5 * (low + high) if high < np.inf else 2.0 * low
        if t * abs(slope) < NOTHING * abs(f):
            break
    return best if best is not None and best[1] < f else None


def _bundled(function: Function, x: Array, f: float, g: Array) -> tuple[Array, float, Array] | None:
    """Point, value and gradient below ``f``, along the shortest combination of gradients nearby; None if it is 0."""
    for radius in RADII:
        gradients = [g]
        while len(gradients) < len(x) + MORE:
            down = -_shortest(np.array(gradients))
            length = float(np.linalg.norm(down))
            if length <= FLAT * float(np.linalg.norm(g)):
                break
            point = x + radius / length * down
            value, gradient = function(point)
            if value <= f - DECREASE * radius * length:
                return point, value, gradient
            if not np.isfinite(value):
                break
            gradients.append(gradient)
    return None


def _shortest(gradients: Array) -> Array:
    """The shortest vector in the convex hull of gradients (k, n)."""
    from scipy.optimize import nnls

    size = float(np.linalg.norm(gradients, axis=1).max())
    rows = np.concatenate((gradients.T / size, np.ones((1, len(gradients)))))
    shares = nnls(rows, np.eye(len(rows))[-1])[0]
    return np.asarray(shares @ gradients / shares.sum())
