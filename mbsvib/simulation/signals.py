"""Inputs over time as polynomials, one an interval: samples as straight lines, functions resolved to rounding."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import chebyshev

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.expected import reals
from mbsvib.errors import AccuracyWarning, ModelError

if TYPE_CHECKING:
    from mbsvib.responses.driven import Drive

# Degree of the polynomials that functions are told by, and the share of its size to which they tell it.
DEGREE, RESOLVED = 9, 1e-11
# Intervals of a function are halved at most so often: a jump is then told to this share of an interval.
HALVINGS = 20
# Intervals in one run at most, so that a function that no polynomial tells does not fill the memory; what is left over
# of it on average, as a share of its size, is warned of.
MOST, LEFT_OVER = 200_000, 1e-3
# Times at which functions are compared with their polynomials, and the share of the size to which these agree: pulses
# within an interval, such as blows of a hammer, may pass between the nodes of a polynomial.
COMPARED, AGREES = 4000, 1e-9
# Frames from the warning up to the call of the user.
USER = 6


@dataclass(frozen=True)
class Signals:
    """Inputs on intervals between ``breaks`` (k + 1,) [s].

    ``coefficients`` (k, inputs, degree + 1) are those of powers of the time from an interval's start over its length.
    """

    breaks: Array
    coefficients: Array

    def at(self, t: Array) -> Array:
        """Return the inputs (inputs, len(t)) at some times [s]."""
        k = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, len(self.breaks) - 2)
        share = (t - self.breaks[k]) / (self.breaks[k + 1] - self.breaks[k])
        powers = share[:, None] ** np.arange(self.coefficients.shape[2])
        return np.asarray(np.einsum("kip,kp->ik", self.coefficients[k], powers))


def moved_ends(driven: Signals, known: Sequence[Drive], names: tuple[str, ...]) -> Signals:
    """Return the displacements and velocities of moved ends, from rest, of inputs that are motions.

    ``driven``: signals of the inputs of the user, ``known``; ``names``: those of the equations, in their order.
    """
    length, degree = np.diff(driven.breaks), driven.coefficients.shape[2] - 1
    result = np.zeros((len(length), len(names), degree + 3))
    for i, drive in enumerate(known):
        value = np.pad(driven.coefficients[:, i], ((0, 0), (0, 2)))
        series = {drive.order: value}
        for order in range(drive.order, 0, -1):
            series[order - 1] = _integral(series[order], length)
        for order, name in enumerate(drive.columns):
            if order not in series:
                series[order] = np.pad(value[:, 1:] * np.arange(1, degree + 3) / length[:, None], ((0, 0), (0, 1)))
            if name in names:
                result[:, names.index(name)] = series[order]
    return Signals(driven.breaks, result)


def _integral(value: Array, length: Array) -> Array:
    """Coefficients (k, degree + 1) of the integral from the first time."""
    result = np.zeros_like(value)
    result[:, 1:] = value[:, :-1] / np.arange(1, value.shape[1]) * length[:, None]
    result[1:, 0] = np.cumsum(result.sum(axis=1))[:-1]
    return result


def signals(inputs: Any, names: tuple[str, ...], t: Array) -> Signals:
    """Return inputs over time as polynomials.

    ``inputs``: inputs by name; samples (len(t),) are joined by straight lines, what is not named is 0. ``t`` (n,):
    times [s]. Returns the polynomials; functions may add breaks between the times.
    """
    if inputs is None:
        inputs = {}
    check.mapping("simulate", "inputs", inputs, "a mapping of inputs to samples or functions, {'F': f}", empty=True)
    for name in inputs:
        check.known(name, names, f"simulate: '{name}' is not an input of the model", "inputs")
    functions = {name: value for name, value in inputs.items() if callable(value)}
    breaks = _breaks(functions, t)
    start, length = breaks[:-1], np.diff(breaks)
    result = np.zeros((len(start), len(names), DEGREE + 1 if functions else 2))
    for i, name in enumerate(names):
        if name in functions:
            result[:, i] = _powers(functions[name], name, start, length)[0]
        elif name in inputs:
            samples = _samples(inputs[name], name, t)
            at = np.interp(breaks, t, samples)
            result[:, i, 0], result[:, i, 1] = at[:-1], np.diff(at)
    return Signals(breaks, result)


def _samples(value: Any, name: str, t: Array) -> Array:
    who, expected = "simulate", f"a number, {len(t)} samples, one for each time, or a function of t"
    array = reals(value, who, f"inputs['{name}']", expected, ModelError)
    if array.ndim == 0:
        array = np.full(len(t), float(array))
    if array.shape != t.shape or not np.isfinite(array).all():
        raise check.refuse(who, f"inputs['{name}']", value, expected)
    return array


def _breaks(functions: Mapping[str, Callable[[float], Any]], t: Array) -> Array:
    """Times between which all functions are polynomials to rounding."""
    breaks, duration = t, float(t[-1] - t[0])
    times = t[0] + duration * (np.arange(COMPARED) + 0.5) / COMPARED
    for name, function in functions.items():
        size = max(float(np.abs(_values(function, name, t)).max()), 1e-300)
        values = _values(function, name, times)
        for _ in range(HALVINGS):
            start, length = breaks[:-1], np.diff(breaks)
            powers, error = _powers(function, name, start, length)
            size = max(size, float(np.abs(powers[:, 0]).max()), float(np.abs(values).max()))
            off = np.abs(Signals(breaks, powers[:, None]).at(times)[0] - values)
            off[off <= AGREES * size] = 0.0
            np.maximum.at(error, np.searchsorted(start, times, side="right") - 1, off)
            # what is next to a jump may hide a part of it behind its last node
            rough = np.flatnonzero(np.convolve(error > RESOLVED * size, np.ones(3))[1:-1])
            if not len(rough) or len(breaks) > MOST:
                break
            breaks = np.sort(np.concatenate((breaks, start[rough] + 0.5 * length[rough])))
        if float(error @ length) > LEFT_OVER * size * duration:
            warnings.warn(f"simulate: input '{name}' changes too fast to be resolved over {duration:.6g} s, or is "
                          f"random; give samples of it, or a shorter run.",
                          AccuracyWarning, stacklevel=USER)  # fmt: skip
    return breaks


def _powers(function: Callable[[float], Any], name: str, start: Array, length: Array) -> tuple[Array, Array]:
    """Coefficients (k, degree + 1) of powers of the share of intervals, and the size (k,) of the last ones of
    Chebyshev's series.
    """
    nodes = 0.5 + 0.5 * np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
    values = _values(function, name, (start[:, None] + length[:, None] * nodes).reshape(-1)).reshape(len(start), -1)
    to_series = np.linalg.inv(chebyshev.chebvander(2.0 * nodes - 1.0, DEGREE))
    series = values @ to_series.T
    shift = np.zeros((DEGREE + 1, DEGREE + 1))  # powers of 2 s - 1 in powers of s
    for j in range(DEGREE + 1):
        power = np.polynomial.polynomial.polypow((-1.0, 2.0), j)
        shift[: len(power), j] = power
    to_powers = np.array([np.pad(chebyshev.cheb2poly(row[: j + 1]), (0, DEGREE - j))
                          for j, row in enumerate(np.eye(DEGREE + 1))])  # fmt: skip
    return series @ to_powers @ shift.T, np.abs(series[:, -2:]).max(axis=1)


def _values(function: Callable[[float], Any], name: str, t: Array) -> Array:
    try:
        result = np.array([float(function(float(time))) for time in t])
    except TypeError as error:
        raise ModelError(f"simulate: input '{name}' is a function that cannot be taken at a time t, or whose value is "
                         f"no number ({error}); give a function of t that returns a number.",
                         element=name, field="inputs") from error  # fmt: skip
    if not np.isfinite(result).all():
        at = float(t[~np.isfinite(result)][0])
        raise ModelError(f"simulate: input '{name}' is not finite at t = {at:.6g} s; give a function that is finite at "
                         f"all times.", element=name, field="inputs")  # fmt: skip
    return result
