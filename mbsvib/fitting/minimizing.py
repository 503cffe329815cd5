"""The search for the values of a fit: damped Gauss-Newton steps, from afar on logarithms of responses.

Steps solve (J^T J + mu D) dx = -J^T r in directions that the data tell; others stay. Bounds hold by projection,
those of inertias too. A step that does not lower the cost, or leads to values that no mechanism has, is taken again
with more damping.

Source: Madsen, Nielsen & Tingleff, Methods for Non-Linear Least Squares Problems (2004), section 3.2, for the damping.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import MbsvibError

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array, Bools
    from mbsvib.fitting.problem import Problem, Sums

# The gradient in standard deviations that ends a search; from afar the share of the cost that a step may still bring.
CONVERGED, CONVERGED_FAR = 1e-3, 1e-4
# A step of this size has reached rounding.
SMALLEST = 1e-12
# Squares of singular values below this share of the largest are of directions that the data do not tell.
UNTOLD = 1e-12
# Squares of slopes to an unknown, whose change by 1 is one of 100 %, below this share of the largest are rounding.
UNFELT = 1e-24
STEPS, STEPS_FAR, TRIALS = 60, 60, 12
# Damping at the start: from afar, where steps are far from linear, and near the end.
DAMPING_FAR, DAMPING = 1e-2, 1e-6


@dataclass(frozen=True, slots=True)
class Found:
    """Where a search ended: unknowns, cost, steps, and whether it converged."""

    x: Array
    cost: float
    steps: int
    converged: bool


def minimized(problem: Problem, x: Array, far: bool, tell: Callable[[float], object] = lambda cost: None) -> Found:
    """Return where a search from x ends; ``tell`` gets the cost of each step."""
    low, high = problem.variables.limits()
    x = problem.variables.within(x)
    sums, damping, growth = problem.sums(x, far), DAMPING_FAR if far else DAMPING, 2.0
    most = STEPS_FAR if far else STEPS
    for step in range(most):
        tell(sums.cost)
        free = ~(((x <= low) & (sums.gradient > 0.0)) | ((x >= high) & (sums.gradient < 0.0)))
        decomposed = _decomposed(sums, free)
        if _converged(problem, sums.cost, decomposed, far):
            return Found(x, sums.cost, step, True)
        cost = sums.cost
        for _ in range(TRIALS):
            dx, predicted = _step(decomposed, damping)
            trial = problem.variables.within(x + dx)
            if np.abs(trial - x).max(initial=0.0) <= SMALLEST * (1.0 + np.abs(x).max()):
                return Found(x, sums.cost, step, bool(np.isfinite(cost)))  # not beside values of no mechanism
            cost = _cost(problem, trial, far)
            gain = (sums.cost - cost) / predicted if predicted > 0.0 else -1.0
            if gain > 1e-4:
                damping, growth = damping * max(1.0 / 10.0, 1.0 - (2.0 * min(gain, 1.0) - 1.0) ** 3), 2.0
                break
            damping, growth = damping * growth, 2.0 * growth
        else:
            return Found(x, sums.cost, step, False)
        x, sums = trial, problem.sums(trial, far)
    return Found(x, sums.cost, most, False)


def _cost(problem: Problem, x: Array, far: bool) -> float:
    """The cost at x, infinite where there is no such mechanism."""
    try:
        cost = problem.cost(x, far)
    except MbsvibError:
        return np.inf
    return cost if np.isfinite(cost) else np.inf


def _decomposed(sums: Sums, free: Bools) -> tuple[Array, Array, Array]:
    """Eigenvalues (k,) of the normal matrix with a unit diagonal, in ``free`` unknowns, directions (v, k) that the data
    tell, and the gradient along these (k,).
    """
    diagonal = sums.normal.diagonal()
    free = free & (diagonal > UNFELT * diagonal.max(initial=0.0))
    scale = np.sqrt(np.where(free, diagonal, 1.0))
    scaled = sums.normal / scale[:, None] / scale * free[:, None] * free
    size, vectors = np.linalg.eigh(scaled)
    told = size > UNTOLD * size.max(initial=0.0)
    directions = vectors[:, told] / scale[:, None] * free[:, None]
    return size[told], directions, directions.T @ sums.gradient


def _step(decomposed: tuple[Array, Array, Array], damping: float) -> tuple[Array, float]:
    """A step and the decrease of the cost that a linear model predicts."""
    size, directions, pull = decomposed
    y = -pull / (size + damping * size.max(initial=0.0))
    return directions @ y, float(-(pull * y).sum() - 0.5 * (size * y * y).sum())


def _converged(problem: Problem, cost: float, decomposed: tuple[Array, Array, Array], far: bool) -> bool:
    size, directions, pull = decomposed
    decrease = float((pull**2 / size).sum())
    if far:
        return decrease <= 2.0 * CONVERGED_FAR * cost
    noise = 1.0 if problem.known else 2.0 * cost / max(1, problem.numbers - len(directions))
    return decrease <= CONVERGED**2 * noise
