"""Variables: one or several parameters that change together, by name, pattern or linear map."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from mbsvib.common import arguments as check
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.mechanism.parameters import Parameter, Parameters

    Mask = NDArray[np.bool_]
    Asked = str | Iterable[str] | Mapping[str, Mapping[str, float]] | None


@dataclass(frozen=True, slots=True)
class Direction:
    """Parameters by name that change together, each at its rate, under the name of the variable that does it."""

    name: str
    rates: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Variables:
    """Variables by ``names``: term t moves the parameter numbered ``parameter`` (t,) with the ``variable`` (t,), at a
    ``rate`` (t,); numbers behind the last of the parameters are those of ``directions``.
    """

    names: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    variable: Index
    parameter: Index
    rate: Array
    directions: tuple[Direction, ...] = ()

    @cached_property
    def identity(self) -> bool:
        """Whether variables are parameters, one by one."""
        every = np.arange(len(self.names))
        return not self.directions and len(self.parameters) == len(self.rate) == len(every) and bool(
            (self.rate == 1.0).all() and (self.parameter == every).all() and (self.variable == every).all()
        )

    @cached_property
    def rates(self) -> csr_array | None:
        """How variables move parameters and directions, (variables, parameters); None: they are the parameters."""
        if self.identity:
            return None
        count = len(self.parameters) + len(self.directions)
        return csr_array((self.rate, (self.variable, self.parameter)), shape=(len(self.names), count))

    def among(self, every: tuple[Parameter, ...]) -> Variables:
        """Return the same variables with more parameters than they move, ``every`` one there is."""
        place = {entry.name: k for k, entry in enumerate(every)}
        own = np.array([place[entry.name] for entry in self.parameters], dtype=np.intp)
        return Variables(self.names, every, self.variable, own[self.parameter], self.rate)

    def each(self) -> tuple[Direction, ...]:
        """Return every variable with all parameters that it moves."""
        rates: list[dict[str, float]] = [{} for _ in self.names]
        for v, p, rate in zip(self.variable.tolist(), self.parameter.tolist(), self.rate.tolist(), strict=True):
            count = len(self.parameters)
            moved = ((self.parameters[p].name, 1.0),) if p < count else self.directions[p - count].rates
            for name, share in moved:
                rates[v][name] = rates[v].get(name, 0.0) + rate * share
        return tuple(Direction(name, tuple(moves.items())) for name, moves in zip(self.names, rates, strict=True))

    def joined(self, together: Mask) -> Variables:
        """Return the same variables, in which all of some parameters that one variable moves are one direction.

        Parameters
        ----------
        together : array of bool, shape (parameters,)
            Which parameters.

        Returns
        -------
        Variables
            The others, then one direction for each variable that moves any of these.
        """
        left = np.flatnonzero(~together)
        place = np.full(len(together), -1)
        place[left] = np.arange(len(left))
        directions: list[Direction] = []
        own = together[self.parameter]
        terms = list(zip(self.variable[~own].tolist(), place[self.parameter[~own]].tolist(), self.rate[~own].tolist(),
                         strict=True))  # fmt: skip
        rates: dict[int, dict[str, float]] = {}
        for v, p, rate in zip(self.variable[own].tolist(), self.parameter[own].tolist(), self.rate[own].tolist(),
                              strict=True):  # fmt: skip
            own_rates, name = rates.setdefault(v, {}), self.parameters[p].name
            own_rates[name] = own_rates.get(name, 0.0) + rate
        for v, own_rates in rates.items():
            moved = tuple((name, rate) for name, rate in own_rates.items() if rate)
            if moved:
                terms.append((v, len(left) + len(directions), 1.0))
                directions.append(Direction(self.names[v], moved))
        table = np.array(terms, dtype=float).reshape(-1, 3)
        return Variables(
            self.names, tuple(self.parameters[k] for k in left.tolist()), table[:, 0].astype(np.intp),
            table[:, 1].astype(np.intp), table[:, 2], tuple(directions),
        )

    def chain(self, values: Any) -> Any:
        """Turn derivatives to the parameters (parameters, ...) into those to the variables (variables, ...)."""
        rates = self.rates
        if rates is None:
            return values
        flat = rates @ values.reshape(len(values), prod(values.shape[1:]))
        return flat.reshape(len(self.names), *values.shape[1:])


def variables(known: Parameters, asked: Asked) -> Variables:
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
            terms += [(i, place.setdefault(match, len(place)), rate) for match in known.matching(pattern)]
    table = np.array(terms, dtype=float).reshape(-1, 3)
    return Variables(tuple(names), tuple(known.entry(name) for name in place), table[:, 0].astype(np.intp),
                     table[:, 1].astype(np.intp), table[:, 2])  # fmt: skip
