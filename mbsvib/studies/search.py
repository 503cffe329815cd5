"""A search as a smooth problem: scaled unknowns, an objective, inequality constraints g >= 0, equality constraints.

The largest of many numbers has kinks. So an additional unknown, an upper bound of all of them, replaces it; this is
exact if objective and constraints grow with it. A peak over a band is bounded at some frequencies; local maxima above
the bound are added to these and the search continues: an exchange method (Remez).
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.errors import MbsvibError, ModelError
from mbsvib.linalg.matching import Reference, Station, match_next, reference
from mbsvib.studies.design import StudyVariables
from mbsvib.studies.evaluation import DesignPoint, Dual, check_variables, frame, framed, stacked, station
from mbsvib.studies.measures import Modal
from mbsvib.studies.plants import Systems
from mbsvib.studies.quantities import Constraint, Largest, Quantity


@dataclass(frozen=True)
class Scales:
    """Unknowns x of variables p: ln(p / start) where p is positive throughout, else (p - start) / size."""

    start: Array
    low: Array
    high: Array
    size: Array
    positive: NDArray[np.bool_]

    def values(self, x: Array) -> Array:
        """Return the variables, clipped to their bounds."""
        p = np.where(self.positive, self.start * np.exp(np.where(self.positive, x, 0.0)), self.start + x * self.size)
        return np.asarray(np.clip(p, self.low, self.high))

    def rates(self, p: Array) -> Array:
        """Return dp/dx."""
        return np.where(self.positive, p, self.size)

    def bounds(self) -> tuple[Array, Array]:
        """Return bounds of the unknowns."""
        return self._unknown(self.low), self._unknown(self.high)

    def _unknown(self, p: Array) -> Array:
        ratio = np.where(self.positive, p, 1.0) / np.where(self.positive, self.start, 1.0)
        return np.where(self.positive, np.log(ratio), (p - self.start) / self.size)


def scales(design: StudyVariables, variables: Mapping[str, Any], start: Mapping[str, float] | None) -> Scales:
    """Return the unknowns of a search.

    ``variables``: lower and upper bound of each; None: none, on that side or on both. ``start``: initial values;
    default: those of the model, 0 for linear maps.
    """
    begin = dict(start or {})
    for name in begin:
        check.known(name, design.variables, f"optimize: start has '{name}', which is not one of the variables", "start",
                    "Variables are:")  # fmt: skip
    rows = []
    for name in design.variables:
        low, high = _bounds(name, variables[name])
        if name in begin:
            p = check.number(begin[name], f"variable '{name}'", "start")
        else:
            p = min(max(design.start[name], low), high)
            if np.isnan(design.start[name]):
                raise ModelError(f"variable '{name}': this argument of plant has no default; add one, or give "
                                 f"start = {{'{name}': ...}}.", element=name, field="start")  # fmt: skip
        if not low <= p <= high:
            raise ModelError(f"variable '{name}': start = {p:g}; expected a value from {low:g} to {high:g}.",
                             element=name, field="start")  # fmt: skip
        size = high - low if np.isfinite(high - low) else abs(p) or 1.0
        rows.append((p, low, high, size))
    values, low_, high_, size_ = np.array(rows, dtype=float).T
    return Scales(values, low_, high_, size_, low_ > 0.0)


def _bounds(name: str, bounds: Any) -> tuple[float, float]:
    pair = (None, None) if bounds is None else bounds
    try:
        low, high = pair
        least = -np.inf if low is None else float(low)
        most = np.inf if high is None else float(high)
    except (TypeError, ValueError) as error:
        raise check.refuse(f"variable '{name}'", "bounds", bounds, "a pair (lowest, highest), or None") from error
    if not least < most:
        raise check.refuse(f"variable '{name}'", "bounds", bounds, "a pair of ascending numbers")
    return least, most


MOST_REFERENCES = 24  # maximum number of points from which modes are followed
EXCEEDS = 1e-7  # share by which a peak may exceed its bound
NEAR = 1e-9  # relative distance below which local maxima are one


@dataclass(frozen=True)
class Value:
    """Objective ``f``, ``g`` >= 0 and ``h`` = 0 at unknowns ``z``, with derivatives to these."""

    z: Array
    f: Dual
    g: Dual
    h: Dual


class Search:
    """The objective and constraints of a search."""

    def __init__(
        self, systems: Systems, scales: Scales, objective: Quantity, constraints: tuple[Constraint, ...],
        observed: Mapping[str, Quantity],
    ) -> None:  # fmt: skip
        self.systems, self.design, self.scales = systems, systems.design, scales
        self.objective, self.constraints = objective, constraints
        self.evaluations, self.steepest = 0, 0.0
        self._references: list[tuple[Array, Reference]] = []
        self._frame: Array | Complex | None = None
        self._point: tuple[Array, DesignPoint] | None = None
        self._value: Value | None = None
        self.observed = observed
        requested = (objective, *(c.quantity for c in constraints))
        items = [item for part in (*requested, *self.observed.values()) for item in part.inner()]
        self._follows = any(isinstance(item, Modal) for item in items)
        self.largest = tuple(dict.fromkeys(
            item for part in requested for item in part.inner() if isinstance(item, Largest)))  # fmt: skip
        self.needs_equations = any(part.needs_equations for part in (*requested, *self.observed.values()))
        start = self.point(np.zeros(len(scales.start)))
        if self.needs_equations:
            if start.systems is None:
                check_variables(start.system, start.rates)
            self.systems = Systems(systems.model, systems.design, systems.plant, start.equations.coordinates)
        true = {item: float(item.true(start).value[0]) for item in self.largest}
        self.unit = {item: abs(value) or 1.0 for item, value in true.items()}
        self._active = {item: item.seeds(start) for item in self.largest}
        self._size = abs(float(self._scalar(objective.at(start)).value[0])) or 1.0
        numbers = [constraint.quantity.at(start).value for constraint in constraints]
        if not np.isfinite([self._size, *true.values(), *(number for value in numbers for number in value)]).all():
            raise _not_finite(start)
        self._sizes = [max([abs(b) for b in (c.low, c.high) if b is not None]) or float(np.abs(value).max()) or 1.0
                       for c, value in zip(constraints, numbers, strict=True)]  # fmt: skip
        self._check_directions(start)

    def values(self, x: Array) -> dict[str, float]:
        """Return the variables by name at their unknowns."""
        return dict(zip(self.design.variables, self.scales.values(x).tolist(), strict=True))

    def point(self, x: Array) -> DesignPoint:
        """Return the point at the unknowns of variables; its modes, if used, are followed from the nearest computed
        point.
        """
        if self._point is None or not np.array_equal(self._point[0], x):
            self.evaluations += 1
            values, scale = self.values(x), self.scales.rates(self.scales.values(x))
            try:
                point = DesignPoint.at(self.systems, values, scale, scale, self.needs_equations)
                order = self._followed(x, point) if self._follows else None
            except MbsvibError as error:
                error.add_note(f"at {_text(values)}")
                raise
            self._point = x.copy(), point.ordered(order)
        return self._point[1]

    def at(self, z: Array) -> Value:
        """Return objective and constraints at unknowns."""
        if self._value is not None and np.array_equal(self._value.z, z):
            return self._value
        n = len(self.scales.start)
        levels: dict[Hashable, float] = {
            item: float(level) * self.unit[item] for item, level in zip(self.largest, z[n:], strict=True)
        }
        point = self.point(z[:n]).with_levels(levels)
        try:
            f = self._scalar(self.objective.at(point))
            g, h = self._bounded(point)
        except MbsvibError as error:
            error.add_note(f"at {_text(point.values)}")
            raise
        chain = np.concatenate((np.ones(n), [self.unit[item] for item in self.largest]))
        parts = [Dual(dual.value, np.broadcast_to(dual.slope, (len(dual.value), point.width)) * chain)
                 for dual in (Dual(f.value / self._size, f.slope / self._size), _stacked(g), _stacked(h))]  # fmt: skip
        if not all(np.isfinite(numbers).all() for dual in parts for numbers in (dual.value, dual.slope)):
            raise _not_finite(point)
        self.steepest = max(self.steepest, float(np.linalg.norm(parts[0].slope[0])))
        self._value = Value(z.copy(), *parts)
        return self._value

    def begin(self, x: Array) -> Array:
        """Return the initial unknowns: those of the variables, and for each bounded maximum its value there."""
        point = self.point(x)
        return np.concatenate((x, [float(item.true(point).value[0]) / self.unit[item] for item in self.largest]))

    def exchange(self, z: Array) -> tuple[Array, bool]:
        """Add local maxima above their bounds; return unknowns with raised bounds, and whether there are any."""
        n, changed, z = len(self.scales.start), False, z.copy()
        point = self.point(z[:n])
        for k, largest in enumerate(self.largest):
            active = self._active[largest]
            if active is None:
                z[n + k] = max(z[n + k], float(largest.true(point).value[0]) / self.unit[largest])
                continue
            where, size = largest.tops(point)
            added = where[size > z[n + k] * self.unit[largest] * (1.0 + EXCEEDS)]
            added = added[np.abs(added[:, None] - active).min(axis=1, initial=np.inf) > NEAR * added]
            self._active[largest] = np.concatenate((active, added))
            changed = changed or len(added) > 0
            z[n + k] = max(z[n + k], size.max() / self.unit[largest])
        self._value = None
        return z, changed

    def bounds(self) -> tuple[Array, Array]:
        """Return lower and upper bounds of the unknowns."""
        low, high = self.scales.bounds()
        free = np.full(len(self.largest), np.inf)
        return np.concatenate((low, -free)), np.concatenate((high, free))

    def true(self, z: Array) -> tuple[float, list[Array]]:
        """Return objective and constrained quantities, with maxima instead of their bounds."""
        point = self.point(z[: len(self.scales.start)])
        return float(self.objective.at(point).value[0]), [c.quantity.at(point).value for c in self.constraints]

    @property
    def labels(self) -> list[str]:
        """The labels of the constraints, with their places, from 1, where several have one."""
        labels = [constraint.label for constraint in self.constraints]
        return [label if labels.count(label) == 1 else f"{label} ({k})" for k, label in enumerate(labels, 1)]

    def violations(self, numbers: list[Array]) -> dict[str, float]:
        """Return how far constrained quantities are beyond their bounds, in parts of these, by label."""
        result = {}
        for label, constraint, values, size in zip(self.labels, self.constraints, numbers, self._sizes, strict=True):
            below = -np.inf if constraint.low is None else constraint.low - values.min()
            above = -np.inf if constraint.high is None else values.max() - constraint.high
            result[label] = max(0.0, float(below), float(above)) / size
        return result

    def at_bounds(self, z: Array, near: float) -> dict[str, str]:
        """Return which bound each variable is ``near``, in parts of its range: "lower" or "upper"."""
        low, high = self.bounds()
        sides = zip(self.design.variables, z <= low + near, z >= high - near, strict=False)
        return {name: "lower" if below else "upper" for name, below, above in sides if below or above}

    def observations(self, z: Array) -> dict[str, Array]:
        """Return the observed quantities by name."""
        point = self.point(z[: len(self.scales.start)])
        return {name: part.at(point).value for name, part in self.observed.items()}

    def _scalar(self, dual: Dual) -> Dual:
        if len(dual.value) != 1:
            raise ModelError(f"optimize: the objective '{self.objective.label}' has {len(dual.value)} numbers; "
                             f"expected one. q.sum(), largest(q) or q[0] make one of them.",
                             field="objective")  # fmt: skip
        return dual

    def _bounded(self, point: DesignPoint) -> tuple[list[Dual], list[Dual]]:
        g: list[Dual] = []
        h: list[Dual] = []
        for constraint, size in zip(self.constraints, self._sizes, strict=True):
            dual = constraint.quantity.at(point)
            for bound, sign in ((constraint.low, 1.0 / size), (constraint.high, -1.0 / size)):
                if bound is not None and not (constraint.equal and sign < 0.0):
                    part = Dual(sign * (dual.value - bound), sign * dual.slope)
                    (h if constraint.equal else g).append(part)
        for item in self.largest:
            level, members, unit = point.level(item), item.members(point, self._active[item]), self.unit[item]
            if level is not None:
                g.append(Dual((level.value - members.value) / unit, (level.slope - members.slope) / unit))
        return g, h

    def _check_directions(self, start: DesignPoint) -> None:
        """Refuse a search that improves when a bound grows above the maximum that it replaces."""
        n = len(self.scales.start)
        point = start.with_levels({largest: float(largest.true(start).value[0]) for largest in self.largest})
        g, h = self._bounded(point)
        g, bounds = g[: len(g) - len(self.largest)], g[len(g) - len(self.largest) :]
        for k, largest in enumerate(self.largest):
            others = [part for candidate, part in zip(self.largest, bounds, strict=True) if candidate is not largest]
            down = [_at(self.objective.at(point), n + k), *(-_at(part, n + k) for part in (*g, *others))]
            if any((rate < 0.0).any() for rate in down) or any(_at(part, n + k).any() for part in h):
                raise ModelError(f"optimize: '{largest.label}' would have to grow; expected that it is minimised, or "
                                 f"bounded from above.", field="objective")  # fmt: skip

    def _followed(self, x: Array, point: DesignPoint) -> Index:
        """The mode of each track."""
        target = station(point.system, modes=point.modes)
        if not self._references:
            self._frame = frame(point.system, target)
            self._references.append((x.copy(), reference(framed(target, self._frame))))
            return np.arange(len(point.modes))
        origin, known = min(self._references, key=lambda tracks: float(np.abs(tracks[0] - x).max()))
        if known.vectors.shape[1] != len(point.modes):
            raise ModelError(f"optimize: {len(point.modes)} modes here, {known.vectors.shape[1]} at the start: poles "
                             f"have met on the real axis, or left it. Give bounds that keep away from there, or ask "
                             f"quantities of responses.", field="plant")  # fmt: skip

        def between(share: float) -> Station:
            inside = origin + share * (x - origin)
            return framed(station(self.systems.asked(self.values(inside)), share), self._frame)

        target = framed(replace(target, at=1.0), self._frame)
        number, tracks = match_next(known, 0.0, target, between)
        self._references = [*self._references[-MOST_REFERENCES:], (x.copy(), tracks)]
        return number


def _stacked(duals: list[Dual]) -> Dual:
    return stacked(*duals) if duals else Dual(np.zeros(0), np.zeros((0, 1)))


def _not_finite(point: DesignPoint) -> ModelError:
    return ModelError(f"optimize: objective, constraints or their derivatives are not finite at {_text(point.values)}; "
                      f"give bounds that keep away from there, or another start.", field="variables")  # fmt: skip


def _at(dual: Dual, unknown: int) -> Array:
    """Derivatives with respect to one unknown; constants have none."""
    return dual.slope[:, unknown] if dual.slope.shape[1] > unknown else np.zeros(1)


def _text(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
