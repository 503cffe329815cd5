"""Variables: one or several parameters that change together, by name, pattern or linear map."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import accumulate, chain, combinations_with_replacement, product
from math import prod
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Index
from mbsvib.elements.part import Part
from mbsvib.errors import ModelError
from mbsvib.mechanism.parameters import Parameter, Parameters

Mask = NDArray[np.bool_]
Requested = str | Iterable[str] | Mapping[str, Mapping[str, float]] | None


T = TypeVar("T")
# Numbers of the entries of symmetric 6x6 matrices, each pair once.
_COLUMN: dict[tuple[int, ...], int] = {(i, j): n for n, (i, j) in enumerate(combinations_with_replacement(range(6), 2))}


class ListedLater(Sequence[T]):
    """A ``count`` of entries, which are listed when one is requested."""

    def __init__(self, count: int, listed: Callable[[], Sequence[T]]) -> None:
        self._count, self._listed = count, listed

    @cached_property
    def _entries(self) -> Sequence[T]:
        return self._listed()

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, k: Any) -> Any:
        return self._entries[k]


@dataclass(frozen=True, eq=False)
class PartFields:
    """The fields of a part whose numbers are parameters: name, number of indices, first entry and number of entries of
    each, and the number of all entries, ``width``. Equal ones are the same object.
    """

    fields: tuple[tuple[str, int, int, int], ...]
    width: int


@lru_cache(maxsize=1024)
def _part_fields(*shapes: tuple[str, int, int]) -> PartFields:
    ends = list(accumulate((count for *_, count in shapes), initial=0))
    fields = [(name, depth, start, count) for (name, depth, count), start in zip(shapes, ends, strict=False)]
    return PartFields(tuple(fields), ends[-1])


def fields_of(part: Part) -> PartFields:
    """Return the fields of a part whose numbers are parameters."""
    shapes = []
    for field in part.parameter_fields():
        if field.suffixes is None:
            shapes.append((field.name, 0, 1))
        elif isinstance(field.value[0], tuple):
            shapes.append((field.name, 2, len(_COLUMN) if field.is_symmetric else 36))
        else:
            shapes.append((field.name, 1, len(field.suffixes)))
    return _part_fields(*shapes)


@lru_cache(maxsize=64)
def indices(depth: int, count: int) -> list[tuple[int, ...]]:
    """Return the indices of the ``count`` entries of a field, row by row."""
    if depth < 2:
        return [(i,) if depth else () for i in range(count)]
    return list(_COLUMN) if count == len(_COLUMN) else list(product(range(6), repeat=2))


def _entry(index: tuple[int, ...], count: int) -> int:
    """The place of an entry among the ``count`` ones of its field, row by row."""
    if len(index) == 2:
        return _COLUMN[index] if count == len(_COLUMN) else 6 * index[0] + index[1]
    return index[0] if index else 0


@dataclass(frozen=True, slots=True)
class FieldLayout:
    """The numbers of some parts that are parameters, part after part: the ``names`` of these and the ``fields`` of
    each.

    Entry e is the parameter ``number[e]``, -1 for none; where ``number`` is None, the entries are the parameters, one
    by one.
    """

    names: list[str]
    fields: list[PartFields]
    number: Index | None

    @staticmethod
    def of(parts: Iterable[Part]) -> FieldLayout:
        """Return the layout in which all numbers of some parts are parameters, one after the other."""
        named = [(part.name, fields_of(part)) for part in parts]
        return FieldLayout([name for name, _ in named], [fields for _, fields in named], None)

    @property
    def starts(self) -> list[int]:
        """The first entry of each part, and the number of entries behind them."""
        return list(accumulate([fields.width for fields in self.fields], initial=0))

    def picked(self, parameters: Sequence[Parameter]) -> FieldLayout:
        """Return the same fields with some of their entries as parameters."""
        starts = self.starts
        start = {(name, field): (first + shift, count)
                 for name, fields, first in zip(self.names, self.fields, starts, strict=False)
                 for field, _, shift, count in fields.fields}  # fmt: skip
        number = np.full(starts[-1], -1, dtype=np.intp)
        for k, entry in enumerate(parameters):
            first, count = start[entry.part, entry.field]
            number[first + _entry(entry.index, count)] = k
        return FieldLayout(self.names, self.fields, number)

    def keys(self) -> Iterator[tuple[str, str, tuple[int, ...]]]:
        """Yield part, field and index of every entry."""
        for name, fields in zip(self.names, self.fields, strict=True):
            for field, depth, _, count in fields.fields:
                yield from [(name, field, index) for index in indices(depth, count)]

    def of_parameters(self, values: Sequence[Sequence[bool]]) -> Mask:
        """Return values of the entries of each part as one of each parameter."""
        flat = np.array(list(chain.from_iterable(values)), dtype=np.bool_)
        if self.number is None:
            return flat
        result = np.empty(int(self.number.max(initial=-1)) + 1, dtype=np.bool_)
        result[self.number[self.number >= 0]] = flat[self.number >= 0]
        return result

    def only(self, which: Mask) -> FieldLayout:
        """Return the layout with only some of the parameters, numbered as before."""
        number = np.arange(len(which)) if self.number is None else self.number
        return FieldLayout(self.names, self.fields, np.where((number >= 0) & which[number], number, -1))


@dataclass(frozen=True, slots=True)
class Direction:
    """Parameters by name that change together, each at its rate, under the name of the variable that does it."""

    name: str
    rates: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Variables:
    """Variables by ``names`` that move some ``parameters`` of the ``parts``.

    Term t moves the parameter numbered ``parameter`` (t,) with the ``variable`` (t,), at a ``rate`` (t,); numbers
    behind the last of the parameters are those of ``directions``. ``every`` is the layout of all parameters where these
    are the variables, one by one.
    """

    names: Sequence[str]
    parameters: Sequence[Parameter]
    parts: Mapping[str, Part]
    variable: Index
    parameter: Index
    rate: Array
    directions: tuple[Direction, ...] = ()
    every: FieldLayout | None = None

    @cached_property
    def layout(self) -> FieldLayout:
        """The parameters by the fields of their parts."""
        if self.every is not None:
            return self.every
        parts = dict.fromkeys(entry.part for entry in self.parameters)
        return FieldLayout.of([self.parts[name] for name in parts]).picked(self.parameters)

    @cached_property
    def identity(self) -> bool:
        """Whether variables are parameters, one by one."""
        every = np.arange(len(self.names))
        return self.every is not None or (
            not self.directions and len(self.parameters) == len(self.rate) == len(every) and bool(
                (self.rate == 1.0).all() and (self.parameter == every).all() and (self.variable == every).all())
        )

    @cached_property
    def rates(self) -> csr_array | None:
        """How variables move parameters and directions, (variables, parameters); None: they are the parameters."""
        if self.identity:
            return None
        count = len(self.parameters) + len(self.directions)
        return csr_array((self.rate, (self.variable, self.parameter)), shape=(len(self.names), count))

    def among(self, every: Sequence[Parameter]) -> Variables:
        """Return the same variables with more parameters than they move, ``every`` one there is."""
        if self.every is not None:
            return self
        number_of = {entry.name: k for k, entry in enumerate(every)}
        number = np.array([number_of[entry.name] for entry in self.parameters], dtype=np.intp)
        return Variables(self.names, every, self.parts, self.variable, number[self.parameter], self.rate)

    def as_directions(self) -> tuple[Direction, ...]:
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

        ``together`` (parameters,): which parameters. Returns the others, then one direction for each variable that
        moves any of these.
        """
        separate = np.flatnonzero(~together)
        number_of = np.full(len(together), -1)
        number_of[separate] = np.arange(len(separate))
        directions: list[Direction] = []
        merged = together[self.parameter]
        terms = list(zip(self.variable[~merged].tolist(), number_of[self.parameter[~merged]].tolist(),
                         self.rate[~merged].tolist(), strict=True))  # fmt: skip
        rates: dict[int, dict[str, float]] = {}
        for v, p, rate in zip(self.variable[merged].tolist(), self.parameter[merged].tolist(),
                              self.rate[merged].tolist(), strict=True):  # fmt: skip
            rates_of, name = rates.setdefault(v, {}), self.parameters[p].name
            rates_of[name] = rates_of.get(name, 0.0) + rate
        for v, rates_of in rates.items():
            moved = tuple((name, rate) for name, rate in rates_of.items() if rate)
            if moved:
                terms.append((v, len(separate) + len(directions), 1.0))
                directions.append(Direction(self.names[v], moved))
        table = np.array(terms, dtype=float).reshape(-1, 3)
        return Variables(
            self.names, tuple(self.parameters[k] for k in separate.tolist()), self.parts, table[:, 0].astype(np.intp),
            table[:, 1].astype(np.intp), table[:, 2], tuple(directions),
        )

    def chain(self, values: Any) -> Any:
        """Turn derivatives to the parameters (parameters, ...) into those to the variables (variables, ...)."""
        rates = self.rates
        if rates is None:
            return values
        flat = rates @ values.reshape(len(values), prod(values.shape[1:]))
        return flat.reshape(len(self.names), *values.shape[1:])


def variables(known: Parameters, requested: Requested) -> Variables:
    """Return the variables that were requested; None: every parameter.

    ``requested``: names; a pattern ties all that it picks to one variable (``"leg*.k.stiffness"``); a mapping gives
    each variable its own linear map, {variable: {name or pattern: rate}}. Raises an error if a name is unknown, a
    pattern picks nothing, or a rate is not a number.
    """
    if requested is None:
        layout = FieldLayout.of(known.parts.values())
        numbers = np.arange(layout.starts[-1])
        count = len(numbers)
        every, entries = partial(tuple, known), partial(attrgetter("entries"), known)
        return Variables(ListedLater(count, every), ListedLater(count, entries), known.parts, numbers, numbers,
                         np.ones(count), every=layout)  # fmt: skip
    if not isinstance(requested, (str, Iterable)):
        raise ModelError(f"sensitivities: parameters = {requested!r}; expected names, patterns, or a mapping of "
                         f"variables to {{parameter: rate}}.", element="parameters")  # fmt: skip
    names = [requested] if isinstance(requested, str) else list(requested)
    maps = requested if isinstance(requested, Mapping) else {name: {name: 1.0} for name in names}
    number_of: dict[str, int] = {}
    terms: list[tuple[int, int, float]] = []
    for i, name in enumerate(names):
        if not isinstance(maps[name], Mapping) or not maps[name]:
            raise ModelError(f"variable '{name}': {maps[name]!r}; expected the parameters that it moves, one or more, "
                             f"{{name or pattern: rate}}.", element=str(name))  # fmt: skip
        for pattern, rate in maps[name].items():
            rate = check.number(rate, f"variable '{name}'", pattern, "a finite rate")
            terms += [(i, number_of.setdefault(match, len(number_of)), rate) for match in known.matching(pattern)]
    table = np.array(terms, dtype=float).reshape(-1, 3)
    return Variables(tuple(names), tuple(known.entry(name) for name in number_of), known.parts,
                     table[:, 0].astype(np.intp), table[:, 1].astype(np.intp), table[:, 2])  # fmt: skip
