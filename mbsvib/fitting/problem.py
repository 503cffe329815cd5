"""All data of a fit, with sums over their residuals, and the search for its values by damped Gauss-Newton steps.

From afar steps are on logarithms of responses. They solve (J^T J + mu D) dx = -J^T r in directions that the data tell;
others stay. Bounds hold by projection, those of inertias too. A step that does not lower the cost, or leads to values
that no mechanism has, is taken again with more damping.

Source: Madsen, Nielsen & Tingleff, Methods for Non-Linear Least Squares Problems (2004), section 3.2, for the damping.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.errors import MbsvibError
from mbsvib.fitting.mode_data import ModeData
from mbsvib.fitting.record_data import RecordData
from mbsvib.fitting.response_data import Block, ResponseData
from mbsvib.fitting.variables import Variables

Scene = Callable[[Array, Array | None], tuple[Any, dict[str, Array] | None]]


# Standard deviation of logarithms of positive values around their start, from afar: a damping that the first steps take
# to zero would not come back.
LEASH = 2.0


class Sums(NamedTuple):
    """Half the sum of squares, its gradient to x (v,) and J^T J (v, v)."""

    cost: float
    gradient: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """What a fit minimises: residuals of all data, each in one of the ``scenes``, and of prior knowledge."""

    variables: Variables
    scenes: tuple[Scene, ...]
    data: tuple[ResponseData | RecordData | ModeData, ...]

    def blocks(self, x: Array, far: bool = False, slopes: bool = True) -> Iterator[tuple[int, Block]]:
        """Yield the number of the data with residuals and their derivatives to x, some lines at a time."""
        variables = self.variables
        values = variables.values(x)
        rates, parameters = variables.rates(values), variables.map @ values
        moved = np.flatnonzero(variables.map.any(axis=0))
        directions = variables.map[:, moved] * rates[moved] if slopes else None
        known = [scene(parameters, directions) for scene in self.scenes]
        other = np.delete(rates, moved)
        for k, data in enumerate(self.data):
            for block in data.blocks(*known[data.scene], values, far):
                if block.slopes is not None:
                    block.slopes[len(moved) :] *= other.reshape(-1, *[1] * block.residual.ndim)
                yield k, block
        if np.isfinite(variables.prior).any():
            held = np.flatnonzero(np.isfinite(variables.prior[:, 1]))
            value, deviation = variables.prior[held].T
            yield -1, _diagonal(held, (values[held] - value) / deviation, rates[held] / deviation, len(values))
        if far:
            held = np.flatnonzero(variables.positive)
            away = (np.asarray(x) - variables.unknowns(variables.start))[held]
            yield -1, _diagonal(held, away / LEASH, np.full(len(held), 1.0 / LEASH), len(x))

    def cost(self, x: Array, far: bool) -> float:
        """Return half the sum of squares, of logarithms in the robust measure 2 (sqrt(1 + |r|^2) - 1)."""
        return sum(_cost(block.residual, far and k >= 0) for k, block in self.blocks(x, far, slopes=False))

    def sums(self, x: Array, far: bool) -> Sums:
        """Return cost, gradient and normal matrix."""
        v = len(x)
        cost, gradient, normal = 0.0, np.zeros(v), np.zeros((v, v))
        for k, block in self.blocks(x, far):
            robust = far and k >= 0
            cost += _cost(block.residual, robust)
            slopes, residual = real_rows(block)
            if robust:
                weight = np.repeat((1.0 + np.abs(block.residual.reshape(-1)) ** 2) ** -0.25, 2)
                slopes, residual = slopes * weight, residual * weight
            gradient += slopes @ residual
            normal += slopes @ slopes.T
        return Sums(cost, gradient, normal)

    @property
    def known(self) -> bool:
        """Whether the noise of all data is known."""
        return all(data.known for data in self.data)

    @property
    def numbers(self) -> float:
        """How many independent real numbers were measured, prior knowledge among them."""
        return sum(data.numbers for data in self.data) + int(np.isfinite(self.variables.prior[:, 1]).sum())

    def reweighted(self, x: Array) -> Problem:
        """Return the same with the noise of data as large as their residuals tell, where it is not known."""
        residuals = self.residuals(x)
        share = self.numbers / max(1, self.numbers - len(x))
        return replace(self, data=tuple([
            data.reweighted(residual, share) if not isinstance(data, ModeData) and not data.known else data
            for data, residual in zip(self.data, residuals, strict=True)]))  # fmt: skip

    def residuals(self, x: Array) -> list[Complex]:
        """Return the residuals (n, ...) of each of the data."""
        parts: list[list[Complex]] = [[] for _ in self.data]
        for k, block in self.blocks(x, slopes=False):
            if k >= 0:
                parts[k].append(block.residual)
        return [np.concatenate(part) for part in parts]

    def fitted(self, x: Array, number: int) -> Complex:
        """Return fitted responses (n, outputs, inputs) of one of the data."""
        values, data = self.variables.values(x), self.data[number]
        assert isinstance(data, ResponseData)
        return data.fitted(self.scenes[data.scene](self.variables.map @ values, None)[0], values)


def _diagonal(which: Index, residual: Array, slopes: Array, count: int) -> Block:
    """Residuals that depend on one unknown each."""
    full = np.zeros((count, len(which)), dtype=complex)
    full[which, np.arange(len(which))] = slopes
    return Block(residual.astype(complex), full)


def real_rows(block: Block) -> tuple[Array, Array]:
    """Return derivatives (v, N) and residuals (N,), real and imaginary parts one beside the other."""
    assert block.slopes is not None
    slopes = np.ascontiguousarray(block.slopes).reshape(len(block.slopes), -1).view(float)
    return slopes, np.ascontiguousarray(block.residual).reshape(-1).view(float)


def _cost(residual: Complex, robust: bool) -> float:
    power = residual.real**2 + residual.imag**2
    return float((np.sqrt(1.0 + power) - 1.0).sum() if robust else 0.5 * power.sum())


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
            cost = _cost_at(problem, trial, far)
            gain = (sums.cost - cost) / predicted if predicted > 0.0 else -1.0
            if gain > 1e-4:
                damping, growth = damping * max(1.0 / 10.0, 1.0 - (2.0 * min(gain, 1.0) - 1.0) ** 3), 2.0
                break
            damping, growth = damping * growth, 2.0 * growth
        else:
            return Found(x, sums.cost, step, False)
        x, sums = trial, problem.sums(trial, far)
    return Found(x, sums.cost, most, False)


def _cost_at(problem: Problem, x: Array, far: bool) -> float:
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
