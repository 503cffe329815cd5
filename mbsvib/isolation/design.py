"""Results of passive designs: a mechanism with its figures before and after, and Pareto fronts of designs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.isolation.isolation_study import Isolation
from mbsvib.studies import Optimum


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
