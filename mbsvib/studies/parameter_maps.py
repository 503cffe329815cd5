"""Ties: parameters as functions of variables, with their derivatives; linear maps are the simplest of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import Mapping


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
