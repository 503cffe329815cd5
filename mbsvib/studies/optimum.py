"""What a search for the best design found, as a table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.errors import counted

HELD = "Narrow the bounds to values at which the mechanism is held."
FEASIBLE = 1e-6  # permitted constraint violation, in parts of the bound


@dataclass(frozen=True, slots=True, eq=False)
class Descent:
    """One local search: from the values ``start`` of the variables to ``values`` and the ``objective`` there, with the
    largest constraint ``violation``; ``success`` as of ``Optimum``. Not a number where the ``message`` tells an
    error.
    """

    start: Mapping[str, float]
    values: Mapping[str, float]
    objective: float
    violation: float
    success: bool
    message: str


@dataclass(frozen=True, repr=False, eq=False)
class Optimum(Columnar, Displayed):
    """Where a search ended: the ``model`` there, the ``values`` of its variables and of the ``parameters`` that they
    move, the ``objective`` and where it began.

    The search is local: it goes downhill from its start, and another start may lead to a smaller objective. Where there
    were several starts it is the best of them, and ``starts`` has all of them, the model's own first.

    ``plant`` is what the function ``plant`` of the search returns there, such as the closed loop, None without one.
    ``observed`` has the quantities that were asked for besides, by name. ``constraints`` has the constrained numbers by
    label, ``violations`` how far each of them is beyond its bound, in parts of the bound, 0 where it holds, and
    ``violation`` the largest of these. ``at_bounds`` names the variables that ended at a bound, "lower" or "upper".
    ``optimality`` is the norm of the objective's gradient minus its projection on those of active constraints
    and bounds, relative to the largest gradient: 0 at an optimum. ``success`` is true if the constraints hold, and the
    solver has converged or the projected gradient is small.
    """

    _engine = "label"

    model: Model = field(repr=False)
    values: Mapping[str, float]
    parameters: Mapping[str, float] = field(repr=False)
    start: Mapping[str, float]
    objective: float
    began: float
    label: str
    """Name of the objective."""
    constraints: Mapping[str, Array]
    observed: Mapping[str, Array]
    violations: Mapping[str, float]
    violation: float
    at_bounds: Mapping[str, str]
    optimality: float
    success: bool
    message: str
    """What the solver reported at its end."""
    iterations: int
    """Number of iterations."""
    evaluations: int
    """Number of evaluations of the objective."""
    units: Mapping[str, str] = field(repr=False)
    starts: tuple[Descent, ...] = field(repr=False)
    plant: Any = field(default=None, repr=False)
    unstable: str = field(default="", repr=False)
    """The pole that grows fastest where the search ended, in words; "" where none does."""

    _index = "variable"

    def columns(self) -> dict[str, Any]:
        """Return the variables with their values at the start and at the optimum as columns (variables,) by name:
        ``variable``, ``unit``, ``start``, ``optimum``.
        """
        return {"variable": np.array(list(self.values)), "unit": np.array([self.units.get(n, "") for n in self.values]),
                "start": np.array([self.start[n] for n in self.values]),
                "optimum": np.array(list(self.values.values()))}  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return the table of variables as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        rows = [(name + (f" [{self.units[name]}]" if name in self.units else ""), f"{self.start[name]:.7g}",
                 f"{value:.7g}") for name, value in self.values.items()]  # fmt: skip
        rows.append((self.label, f"{self.began:.7g}", f"{self.objective:.7g}"))
        notes = [f"{label}: {' to '.join([f'{x:.6g}' for x in (numbers.min(), numbers.max())][: len(numbers)])}"
                 f"{', not met' if self.violations.get(label, 0.0) > FEASIBLE else ''}."
                 for label, numbers in {**self.constraints, **self.observed}.items()]  # fmt: skip
        if self.at_bounds:
            notes.append(f"At a bound: {', '.join(f'{name} ({side})' for name, side in self.at_bounds.items())}.")
        notes.append(f"{'Optimal' if self.success else 'Not optimal'} after {counted(self.iterations, 'iteration')}, "
                     f"{counted(self.evaluations, 'system')} evaluated; residual gradient {self.optimality:.1e}, "
                     f"constraint violation {self.violation:.1e}.")  # fmt: skip
        if not self.success:
            notes.append(f"Message of the solver: {self.message}")
        if self.unstable:
            notes.append(f"Unstable: {self.unstable} grows. {HELD}")
        if self.violation > FEASIBLE:
            notes.append("No values were found at which all constraints hold: relax one that is not met, widen the "
                         "bounds of variables, or add variables.")  # fmt: skip
        if self.success or len(self.starts) > 1:
            notes.append(self._starts_note())
        return {"title": f"Optimum of {self.model.name}", "columns": [("variable", "left"), ("start", "right"),
                ("optimum", "right")], "rows": rows, "notes": notes}  # fmt: skip

    def _starts_note(self) -> str:
        """Sentence on other minima."""
        if len(self.starts) == 1:
            return "This is a local minimum. A smaller one may exist: starts=n searches from n points."
        ends = [f"{optimum.objective:.6g}" + ("" if optimum.violation <= FEASIBLE else f" (constraint violation "
                f"{optimum.violation:.1e})") for optimum in self.starts if np.isfinite(optimum.objective)]  # fmt: skip
        several = Counter(sorted(ends, key=lambda text: float(text.split()[0])))
        reached = ", ".join(f"{end} from {count}" for end, count in several.items())
        failed = len(self.starts) - len(ends)
        return (f"The best of local searches from {len(self.starts)} starts: {reached}"
                f"{f', none from {failed}' if failed else ''}.")  # fmt: skip

    def __repr__(self) -> str:
        return f"Optimum({self.model.name!r}: {self.label} from {self.began:.6g} to {self.objective:.6g})"
