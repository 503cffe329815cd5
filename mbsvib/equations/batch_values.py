"""Values of parameters in a batch, with the checks of a single model for every variant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.common.expected import reals
from mbsvib.elements.beam import Beam
from mbsvib.elements.part import Part
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import exponential
from mbsvib.mechanism.changes import FieldsOf, Slots, resolved, variant

if TYPE_CHECKING:
    from mbsvib.mechanism.parameters import Parameters


P = TypeVar("P", bound=Part)

# Imaginary steps are this small: their squares are far below rounding, and small units stay far above the least number.
STEP = 2.0**-100


@dataclass(frozen=True)
class Values:
    """Values of the parameters that vary, ``by_name`` (n,), and by part and field in ``fields``, with the variants on
    the last axis; ``slots`` are their places in the parts of the nominal model.

    ``numbers`` (rows, n) are all numbers of the parts that they change; ``index`` has their rows by part and field,
    those of the model or of the parts that replace them in the equations. ``displacements`` (n,) are those of joint
    coordinates that vary as well, by name [m, rad].
    """

    numbers: Array
    slots: Slots
    index: Mapping[str, Mapping[str, Index]]
    displacements: Mapping[str, Array] = field(default_factory=dict)

    @staticmethod
    def of(slots: Slots, values: Array) -> Values:
        """Return the values (p, n) of the parameters of ``slots`` without checks."""
        numbers = slots.numbers(values)
        numbers.setflags(write=False)
        return Values(numbers, slots, slots.index)

    @property
    def count(self) -> int:
        """Number of variants, n."""
        return len(self.numbers[0])

    @property
    def parameters(self) -> Parameters:
        """The parameters of the nominal model."""
        return self.slots.parameters

    @cached_property
    def by_name(self) -> Mapping[str, Array]:
        """Values (n,) of the parameters, by name."""
        return dict(zip(self.slots.names, self.numbers[self.slots.rows], strict=True))

    @property
    def fields(self) -> Mapping[str, Mapping[str, Array]]:
        """Complete fields by part and name, with the variants on the last axis."""
        return FieldsOf(self.numbers, self.index)

    @cached_property
    def rotations(self) -> Array:
        """The rotations (n, k, 3, 3) of the parts whose orientations vary, ``slots.turning`` numbers them."""
        return exponential(self.numbers[self.slots.turns].transpose(2, 1, 0))

    @cached_property
    def beams(self) -> Mapping[str, Beam]:
        """The beams and flexures whose numbers vary, with arrays of all variants, by name."""
        parts = {name: self.parameters.parts[name] for name in self.slots.index}
        return {name: part.of_variants(self.fields[name]) for name, part in parts.items() if isinstance(part, Beam)}

    @property
    def in_equations(self) -> Values:
        """The values of the parts that replace those of the model in the equations."""
        return Values(self.slots.with_places(self.numbers), self.slots, self.slots.replaced, self.displacements)

    def stepping(self, directions: Mapping[str, Array]) -> Values:
        """Return imaginary steps along directions (k,), by name, from all variants, as values of parts in the
        equations: k of each variant, one variant behind the other.
        """
        names = (*self.slots.names, *self.displacements)
        rates = np.array([directions[name] for name in names])
        before = np.array([*self.numbers[self.slots.rows], *self.displacements.values()])
        values: Any = (before[:, :, None] + 1j * STEP * rates[:, None]).reshape(len(names), -1)
        count = len(self.slots.names)
        displacements = dict(zip(self.displacements, values[count:], strict=True))
        return replace(Values.of(self.slots, values[:count]), displacements=displacements).in_equations

    @property
    def stepped(self) -> bool:
        """Whether values are complex: steps from those of variants that are known, see ``batch_tangents``."""
        return self.numbers.dtype.kind == "c"

    def repeated(self, array: Array) -> Array:
        """Return an array that is the same in all variants with an axis of variants in front, to be changed."""
        result = np.empty((self.count, *array.shape), np.result_type(array, self.numbers))
        result[:] = array
        return result

    def of_variant(self, part: P, i: int) -> P:
        """Return a part as it is in variant ``i``; also parts of the equations that no parameter changes."""
        if part.name not in self.slots.index or type(part) is not type(self.parameters.parts[part.name]):
            return part  # the node of a connection has joints of its name
        return variant(part, self.fields[part.name], i)

    def slice(self, start: int, stop: int) -> Values:
        """Return the variants start..stop."""
        if (start, stop) == (0, self.count):
            return self
        displacements = {name: array[start:stop] for name, array in self.displacements.items()}
        return Values(self.numbers[:, start:stop], self.slots, self.index, displacements)


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
    for part, suspects in values.slots.suspects(values.numbers).items():
        for i in suspects:
            _check(values, part, i)
    return values


def refused(parameters: Parameters, values: Mapping[str, Any]) -> Bools:
    """Return a mask of the variants with a value that a part refuses, or with a body without mass.

    ``values`` (n,): finite values by name or pattern. Returns (n,): true where a variant is refused.
    """
    arrays_by_name = {name: np.asarray(value, dtype=float) for name, value in resolved(parameters, values).items()}
    result = np.zeros(len(next(iter(arrays_by_name.values()))), dtype=bool)
    slots = Slots.of(parameters, list(arrays_by_name))
    variants = Values.of(slots, np.array(list(arrays_by_name.values())))
    suspects = slots.suspects(variants.numbers)
    for name, fields in variants.fields.items():
        result |= fields.get("mass", np.ones(1)) == 0.0
        for i in suspects.get(name, ()):
            try:
                variants.of_variant(variants.parameters.parts[name], i)
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


def _check(values: Values, name: str, i: int) -> None:
    """Check a suspect variant of a part by building the part."""
    try:
        values.of_variant(values.parameters.parts[name], i)
    except ModelError as error:
        own_parameters = [p for p in values.by_name if values.parameters.entry(p).part == name]
        causes = [p for p in own_parameters if values.parameters.entry(p).field == error.field] or own_parameters
        assignments = ", ".join(f"values['{p}'][{i}] = {values.by_name[p][i]:.6g}" for p in causes)
        raise ModelError(f"variant {i}: {assignments}. {error}", element=causes[0], field="values") from error
