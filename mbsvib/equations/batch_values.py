"""Values of parameters in a batch, with the checks of a single model for every variant."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arguments import shown
from mbsvib.common.expected import reals
from mbsvib.errors import ModelError
from mbsvib.mechanism.changes import Slots, resolved, variant

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Part
    from mbsvib.mechanism.parameters import Parameters

    Mask = NDArray[np.bool_]


# Imaginary steps are this small: their squares are far below rounding, and small units stay far above the least number.
STEP = 2.0**-100


@dataclass(frozen=True, slots=True)
class Values:
    """Values of the parameters that vary, ``by_name`` (n,), and by part and field in ``fields``, with the variants on
    the last axis; ``slots`` are their places in the parts of the nominal model.
    """

    count: int
    by_name: Mapping[str, Array]
    fields: Mapping[str, Mapping[str, Array]]
    slots: Slots

    @staticmethod
    def of(slots: Slots, values: Array) -> Values:
        """Return the values (p, n) of the parameters of ``slots`` without checks."""
        by_name = dict(zip(slots.names, values, strict=True))
        return Values(values.shape[1], by_name, slots.fields(values), slots)

    @property
    def parameters(self) -> Parameters:
        """The parameters of the nominal model."""
        return self.slots.parameters

    @property
    def in_equations(self) -> Values:
        """The values of the parts that replace those of the model in the equations."""
        parts = self.parameters.parts
        return replace(self, fields={name: parts[name].replaced_fields(fields) for name, fields in self.fields.items()})

    def stepping(self, directions: Mapping[str, Array]) -> Values:
        """Return imaginary steps along directions (k,), by name, from all variants, as values of parts in the
        equations: k of each variant, one variant behind the other.
        """
        values = np.array([(array[:, None] + 1j * STEP * directions[name]).reshape(-1)
                           for name, array in self.by_name.items()])  # fmt: skip
        return Values.of(self.slots, values).in_equations

    @property
    def stepped(self) -> bool:
        """Whether values are complex: steps from those of variants that are known, see ``batch_tangents``."""
        return any(np.iscomplexobj(value) for fields in self.fields.values() for value in fields.values())

    def repeated(self, array: Array) -> Array:
        """Return an array that is the same in all variants with an axis of variants in front, to be changed."""
        kinds = [value.dtype for fields in self.fields.values() for value in fields.values()]
        return np.repeat(array[None], self.count, axis=0).astype(np.result_type(array, *kinds), copy=False)

    def part(self, name: str, i: int) -> Part:
        """Return a part of variant ``i``."""
        part = self.parameters.parts[name]
        return variant(part, self.fields[name], i) if name in self.fields else part

    def slice(self, start: int, stop: int) -> Values:
        """Return the variants start..stop."""
        if (start, stop) == (0, self.count):
            return self
        fields = {name: {field: array[..., start:stop] for field, array in arrays.items()}
                  for name, arrays in self.fields.items()}  # fmt: skip
        by_name = {name: array[start:stop] for name, array in self.by_name.items()}
        return Values(min(stop, self.count) - start, by_name, fields, self.slots)

    def suspects(self, name: str) -> list[int]:
        """Return the variants whose values a part might refuse."""
        mask = self.parameters.parts[name].suspects(self.fields[name])
        return np.flatnonzero(np.broadcast_to(mask, (self.count,))).tolist()


def checked(parameters: Parameters, values: Mapping[str, Any]) -> Values:
    """Return the values of a batch, checked as those of a model.

    ``values`` (n,) or (): by name or pattern. The result has arrays of one length.
    """
    if not hasattr(values, "items") or not values:
        raise ModelError(f"values = {shown(values)}; expected a mapping from parameters' names to arrays.",
                         field="values")  # fmt: skip
    arrays: dict[int, Array] = {}
    arrays_by_name: dict[str, Array] = {}
    for name, value in resolved(parameters, values).items():
        if id(value) not in arrays:  # parameters of one pattern share an array
            arrays[id(value)] = _array(name, value, parameters.entry(name).unit)
        arrays_by_name[name] = arrays[id(value)]
    lengths = {name: len(array) for name, array in arrays_by_name.items() if array.ndim}
    count = next(iter(lengths.values()), 1)
    for name, length in lengths.items():
        if length != count or length == 0:
            first = next(iter(lengths))
            raise ModelError(
                f"values['{name}'] has {length} entries" + (
                    f", values['{first}'] has {count}; expected one for each variant." if length != count else
                    "; expected at least one variant."), element=name, field="values",
            )  # fmt: skip
    values_of = np.array([np.broadcast_to(array, (count,)) for array in arrays_by_name.values()])
    values_of.setflags(write=False)
    return with_checked_parts(Values.of(Slots.of(parameters, list(arrays_by_name)), values_of))


def with_checked_parts(values: Values) -> Values:
    """Return the values after every part has accepted its own in all variants."""
    for part in values.fields:
        _check_part(values, part)
    return values


def refused(parameters: Parameters, values: Mapping[str, Any]) -> Mask:
    """Return a mask of the variants with a value that a part refuses, or with a body without mass.

    ``values`` (n,): finite values by name or pattern. Returns (n,): true where a variant is refused.
    """
    arrays_by_name = {name: np.asarray(value, dtype=float) for name, value in resolved(parameters, values).items()}
    result = np.zeros(len(next(iter(arrays_by_name.values()))), dtype=bool)
    slots = Slots.of(parameters, list(arrays_by_name))
    variants = Values.of(slots, np.array(list(arrays_by_name.values())))
    for name, fields in variants.fields.items():
        result |= fields.get("mass", np.ones(1)) == 0.0
        for i in variants.suspects(name):
            try:
                variants.part(name, i)
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
    not_finite = np.flatnonzero(~np.isfinite(array))
    if len(not_finite):
        index = f"[{not_finite[0]}]" if array.ndim else ""
        raise ModelError(
            f"values['{name}']{index} = {array.reshape(-1)[not_finite[0]]}; expected {expected}. NaN and infinity are "
            f"not values a mechanism can have.", element=name, field="values",
        )  # fmt: skip
    array.setflags(write=False)
    return array


def _check_part(values: Values, name: str) -> None:
    """Check every suspect variant of a part by building the part."""
    for i in values.suspects(name):
        try:
            values.part(name, i)
        except ModelError as error:
            own_parameters = [p for p in values.by_name if values.parameters.entry(p).part == name]
            causes = [p for p in own_parameters if values.parameters.entry(p).field == error.field] or own_parameters
            assignments = ", ".join(f"values['{p}'][{i}] = {values.by_name[p][i]:.6g}" for p in causes)
            raise ModelError(f"variant {i}: {assignments}. {error}", element=causes[0], field="values") from error
