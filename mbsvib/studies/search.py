"""A search as smooth mathematics: unknowns of one size, an objective, bounds at least 0, equations.

The largest of many numbers has kinks. So a number of its own stands for it, no less than any of them, which is
exact where objective and constraints grow with it. A peak over a band is bounded at some frequencies; where it has tops
higher than that, these join them and the search goes on from there: an exchange, as of Remez.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.api.settled import settled
from mbsvib.errors import MbsvibError, ModelError
from mbsvib.linalg.matching import Reference, reference, step
from mbsvib.studies.dual import Dual, stacked
from mbsvib.studies.evaluation import DesignPoint, check_variables, checked, station
from mbsvib.studies.extremes import Largest
from mbsvib.studies.modal import Modal
from mbsvib.studies.quantities import Constraint, Quantity

if TYPE_CHECKING:
    from collections.abc import Hashable, Mapping

    from mbsvib.api.model import Model
    from mbsvib.api.system import System
    from mbsvib.common.arrays import Array, Index
    from mbsvib.linalg.matching import Station
    from mbsvib.studies.design import Design
    from mbsvib.studies.scales import Scales


KEPT = 24  # places that modes are followed from
EXCEEDS = 1e-7  # share by which a peak may exceed the number that stands for it
NEAR = 1e-9  # tops that near to each other, relative, are one


@dataclass(frozen=True)
class Value:
    """Objective ``f``, ``g`` >= 0 and ``h`` = 0 at unknowns ``z``, with derivatives to these."""

    z: Array
    f: Dual
    g: Dual
    h: Dual


class Search:
    """What is minimised, and subject to what."""

    def __init__(
        self, model: Model, design: Design, scales: Scales, objective: Quantity, constraints: tuple[Constraint, ...]
    ) -> None:
        self.model, self.design, self.scales = model, design, scales
        self.objective, self.constraints = objective, constraints
        self.evaluations, self.steepest = 0, 0.0
        self._independent: tuple[str, ...] | None = None
        self._seen: list[tuple[Array, Reference]] = []
        self._point: tuple[Array, DesignPoint] | None = None
        self._value: Value | None = None
        inner = [each for part in (objective, *(c.quantity for c in constraints)) for each in part.inner()]
        self._follows = any(isinstance(each, Modal) for each in inner)
        self.largest = tuple(dict.fromkeys(each for each in inner if isinstance(each, Largest)))
        start = self.point(np.zeros(len(scales.start)))
        check_variables(start.system, start.rates)
        self._independent = start.system.coordinates
        true = {each: float(each.true(start).value[0]) for each in self.largest}
        self.unit = {each: abs(value) or 1.0 for each, value in true.items()}
        self._active = {each: each.seeds(start) for each in self.largest}
        self._size = abs(float(self._one(objective.at(start)).value[0])) or 1.0
        found = [constraint.quantity.at(start).value for constraint in constraints]
        if not np.isfinite([self._size, *true.values(), *(number for value in found for number in value)]).all():
            raise _not_finite(start)
        self._sizes = [max([abs(b) for b in (c.low, c.high) if b is not None]) or float(np.abs(value).max()) or 1.0
                       for c, value in zip(constraints, found, strict=True)]  # fmt: skip
        self._check_directions(start)

    def system(self, x: Array) -> System:
        """Return the system at the unknowns of variables."""
        values = dict(zip(self.design.variables, self.scales.values(x).tolist(), strict=True))
        try:
            changed = self.model.with_values(self.design.values(values))
            return checked(settled(changed, independent=self._independent)[1])
        except MbsvibError as error:
            error.add_note(f"at {_said(values)}")
            raise

    def point(self, x: Array) -> DesignPoint:
        """Return the point at the unknowns of variables, its modes followed from the nearest one that was looked at, if
        any are asked for.
        """
        if self._point is None or not np.array_equal(self._point[0], x):
            self.evaluations += 1
            p = self.scales.values(x)
            values = dict(zip(self.design.variables, p.tolist(), strict=True))
            found = DesignPoint(self.system(x), self.design.rates(values), values, self.scales.rates(p), {})
            order = self._followed(x, found) if self._follows else None
            self._point = x.copy(), replace(found, order=order)
        return self._point[1]

    def at(self, z: Array) -> Value:
        """Return objective and constraints at unknowns."""
        if self._value is not None and np.array_equal(self._value.z, z):
            return self._value
        n = len(self.scales.start)
        levels: dict[Hashable, float] = {
            each: float(level) * self.unit[each] for each, level in zip(self.largest, z[n:], strict=True)
        }
        point = self.point(z[:n]).with_levels(levels)
        try:
            f = self._one(self.objective.at(point))
            g, h = self._bounded(point)
        except MbsvibError as error:
            error.add_note(f"at {_said(point.values)}")
            raise
        chain = np.concatenate((np.ones(n), [self.unit[each] for each in self.largest]))
        parts = [Dual(dual.value, np.broadcast_to(dual.slope, (len(dual.value), point.width)) * chain)
                 for dual in (Dual(f.value / self._size, f.slope / self._size), _stacked(g), _stacked(h))]  # fmt: skip
        if not all(np.isfinite(numbers).all() for dual in parts for numbers in (dual.value, dual.slope)):
            raise _not_finite(point)
        self.steepest = max(self.steepest, float(np.linalg.norm(parts[0].slope[0])))
        self._value = Value(z.copy(), *parts)
        return self._value

    def begin(self, x: Array) -> Array:
        """Return unknowns to begin with, at those of variables: what stands for the largest of many is that."""
        point = self.point(x)
        return np.concatenate((x, [float(each.true(point).value[0]) / self.unit[each] for each in self.largest]))

    def exchange(self, z: Array) -> tuple[Array, bool]:
        """Add tops that are higher than what stands for them; return unknowns that allow for them, and whether there
        are any.
        """
        n, grown, z = len(self.scales.start), False, z.copy()
        point = self.point(z[:n])
        for k, each in enumerate(self.largest):
            active = self._active[each]
            if active is None:
                z[n + k] = max(z[n + k], float(each.true(point).value[0]) / self.unit[each])
                continue
            where, size = each.tops(point)
            new = where[size > z[n + k] * self.unit[each] * (1.0 + EXCEEDS)]
            new = new[np.abs(new[:, None] - active).min(axis=1, initial=np.inf) > NEAR * new]
            self._active[each] = np.concatenate((active, new))
            grown = grown or len(new) > 0
            z[n + k] = max(z[n + k], size.max() / self.unit[each])
        self._value = None
        return z, grown

    def bounds(self) -> tuple[Array, Array]:
        """Return lower and upper bounds of the unknowns."""
        low, high = self.scales.bounds()
        free = np.full(len(self.largest), np.inf)
        return np.concatenate((low, -free)), np.concatenate((high, free))

    def true(self, z: Array) -> tuple[float, list[Array]]:
        """Return objective and constrained quantities, without anything that stands for others."""
        point = self.point(z[: len(self.scales.start)])
        return float(self.objective.at(point).value[0]), [c.quantity.at(point).value for c in self.constraints]

    def _one(self, found: Dual) -> Dual:
        if len(found.value) != 1:
            raise ModelError(f"optimize: the objective '{self.objective.label}' has {len(found.value)} numbers; "
                             f"expected one. q.sum(), largest(q) or q[0] make one of them.",
                             field="objective")  # fmt: skip
        return found

    def _bounded(self, point: DesignPoint) -> tuple[list[Dual], list[Dual]]:
        g: list[Dual] = []
        h: list[Dual] = []
        for constraint, size in zip(self.constraints, self._sizes, strict=True):
            found = constraint.quantity.at(point)
            for bound, sign in ((constraint.low, 1.0 / size), (constraint.high, -1.0 / size)):
                if bound is not None and not (constraint.equal and sign < 0.0):
                    part = Dual(sign * (found.value - bound), sign * found.slope)
                    (h if constraint.equal else g).append(part)
        for each in self.largest:
            level, members, unit = point.level(each), each.members(point, self._active[each]), self.unit[each]
            if level is not None:
                g.append(Dual((level.value - members.value) / unit, (level.slope - members.slope) / unit))
        return g, h

    def _check_directions(self, start: DesignPoint) -> None:
        """What stands for the largest of many is that only where nothing is won by making it larger."""
        n = len(self.scales.start)
        point = start.with_levels({each: float(each.true(start).value[0]) for each in self.largest})
        g, h = self._bounded(point)
        g, own = g[: len(g) - len(self.largest)], g[len(g) - len(self.largest) :]
        for k, each in enumerate(self.largest):
            others = [part for other, part in zip(self.largest, own, strict=True) if other is not each]
            down = [_at(self.objective.at(point), n + k), *(-_at(part, n + k) for part in (*g, *others))]
            if any((rate < 0.0).any() for rate in down) or any(_at(part, n + k).any() for part in h):
                raise ModelError(f"optimize: '{each.label}' would have to grow; expected that it is minimised, or "
                                 f"bounded from above.", field="objective")  # fmt: skip

    def _followed(self, x: Array, point: DesignPoint) -> Index:
        """The mode of each track."""
        here = point.station
        if not self._seen:
            self._seen.append((x.copy(), reference(here)))
            return np.arange(len(point.modes))
        origin, known = min(self._seen, key=lambda seen: float(np.abs(seen[0] - x).max()))

        def between(share: float) -> Station:
            system = self.system(origin + share * (x - origin))
            return station(system.modes(), system, share)

        number, seen = step(known, 0.0, replace(here, at=1.0), between)
        self._seen = [*self._seen[-KEPT:], (x.copy(), seen)]
        return number


def _stacked(duals: list[Dual]) -> Dual:
    return stacked(duals) if duals else Dual(np.zeros(0), np.zeros((0, 1)))


def _not_finite(point: DesignPoint) -> ModelError:
    return ModelError(f"optimize: objective, constraints or their derivatives are not finite at {_said(point.values)}; "
                      f"give bounds that keep away from there, or another start.", field="variables")  # fmt: skip


def _at(dual: Dual, unknown: int) -> Array:
    """Derivatives to one unknown; constants have none."""
    return dual.slope[:, unknown] if dual.slope.shape[1] > unknown else np.zeros(1)


def _said(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
