"""The search for values: starts are stabilised and go down in turn or in processes; the best go on, and begin anew.

Limits are exact penalties whose weight grows until they hold. All that a descent does follows from its start, so that
the result is the same for any number of processes.

Source: Burke, Henrion, Lewis & Overton, HIFOO (2006), for stabilisation first and BFGS.

Minimisation of functions that are not smooth where several peaks are equally high.

BFGS with a line search for the weak Wolfe conditions by bisection. Where not even the gradient leads down, several
peaks meet: the shortest combination of gradients nearby, one of each, leads down from all of them.

Source: Lewis & Overton, Nonsmooth optimization via quasi-Newton methods, Math. Program. 141 (2013) 135; Burke, Lewis &
Overton, A robust gradient sampling algorithm, SIAM J. Optim. 15 (2005) 751, for combinations of gradients.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.errors import ResponseError
from mbsvib.studies.running import run
from mbsvib.tuning.problem import SPARE, Problem

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


SHORT, LONG = 150, 1500  # steps of the first descents, and of those that are continued
BEST = 3  # starts that are continued
RESTARTS, TOGETHER, NEAR = 8, 2, 0.02  # new searches about the best, so many of which begin at once, and how near
GAINED = 1e-4  # restarts end if those that began at once gain less than this share
PENALTIES = 7  # tenfold weights of limits
# Weights of barriers against hardly stable loops, of first, continued and last searches, in parts of the objective.
BARRIERS = (1e-2, 1e-4, 1e-7)
AWAY = 1e-3  # poles of a stabilised start decay by this share of the mean rate if the structure allows it
AGREES, ROUNDS = 1e-6, 3  # share by which the library may find a higher peak, and descents that are told of it


@dataclass(frozen=True, eq=False)
class End:
    """Where a search ended: unknowns ``x``, their ``rank`` (violation, largest norm), the ``problem`` that knows the
    peaks there, and the objective after all steps.
    """

    x: Array
    rank: tuple[float, float]
    problem: Problem
    history: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Descents:
    """Descents from ``starts`` as the work of ``studies.running``."""

    descend: Callable[[Any], Any]
    starts: Sequence[Any]
    kind: str = "single"
    dof: int = 1

    def run(self, numbers: Sequence[int], columns: Mapping[str, Any]) -> list[tuple[int, Any]]:
        """Return the ends of the descents with these numbers."""
        return [(k, self.descend(self.starts[k])) for k in numbers]

    def ends(self, workers: int | None, tell: Callable[[int], None]) -> list[Any]:
        """Return all ends in the order of the starts."""
        result: dict[int, Any] = {}
        for outcomes in run(self, {}, range(len(self.starts)), workers):
            result |= dict(outcomes)
            tell(len(outcomes))
        for outcome in result.values():
            if isinstance(outcome, str):
                raise ResponseError(f"tune: a search failed: {outcome}. Give workers=1, or free memory.")
        return [result[k] for k in range(len(self.starts))]


def rank(problem: Problem, x: Array) -> tuple[float, float]:
    """Return by how much limits are missed, at least 0, and the largest norm."""
    value, violation = problem.measured(x)
    return max(violation, 0.0), value


def stabilised(problem: Problem, x: Array) -> tuple[End | None, End | None]:
    """Return a start whose poles decay, and where a first descent from it ends; None if it cannot be stabilised."""
    if not np.isfinite(problem.objective(x, 1.0)[0]):
        x = bfgs(problem.growth, x, LONG, -AWAY).x
    if problem.stable(x) is None:
        return None, None
    start = End(x, rank(problem, x), problem, ())
    return start, _penalised(problem, x, SHORT, BARRIERS[0]) if np.isfinite(max(start.rank)) else None


def _penalised(problem: Problem, x: Array, steps: int, barrier: float) -> End:
    """A descent with limits as penalties, whose weight grows until they hold."""
    norms = any(goal.limit is None for goal in problem.goals)
    value = problem.measured(x)[0]
    penalty = size = max(abs(value), 1e-300) if np.isfinite(value) else 1.0
    history: tuple[float, ...] = ()
    for _ in range(PENALTIES):
        function = partial(problem.objective, penalty=penalty, barrier=barrier * size)
        end = bfgs(function, x, steps, -np.inf if norms else -2.0 * SPARE)
        history += end.history
        x = end.x
        result = rank(problem, x)
        if result[0] <= 0.0 or not norms:
            break
        penalty *= 10.0
    return End(x, result, problem, history)


def _honest(barrier: float, start: End) -> End:
    """A long descent to where the library finds no higher peak than the search."""
    problem, x = start.problem, start.x
    history: tuple[float, ...] = ()
    for _ in range(ROUNDS):
        end = _penalised(problem, x, LONG, barrier)
        history += end.history
        if end.rank >= start.rank:  # nothing was gained, whatever the library finds there
            return replace(end, history=history)
        told = _told(end)
        problem, x = told.problem, end.x
        if all(there <= here + AGREES * (abs(here) + SPARE) for there, here in zip(told.rank, end.rank, strict=True)):
            break
    return replace(told, history=history)


def _told(end: End) -> End:
    """The same, with the peaks that the library finds there."""
    problem = end.problem.knowing(end.x)
    return End(end.x, rank(problem, end.x), problem, end.history)


def searched(
    starts: Sequence[End], first: Sequence[End], random: np.random.Generator, workers: int | None,
    tell: Callable[[int], None],
) -> tuple[Array, tuple[tuple[float, ...], ...]]:  # fmt: skip
    """Return the best unknowns and the history of each search, after the ``first`` descents from stable ``starts``."""
    histories = [end.history for end in first]
    order = sorted(range(len(first)), key=lambda k: first[k].rank)[:BEST]
    ends: list[End] = Descents(partial(_honest, BARRIERS[1]), [first[k] for k in order]).ends(workers, tell)
    for k, end in zip(order, ends, strict=True):
        histories[k] += end.history
    best = min((*ends, *first, *starts), key=lambda end: end.rank)  # barriers may lead away from a good start
    best = min((_told(best), *ends), key=lambda end: end.rank)
    for _ in range(RESTARTS // TOGETHER):
        shift = NEAR * random.normal(size=(TOGETHER, len(best.x))) * np.maximum(np.abs(best.x), 0.1)
        near = [End(best.x + step, best.rank, best.problem, ()) for step in shift]
        ends = Descents(partial(_honest, BARRIERS[2]), near).ends(workers, tell)
        histories += [end.history for end in ends]
        old, end = best, min(ends, key=lambda end: end.rank)
        best = end if end.rank < old.rank else old
        if not (end.rank[0] < old.rank[0] or end.rank[1] < old.rank[1] - GAINED * abs(old.rank[1])):
            break
    return best.x, tuple(histories)
