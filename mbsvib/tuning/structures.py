"""Controllers of a given structure: sums and series of parts, each a map from named values to state-space equations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.selection import Names, selected, united
from mbsvib.errors import ModelError, ResponseError
from mbsvib.feedback.controller import Controller, controller
from mbsvib.tuning.realization import Realization, in_series, summed, with_slopes

Bounds = tuple[float, float]
FREE: Bounds = (-np.inf, np.inf)


class Signals(NamedTuple):
    """Sizes of signals by name."""

    actuators: dict[str, float]
    sensors: dict[str, float]


class Sizes(NamedTuple):
    """Sizes of signals of a plant: of ``actuators`` (outputs,) and ``sensors`` (inputs,), and a ``rate`` [rad/s]."""

    actuators: Array
    sensors: Array
    rate: float


@dataclass(frozen=True)
class Value:
    """A value of a controller: its ``symbol``, its ``size``, ``start`` and ``spread`` of starts in parts of the size,
    ``bounds``, and whether it is ``positive``, of which the logarithm is searched.
    """

    symbol: str
    size: float
    start: float
    spread: float
    positive: bool = False
    bounds: Bounds = FREE


class Tunable(Displayed, ABC):
    """A controller of a given structure, u = K(p) y, with values p that ``mv.tune`` chooses.

    ``K1 + K2`` acts in parallel, ``K1 * K2`` in series: K2 acts first, and may be a fixed Controller or StateSpace.
    """

    _engine = "at described for_ports kind parts realized single sized through values"

    __array_ufunc__ = None

    inputs: tuple[str, ...]
    """Names of the sensors."""
    outputs: tuple[str, ...]
    """Names of the actuators."""

    @abstractmethod
    def parts(self) -> tuple[Part, ...]:
        """Return the parts that have values of their own."""

    @abstractmethod
    def for_ports(self, outputs: Sequence[str] | None, inputs: Sequence[str] | None, owner: str) -> Tunable:
        """Return the structure with names in the place of patterns; None: of no plant, names as they are.

        ``outputs``: known actuators; ``inputs``: known sensors; ``owner``: name of the plant, for messages.
        """

    @abstractmethod
    def sized(self, signals: Signals, rate: float) -> Iterator[Sizes]:
        """Return the sizes of the signals of all parts, for those that this controller has."""

    @abstractmethod
    def realized(self, parts: Iterator[Realization]) -> Realization:
        """Return the equations for those of all parts, in their order."""

    def through(self, sensors: Array, rate: float) -> Array:
        """Return the sizes of outputs for sizes of the inputs, 1 if values choose them."""
        return np.ones(len(self.outputs))

    def __add__(self, other: Any) -> Tunable:
        """Return both controllers in parallel."""
        return Sum((self, as_tunable(other)))

    def __radd__(self, other: Any) -> Tunable:
        """Return both controllers in parallel."""
        return Sum((as_tunable(other), self))

    def __mul__(self, other: Any) -> Tunable:
        """Return both controllers in series: the right one acts first."""
        return Series(self, as_tunable(other))

    def __rmul__(self, other: Any) -> Tunable:
        """Return both controllers in series: the right one acts first."""
        return Series(as_tunable(other), self)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(self.inputs)} -> {', '.join(self.outputs)})"


@dataclass(frozen=True, repr=False, eq=False)
class Part(Tunable):
    """A controller with values of its own; ``name`` is the first part of their names: parts of one name share them.

    ``start``, ``bounds``: initial values and bounds of some values by symbol.
    """

    kind: ClassVar[str] = "part"
    single: ClassVar[bool] = False  # whether it has one actuator and one sensor

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    name: str | None = None
    start: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, Bounds] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.single and (len(self.outputs) > 1 or len(self.inputs) > 1):
            raise ResponseError(f"tunable.{self.kind}: {len(self.outputs)} outputs and {len(self.inputs)} inputs; "
                                f"expected one of each. Put several into tunable.diagonal([...]), with one name= if "
                                f"they share their values.")  # fmt: skip

    @abstractmethod
    def values(self, sizes: Sizes) -> list[Value]:
        """Return the values, with sizes that suit the signals."""

    @abstractmethod
    def at(self, values: Complex) -> Realization:
        """Return the equations (n, ...) for values (v, n)."""

    def parts(self) -> tuple[Part, ...]:
        return (self,)

    def for_ports(self, outputs: Sequence[str] | None, inputs: Sequence[str] | None, owner: str) -> Self:
        return replace(self, outputs=_names(self.outputs, outputs, "actuator", owner),
                       inputs=_names(self.inputs, inputs, "sensor", owner))  # fmt: skip

    def sized(self, signals: Signals, rate: float) -> Iterator[Sizes]:
        yield Sizes(np.array([signals.actuators[name] for name in self.outputs]),
                    np.array([signals.sensors[name] for name in self.inputs]), rate)  # fmt: skip

    def realized(self, parts: Iterator[Realization]) -> Realization:
        return next(parts)

    def described(self, sizes: Sizes) -> list[Value]:
        """Return the values with the bounds and the start of the user."""
        result = self.values(sizes)
        symbols = united(tuple([value.symbol for value in result]),
                         tuple([value.symbol.split("[")[0] for value in result]))
        for argument, given in (("start", self.start), ("bounds", self.bounds)):
            for symbol in given:
                check.known(symbol, symbols, f"tunable.{self.kind}: {argument} has '{symbol}', which is none of its "
                            f"values", told="Values:")  # fmt: skip
        return [_with(value, _of(self.start, value.symbol), _of(self.bounds, value.symbol), self.kind)
                for value in result]  # fmt: skip


def _of(given: Mapping[str, Any], symbol: str) -> Any:
    return given.get(symbol, given.get(symbol.split("[")[0]))


def _with(value: Value, start: Any, bounds: Any, kind: str) -> Value:
    who = f"tunable.{kind}"
    if bounds is not None:
        try:
            low, high = (float(end) for end in bounds)
        except (TypeError, ValueError) as error:
            raise check.refuse(who, f"bounds of {value.symbol}", bounds, "a pair (lowest, highest)") from error
        if not low < high or (value.positive and low < 0.0):
            raise check.refuse(who, f"bounds of {value.symbol}", bounds, "ascending numbers, none negative where the "
                               "value is positive")  # fmt: skip
        value = replace(value, bounds=(low, high), positive=value.positive or low > 0.0)
        begin = min(max(value.size * value.start, low), high)
        if begin != value.size * value.start and start is None:
            value = replace(value, size=abs(begin) or value.size, start=float(np.sign(begin)))
    if start is not None:
        number = check.number(start, who, f"start of {value.symbol}")
        if not value.bounds[0] <= number <= value.bounds[1] or (value.positive and number <= 0.0):
            raise check.refuse(who, f"start of {value.symbol}", start, "a number within its bounds")
        size = abs(number) or value.size
        value = replace(value, size=size, start=number / size, spread=value.spread if value.positive else 0.3)
    return value


def _names(given: tuple[str, ...], known: Sequence[str] | None, kind: str, owner: str) -> tuple[str, ...]:
    return given if known is None else tuple([known[k] for k in selected(given, known, kind, owner)])


@dataclass(frozen=True, repr=False, eq=False)
class Fixed(Part):
    """A controller that is given, without values."""

    kind: ClassVar[str] = "fixed"

    law: Any = None

    def values(self, sizes: Sizes) -> list[Value]:
        return []

    def at(self, values: Complex) -> Realization:
        x = np.block([[self.law.A, self.law.B], [self.law.C, self.law.D]])
        return Realization(len(self.law.A), np.broadcast_to(x, (values.shape[1], *x.shape)))

    def through(self, sensors: Array, rate: float) -> Array:
        sizes = np.abs(self.law.at(np.array([1j * rate]))[0]) @ sensors
        return np.asarray(np.where(sizes > 0.0, sizes, 1.0))


@dataclass(frozen=True, repr=False, eq=False)
class Sum(Tunable):
    """Controllers in parallel, from all their sensors to all their actuators."""

    terms: tuple[Tunable, ...]

    @property
    def inputs(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the sensors."""
        return united(*[term.inputs for term in self.terms])

    @property
    def outputs(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the actuators."""
        return united(*[term.outputs for term in self.terms])

    def parts(self) -> tuple[Part, ...]:
        return tuple([part for term in self.terms for part in term.parts()])

    def for_ports(self, outputs: Sequence[str] | None, inputs: Sequence[str] | None, owner: str) -> Sum:
        return Sum(tuple([term.for_ports(outputs, inputs, owner) for term in self.terms]))

    def sized(self, signals: Signals, rate: float) -> Iterator[Sizes]:
        for term in self.terms:
            yield from term.sized(signals, rate)

    def through(self, sensors: Array, rate: float) -> Array:
        known, sizes = dict(zip(self.inputs, sensors, strict=True)), dict.fromkeys(self.outputs, 0.0)
        for term in self.terms:
            own = term.through(np.array([known[name] for name in term.inputs]), rate)
            sizes |= {name: max(sizes[name], size) for name, size in zip(term.outputs, own.tolist(), strict=True)}
        return np.array(list(sizes.values()))

    def realized(self, parts: Iterator[Realization]) -> Realization:
        outputs, inputs = self.outputs, self.inputs
        rows = [[outputs.index(name) for name in term.outputs] for term in self.terms]
        columns = [[inputs.index(name) for name in term.inputs] for term in self.terms]
        return summed([term.realized(parts) for term in self.terms], rows, columns, (len(outputs), len(inputs)))


@dataclass(frozen=True, repr=False, eq=False)
class Series(Tunable):
    """Two controllers in series: the outputs of ``first`` are the inputs of ``last``, in their order."""

    last: Tunable
    first: Tunable

    def __post_init__(self) -> None:
        if len(self.last.inputs) != len(self.first.outputs):
            raise ResponseError(f"tunable: {self.last!r} * {self.first!r}: the right one acts first and has "
                                f"{len(self.first.outputs)} outputs; expected as many as the left one has inputs, "
                                f"{len(self.last.inputs)}.")  # fmt: skip

    @property
    def inputs(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the sensors."""
        return self.first.inputs

    @property
    def outputs(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the actuators."""
        return self.last.outputs

    def parts(self) -> tuple[Part, ...]:
        """Return the parts of both, those that act first first."""
        return (*self.first.parts(), *self.last.parts())

    def for_ports(self, outputs: Sequence[str] | None, inputs: Sequence[str] | None, owner: str) -> Series:
        """Return the series with names in the place of patterns; signals between both have none."""
        return Series(self.last.for_ports(outputs, None, owner), self.first.for_ports(None, inputs, owner))

    def sized(self, signals: Signals, rate: float) -> Iterator[Sizes]:
        size = self.first.through(np.array([signals.sensors[name] for name in self.inputs]), rate)
        to, of = (dict(zip(names, size.tolist(), strict=True)) for names in (self.first.outputs, self.last.inputs))
        yield from self.first.sized(signals._replace(actuators=to), rate)
        yield from self.last.sized(signals._replace(sensors=of), rate)

    def through(self, sensors: Array, rate: float) -> Array:
        return self.last.through(self.first.through(sensors, rate), rate)

    def realized(self, parts: Iterator[Realization]) -> Realization:
        first = self.first.realized(parts)
        return in_series(self.last.realized(parts), first)


def as_tunable(value: Any) -> Tunable:
    """Return a structure, or a fixed controller as one."""
    if isinstance(value, Tunable):
        return value
    if isinstance(value, Controller) or getattr(value, "kind", None) == "state space":
        law = value if isinstance(value, Controller) else controller(value, value.inputs, value.outputs, value.name)
        return Fixed(law.outputs, law.inputs, law=law)
    raise ResponseError(f"tunable: {check.shown(value)}; expected what mv.tunable makes, a Controller or a StateSpace.")


@dataclass(frozen=True, eq=False)
class Law:
    """A controller structure at a plant: ``names`` and ``values`` of all variables, and ``at``, those of each part."""

    structure: Tunable
    names: tuple[str, ...]
    values: tuple[Value, ...]
    at: tuple[list[int], ...]

    def realized(self, p: Array) -> tuple[Realization, Array]:
        """Return the equations for values p (v,), and dX/dp (v, ...)."""
        return with_slopes(lambda points: self.structure.realized(iter(
            [part.at(points[:, which].T) for part, which in zip(self.structure.parts(), self.at, strict=True)])), p)

    def controller(self, p: Array, name: str = "tuned") -> Controller:
        """Return the controller for values p (v,)."""
        return Controller(name, *self.realized(p)[0].matrices, self.structure.inputs, self.structure.outputs)


def law(structure: Tunable, sizes: Signals, rate: float) -> Law:
    """Return the values of a structure, whose names are those of signals, for sizes of these."""
    known: dict[str, tuple[int, Value, str | None]] = {}
    taken: dict[str, int] = {}
    at = []
    for part, own in zip(structure.parts(), structure.sized(sizes, rate), strict=True):
        prefix = part.name or f"{part.outputs[0]}/{part.inputs[0]}"
        if part.name is None and part.described(own):
            taken[prefix] = taken.get(prefix, 0) + 1
            prefix = prefix if taken[prefix] == 1 else f"{prefix}#{taken[prefix]}"
        rows = []
        for value in part.described(own):
            key = f"{prefix}.{value.symbol}"
            number, first, owner = known.setdefault(key, (len(known), value, part.name))
            if (first.bounds, first.positive) != (value.bounds, value.positive) or owner != part.name:
                raise ModelError(f"tunable: '{key}' is shared by parts that give it different bounds; give all of "
                                 f"them the same, or other names.", element=key)  # fmt: skip
            rows.append(number)
        at.append(rows)
    return Law(structure, tuple(known), tuple([value for _, value, _ in known.values()]), tuple(at))


def port_names(value: Names, who: str, argument: str) -> tuple[str, ...]:
    """Return names of signals as a tuple."""
    several = check.names_in([value] if isinstance(value, str) else value)
    if not several:
        raise check.refuse(who, argument, value, "one name or several")
    return tuple(several)
