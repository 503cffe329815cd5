"""Parts with other values of some of their parameters, for one variant or many."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Index
from mbsvib.elements.part import Part
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import jacobian

if TYPE_CHECKING:
    from mbsvib.mechanism.parameters import Parameters


P = TypeVar("P", bound=Part)

_TURN, _AXES = ".orientation.", ("rx", "ry", "rz")
# Fields by which connections have a row, or none.
COEFFICIENTS = ("stiffness", "damping", "inertance", "static_stiffness")


def parts_with(parameters: Parameters, values: Mapping[str, Any]) -> dict[str, Part]:
    """Return the parts that some values change; they are checked like new parts.

    Values are by name or pattern; names have precedence.
    """
    arrays = {}
    for name, value in resolved(parameters, values).items():
        expected = f"a finite number [{parameters.entry(name).unit}]"
        arrays[name] = np.array([check.number(value, f"parameter '{name}'", "value", expected)])
    slots = Slots.of(parameters, list(arrays))
    fields = FieldsOf(slots.numbers(np.array(list(arrays.values())).reshape(-1, 1)), slots.index)
    return {name: variant(parameters.parts[name], fields[name], 0) for name in fields}


def resolved(parameters: Parameters, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the value of every parameter that is named or matches a pattern, by name.

    A name has precedence over patterns that match it; values are not checked.
    """
    check.mapping("values", "values", values, "a mapping of parameters to values, {'body.mass': 1.0}", empty=True)
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


@dataclass(frozen=True)
class Slots:
    """Places of the parameters ``names`` (p,) among the numbers of the parts that they change.

    ``index`` has the rows of each field that varies, by part and field, in the shape of the field: (), (3,) ...;
    ``others`` those of constant fields that go with them: with a point all points of a part, with a coefficient all
    coefficients. ``nominal`` (rows,) are all these numbers as they are, behind a zero in the row 0. Values of the
    parameters ``source`` (k,) are the numbers in the rows ``target`` (k,).
    """

    parameters: Parameters
    names: tuple[str, ...]
    index: Mapping[str, Mapping[str, Index]]
    others: Mapping[str, Mapping[str, Index]]
    nominal: Array
    target: Index
    source: Index

    @staticmethod
    def of(parameters: Parameters, names: Sequence[str]) -> Slots:
        """Return the places of parameters."""
        index: dict[str, dict[str, Index]] = {}
        others: dict[str, dict[str, Index]] = {}
        numbers, target, source = [0.0], [], []

        def rows_of(fields: dict[str, Index], part: Part, field: str) -> Index:
            if field not in fields:
                value = np.array(_value(part, field), dtype=float)
                fields[field] = len(numbers) + np.arange(value.size).reshape(value.shape)
                numbers.extend(value.reshape(-1).tolist())
            return fields[field]

        for k, name in enumerate(names):
            entry = parameters.entry(name)
            rows = rows_of(index.setdefault(entry.part, {}), parameters.parts[entry.part], entry.field)
            places = {entry.index, entry.index[::-1]} if entry.is_pair else {entry.index}
            target += [int(rows[place]) for place in places]
            source += [k] * len(places)
        for name, fields in index.items():
            part = parameters.parts[name]
            known = {item.name for item in part.parameter_fields()}
            for group in (part.point_fields, COEFFICIENTS):
                for field in known.intersection(group) - fields.keys() if fields.keys() & set(group) else ():
                    rows_of(others.setdefault(name, {}), part, field)
        return Slots(parameters, tuple(names), index, others, np.array(numbers), np.array(target, dtype=np.intp),
                     np.array(source, dtype=np.intp))  # fmt: skip

    @cached_property
    def replaced(self) -> Mapping[str, Mapping[str, Index]]:
        """The same as ``index``, by the fields of the parts that replace those of the model in the equations."""
        return {name: self._replaced(name, fields) for name, fields in self.index.items()} | dict(self.places)

    @cached_property
    def places(self) -> Mapping[str, Mapping[str, Index]]:
        """Rows of the points and turns of parts that follow varied ones, by part and field; behind the model's own."""
        rows, result = len(self.nominal), {}
        for name, fields in self._places(self.nominal[:, None]).items():
            result[name] = {field: rows + 3 * k + np.arange(3) for k, field in enumerate(fields)}
            rows += 3 * len(fields)
        return result

    def _places(self, numbers: Array) -> dict[str, dict[str, Array]]:
        """Points and turns (3, n) of parts that follow those that vary, of numbers (rows, n)."""
        result: dict[str, dict[str, Array]] = {}
        for name, fields in FieldsOf(numbers, self.index).items():
            result |= self.parameters.parts[name].replaced_places(fields)
        return result

    def with_places(self, numbers: Array) -> Array:
        """Return numbers (rows, n) with those of the ``places`` behind them."""
        if not self.places:
            return numbers
        places = [array for fields in self._places(numbers).values() for array in fields.values()]
        return np.concatenate((numbers, *places))

    @cached_property
    def complete(self) -> Mapping[str, Mapping[str, Index]]:
        """The same as ``replaced``, with the constant fields that go with those that vary."""
        return {name: {**(self._replaced(name, self.others[name]) if name in self.others else {}), **fields}
                for name, fields in self.replaced.items()}  # fmt: skip

    @cached_property
    def turning(self) -> Mapping[str, int]:
        """Numbers of the parts in the equations whose orientations vary, by name."""
        return {name: k for k, name in enumerate(
            [name for name, fields in self.replaced.items() if "orientation" in fields])}  # fmt: skip

    @cached_property
    def turns(self) -> Index:
        """Rows (3, k) of the rotation vectors of these parts."""
        rows = [self.replaced[name]["orientation"] for name in self.turning]
        return np.array(rows, dtype=np.intp).reshape(-1, 3).T

    def _replaced(self, name: str, fields: Mapping[str, Index]) -> dict[str, Index]:
        with_axis: Any = {field: np.asarray(rows)[..., None] for field, rows in fields.items()}
        replaced = self.parameters.parts[name].replaced_fields(with_axis)
        return {field: rows[..., 0].astype(np.intp) for field, rows in replaced.items()}

    @cached_property
    def _checks(self) -> tuple[Index, tuple[str, ...], tuple[_Alike, ...], tuple[str, ...]]:
        """Rows (k,) of numbers that the parts (k,), by name, accept with the sign of the model's, other parts that are
        checked by their roles, many at once, and those with checks of their own.

        What a part accepts of its ``signed_fields`` depends on no more than the signs of their numbers.
        """
        rows: list[int] = []
        owners: list[str] = []
        alike: dict[Any, list[str]] = {}
        others = []
        for name, fields in self.index.items():
            part = self.parameters.parts[name]
            if fields.keys() <= part.signed_fields:
                for numbers in fields.values():
                    rows += numbers.reshape(-1).tolist()
                    owners += [name] * numbers.size
            elif type(part).suspects is Part.suspects:
                shapes = [tuple((field, at.shape) for field, at in own.items())
                          for own in (fields, self.others.get(name, {}))]  # fmt: skip
                alike.setdefault((type(part), *shapes), []).append(name)
            else:
                others.append(name)
        groups = tuple([_Alike.of(self, kind, tuple(names)) for (kind, *_), names in alike.items()])
        return np.array(rows, dtype=np.intp), tuple(owners), groups, tuple(others)

    def suspects(self, numbers: Array) -> dict[str, list[int]]:
        """Return the variants whose numbers (rows, n) a part might refuse, by the names of such parts."""
        rows, owners, groups, others = self._checks
        other = (np.sign(numbers[rows]) != np.sign(self.nominal[rows, None])).any(axis=1)
        result: dict[str, list[int]] = {}
        for name in (*others, *dict.fromkeys(owners[k] for k in other.nonzero()[0].tolist())):
            fields = {field: numbers[at] for field, at in self.index[name].items()}
            mask = np.broadcast_to(self.parameters.parts[name].suspects(fields), numbers.shape[1:])
            result[name] = mask.nonzero()[0].tolist()
        for group in groups:
            for name, mask in group.suspects(numbers):
                result[name] = mask.nonzero()[0].tolist()
        return result

    def rescales(self, name: str) -> bool:
        """Tell whether numbers of a part vary that are not zero, and are no entries of matrices."""
        fields = self.index[name].values()
        varied = [rows[np.isin(rows, self.target)] for rows in fields]
        return all(rows.ndim < 2 for rows in fields) and all(self.nominal[rows].all() for rows in varied)

    @cached_property
    def rows(self) -> Index:
        """A row (p,) of each parameter."""
        result = np.zeros(len(self.names), dtype=np.intp)
        result[self.source] = self.target
        return result

    def numbers(self, values: Array) -> Array:
        """Return all numbers (rows, n) for values (p, n)."""
        result = np.empty((len(self.nominal), values.shape[1]), values.dtype)
        result[:] = self.nominal[:, None]
        result[self.target] = values[self.source]
        return result


@dataclass(frozen=True, slots=True)
class _Alike:
    """Parts of one ``kind``, by ``names`` (k,), in which the same fields vary: the ``rows`` (..., k) of their numbers,
    and ``nominal`` values (..., k, 1), also of constant fields that go with them.
    """

    kind: type[Part]
    names: tuple[str, ...]
    rows: Mapping[str, Index]
    nominal: Mapping[str, Array]

    @staticmethod
    def of(slots: Slots, kind: type[Part], names: tuple[str, ...]) -> _Alike:
        def stacked(index: Mapping[str, Mapping[str, Index]]) -> dict[str, Index]:
            fields = index.get(names[0], {})
            return {field: np.stack([index[name][field] for name in names], axis=-1) for field in fields}

        rows, others = stacked(slots.index), stacked(slots.others)
        nominal = {field: slots.nominal[at][..., None] for field, at in (rows | others).items()}
        return _Alike(kind, names, rows, nominal)

    def suspects(self, numbers: Array) -> list[tuple[str, Any]]:
        """Return masks of the variants whose numbers (rows, n) some of the parts might refuse, by name."""
        values = {field: numbers[at] for field, at in self.rows.items()}
        mask = np.broadcast_to(self.kind.suspects_among(values, self.nominal), (len(self.names), numbers.shape[1]))
        return [(self.names[k], mask[k]) for k in np.flatnonzero(mask.any(axis=1)).tolist()]


@dataclass(frozen=True, slots=True)
class FieldsOf(Mapping[str, Mapping[str, Any]]):
    """Complete fields of parts in which some entries have new values, by part and field: ``numbers`` (rows, n) in the
    rows that ``index`` has, as in ``Slots``.

    The last axis of fields is that of the values (position: (3, n)); orientations are rotation vectors from the present
    pose.
    """

    numbers: Array
    index: Mapping[str, Mapping[str, Index]]

    def __getitem__(self, part: str) -> dict[str, Array]:
        return {field: self.numbers[rows] for field, rows in self.index[part].items()}

    def __contains__(self, part: object) -> bool:
        return part in self.index

    def __iter__(self) -> Iterator[str]:
        return iter(self.index)

    def __len__(self) -> int:
        return len(self.index)


def variant(part: P, fields: Mapping[str, Array], i: int) -> P:
    """Return a part with other values, checked like a new part.

    ``fields`` are those of ``FieldsOf``, ``i`` is the index along their last axis.
    """
    return part.with_values({field: _plain(array[..., i]) for field, array in fields.items()})


def to_angular_velocities(rates: Iterable[dict[str, float]], values: Mapping[str, Any]) -> None:
    """Replace, in place, rates of rotation vectors from the nominal axes by angular velocities, which are the rates of
    the orientations of parts that have the ``values``; each of the ``rates`` by name, as the values.
    """
    vectors: dict[str, Array] = {}
    for name, value in values.items():
        part, separator, axis = name.rpartition(_TURN)
        if separator and value:
            vectors.setdefault(part, np.zeros(3))[_AXES.index(axis)] = value
    for part, vector in vectors.items():
        matrix, names = jacobian(vector), [f"{part}{_TURN}{axis}" for axis in _AXES]
        for slopes in rates:
            if not slopes.keys().isdisjoint(names):
                rate = np.array([slopes.get(name, 0.0) for name in names])
                slopes.update(zip(names, (matrix @ rate).tolist(), strict=True))


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
