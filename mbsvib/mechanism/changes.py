"""Parts with other values of some of their parameters, for one variant or many."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Part
    from mbsvib.mechanism.parameters import Parameters


def parts_with(parameters: Parameters, values: Mapping[str, Any]) -> dict[str, Part]:
    """Return the parts that some values change; they are checked like new parts.

    Values are by name or pattern; names have precedence.
    """
    arrays = {}
    for name, value in resolved(parameters, values).items():
        expected = f"a finite number [{parameters.entry(name).unit}]"
        arrays[name] = np.array([check.number(value, f"parameter '{name}'", "value", expected)])
    fields = Slots.of(parameters, list(arrays)).fields(np.array(list(arrays.values())).reshape(-1, 1))
    return {name: variant(parameters.parts[name], fields[name], 0) for name in fields}


def resolved(parameters: Parameters, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the value of every parameter that is named or matches a pattern, by name.

    A name has precedence over patterns that match it; values are not checked.
    """
    if not isinstance(values, Mapping):
        raise check.refuse("values", "values", values, "a mapping of parameters to values, {'body.mass': 1.0}")
    result: dict[str, Any] = {}
    pattern_of: dict[str, str] = {}
    for pattern, value in values.items():
        for name in parameters.matching(pattern):
            if name == pattern:
                pattern_of[name] = name
            elif name in values:
                continue
            elif name in pattern_of:
                raise ModelError(f"values: both '{pattern_of[name]}' and '{pattern}' match '{name}'; name it by itself "
                                 f"too, which goes before patterns.", element=name, field="values")  # fmt: skip
            else:
                pattern_of[name] = pattern
            result[name] = value
    return result


@dataclass(frozen=True, slots=True)
class Slots:
    """Places of the parameters ``names`` (p,) in the fields of parts: of each field its present value, and the places
    of new entries in it with their numbers among the parameters.
    """

    parameters: Parameters
    names: tuple[str, ...]
    places: tuple[tuple[str, str, Array, tuple[tuple[tuple[int, ...], int], ...]], ...]

    @staticmethod
    def of(parameters: Parameters, names: Sequence[str]) -> Slots:
        """Return the places of parameters."""
        places: dict[tuple[str, str], list[tuple[tuple[int, ...], int]]] = {}
        for k, name in enumerate(names):
            entry = parameters.entry(name)
            place = places.setdefault((entry.part, entry.field), [])
            place.append((entry.index, k))
            if entry.is_pair:
                place.append((entry.index[::-1], k))
        return Slots(parameters, tuple(names), tuple([
            (part, field, np.array(_value(parameters.parts[part], field), dtype=float), tuple(entries))
            for (part, field), entries in places.items()]))  # fmt: skip

    def fields(self, values: Array) -> dict[str, dict[str, Array]]:
        """Return the complete fields of parts in which some entries have new values, by part and field.

        ``values`` (p, n). The last axis of fields is that of the values (position: (3, n)); orientations are rotation
        vectors from the present pose.
        """
        result: dict[str, dict[str, Array]] = {}
        for part, field, start, entries in self.places:
            array = np.repeat(start[..., None], values.shape[1], axis=-1).astype(values.dtype, copy=False)
            for index, k in entries:
                array[index] = values[k]
            result.setdefault(part, {})[field] = array
        return result


def variant(part: Part, fields: Mapping[str, Array], i: int) -> Part:
    """Return a part with other values, checked like a new part.

    ``fields`` are those of ``Slots``, ``i`` is the index along their last axis.
    """
    return part.with_values({field: _plain(array[..., i]) for field, array in fields.items()})


def _plain(array: Array) -> Any:
    """Numbers as floats and tuples, the types of the fields of parts."""
    items = array.tolist()
    if array.ndim < 2:
        return tuple(items) if array.ndim else items
    return tuple([tuple(row) for row in items])


def scale_of(parameters: Parameters, name: str) -> float:
    """Return the scale of a parameter: its own value, or the largest entry of its field.

    It is 1 where all entries are 0, and for orientations, which have no size.
    """
    entry = parameters.entry(name)
    if entry.value or entry.field == "orientation":
        return abs(entry.value) or 1.0
    return float(np.abs(np.array(_value(parameters.parts[entry.part], entry.field))).max()) or 1.0


def _value(part: Part, field: str) -> Any:
    return next(item.value for item in part.parameter_fields() if item.name == field)
