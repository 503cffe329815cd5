"""Result of a passive design: the mechanism, and its figures before and after."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mbsvib.common.display import Displayed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.api.model import Model
    from mbsvib.isolation.isolation_study import Isolation
    from mbsvib.studies import Optimum


@dataclass(frozen=True, repr=False, eq=False)
class Design(Displayed):
    """A mechanism that was optimised: ``model`` with the values found, figures ``before`` and ``after``."""

    model: Model
    optimum: Optimum
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

    def table(self) -> dict[str, Any]:
        """Return variables, objective and figures as arguments of ``mbsvib.common.tables.text`` and ``show``.

        Returns
        -------
        dict
            Title, columns, rows and notes.
        """
        table = self.optimum.table()
        both = zip(self.before.table()["rows"], self.after.table()["rows"], strict=True)
        table["rows"] = [*table["rows"], *((name, before, after) for (name, before), (_, after) in both)]
        table["title"] = f"Passive design of {self.model.name}"
        return table

    def __repr__(self) -> str:
        return f"Design({self.optimum!r})"
