"""The values that a fit may change, as unknowns x of the search: of parameters, and of channels of measurements.

A positive value is p = e^x, any other p = s x with a natural size s: a change of x by 1 is one of 100 %.

An output o was measured through F_o = g e^(-s tau) / (1 + s T) P H with a gain, a delay, a lag and filters of second
order P = 1 / d(s / w), H = (s / w)^2 / d(s / w), d(x) = 1 + 2 zeta x + x^2, w = 2 pi f;  an input i has a gain g_i.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from mbsvib.mechanism.parameters import Parameter, Parameters

# Fields whose numbers are positive, if the model has them so; those of several of a kind end with a number.
POSITIVE = frozenset({
    "mass", "inertia", "stiffness", "damping", "static_stiffness", "inertance", "free_length", "E", "G", "rho",
    "radius", "wall", "width", "height", "A", "Iy", "Iz", "J", "alpha", "beta", "damping_ratio", "length",
    "dynamic_stiffness", "g", "tau",
})  # fmt: skip

# Positive values stay within this factor of their start: a stiffness that the data do not tell would run away.
FARTHEST = 1e6
# Entries of an inertia, and the least second moment of a body over the largest: flat bodies are at the limit.
INERTIA, FLAT = ("xx", "yy", "zz", "xy", "xz", "yz"), 1e-9


@dataclass(frozen=True, slots=True)
class Variables:
    """The ``names`` (v,) of values, their ``start``, ``size`` and ``unit``, lowest and highest values, which are
    ``positive``, and the ``prior`` (v, 2), value and standard deviation, NaN where there is none.

    ``parameters`` (p,) of the model follow from the first values by ``map`` (p, v).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    start: Array
    size: Array
    low: Array
    high: Array
    positive: Bools
    prior: Array
    parameters: tuple[str, ...]
    map: Array

    def unknowns(self, values: Array) -> Array:
        """Return x of values p."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.positive, np.log(np.where(self.positive, values, 1.0)), values / self.size)

    def values(self, x: Array) -> Array:
        """Return p of x, within the limits."""
        lowest, highest = self.limits()
        x = np.clip(x, lowest, highest)
        p = np.where(self.positive, np.exp(np.where(self.positive, x, 0.0)), x * self.size)
        return np.asarray(np.clip(p, self.low, self.high))

    def within(self, x: Array) -> Array:
        """Return x within the limits, with inertias that bodies can have where all their entries are values."""
        x = np.clip(x, *self.limits())
        number = {name: k for k, name in enumerate(self.names)}
        for body in [name.removesuffix(".xx") for name in self.names if name.endswith(".inertia.xx")]:
            entries = [number.get(f"{body}.{end}", -1) for end in INERTIA]
            if min(entries) >= 0:
                values = self.values(x)
                values[entries] = physical(values[entries])
                x[entries] = self.unknowns(values)[entries]
        return x

    def rates(self, values: Array) -> Array:
        """Return dp/dx (v,)."""
        return np.where(self.positive, values, self.size)

    def limits(self) -> tuple[Array, Array]:
        """Return the lowest and highest x."""
        return self.unknowns(self.low), self.unknowns(self.high)

    def with_channels(self, channels: Sequence[tuple[str, str, float, float, float, float, bool]]) -> Variables:
        """Return these with values of channels: name, unit, start, size, lowest and highest value of each, and whether
        it is positive.
        """
        if not channels:
            return self
        names, units, *columns, positive = zip(*channels, strict=True)
        start, size, low, high = (np.array(column, dtype=float) for column in columns)
        n = len(names)
        return Variables(
            self.names + names, self.units + units, np.append(self.start, start), np.append(self.size, size),
            np.append(self.low, low), np.append(self.high, high), np.append(self.positive, positive),
            np.concatenate((self.prior, np.full((n, 2), np.nan))), self.parameters,
            np.pad(self.map, ((0, 0), (0, n))),
        )  # fmt: skip

    def starting(self, values: Array) -> Variables:
        """Return these with another start."""
        return replace(self, start=np.clip(values, self.low, self.high))


def physical(entries: Array) -> Array:
    """Return the nearest inertia (6,), xx yy zz xy xz yz, of a body: its second moments tr(I) / 2 - I are not negative.

    Source: Wensing, Kim & Slotine, IEEE Robotics and Automation Letters 3 (2018), 60, equation 9.
    """
    xx, yy, zz, xy, xz, yz = entries.tolist()
    moments, axes = np.linalg.eigh(0.5 * (xx + yy + zz) * np.eye(3) - [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    least = FLAT * moments[-1]
    if moments[0] >= least:
        return entries
    second = (axes * np.maximum(moments, least)) @ axes.T
    tensor = np.trace(second) * np.eye(3) - second
    return np.asarray(tensor[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)])


def variables(parameters: Parameters, free: Any, tied: Any, prior: Any = None, bounds: Any = None) -> Variables:
    """Return the values of parameters that a fit may change.

    ``free``: names or patterns, a value for each name; ``tied``: names or patterns, one value for all that each
    matches; ``prior`` and ``bounds``: as in ``limited``.
    """
    groups: dict[str, tuple[str, ...]] = {
        name: (name,) for pattern in _patterns(free, "free") for name in parameters.matching(pattern)}  # fmt: skip
    groups |= {pattern: tuple(parameters.matching(pattern)) for pattern in _patterns(tied, "tied")}
    if not groups:
        raise ModelError("fit: free and tied are empty; expected the parameters to be fitted, such as "
                         "free=['leg*.k.stiffness'].", field="free")  # fmt: skip
    owner: dict[str, str] = {}
    for name, group in groups.items():
        for member in group:
            if member in owner:
                raise ModelError(f"fit: '{owner[member]}' and '{name}' both set '{member}'; leave one of both out.",
                                 element=member, field="tied")  # fmt: skip
            owner[member] = name
    names, rows = tuple(groups), [_row(parameters, name, group) for name, group in groups.items()]
    units, start, size, positive = zip(*rows, strict=True)
    every, none, mask, begin = tuple(owner), np.full(len(names), np.inf), np.array(positive), np.array(start)
    to_parameters = np.array([[float(owner[member] == name) for name in names] for member in every])
    return limited(Variables(
        names, units, begin, np.array(size), np.where(mask, begin / FARTHEST, -none),
        np.where(mask, begin * FARTHEST, none), mask, np.full((len(names), 2), np.nan), every, to_parameters,
    ), prior, bounds)  # fmt: skip


def limited(free: Variables, prior: Any, bounds: Any) -> Variables:
    """Return values with what is known of them; those of channels start within their limits.

    ``prior``: {name: (value, standard deviation)}; ``bounds``: {name: (lowest, highest)}, None: no limit.
    """
    names, mask = free.names, free.positive
    known = _by_name(names, prior, "prior", "(value, standard deviation)")
    for name, (value, deviation) in known.items():
        if value is None or not np.isfinite(value) or not deviation or not deviation > 0.0:
            raise ModelError(f"fit: prior of '{name}' has the value {value} and the standard deviation {deviation}; "
                             f"expected a finite and a positive number.", element=name, field="prior")  # fmt: skip
    limits = _by_name(names, bounds, "bounds", "(lowest, highest), None for no limit")
    least = np.array([-np.inf if limits.get(name, (None,))[0] is None else limits[name][0] for name in names])
    most = np.array([np.inf if limits.get(name, (None, None))[1] is None else limits[name][1] for name in names])
    low, most = np.maximum(least, free.low), np.minimum(most, free.high)
    begin = np.where(free.map.any(axis=0), free.start, np.clip(free.start, low, most))
    for name, a, b, c in zip(names, low, begin, most, strict=True):
        if not a <= b <= c or not a < c:
            raise ModelError(f"fit: bounds of '{name}' are {a:g} to {c:g}, and its start is {b:g}; expected a start "
                             f"within ascending bounds.", element=name, field="bounds")  # fmt: skip
    width = np.where(np.isfinite(most - low) & ~mask & (begin == 0.0), most - low, free.size)
    return replace(free, start=begin, size=width, low=low, high=most,
                   prior=np.array([known.get(name, was) for name, was in zip(names, free.prior, strict=True)]))


def _patterns(given: Any, field: str) -> list[str]:
    patterns = check.names_in([given] if isinstance(given, str) else given)
    if patterns is None:
        raise check.refuse("fit", field, given, "names or patterns of parameters")
    return list(dict.fromkeys(patterns))


def _row(parameters: Parameters, name: str, group: tuple[str, ...]) -> tuple[str, float, float, bool]:
    """Unit, start, size and sign of a value that moves some parameters."""
    entries = [parameters.entry(member) for member in group]
    if len({entry.unit for entry in entries}) > 1:
        units = " and ".join(sorted({entry.unit for entry in entries}))
        raise ModelError(f"fit: '{name}' ties parameters in {units}; expected one unit.", element=name, field="tied")
    values = np.array([entry.value for entry in entries])
    intrinsic = all(entry.field.rstrip("0123456789") in POSITIVE and not _is_product(entry) for entry in entries)
    positive = intrinsic and bool((values > 0.0).all())
    start = float(np.exp(np.log(values).mean()) if positive else values.mean())
    size = max(map(abs, values.tolist()))
    if entries[0].index and not intrinsic:  # depends on axes or on the origin, and may be small by chance
        size = max(size, _largest(parameters, entries, entries[0].part if _is_product(entries[0]) else ""))
    return entries[0].unit, start, size or _largest(parameters, entries) or 1.0, positive


def _is_product(entry: Parameter) -> bool:
    """Whether an entry is off the diagonal of an inertia or of another matrix."""
    return len(set(entry.index)) > 1 or (entry.field == "inertia" and bool(entry.index) and entry.index[0] > 2)


def _largest(parameters: Parameters, entries: Sequence[Parameter], part: str = "") -> float:
    """The largest value of the unit of some entries, of a part or of the model."""
    return max((abs(entry.value) for entry in parameters.entries
                if entry.unit == entries[0].unit and part in ("", entry.part)), default=0.0)  # fmt: skip


def _by_name(names: tuple[str, ...], given: Any, field: str, expected: str) -> dict[str, tuple[Any, Any]]:
    """Pairs of numbers by the names of values."""
    check.mapping("fit", field, {} if given is None else given, f"a mapping of names to {expected}", empty=True)
    result = {}
    for name, pair in (given or {}).items():
        check.known(name, names, f"fit: {field} has '{name}', which is not fitted", field)
        try:
            first, second = (None if number is None else float(number) for number in pair)
        except (TypeError, ValueError):
            raise check.refuse(f"fit: '{name}'", field, pair, expected) from None
        result[name] = first, second
    return result


# In the place of the number of a value: what is held.
HELD = -1


class Channels(NamedTuple):
    """Numbers among all values of the gains, delays and lags (outputs,), of frequency and damping ratio of low-pass and
    high-pass filters (outputs, 2), and of the gains of inputs (inputs,), or HELD.
    """

    gain: Index
    delay: Index
    lag: Index
    lowpass: Index
    highpass: Index
    input_gain: Index

    @classmethod
    def held(cls, outputs: int, inputs: int) -> Self:
        """Return channels with nothing free."""
        ends, filters = np.full(outputs, HELD), np.full((outputs, 2), HELD)
        return cls(ends, ends, ends, filters, filters, np.full(inputs, HELD))

    def of_new_output(self) -> Channels:
        """Return those of one output that has nothing free."""
        return self.held(1, 1)._replace(input_gain=self.input_gain)

    def of_new_input(self) -> Channels:
        """Return those with one input whose gain is held."""
        return self._replace(input_gain=np.array([HELD]))

    def factor(self, values: Array, omega: Array, without_gains: bool = False) -> Complex:
        """Return H / G (n, outputs, inputs)."""
        rows = self.rows(values, omega, without_gains)
        inner = np.ones(len(self.input_gain)) if without_gains else values_of(values, self.input_gain, 1.0)
        return np.asarray(rows[:, :, None] * inner)

    def rows(self, values: Array, omega: Array, without_gains: bool = False) -> Complex:
        """Return F (n, outputs)."""
        result = self.tails(values, omega)
        for o, (frequency, _) in _filters(self.highpass):
            result[:, o] *= (1j * omega / (2.0 * np.pi * values[frequency])) ** 2
        return result if without_gains else np.asarray(result * values_of(values, self.gain, 1.0))

    def tails(self, values: Array, omega: Array) -> Complex:
        """Return F (n, outputs) without gains and numerators: what states of the channels look like."""
        s = 1j * omega[:, None]
        result = np.exp(-s * values_of(values, self.delay, 0.0)) / (1.0 + s * values_of(values, self.lag, 0.0))
        for which in (self.lowpass, self.highpass):
            for o, number in _filters(which):
                result[:, o] /= _denominator(values[number], omega)[0]
        return np.asarray(result)

    @property
    def orders(self) -> list[int]:
        """How many states each output's channel has, a delay counted as some."""
        orders = ((self.lag >= 0) + 2 * (self.lowpass[:, 0] >= 0) + 2 * (self.highpass[:, 0] >= 0)
                  + 3 * (self.delay >= 0))  # fmt: skip
        return [int(order) for order in orders]

    def rates(self, values: Array, omega: Array) -> Iterator[tuple[int, int, Any]]:
        """Yield number of a value, of its output, and the derivative (n,) of log F, but those of gains."""
        s = 1j * omega
        for o, number in enumerate(self.delay.tolist()):
            if number >= 0:
                yield number, o, -s
        for o, number in enumerate(self.lag.tolist()):
            if number >= 0:
                yield number, o, -s / (1.0 + s * values[number])
        for which, power in ((self.lowpass, 0.0), (self.highpass, 2.0)):
            for o, (frequency, ratio) in _filters(which):
                denominator, x = _denominator(values[[frequency, ratio]], omega)
                f, zeta = values[frequency], values[ratio]
                yield frequency, o, ((2.0 * zeta * x + 2.0 * x**2) / denominator - power) / f
                yield ratio, o, -2.0 * x / denominator

    def slopes(self, values: Array, omega: Array, model: Complex, first: int) -> Complex:
        """Return derivatives (channels, n, outputs, inputs) of H to all values of channels, behind the ``first`` ones.

        ``model``: G (n, outputs, inputs).
        """
        result = np.zeros((len(values) - first, *model.shape), dtype=complex)
        bare = self.factor(values, omega, without_gains=True) * model
        outer, inner = values_of(values, self.gain, 1.0), values_of(values, self.input_gain, 1.0)
        for o, number in enumerate(self.gain.tolist()):
            if number >= 0:
                result[number - first, :, o] = bare[:, o] * inner
        for number, o, rate in self.rates(values, omega):
            result[number - first, :, o] = rate[:, None] * bare[:, o] * outer[o] * inner
        for i, number in enumerate(self.input_gain.tolist()):
            if number >= 0:
                result[number - first, :, :, i] = bare[:, :, i] * outer
        return result


def values_of(values: Array, number: Index, held: float) -> Array:
    """Return the values with some numbers, ``held`` where there is none."""
    return np.where(number >= 0, values[number], held)


def _filters(which: Index) -> Iterator[tuple[int, list[int]]]:
    """Outputs that have such a filter, with the numbers of its frequency and damping ratio."""
    for o, numbers in enumerate(which.tolist()):
        if numbers[0] >= 0:
            yield o, numbers


def _denominator(pair: Array, omega: Array) -> tuple[Complex, Complex]:
    """d(x) and x = s / w of a filter with a frequency [Hz] and damping ratio."""
    x = 1j * omega / (2.0 * np.pi * pair[0])
    return 1.0 + 2.0 * pair[1] * x + x * x, x
