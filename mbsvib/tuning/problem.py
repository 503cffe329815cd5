"""The functions that a search for a controller minimises: growth of poles, and the largest of all goals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array
from mbsvib.errors import MbsvibError
from mbsvib.tuning.measures import Goal, Measure
from mbsvib.tuning.scene import Loop, Scene
from mbsvib.tuning.structures import Law, Value

# Limits are searched for with this to spare, so that rounding of the value told does not miss them.
SPARE = 1e-6
LARGEST = np.log(1e5)  # logarithms of positive values, in parts of their sizes, go no further
# Decay rates, in parts of the mean pole, below which barriers act.
SLOW = 1e-2


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Unknowns x of values p: p = size x, ln(p / size) = x where positive; within two bounds the sine of x, next to
    one a root of x^2 + 1.
    """

    size: Array
    start: Array
    spread: Array
    positive: NDArray[np.bool_]
    low: Array
    high: Array

    @classmethod
    def of(cls, values: Sequence[Value]) -> Unknowns:
        """Return the unknowns of values; bounds of positive ones are those of the logarithms of p / size."""
        size, start, spread, low, high = np.array(
            [(v.size, v.start, v.spread, *v.bounds) for v in values], dtype=float).reshape(-1, 5).T  # fmt: skip
        positive = np.array([v.positive for v in values], dtype=bool)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = [np.where(positive, np.log(np.maximum(end / size, 0.0)), end / size) for end in (low, high)]
        begin = np.where(positive, np.log(np.where(positive, start, 1.0)), start)
        return cls(size, begin, spread, positive, *ends)

    def begin(self, random: np.random.Generator | None) -> Array:
        """Return the unknowns of a start, about that of the values if it is random."""
        t = self.start if random is None else self.start + self.spread * random.normal(size=len(self.start))
        return self.at(t)

    @property
    def _bounded(self) -> list[NDArray[np.bool_]]:
        """Which have two bounds, which a lower and which an upper one; the first that holds counts."""
        lower, upper = np.isfinite(self.low), np.isfinite(self.high)
        return [lower & upper, lower, upper]

    def at(self, t: Array) -> Array:
        """Return the unknowns of scaled values or logarithms, moved into the bounds."""
        with np.errstate(invalid="ignore"):  # of bounds that are infinite, which do not count
            sine = np.arcsin(2.0 * np.clip((t - self.low) / (self.high - self.low), 0.02, 0.98) - 1.0)
        above, below = np.maximum(t - self.low, 0.02), np.maximum(self.high - t, 0.02)
        return np.select(self._bounded, [sine, *[np.sqrt(s * (s + 2.0)) for s in (above, below)]], t)

    def values(self, x: Array) -> tuple[Array, Array]:
        """Return p and dp/dx."""
        root = np.sqrt(x * x + 1.0)
        with np.errstate(invalid="ignore"):
            half = 0.5 * (self.high - self.low)
            t = np.select(self._bounded, [self.low + half * (1.0 + np.sin(x)), self.low + root - 1.0,
                                          self.high - root + 1.0], x)  # fmt: skip
            rate = np.select(self._bounded, [half * np.cos(x), x / root, -x / root], 1.0)
        held = self.positive & (np.abs(t) > LARGEST)
        t, rate = np.where(held, np.clip(t, -LARGEST, LARGEST), t), np.where(held, 0.0, rate)
        p = self.size * np.where(self.positive, np.exp(np.where(self.positive, t, 0.0)), t)
        return p, np.where(self.positive, p, self.size) * rate


class Judged(NamedTuple):
    """A goal at the plant where it is worst: its weighted value or violation, and a function of its gradient."""

    value: float
    rate: float
    slope: Callable[[], Array]
    loop: Loop


@dataclass(frozen=True, eq=False)
class Problem:
    """A structure and variables of models at plants: values are those of the ``law``, then of the ``variables``.

    ``measures``, ``known``: of each goal at each plant, and frequencies at which it has peaks.
    """

    scenes: tuple[Scene, ...]
    law: Law
    variables: tuple[str, ...]
    unknowns: Unknowns
    goals: tuple[Goal, ...]
    measures: tuple[tuple[Measure, ...], ...]
    known: tuple[tuple[tuple[float, ...], ...], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all values."""
        return (*self.law.names, *self.variables)

    def split(self, p: Array) -> tuple[Array, dict[str, float]]:
        """Return the values of the controller, and those of the variables by name."""
        count = len(self.law.names)
        return p[:count], dict(zip(self.variables, p[count:].tolist(), strict=True))

    def loops(self, p: Array) -> list[Loop] | None:
        """Return the loops with all plants, None where one has no solution."""
        own, variables = self.split(p)
        law, slopes = self.law.realized(own)
        loops = []
        for scene in self.scenes:
            try:
                loop = scene.loop(law, slopes, variables)
            except MbsvibError:
                return None
            if loop is None or not all(np.isfinite(part).all() for part in loop.closed):
                return None
            loops.append(loop)
        return loops

    def stable(self, x: Array) -> list[Loop] | None:
        """Return the loops with all plants for unknowns, None unless all poles decay."""
        loops = self.loops(self.unknowns.values(x)[0])
        return None if loops is None or not all(loop.decays for loop in loops) else loops

    def _slope(self, loop: Loop, gradient: Array) -> Array:
        own, variables = loop.to_values(gradient)
        return np.concatenate((own, [variables[name] for name in self.variables]))

    def growth(self, x: Array) -> tuple[float, Array]:
        """Return the largest real part of all poles, in parts of the mean rate of a plant, and its gradient."""
        p, rate = self.unknowns.values(x)
        loops = self.loops(p)
        if loops is None:
            return np.inf, np.zeros(len(x))
        worst = max(loops, key=lambda loop: loop.growth)
        return worst.growth, self._slope(worst, worst.growth_slope()) * rate

    def _judged(self, loops: list[Loop] | None) -> tuple[list[Judged], list[Judged]] | None:
        """Norms that are minimised and limits, None where one has no value."""
        result: tuple[list[Judged], list[Judged]] = [], []
        if loops is None:
            return None
        try:
            for goal, measures, known in zip(self.goals, self.measures, self.known, strict=True):
                entries = []
                for measure, loop, peaks in zip(measures, loops, known, strict=True):
                    value, slope = measure(loop, peaks)
                    entries.append(Judged(*goal.rated(value), slope, loop))
                result[goal.limit is not None].append(max(entries, key=lambda entry: entry.value))
        except MbsvibError:
            return None
        return result if all(np.isfinite(entry.value) for part in result for entry in part) else None

    def measured(self, x: Array) -> tuple[float, float]:
        """Return the largest weighted norm and the largest violation of a limit."""
        judged = self._judged(self.stable(x))
        if judged is None:
            return np.inf, np.inf
        value, violation = (max([entry.value for entry in part], default=-np.inf) for part in judged)
        return value, violation

    def objective(self, x: Array, penalty: float, barrier: float = 0.0) -> tuple[float, Array]:
        """Return the largest weighted norm plus a ``penalty`` times violations of limits, and the gradient; without
        norms the largest violation. Infinite where a pole does not decay.

        ``barrier``: times -ln(r / SLOW) of the decay rate r of a slow pole is added, so that searches do not end where
        a loop is hardly stable.
        """
        loops = self.stable(x)
        judged = self._judged(loops)
        if loops is None or judged is None:
            return np.inf, np.zeros(len(x))
        norms, limits = judged
        parts = [(1.0, 0.0, max(norms or limits, key=lambda entry: entry.value))]
        parts += [(penalty, SPARE, entry) for entry in limits if norms and entry.value > -SPARE]
        total = float(sum(weight * (entry.value + spare) for weight, spare, entry in parts))
        slope = np.asarray(sum(weight * entry.rate * self._slope(entry.loop, entry.slope())
                               for weight, _, entry in parts))  # fmt: skip
        slowest = max(loops, key=lambda loop: loop.growth)
        if barrier and -slowest.growth < SLOW:
            total -= barrier * float(np.log(-slowest.growth / SLOW))
            slope = slope - barrier / slowest.growth * self._slope(slowest, slowest.growth_slope())
        slope = slope * self.unknowns.values(x)[1]
        return (total, slope) if np.isfinite(slope).all() else (np.inf, np.zeros(len(x)))

    def closed(self, p: Array) -> list[Any]:
        """Return the closed loops of the library for values p, with inputs of noise."""
        own, variables = self.split(p)
        law = self.law.controller(own)
        return [scene.plant_at(variables)[1].feedback(law, noise=True) for scene in self.scenes]

    def knowing(self, x: Array) -> Problem:
        """Return the same problem, which knows the peaks that the library finds on panels for some unknowns."""
        loops = self.closed(self.unknowns.values(x)[0])

        def peaks(goal: Goal, loop: Any, scene: Scene) -> tuple[float, ...]:
            try:
                omega = goal.of(loop).omega
            except MbsvibError:  # the search knows no peak that the library refuses
                return ()
            return () if omega is None or not np.isfinite(omega) else (omega / scene.rate,)

        return replace(self, known=tuple([
            tuple([old + peaks(goal, loop, scene) for old, loop, scene in zip(known, loops, self.scenes, strict=True)])
            for goal, known in zip(self.goals, self.known, strict=True)
        ]))  # fmt: skip

    def values(self, p: Array) -> Mapping[str, float]:
        """Return all values by name."""
        return dict(zip(self.names, p.tolist(), strict=True))
