"""Variables: one or several parameters that change together, by name, pattern or linear map."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib import _checks as check
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from mbsvib.kinematics import Array, Index
    from mbsvib.parameters import Parameter, Parameters


@dataclass(frozen=True)
class Variables:
    """Variables by ``names``: term t moves the parameter numbered ``parameter`` (t,) with the ``variable`` (t,), at a
    ``rate`` (t,).
    """

    names: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    variable: Index
    parameter: Index
    rate: Array

    @cached_property
    def identity(self) -> bool:
        """Whether variables are parameters, one by one."""
        every = np.arange(len(self.names))
        return len(self.parameters) == len(self.rate) == len(every) and bool(
            (self.rate == 1.0).all() and (self.parameter == every).all() and (self.variable == every).all()
        )

    def chain(self, values: Any) -> Any:
        """Turn derivatives to the parameters (parameters, ...) into those to the variables (variables, ...)."""
        if self.identity:
            return values
        result = np.zeros((len(self.names), *values.shape[1:]), dtype=values.dtype)
        rate = self.rate.reshape(-1, *[1] * (values.ndim - 1))
        np.add.at(result, self.variable, rate * values[self.parameter])
        return result


def variables(known: Parameters, asked: str | Iterable[str] | Mapping[str, Mapping[str, float]] | None) -> Variables:
    """Return the variables that were asked for.

    Parameters
    ----------
    known : Parameters
        The parameters of a model or system.
    asked : str, iterable of str, mapping or None
        Names; a pattern ties all that it picks to one variable (``"leg*.k.stiffness"``); a mapping gives each variable
        its own linear map, {variable: {name or pattern: rate}}. None: every parameter.

    Returns
    -------
    Variables
        Names and the parameters that they move.

    Raises
    ------
    ModelError
        If a name is unknown, a pattern picks nothing, or a rate is no number.
    """
    if asked is None:
        entries = known.entries
        every = np.arange(len(entries))
        return Variables(tuple(known), entries, every, every, np.ones(len(entries)))
    if not isinstance(asked, (str, Iterable)):
        raise ModelError(f"sensitivities: parameters = {asked!r}; expected names, patterns, or a mapping of variables "
                         f"to {{parameter: rate}}.", element="parameters")  # fmt: skip
    names = [asked] if isinstance(asked, str) else list(asked)
    maps = asked if isinstance(asked, Mapping) else {name: {name: 1.0} for name in names}
    place: dict[str, int] = {}
    terms: list[tuple[int, int, float]] = []
    for i, name in enumerate(names):
        if not isinstance(maps[name], Mapping) or not maps[name]:
            raise ModelError(f"variable '{name}': {maps[name]!r}; expected the parameters that it moves, one or more, "
                             f"{{name or pattern: rate}}.", element=str(name))  # fmt: skip
        for pattern, rate in maps[name].items():
            rate = check.number(rate, f"variable '{name}'", pattern, "a finite rate")
            for found in known.matching(pattern):
                terms.append((i, place.setdefault(found, len(place)), rate))
    table = np.array(terms, dtype=float).reshape(-1, 3)
    return Variables(tuple(names), tuple(known.entry(name) for name in place), table[:, 0].astype(np.intp),
                     table[:, 1].astype(np.intp), table[:, 2])  # fmt: skip
