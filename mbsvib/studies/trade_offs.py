"""Trade-offs: designs of which none is better in all of several quantities (Pareto fronts)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.progress import Progress, counting
from mbsvib.errors import MbsvibError, ModelError, counted
from mbsvib.studies.design import Ties
from mbsvib.studies.evaluation import DesignPoint
from mbsvib.studies.optimizing import optimize
from mbsvib.studies.optimum import Optimum
from mbsvib.studies.plants import PlantFunction, systems_of
from mbsvib.studies.quantities import Constraint, Quantity, largest, quantity

# Share of the sum that is added to the largest: of designs with the same largest, the better ones in the others count.
SUM = 1e-4
# Differences below this share of a quantity's range on the front are none.
SAME = 1e-6
# Quantities that are zero in all designs have this range.
TINY = 1e-300
# Divisions of each weight between 0 and 1, by the number of quantities; more quantities have the last.
DIVISIONS = {2: 12, 3: 6, 4: 4}
FEWEST = 3
# Variables that the table lists.
LISTED = 4


@dataclass(frozen=True, repr=False, eq=False)
class TradeOff(Columnar, Displayed):
    """Designs of which none is better in all quantities, in ascending order of the first.

    ``values`` (n,) are the quantities by name and ``variables`` (n,) the variables, ``optima`` the n designs with their
    models. ``ideal`` is the least of each quantity on its own, ``began`` its value of the model that was given, and
    ``labels`` tell what it is. ``weights`` (n, quantities) are those of each search; ``left_out`` says why
    designs of other searches are not on the front.
    """

    name: str
    """Name of the model."""
    labels: Mapping[str, str]
    values: Mapping[str, Array]
    variables: Mapping[str, Array]
    weights: Array
    optima: tuple[Optimum, ...]
    ideal: Mapping[str, float]
    began: Mapping[str, float]
    units: Mapping[str, str] = field(repr=False)
    left_out: Mapping[str, int]

    def __len__(self) -> int:
        return len(self.optima)

    def columns(self) -> dict[str, Array]:
        """Return quantities and variables as columns (n,) by name."""
        return {**self.values, **self.variables}

    def table(self) -> dict[str, Any]:
        """Return the table of designs as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        listed = list(self.variables)[:LISTED]
        columns: list[tuple[str, str]] = [(name, "right") for name in self.values]
        columns += [(name + (f" [{self.units[name]}]" if name in self.units else ""), "right") for name in listed]
        rows = [tuple(f"{column[i]:.6g}" for column in (*self.values.values(), *(self.variables[x] for x in listed)))
                for i in range(len(self))]  # fmt: skip
        notes = [f"{name} is {label}; least on its own {self.ideal[name]:.6g}, of the given model "
                 f"{self.began[name]:.6g}." for name, label in self.labels.items()]  # fmt: skip
        searches = len(self) + sum(self.left_out.values())
        without = ", ".join(f"{count} {why}" for why, count in self.left_out.items() if count)
        notes.append(f"{counted(len(self), 'design')} of {searches} local searches"
                     f"{f'; not on the front: {without}' if without else ''}.")  # fmt: skip
        return {"title": f"Trade-off of {self.name}", "columns": columns, "rows": rows, "notes": notes}

    def __repr__(self) -> str:
        return f"TradeOff({self.name!r}: {counted(len(self), 'design')}, {' against '.join(self.values)})"


def trade_off(
    model: Model, variables: Mapping[str, tuple[float | None, float | None] | None], quantities: Mapping[str, Quantity],
    constraints: Constraint | Iterable[Constraint] = (), *, divisions: int | None = None, ties: Ties | None = None,
    method: str = "SLSQP", options: Mapping[str, Any] | None = None, starts: int = 1, seed: int = 0,
    progress: Progress = False, plant: PlantFunction | None = None, relaxed: bool = False,
) -> TradeOff:  # fmt: skip
    """Return designs of which none is better in all of several quantities: the Pareto front.

    minimise  max over k of w_k n_k + 0.0001 sum of n_k,  n_k = (f_k - least of f_k) / range of f_k

    for weights w on a grid, by the exact gradients of ``optimize``; fronts need not be convex. The least of each
    quantity is searched for first. Then each search begins at the design with the nearest weights; all are local.

    Parameters
    ----------
    model : Model
        The mechanism.
    variables : mapping of str to (float, float) or None
        Lower and upper bound of each variable, as for ``optimize``.
    quantities : mapping of str to Quantity
        Two or more quantities of one number each by name, all to be small; the negative of one that is to be large.
        One that reaches zero needs a derivative there: mean squares rather than root mean squares.
    constraints : Constraint or iterable of Constraint
        What has to hold.
    divisions : int, optional
        Weights are multiples of 1/divisions with the sum 1; default: 12 for two quantities (13 designs), 6 for three
        (28), fewer for more.
    ties : mapping of str to mapping of str to float or Tie, optional
        Linear maps or functions that variables stand for; this and the next ones as for ``optimize``.
    method : str
        The solver.
    options : mapping of str to object, optional
        The solver's own.
    starts : int
        Number of local searches, of which the best one counts.
    seed : int
        Of the points where they start.
    progress : bool or callable
        True: a bar on standard error; a function is called with how many searches are done, and how many there are.
    plant : callable, optional
        A function of the system that returns what quantities are those of in its place, such as a closed loop, whose
        further arguments may be variables; as for ``optimize``.
    relaxed : bool
        Whether springs keep their forces where joints are displaced, as for ``sweep``.

    Returns
    -------
    TradeOff
        Quantities and variables of the designs, with their models; ``print`` shows a table, ``plots.trade_off`` a
        figure.

    Raises
    ------
    ModelError
        If there are less than two quantities, one has several numbers, or the least of one is not found; and as
        ``optimize`` does.

    Source: R. E. Steuer, E.-U. Choo, "An interactive weighted Tchebycheff procedure for multiple objective
    programming" (1983).
    """
    names = _checked(quantities)
    conditions = tuple(constraints) if isinstance(constraints, Iterable) else (constraints,)
    count = DIVISIONS.get(len(names), FEWEST) if divisions is None else divisions
    grid = _grid(len(names), check.count(count, "trade_off", "divisions", 1))

    def best(objective: Quantity, start: Mapping[str, float] | None) -> Optimum:
        return optimize(model, variables, objective, conditions, ties=ties, start=start, method=method, options=options,
                        starts=starts, seed=seed, observed=quantities, plant=plant,
                        relaxed=relaxed)  # fmt: skip

    with counting(progress, len(names) + len(grid), "trade-off") as tell:
        single = []
        for name in names:
            single.append(best(quantities[name], None))
            tell(1)
        ideal, span = _range(list(map(_numbers, single)))
        ends: list[tuple[Array, Optimum]] = list(zip(np.eye(len(names)), single, strict=True))
        failed = 0
        for i, weights in enumerate(grid):
            if i == len(names):  # the first have one weight alone
                span = _range([_numbers(optimum) for _, optimum in ends])[1]
            near = min(range(len(ends)), key=lambda k, w=weights: float(np.abs(ends[k][0] - w).sum()))  # type: ignore[misc]
            try:
                end = best(_scalar(quantities, weights, ideal, span), ends[near][1].values)
                ends[i : i + 1] = [(weights, end)]
            except MbsvibError:
                failed += 1
            tell(1)
    rows = np.array([_numbers(optimum) for _, optimum in ends])
    systems = systems_of(model, variables, ties, plant, relaxed)
    start, sizes = dict(systems.design.start), np.ones(len(systems.design.start))
    equations = any(part.needs_equations for part in quantities.values())
    given = DesignPoint.at(systems, start, sizes, sizes, equations)
    began = {name: float(part.at(given).value[0]) for name, part in quantities.items()}
    return _front(model, quantities, ends, rows, span, ideal, began, failed)


def _range(rows: Sequence[Array]) -> tuple[Array, Array]:
    """The least of each quantity, and how much larger it is where another one is least."""
    table = np.array(rows)
    least, span = table.min(axis=0), np.ptp(table, axis=0)
    return least, np.where(span > SAME * np.abs(table).max(axis=0), span, np.maximum(np.abs(least), TINY))


def _front(
    model: Model, quantities: Mapping[str, Quantity], ends: list[tuple[Array, Optimum]], rows: Array, span: Array,
    ideal: Array, began: Mapping[str, float], failed: int,
) -> TradeOff:  # fmt: skip
    """The designs that are optimal, not dominated and not the same."""
    good = np.array([optimum.success for _, optimum in ends])
    retained: list[int] = []
    dominated = same = 0
    scaled = (rows - ideal) / span
    for i in np.flatnonzero(good):
        others = np.delete(scaled[good], np.flatnonzero(good) == i, axis=0) - scaled[i]
        if ((others <= SAME).all(axis=1) & (others < -SAME).any(axis=1)).any():
            dominated += 1
        elif any(np.abs(scaled[i] - scaled[k]).max() <= SAME for k in retained):
            same += 1
        else:
            retained.append(int(i))
    if not retained:
        raise ModelError(f"trade_off: no search of {len(ends) + failed} ends in an optimum, the first: "
                         f"{ends[0][1].message}; give a better start or other bounds.", field="variables")  # fmt: skip
    retained.sort(key=lambda i: tuple(rows[i]))
    optima = tuple(ends[i][1] for i in retained)
    table, weights = rows[retained].T, np.array([ends[i][0] for i in retained])
    variables = {name: np.array([optimum.values[name] for optimum in optima]) for name in optima[0].values}
    for array in (table, weights, *variables.values()):
        array.setflags(write=False)
    return TradeOff(
        model.name, {name: part.label for name, part in quantities.items()}, dict(zip(quantities, table, strict=True)),
        variables, weights, optima, dict(zip(quantities, map(float, ideal), strict=True)),
        began, optima[0].units,
        {"dominated": dominated, "same as others": same, "not converged": int((~good).sum()), "refused": failed},
    )  # fmt: skip


def _scalar(quantities: Mapping[str, Quantity], weights: Array, ideal: Array, span: Array) -> Quantity:
    """The largest of the weighted quantities and a small share of their sum, plus 1, the unit of a search's scales."""
    scaled = [(part - float(least)) / float(size)
              for part, least, size in zip(quantities.values(), ideal, span, strict=True)]  # fmt: skip
    total: Quantity = quantity(0.0)
    for part in scaled:
        total = total + SUM * part
    result = largest(*(float(w) * part + 1.0 for w, part in zip(weights, scaled, strict=True) if w)) + total
    several = ", ".join(f"{w:.3g} {name}" for w, name in zip(weights, quantities, strict=True) if w)
    result.label = f"largest of {several}"
    return result


def _grid(count: int, divisions: int) -> Array:
    """Weights (n, count) with the sum 1, multiples of 1 / divisions; those with one entry alone are first."""
    bars = combinations(range(divisions + count - 1), count - 1)
    edges = np.array([(-1, *bar, divisions + count - 1) for bar in bars])
    weights = (np.diff(edges, axis=1) - 1) / divisions
    single = weights.max(axis=1) == 1.0
    return np.concatenate((np.eye(count), weights[~single]))


def _numbers(optimum: Optimum) -> Array:
    """The values of the quantities at an optimum."""
    return np.array([float(values[0]) for values in optimum.observed.values()])


def _checked(quantities: Any) -> tuple[str, ...]:
    expected = "two or more quantities by name, such as {'force': cycle.mean_square('force'), ...}"
    if not isinstance(quantities, Mapping) or len(quantities) < 2:
        raise check.refuse("trade_off", "quantities", quantities, expected)
    for name, part in quantities.items():
        if not isinstance(part, Quantity):
            raise check.refuse("trade_off", f"quantities[{name!r}]", part, "a quantity, such as studies.rms('x')")
    return tuple(quantities)
