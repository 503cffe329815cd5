"""Variables of a study: parameters by name or pattern, joint coordinates, and ties, functions that move several."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.expected import a_model
from mbsvib.equilibrium.posed_variants import pose_coordinates
from mbsvib.errors import ModelError
from mbsvib.mechanism.changes import resolved, to_angular_velocities
from mbsvib.mechanism.parameters import Parameters


@runtime_checkable
class Tie(Protocol):
    """Parameters as functions of variables: any object with these two methods.

    Optional are the attributes ``start``, the value of each variable at which the model is as given (which is checked;
    without it variables start at 0), and ``units`` of the variables.
    """

    def values(self, variables: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the values of parameters, by name or pattern.

        Parameters
        ----------
        variables : mapping of str to float or array, shape (n,)
            Values of those variables that the tie is given for, as numbers, or as arrays of one length.

        Returns
        -------
        mapping of str to float or array, shape (n,)
            The same parameters at all values.
        """

    def rates(self, variables: Mapping[str, float]) -> Mapping[str, Mapping[str, float]]:
        """Return the derivatives of these values.

        Parameters
        ----------
        variables : mapping of str to float
            Values of the variables.

        Returns
        -------
        mapping of str to mapping of str to float
            {variable: {parameter: rate}}; those that are left out are 0.
        """


@dataclass(frozen=True, slots=True)
class LinearMap:
    """Parameters that are ``origin`` + rate x variable, summed over the ``maps`` {variable: {parameter: rate}}."""

    maps: Mapping[str, Mapping[str, float]]
    origin: Mapping[str, float]
    start: Mapping[str, float]

    def values(self, variables: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of parameters."""
        result: dict[str, Any] = {}
        for variable, rates in self.maps.items():
            for name, rate in rates.items():
                result[name] = result.get(name, self.origin[name]) + rate * variables[variable]
        return result

    def rates(self, variables: Mapping[str, float]) -> Mapping[str, Mapping[str, float]]:
        """Return the rates, which are the same everywhere."""
        return self.maps


def started(tie: Any, name: str) -> float:
    """Return the value of a variable at the given model."""
    return float(getattr(tie, "start", {}).get(name, 0.0))


Ties = Mapping[str, Mapping[str, float] | Tie]
Bound = tuple[Tie, tuple[str, ...]]

START_TOLERANCE = 1e-9  # difference of a tie from the model at its start, in parts of the largest value of its kind


@dataclass(frozen=True, slots=True)
class StudyVariables:
    """The ``variables`` of a study, their values at the given model (``start``), and the ``ties`` that map them to
    ``parameters``, each with its variables. Changes of several ties to one parameter are added. ``pose`` has the
    joint coordinates of variables that are displacements, which are ``relaxed`` as of ``moved``. ``known`` caches the
    names that match each pattern.
    """

    variables: tuple[str, ...]
    start: Mapping[str, float]
    units: Mapping[str, str]
    ties: tuple[Bound, ...]
    parameters: Parameters
    pose: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    relaxed: bool = False
    known: dict[str, list[str]] = field(default_factory=dict, repr=False, compare=False)

    def values(self, columns: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters' values for values of the variables, numbers or arrays of one length."""
        result: dict[str, Any] = {}
        for tie, names in self.ties:
            for name, value in self._expanded(tie.values({variable: columns[variable] for variable in names})):
                result[name] = result[name] + (value - self.parameters[name]) if name in result else value
        return result

    def displacements(self, columns: Mapping[str, Any]) -> dict[str, Any]:
        """Return the displacements of joint coordinates for values of the variables."""
        return {name: columns[variable] for variable, names in self.pose.items() for name in names}

    def rates(self, values: Mapping[str, float]) -> dict[str, dict[str, float]]:
        """Return the derivatives of parameters with respect to the variables, for sensitivities of the system at these
        values: rotations are relative to the orientations there. Displacements have none.
        """
        result: dict[str, dict[str, float]] = {name: {} for name in self.variables}
        for tie, names in self.ties:
            for variable, rates in tie.rates({variable: values[variable] for variable in names}).items():
                slopes = result[variable]
                for name, rate in self._expanded(rates):
                    slopes[name] = slopes.get(name, 0.0) + rate
        parameter_values = self.values(values)
        to_angular_velocities(result.values(), parameter_values)
        for name, slopes in result.items():
            slopes.update({} if slopes or name in self.pose else {next(iter(parameter_values or self.parameters)): 0.0})
        return result

    def _expanded(self, by_pattern: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
        for pattern, value in by_pattern.items():
            if pattern not in self.known:
                self.known[pattern] = self.parameters.matching(pattern)
            yield from [(name, value) for name in self.known[pattern]]


def rates_at(model: Model, values: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Return linear maps of parameters with which sensitivities at some values are slopes of these values.

    dG/dp = sum over parameters q of ``rates_at[p][q]`` dG/dq of ``model.with_values(values)``

    The orientation parameters of a rebuilt model are 0 and turn its parts from where they are; the values that it was
    given are components of the rotation vector w from the axes of ``model``. A component k of w turns a part by the
    angular velocity J(w) e_k, J = I + (1 - cos a) / a^2 [w]x + (a - sin a) / a^3 [w]x^2, a = |w|. All other parameters
    have the rate 1.

    Parameters
    ----------
    model : Model
        The nominal model.
    values : mapping of str to float
        Values of its parameters, by name or pattern.

    Returns
    -------
    dict
        For each name of ``values`` the rates of the parameters, as ``parameters`` of all sensitivities.

    Raises
    ------
    ModelError
        If a parameter is unknown or a value is not a number.

    Source: Chirikjian, Stochastic Models, Information Theory, and Lie Groups 2 (2011), the left Jacobian of SO(3).
    """
    check.mapping("rates_at", "values", values, "parameters with values, {'hip.orientation.rx': 0.1}")
    numbers = {str(name): check.number(value, "rates_at", str(name)) for name, value in values.items()}
    return design(model, numbers).rates(numbers)


def design(
    model: Model, names: Iterable[str], ties: Ties | None = None, gains: Mapping[str, float] | None = None,
    relaxed: bool | None = None,
) -> StudyVariables:  # fmt: skip
    """Return the variables of a study.

    ``names``: names of the variables: parameters, patterns that pick several, or names that ``ties`` explains.
    ``ties``: for each variable that is a linear map, the rate at which each parameter (by name or pattern) moves with
    it: parameter = value of the model + rate x variable. For others an object with ``values`` and ``rates``, the same
    for all variables that it takes. ``gains``: variables that are arguments of the plant of a study, with their start.
    ``relaxed``: as of ``moved``, for names that are joint coordinates; None: they are refused.
    """
    if ties is not None and not isinstance(ties, Mapping):
        raise check.refuse("study", "ties", ties, "a mapping of variables to the parameters that they move, "
                           "{'height': {'platform.position.z': 1.0}}, or to objects with values(variables) and "
                           "rates(variables), such as isolation.platform(model, body).ties")  # fmt: skip
    variables, maps, parameters = tuple(names), {} if ties is None else dict(ties), a_model(model, "study").parameters
    shared = {id(tie) for name, tie in maps.items() if name in variables and not isinstance(tie, Mapping)}
    for name, tie in maps.items():
        if name not in variables and id(tie) not in shared:
            raise check.unknown(name, variables, f"ties: '{name}' is not one of the variables", "ties",
                                "Variables are:")  # fmt: skip
    gains = gains or {}
    own = [name for name in variables if name not in maps and name not in gains]
    pose = {} if relaxed is None else posed_names(model, own)
    direct = _direct(parameters, [name for name in own if name not in pose])
    linear, objects = _linear(parameters, maps), {id(tie): tie for tie in maps.values() if isinstance(tie, Tie)}
    bound = [(tie, tuple([name for name in variables if maps.get(name) is tie])) for tie in objects.values()]
    result: tuple[Bound, ...] = tuple([(tie, tuple(tie.maps)) for tie in (direct, linear) if tie.maps]) + tuple(bound)
    start = dict(direct.start) | dict(linear.start) | dict(gains) | dict.fromkeys(pose, 0.0)
    known = {variable: {parameters.entry(name).unit for name in rates} for variable, rates in direct.maps.items()}
    units = {variable: own.pop() for variable, own in known.items() if len(own) == 1} | {
        name: "rad" if moved[0].rpartition(".")[2].startswith("r") else "m" for name, moved in pose.items()}
    for tie, tied in bound:
        start |= {name: started(tie, name) for name in tied}
        units |= {name: unit for name, unit in getattr(tie, "units", {}).items() if name in tied}
    affected = [(name, variable) for variable, rates in linear.maps.items() for name in rates]
    affected += [(name, tied[0]) for tie, tied in bound for name in _checked(parameters, tie, tied, start)]
    for name, variable in affected:
        if name in direct.origin:
            raise ModelError(f"variable '{variable}': it moves '{name}', which has values of its own; leave one of "
                             f"both out.", element=name, field="ties")  # fmt: skip
    return StudyVariables(variables, start, units, result, parameters, pose, bool(relaxed))


def posed_names(model: Model, names: list[str]) -> dict[str, tuple[str, ...]]:
    """Joint coordinates by the names and patterns that pick no parameter."""
    result: dict[str, tuple[str, ...]] = {}
    for name in names:
        try:
            model.parameters.matching(name)
        except ModelError:
            with suppress(ModelError):
                result[name] = pose_coordinates(model, name)
    return result


def _direct(parameters: Parameters, names: list[str]) -> LinearMap:
    """Variables that are parameters, or patterns of them."""
    start = {name: float(np.mean([parameters[key] for key in parameters.matching(name)])) for name in names}
    maps: dict[str, dict[str, float]] = {name: {} for name in names}
    for parameter, name in resolved(parameters, {name: name for name in names}).items():
        maps[name][parameter] = 1.0
    return LinearMap(maps, {parameter: 0.0 for rates in maps.values() for parameter in rates}, start)


def _linear(parameters: Parameters, ties: Mapping[str, Any]) -> LinearMap:
    """Variables that are linear maps of parameters."""
    maps: dict[str, dict[str, float]] = {}
    for variable, rates in ties.items():
        if isinstance(rates, Tie):
            continue
        check.mapping(f"variable '{variable}'", "ties", rates, "a mapping from parameters to rates, or an "
                      "object with values(variables) and rates(variables)")  # fmt: skip
        rates_of = maps.setdefault(variable, {})
        for pattern, rate in rates.items():
            value = check.number(rate, f"variable '{variable}'", str(pattern), "a finite rate")
            rates_of.update(dict.fromkeys(parameters.matching(pattern), value))
    origin = {name: parameters[name] for rates in maps.values() for name in rates}
    return LinearMap(maps, origin, dict.fromkeys(maps, 0.0))


def _checked(parameters: Parameters, tie: Tie, variables: tuple[str, ...], start: Mapping[str, float]) -> list[str]:
    """The parameters of a tie, after checks of its values and rates."""
    at, who = {name: start[name] for name in variables}, f"variable '{variables[0]}'"
    values, rates = tie.values(at), tie.rates(at)
    for argument, result in (("values", values), ("rates", rates)):
        check.mapping(who, argument, result, f"a mapping, as {argument} of a tie has to be")
    for pattern, value in values.items():
        check.number(value, who, f"values of '{pattern}'")
    affected = [name for pattern in values for name in parameters.matching(pattern)]
    size: dict[str, float] = {}  # of the largest value of each unit
    unit = {name: parameters.entry(name).unit for name in affected}
    for name in affected:
        size[unit[name]] = max(size.get(unit[name], 0.0), abs(parameters[name]))
    for pattern, value in values.items() if hasattr(tie, "start") else ():
        for name in parameters.matching(pattern):  # elsewhere its rotations would be wrong
            if abs(value - parameters[name]) > START_TOLERANCE * size[unit[name]]:
                raise ModelError(f"{who}: where its tie starts, '{name}' is {value:.6g}, and {parameters[name]:.6g} in "
                                 f"the model; make the tie for this model.", element=name, field="ties")  # fmt: skip
    for variable, slopes in rates.items():
        check.known(variable, variables, f"{who}: its tie has rates of '{variable}', which it was not given", "ties",
                    "It was given")  # fmt: skip
        for pattern, rate in slopes.items():
            check.number(rate, f"variable '{variable}'", f"rates of '{pattern}'", "a finite rate")
            for name in parameters.matching(pattern):
                if name not in affected:
                    raise ModelError(f"variable '{variable}': its tie has rates of '{name}', and no values.",
                                     element=name, field="ties")  # fmt: skip
    return affected
