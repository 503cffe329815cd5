"""Values: what varies in a batch, checked as if every variant had been built by itself."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arguments import shown
from mbsvib.common.expected import reals
from mbsvib.elements import Body, Bushing, Spring
from mbsvib.elements.body import TRIANGLE_SLACK
from mbsvib.elements.coupler import Coupling
from mbsvib.errors import ModelError
from mbsvib.mechanism.changes import changed_fields, resolved, variant

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Part
    from mbsvib.mechanism.parameters import Parameters

    Mask = NDArray[np.bool_]

# Which variants are looked at one by one is decided with this much to spare, so that no rounding lets one slip by.
SPARE = 0.9


@dataclass(frozen=True, slots=True)
class Values:
    """Values of the parameters that vary, ``by_name`` (n,), and the ``fields`` of parts that hold them, components
    first and variants last; ``parameters`` are those of the model as it is.
    """

    count: int
    by_name: Mapping[str, Array]
    fields: Mapping[str, Mapping[str, Array]]
    parameters: Parameters

    def part(self, name: str, i: int) -> Part:
        """Return a part as variant ``i`` has it."""
        part = self.parameters.parts[name]
        return variant(part, self.fields[name], i) if name in self.fields else part

    def slice(self, start: int, stop: int) -> Values:
        """Return the variants start..stop."""
        if (start, stop) == (0, self.count):
            return self
        fields = {name: {field: array[..., start:stop] for field, array in whole.items()}
                  for name, whole in self.fields.items()}  # fmt: skip
        by_name = {name: array[start:stop] for name, array in self.by_name.items()}
        return Values(min(stop, self.count) - start, by_name, fields, self.parameters)

    def varies(self, kinds: tuple[type, ...], *fields: str) -> bool:
        """Tell whether a part of one of the kinds varies in one of the fields, or in any if none is named."""
        return any(
            isinstance(self.parameters.parts[name], kinds) and (not fields or any(field in whole for field in fields))
            for name, whole in self.fields.items()
        )


def checked(parameters: Parameters, values: Mapping[str, Any]) -> Values:
    """Return the values of a batch, each through the checks that a model's values go through.

    Parameters
    ----------
    parameters : Parameters
        Those of the model.
    values : mapping of str to array-like, shape (n,) or ()
        By name or pattern.

    Returns
    -------
    Values
        Arrays of one length.

    Raises
    ------
    ModelError
        If a parameter is unknown, an array has another length or shape, or a value is refused: with the parameter
        and the index of the variant.
    """
    if not hasattr(values, "items") or not values:
        raise ModelError(f"values = {shown(values)}; expected a mapping from parameters' names to arrays.",
                         field="values")  # fmt: skip
    arrays: dict[int, Array] = {}
    given: dict[str, Array] = {}
    for name, value in resolved(parameters, values).items():
        if id(value) not in arrays:  # what a pattern ties is looked at once
            arrays[id(value)] = _array(name, value, parameters.entry(name).unit)
        given[name] = arrays[id(value)]
    lengths = {name: len(array) for name, array in given.items() if array.ndim}
    count = next(iter(lengths.values()), 1)
    for name, length in lengths.items():
        if length != count or length == 0:
            other = next(iter(lengths))
            raise ModelError(
                f"values['{name}'] has {length} entries" + (
                    f", values['{other}'] has {count}; expected one for each variant." if length != count else
                    "; expected at least one variant."), element=name, field="values",
            )  # fmt: skip
    by_name = {name: np.broadcast_to(array, (count,)) for name, array in given.items()}
    result = Values(count, by_name, changed_fields(parameters, by_name), parameters)
    for part, whole in result.fields.items():
        _check_part(result, part, whole)
    return result


def refused(parameters: Parameters, values: Mapping[str, Any]) -> Mask:
    """Tell which variants have a value that a part refuses, or a body without mass, so that the others can be taken.

    Parameters
    ----------
    parameters : Parameters
        Those of the model.
    values : mapping of str to array, shape (n,)
        Finite values by name or pattern.

    Returns
    -------
    array, shape (n,)
        True where a variant is refused.
    """
    given = {name: np.asarray(value, dtype=float) for name, value in resolved(parameters, values).items()}
    result = np.zeros(len(next(iter(given.values()))), dtype=bool)
    for name, whole in changed_fields(parameters, given).items():
        part = parameters.parts[name]
        for i in np.flatnonzero(_suspects(part, whole) & ~result).tolist():
            try:
                changed = variant(part, whole, i)
                result[i] = isinstance(changed, Body) and changed.mass == 0.0
            except ModelError:
                result[i] = True
    return result


def _array(name: str, value: Any, unit: str) -> Array:
    expected = f"a number or a vector of numbers [{unit}]"
    array = reals(value, "linearize", f"values['{name}']", expected,
                  partial(ModelError, element=name, field="values")).copy()  # fmt: skip
    if array.ndim > 1:
        raise ModelError(f"values['{name}'] has shape {array.shape}; expected {expected}, one for each variant.",
                         element=name, field="values")  # fmt: skip
    wrong = np.flatnonzero(~np.isfinite(array))
    if len(wrong):
        at = f"[{wrong[0]}]" if array.ndim else ""
        raise ModelError(
            f"values['{name}']{at} = {array.reshape(-1)[wrong[0]]}; expected {expected}. NaN and infinity are not "
            f"values a mechanism can have.", element=name, field="values",
        )  # fmt: skip
    array.setflags(write=False)
    return array


def _check_part(values: Values, name: str, whole: Mapping[str, Array]) -> None:
    """Send every variant of a part that may be refused through the checks of the part itself."""
    for i in np.flatnonzero(_suspects(values.parameters.parts[name], whole)).tolist():
        try:
            values.part(name, i)
        except ModelError as error:
            of_part = [p for p in values.by_name if values.parameters.entry(p).part == name]
            blamed = [p for p in of_part if values.parameters.entry(p).field == error.field] or of_part
            said = ", ".join(f"values['{p}'][{i}] = {values.by_name[p][i]:.6g}" for p in blamed)
            raise ModelError(f"variant {i}: {said}. {error}", element=blamed[0], field="values") from error


def _suspects(part: Part, whole: Mapping[str, Array]) -> Mask:
    count = next(iter(whole.values())).shape[-1]
    result = np.zeros(count, dtype=bool)
    if isinstance(part, Body):
        if "mass" in whole:
            result |= ~(whole["mass"] > 0.0)
        if "inertia" in whole:
            tensor = whole["inertia"][[0, 3, 4, 3, 1, 5, 4, 5, 2]].T.reshape(-1, 3, 3)
            low, middle, high = np.linalg.eigvalsh(tensor).T
            slack = SPARE * TRIANGLE_SLACK * np.maximum(high, -low)
            # a diagonal tensor may not have the least negative moment
            result |= (low < -slack) | (low + middle < high - slack) | (whole["inertia"][:3] < 0.0).any(axis=0)
    elif isinstance(part, Spring):
        ends = [whole.get(field, np.array(getattr(part, field))[:, None]) for field in ("start", "end")]
        gap = np.abs(ends[1] - ends[0])
        result |= ~gap.any(axis=0) | ~np.isfinite(gap).all(axis=0)
        result |= (whole.get("stiffness", part.stiffness) == 0.0) & (whole.get("damping", part.damping) == 0.0)
    elif isinstance(part, Coupling):
        for array in whole.values():
            result |= (array.reshape(-1, count) == 0.0).any(axis=0)
    elif isinstance(part, Bushing):
        acts = np.zeros(count, dtype=bool)
        for field in ("stiffness", "damping"):
            value = whole.get(field, np.array(getattr(part, field))[..., None])
            acts |= value.reshape(-1, value.shape[-1]).any(axis=0)
        result |= ~acts
    return result
