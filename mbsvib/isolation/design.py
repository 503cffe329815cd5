"""Results of passive designs: a mechanism with its figures before and after, and Pareto fronts of designs.

Mean squares of an isolation under noise of the base, with derivatives, several at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbsvib.api.model import Model
from mbsvib.api.system import System
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.isolation.isolation_study import Isolation
from mbsvib.random.sources import BaseNoise, base_sources
from mbsvib.sensitivities.variables import variables
from mbsvib.studies import Optimum
from mbsvib.studies.evaluation import DesignPoint, Dual
from mbsvib.studies.responses import mean_squares


@dataclass(frozen=True, repr=False, eq=False)
class Design(Columnar, Displayed):
    """A mechanism that was optimised: ``model`` with the values found, figures ``before`` and ``after``.

    Its columns are the variables, those of ``before`` and ``after`` the responses.
    """

    model: Model
    optimum: Optimum
    """Where the search ended."""
    before: Isolation
    after: Isolation

    @property
    def values(self) -> Mapping[str, float]:
        """The variables' values."""
        return self.optimum.values

    @property
    def success(self) -> bool:
        """Whether the constraints hold and no variable betters the objective."""
        return self.optimum.success

    def columns(self) -> dict[str, Any]:
        """Return the variables with their values at the start and at the optimum, as ``Optimum.columns``."""
        return self.optimum.columns()

    def table(self) -> dict[str, Any]:
        """Return variables, objective and figures as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        table = self.optimum.table()
        both = zip(self.before.table()["rows"], self.after.table()["rows"], strict=True)
        table["rows"] = [*table["rows"], *((name, before, after) for (name, before), (_, after) in both)]
        table["title"] = f"Passive design of {self.model.name}"
        return table

    def __repr__(self) -> str:
        return f"Design({self.optimum!r})"


@dataclass(frozen=True, repr=False, eq=False)
class Front(Columnar, Displayed):
    """The best ``objective`` (n,) for n bounds on a quantity, its values ``price`` (n,), and the ``designs``."""

    labels: tuple[str, str]
    """Names of objective and price."""
    objective: Array
    price: Array
    bounds: Array
    designs: tuple[Design, ...] = field(repr=False)

    def columns(self) -> dict[str, Any]:
        """Return a row for each design: its price, its objective, its values by name, and whether it is optimal."""
        return {self.labels[1]: self.price, self.labels[0]: self.objective,
                **{name: np.array([one.values[name] for one in self.designs]) for name in self.designs[0].values},
                "optimal": np.array([one.success for one in self.designs])}  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return the front as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        names = list(self.designs[0].values)
        rows = [(f"{p:.5g}", f"{x:.5g}", *(f"{design.values[name]:.5g}" for name in names),
                 "" if design.success else "not optimal")
                for p, x, design in zip(self.price, self.objective, self.designs, strict=True)]  # fmt: skip
        columns = [(name, "right") for name in (*self.labels[::-1], *names, "")]
        return {"title": f"Pareto front of {self.designs[0].model.name}", "columns": columns, "rows": rows, "notes": []}

    def __repr__(self) -> str:
        return f"Front({self.labels[0]} against {self.labels[1]}, {len(self.designs)} designs)"


Law = tuple[str, str, str]


def _by_laws(
    point: DesignPoint, w: Array, outputs: Sequence[str], inputs: Sequence[str], laws: Mapping[str, Law]
) -> tuple[Complex, Complex]:
    """Responses and derivatives, with some of the outputs computed by their laws."""
    computed = [laws[name][0] if name in laws else name for name in outputs]
    unique = list(dict.fromkeys(computed))
    rows = [unique.index(name) for name in computed]
    value, slope = (part.take(rows, axis=part.ndim - 3) for part in point.response(w, inputs, unique))
    known = point.system.parameters
    moved = [dict(one.rates) for one in variables(known, point.rates).as_directions()]
    for row, name in enumerate(outputs):
        if name in laws:
            _, stiffness, damping = laws[name]
            z = known[stiffness] + 1j * w * known[damping]
            value[row] /= z
            k, c = (np.array([rates.get(name, 0.0) for rates in moved])[:, None] for name in (stiffness, damping))
            slope[:, row] = (slope[:, row] - value[row] * (k + 1j * w * c)[:, None]) / z
    return value, slope


class MeanSquares:
    """Mean squares of single outputs under noise that may be correlated; quantities share computed results.

    ``inputs``: where the noise enters, in its order. ``band``: first and last frequency [Hz]; None: all. ``laws``:
    outputs that are another output divided by k + i w c, with the names of that output and of the parameters k and c.
    """

    def __init__(
        self, outputs: Sequence[str], inputs: Sequence[str], noise: BaseNoise, band: tuple[float, float] | None,
        laws: Mapping[str, Law],
    ) -> None:  # fmt: skip
        self.outputs, self.inputs, self.noise, self.band = list(outputs), list(inputs), noise, band
        self._laws = laws
        self._last: tuple[System, Any, Array, Array] | None = None

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_last": None}

    def requested(self, outputs: Sequence[str]) -> MeanSquares:
        """Return the same mean squares, of these outputs too."""
        self.outputs.extend(name for name in outputs if name not in self.outputs)
        self._last = None
        return self

    def at(self, point: DesignPoint, outputs: Sequence[str]) -> Dual:
        """Return the mean squares of some of the outputs, with derivatives."""
        if self._last is None or self._last[0] is not point.system or self._last[1] is not point.rates:
            squares = mean_squares(point.system, self.outputs, base_sources(self.noise), self.band,
                                   lambda w: _by_laws(point, w, self.outputs, self.inputs, self._laws))  # fmt: skip
            self._last = (point.system, point.rates, *squares)
        rows = [self.outputs.index(name) for name in outputs]
        return point.dual(self._last[2][rows], self._last[3][rows])
