"""Channels through which something was measured: gains, delays and filters as values of a fit.

An output o passes F_o = g e^(-s tau) / (1 + s T) P H with the filters of second order
P = 1 / d(s / w), H = (s / w)^2 / d(s / w), d(x) = 1 + 2 zeta x + x^2, w = 2 pi f;  an input i has a gain g_i.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, Self

import numpy as np

from mbsvib.common.arrays import Array, Complex, Index

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
