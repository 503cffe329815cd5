"""Variables of a study: parameters by name or pattern, or linear maps of several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mbsvib import _checks as check
from mbsvib.changes import resolved
from mbsvib.errors import ModelError, nearest
from mbsvib.parameters import unit

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.model import Model

Ties = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, slots=True)
class Design:
    """The ``variables`` of a study and what they move: ``direct`` variables are parameters (or patterns of parameters)
    and take their values; ``maps`` add a rate times their value to what the model has, ``start`` by parameter.
    """

    variables: tuple[str, ...]
    direct: tuple[str, ...]
    maps: Mapping[str, Mapping[str, float]]
    start: Mapping[str, float]

    def values(self, columns: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters' values for values of the variables, numbers or arrays of one length."""
        result = {name: columns[name] for name in self.direct}
        added: dict[str, Any] = {}
        for variable, rates in self.maps.items():
            for name, rate in rates.items():
                added[name] = added.get(name, self.start[name]) + rate * columns[variable]
        return result | added

    def units(self, model: Model) -> dict[str, str]:
        """Return the units of the variables that have one: parameters, and patterns that pick those of one kind."""
        known = {name: {unit(each) for each in model.parameters.matching(name)} for name in self.direct}
        return {name: units.pop() for name, units in known.items() if len(units) == 1}

    def rates(self, model: Model) -> dict[str, dict[str, float]]:
        """Return how fast each variable moves each parameter, as sensitivities are asked for."""
        known = model.parameters
        return {name: dict(self.maps[name]) if name in self.maps else dict.fromkeys(known.matching(name), 1.0)
                for name in self.variables}  # fmt: skip


def design(model: Model, names: Iterable[str], ties: Ties | None = None) -> Design:
    """Return the variables of a study.

    Parameters
    ----------
    model : Model
        The mechanism.
    names : iterable of str
        Names of the variables: parameters, patterns that pick several, or names that ``ties`` explains.
    ties : mapping of str to mapping of str to float, optional
        For each variable that is a linear map, the rate at which each parameter (by name or pattern) moves with it:
        parameter = what the model has + rate x variable.

    Returns
    -------
    Design
        The variables, checked.

    Raises
    ------
    ModelError
        If a parameter is unknown, a tie picks nothing, or two variables move one parameter in different ways.
    """
    variables, given = tuple(names), {} if ties is None else dict(ties)
    for name in given:
        if name not in variables:
            raise ModelError(f"ties: '{name}' is none of the variables.{nearest(str(name), variables)} Variables are: "
                             f"{', '.join(map(str, variables))}.", element=str(name), field="ties")  # fmt: skip
    direct = tuple([name for name in variables if name not in given])
    parameters = model.parameters
    moved: dict[str, str] = dict.fromkeys(resolved(parameters, dict.fromkeys(direct, 0.0)), "values")
    maps: dict[str, dict[str, float]] = {}
    start: dict[str, float] = {}
    for variable, rates in given.items():
        if not isinstance(rates, Mapping) or not rates:
            raise check.refuse(f"variable '{variable}'", "ties", rates, "a mapping from parameters to rates")
        for pattern, rate in rates.items():
            value = check.number(rate, f"variable '{variable}'", str(pattern), "a finite rate")
            for name in parameters.matching(pattern):
                if name in moved:
                    raise ModelError(f"variable '{variable}': it moves '{name}', which has values of its own; leave "
                                     f"one of both out.", element=name, field="ties")  # fmt: skip
                maps.setdefault(variable, {})[name] = value
                start[name] = parameters[name]
    return Design(variables, direct, maps, start)
