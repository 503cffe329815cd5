"""Quantities of responses whose ports have weights, and of noise that is correlated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.patterns import matching
from mbsvib.feedback.loop_rounding import response
from mbsvib.random.sources import BaseNoise, base_sources
from mbsvib.studies.evaluation import DesignPoint, Dual
from mbsvib.studies.responses import PortResponses, mean_squares

Law = tuple[str, str, str]


class Weighted(PortResponses):
    """Responses as one number, the Frobenius norm of weight of output x response x weight of input."""

    def __init__(self, label: str, outputs: Mapping[str, float], inputs: Mapping[str, float]) -> None:
        super().__init__(list(outputs), list(inputs))
        self._label, self._output_weights, self._input_weights = label, dict(outputs), dict(inputs)

    @property
    def label(self) -> str:
        """The response in words."""
        return self._label

    def _weights(self, system: System) -> Array:
        outputs, inputs = self.of(system)
        left = [self._output_weights[name] for name in outputs]
        right = [self._input_weights[name] for name in inputs]
        return np.outer(left, right)[:, :, None]

    def response(self, system: System, w: Array) -> Complex:
        """Return the weighted responses at angular frequencies, (outputs, inputs, n)."""
        return np.asarray(self._weights(system) * response(system, w, *self.of(system)))

    def with_slopes(self, point: DesignPoint, w: Array) -> tuple[Complex, Complex]:
        """Return the weighted responses and their derivatives, (variables, outputs, inputs, n)."""
        weights = self._weights(point.system)
        value, slope = super().with_slopes(point, w)
        return weights * value, weights * slope


def _by_laws(
    point: DesignPoint, w: Array, outputs: Sequence[str], inputs: Sequence[str], laws: Mapping[str, Law]
) -> tuple[Complex, Complex]:
    """Responses and derivatives, with some of the outputs computed by their laws."""
    computed = [laws[name][0] if name in laws else name for name in outputs]
    unique = list(dict.fromkeys(computed))
    rows = [unique.index(name) for name in computed]
    value, slope = (part.take(rows, axis=part.ndim - 3) for part in point.response(w, inputs, unique))
    known = point.system.parameters
    rates = _rates(point, [name for output in outputs if output in laws for name in laws[output][1:]])
    for row, name in enumerate(outputs):
        if name in laws:
            _, stiffness, damping = laws[name]
            z = known[stiffness] + 1j * w * known[damping]
            value[row] /= z
            change = rates[stiffness][:, None] + 1j * w * rates[damping][:, None]
            slope[:, row] = (slope[:, row] - value[row] * change[:, None]) / z
    return value, slope


def _rates(point: DesignPoint, parameters: Sequence[str]) -> dict[str, Array]:
    """Derivatives of some parameters with respect to each variable."""
    known = point.system.parameters
    result = {name: np.zeros(len(point.rates)) for name in parameters}
    for i, rates in enumerate(point.rates.values()):
        for pattern, rate in rates.items():
            for name in result.keys() & ([pattern] if pattern in known else matching(pattern, result)):
                result[name][i] += rate
    return result


class MeanSquares:
    """Mean squares of single outputs under noise that may be correlated; quantities share computed results.

    ``inputs``: where the noise enters, in its order. ``band``: first and last frequency [Hz]; None: all. ``laws``:
    outputs that are another output divided by k + i w c, with the names of that output and of the parameters k and c.
    """

    def __init__(
        self, outputs: Sequence[str], inputs: Sequence[str], noise: BaseNoise, band: tuple[float, float] | None,
        laws: Mapping[str, Law],
    ) -> None:  # fmt: skip
        self.outputs, self.inputs, self.noise, self.band = list(outputs), list(inputs), noise, band
        self._laws = laws
        self._last: tuple[System, Any, Array, Array] | None = None

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_last": None}

    def requested(self, outputs: Sequence[str]) -> MeanSquares:
        """Return the same mean squares, of these outputs too."""
        self.outputs.extend(name for name in outputs if name not in self.outputs)
        self._last = None
        return self

    def at(self, point: DesignPoint, outputs: Sequence[str]) -> Dual:
        """Return the mean squares of some of the outputs, with derivatives."""
        if self._last is None or self._last[0] is not point.system or self._last[1] is not point.rates:
            squares = mean_squares(point.system, self.outputs, base_sources(self.noise), self.band,
                                   lambda w: _by_laws(point, w, self.outputs, self.inputs, self._laws))  # fmt: skip
            self._last = (point.system, point.rates, *squares)
        rows = [self.outputs.index(name) for name in outputs]
        return point.dual(self._last[2][rows], self._last[3][rows])
