"""Ascent within the limits of uncertain parameters: growth rate, gain and root mean square, by exact gradients.

Changes delta of the parameters are a static gain between the outputs z and the inputs w of a plant: the entries of the
equations that this closes have gradients by ``feedback.closing``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.common.selection import Names, port_numbers
from mbsvib.feedback.closing import Closure, Matrices, regular
from mbsvib.linalg.lasting import separated
from mbsvib.responses.first_order_solver import first_order_solver, gain_slope, pole_slope
from mbsvib.responses.norms import Norm, hinf
from mbsvib.responses.realizations import first_order

Measure = Callable[["Matrices"], "tuple[float, Array]"]

VERTICES = 7  # parameters up to which all vertices are starts
RANDOM = 96  # vertices at random beyond, and points within
BEST = 3  # starts from which the search ascends
ITERATIONS = 60
HALVINGS = 50  # of the way down a ray to the axis


@dataclass(frozen=True, eq=False)
class Perturbed:
    """Equations with inputs w and outputs z first, ``owner`` (r,) the parameter of each of these, and the ``limits``
    (parameters, 2) of changes delta.
    """

    space: Matrices
    owner: Index
    limits: Array
    shown: list[int] = field(default_factory=list)
    sources: list[int] = field(default_factory=list)

    def closure(self, delta: Array) -> Closure | None:
        """Return the equations with changes delta (parameters,), None where these make them singular."""
        r = len(self.owner)
        law = np.zeros((0, 0)), np.zeros((0, r)), np.zeros((r, 0)), np.diag(delta[self.owner])
        if not regular(self.space[3][:r, :r] @ law[3]):
            return None
        return Closure(self.space, law, list(range(r)), list(range(r)), self.shown, self.sources)

    def measured(self, measure: Measure, delta: Array) -> tuple[float, Array]:
        """Return a number of the equations at delta, and its gradient (parameters,); infinite where there are none."""
        closed = self.closure(delta)
        if closed is None:
            return np.inf, np.zeros(len(delta))
        value, gradient = measure(closed.closed)
        entries = np.diagonal(closed.to_law(gradient)) if len(self.owner) else np.zeros(0)
        return value, np.bincount(self.owner, weights=entries, minlength=len(delta)).astype(float)

    def within(self, t: float) -> Perturbed:
        """Return the same with limits t times as far."""
        return replace(self, limits=t * self.limits)

    def highest(self, measure: Measure, *more: Array) -> tuple[float, Array]:
        """Return the largest value that ascents from several points reach, ``more`` among them, and where."""
        from scipy.optimize import minimize

        points = np.array([*samples(self.limits), *more])
        values = np.array([self.measured(measure, point)[0] for point in points])
        best = int(np.argmax(np.nan_to_num(values, nan=-np.inf)))
        value, where = float(values[best]), points[best]
        if value == np.inf:
            return value, where
        unit = max(1e-300, float(np.abs(values[np.isfinite(values)]).max(initial=0.0)))
        for k in np.argsort(-values)[:BEST].tolist():
            result = minimize(lambda x: _negative(self.measured(measure, x), unit), points[k], jac=True,
                              method="L-BFGS-B", bounds=self.limits,
                              options={"maxiter": ITERATIONS, "ftol": 1e-13})  # fmt: skip
            reached = self.measured(measure, result.x)[0]
            if reached > value:
                value, where = reached, result.x
            if value == np.inf:
                break
        return value, np.asarray(where)

    def destabilizing(self, known: float, largest: float) -> tuple[float, Array] | None:
        """Return the smallest factor t on the limits found at which the equations are not stable, and where; None if
        there is none up to the ``largest``.

        ``known``: the factor to begin with.
        """
        t, last = known, None
        while last is None:
            value, where = self.within(t).highest(growth)
            last = where if value >= 0.0 else None
            if last is None and t >= largest:
                return None
            t = min(1.5 * t, largest)
        t, last = self._down(last)
        for _ in range(8):  # a smaller box may hold another one
            value, where = self.within(0.995 * t).highest(growth, 0.995 * last)
            if value < 0.0:
                break
            t, last = self._down(where)
        return t, last

    def _down(self, delta: Array) -> tuple[float, Array]:
        """The first point of the ray to delta that is not stable, and its factor on the limits."""
        first = delta * halved(lambda share: self.measured(growth, share * delta)[0] < 0.0, 0.0, 1.0, HALVINGS)[1]
        return self.factor(first), first

    def factor(self, delta: Array) -> float:
        """Return by which factor of the limits a point is away from the nominal values."""
        return float(np.max(np.where(delta > 0.0, delta / self.limits[:, 1], delta / self.limits[:, 0])))


def halved(holds: Callable[[float], bool], good: float, bad: float, steps: int, near: float = 0.0
           ) -> tuple[float, float]:  # fmt: skip
    """Return a number that holds and one that does not, after halving the way between two in so many steps at most, or
    until they are so ``near``.
    """
    for _ in range(steps):
        if abs(bad - good) <= near:
            break
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good, bad


def samples(limits: Array, vertices: int = VERTICES, many: int = RANDOM, inner: int = RANDOM // 4) -> Array:
    """Return points (k, parameters) within limits: none changed, all vertices of so many parameters or ``many`` of
    more, and so many inner ones.
    """
    rng, count = np.random.default_rng(0), len(limits)
    if count <= vertices:
        corners = np.array(list(product((0, 1), repeat=count)), dtype=np.intp)
    else:
        corners = rng.integers(0, 2, (many, count))
        corners[:2] = [[0], [1]]
    inside = limits[:, 0] + rng.random((inner, count)) * np.diff(limits, axis=1)[:, 0]
    return np.concatenate((np.zeros((1, count)), limits[np.arange(count), corners], inside))


def perturbed(plant: Any, outputs: Names = None, inputs: Names = None) -> Perturbed:
    """Return the equations that changes of parameters close, from some inputs to some outputs.

    Motions that last, but no parameter moves and no output shows, such as those of a free body, are left out.
    """
    space, r, blocks = first_order(plant.linear), sum(plant.blocks.values()), plant.parameters
    o, i = port_numbers(outputs, inputs, (space.outputs[r:], space.inputs[r:]), plant.name)
    owner = np.repeat(np.arange(len(blocks)), [block.repetitions for block in blocks])
    rows, columns = [*range(r), *(r + k for k in o)], [*range(r), *(r + k for k in i)]
    a, b, c, d = space.A, space.B[:, columns], space.C[rows], space.D[np.ix_(rows, columns)]
    parts = separated(a, b, c)
    hidden = [not group.shown.any() and bool((group.part.poles.real <= group.part.errors[0]).all())
              for group in parts.lasting]  # fmt: skip
    if hidden and all(hidden):
        a, b, c = parts.decaying.a, parts.decaying.b, parts.decaying.c
    return Perturbed((a, b, c, d), owner, np.array([block.changes for block in blocks]),
                     list(range(r, len(rows))), list(range(r, len(columns))))  # fmt: skip


def values_at(plant: Any, delta: Array) -> dict[str, float]:
    """Return the values of the parameters for changes delta (parameters,) in units of half their width."""
    return {block.name: block.nominal + block.half * d for block, d in
            zip(plant.parameters, np.asarray(delta).tolist(), strict=True)}  # fmt: skip


def _negative(measured: tuple[float, Array], unit: float) -> tuple[float, Array]:
    value, gradient = measured
    return (-value / unit, -gradient / unit) if np.isfinite(value) else (-1e3, 0.0 * gradient)


def growth(space: Matrices) -> tuple[float, Array]:
    """Return the largest real part of the eigenvalues of A [1/s], and its gradient to [A B; C D].

    It is minus infinity where there is no state.
    """
    a, b, c, _ = space
    gradient = np.zeros((len(a) + len(c), len(a) + b.shape[1]))
    if not len(a):
        return -np.inf, gradient
    value, slope = pole_slope(a, lambda values: int(values.real.argmax()))
    gradient[: len(a), : len(a)] = slope.real
    return value.real, gradient


def gain(space: Matrices) -> tuple[float, Array]:
    """Return the highest peak of the largest singular value, infinite where it is not stable, and its gradient."""
    a, b, c, _ = space
    if len(a) and np.linalg.eigvals(a).real.max() >= 0.0:
        return np.inf, np.zeros((len(a) + len(c), len(a) + b.shape[1]))
    peak = peak_of(space)
    return peak.value, gain_slope(space, float(peak.omega or 0.0))[1]


def peak_of(space: Matrices) -> Norm:
    """Return the highest peak of stable equations."""
    a, b, c, d = space
    solver = first_order_solver(a, b, c, "perturbed plant")
    return hinf(lambda w: solver.frequency_response(w, b, c, d), np.linalg.eigvals(a).astype(complex), d)
