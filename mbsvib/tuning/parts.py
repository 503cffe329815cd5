"""Parts of tunable controllers: their values and their equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.tuning.realization import Realization, stacked, summed
from mbsvib.tuning.structures import Part, Sizes, Value

Given = Mapping[str, Any] | None

SMALL, SPREAD = 0.1, 0.3  # gains of starts in parts of what acts as much as the plant, and their logarithmic spread
DEEP, WIDE = 0.1, 0.7  # damping ratios of zeros and of poles of a notch at the start
FILTER = 0.1  # time constant of a derivative at the start, times the mean pole
ACROSS = 0.03  # spread of gains between one signal and another of a different number, in parts of their sizes


def _matrix(symbol: str, rows: Array, columns: Array, mean: float) -> list[Value]:
    """Values of a matrix of gains, of which those on the diagonal begin at a mean, others about 0."""
    one = len(rows) == len(columns) == 1
    return [Value(symbol if one else f"{symbol}[{r + 1},{c + 1}]", float(rows[r] / columns[c]),
                  mean if r == c else 0.0, SMALL * SPREAD if r == c else ACROSS)
            for r in range(len(rows)) for c in range(len(columns))]  # fmt: skip


@dataclass(frozen=True, repr=False, eq=False)
class Gain(Part):
    """A matrix of gains, u = D y."""

    kind: ClassVar[str] = "gain"

    def values(self, sizes: Sizes) -> list[Value]:
        return _matrix("gain", sizes.actuators, sizes.sensors, -SMALL)

    def at(self, values: Complex) -> Realization:
        return Realization(0, values.T.reshape(-1, len(self.outputs), len(self.inputs)))


@dataclass(frozen=True, repr=False, eq=False)
class Pid(Part):
    """K = kp + ki / s + kd s / (tau s + 1), or some of its terms."""

    kind: ClassVar[str] = "pid"
    single: ClassVar[bool] = True

    terms: str = "pid"

    def values(self, sizes: Sizes) -> list[Value]:
        size, rate = float(sizes.actuators[0] / sizes.sensors[0]), sizes.rate
        spread = SMALL * SPREAD
        known = {"p": [Value("kp", size, -SMALL, spread)], "i": [Value("ki", size * rate, -0.1 * SMALL, 0.1 * spread)],
                 "d": [Value("kd", size / rate, -SMALL, spread),
                       Value("tau", 1.0 / rate, FILTER, SPREAD, positive=True)]}  # fmt: skip
        return [value for term in self.terms for value in known[term]]

    def at(self, values: Complex) -> Realization:
        """Return the terms side by side; states: the integral of the sensor, and its filtered value."""
        given, count, terms = iter(values), values.shape[1], []
        for term in self.terms:
            if term == "p":
                terms.append(stacked(0, [[next(given)]], count))
            elif term == "i":
                terms.append(stacked(1, [[0.0, 1.0], [next(given), 0.0]], count))
            else:
                kd, tau = next(given), next(given)
                terms.append(stacked(1, [[-1.0 / tau, 1.0 / tau], [-kd / tau, kd / tau]], count))
        return summed(terms, [[0]] * len(terms), [[0]] * len(terms), (1, 1))


@dataclass(frozen=True, repr=False, eq=False)
class LeadLag(Part):
    """K = gain (s / zero + 1) / (s / pole + 1)."""

    kind: ClassVar[str] = "lead_lag"
    single: ClassVar[bool] = True

    def values(self, sizes: Sizes) -> list[Value]:
        return [Value("gain", float(sizes.actuators[0] / sizes.sensors[0]), -SMALL, SMALL * SPREAD),
                Value("zero", sizes.rate, 1.0, SPREAD, positive=True),
                Value("pole", sizes.rate, 3.0, SPREAD, positive=True)]  # fmt: skip

    def at(self, values: Complex) -> Realization:
        """Return the sensor, filtered by the pole, as the state."""
        g, z, p = values
        return stacked(1, [[-p, p], [g * (1.0 - p / z), g * p / z]], len(g))


@dataclass(frozen=True, repr=False, eq=False)
class Notch(Part):
    """K = (s^2 + 2 depth w s + w^2) / (s^2 + 2 width w s + w^2), w = frequency."""

    kind: ClassVar[str] = "notch"
    single: ClassVar[bool] = True

    def values(self, sizes: Sizes) -> list[Value]:
        return [Value("frequency", sizes.rate, 1.0, SPREAD, positive=True),
                Value("depth", 1.0, DEEP, SPREAD, positive=True),
                Value("width", 1.0, WIDE, SPREAD, positive=True)]  # fmt: skip

    def at(self, values: Complex) -> Realization:
        """Return 1 and an oscillator that takes away what the notch stops."""
        w, depth, width = values
        return stacked(2, [[0.0, w, 0.0], [-w, -2.0 * width * w, w], [0.0, 2.0 * (depth - width), 1.0]], len(w))

    def through(self, sensors: Array, rate: float) -> Array:
        return sensors


@dataclass(frozen=True, repr=False, eq=False)
class Space(Part):
    """x' = A x + B y, u = C x + D y of a given order; A is full, of oscillators ("modal") or diagonal."""

    kind: ClassVar[str] = "state_space"

    order: int = 2
    structure: str = "full"
    feedthrough: bool = True

    @property
    def _drive_is_fixed(self) -> bool:
        """Whether B is given by A: for one sensor this is no loss."""
        return self.structure != "full" and len(self.inputs) == 1

    def values(self, sizes: Sizes) -> list[Value]:
        k, rate = self.order, sizes.rate
        spread = np.linspace(1.0, 2.0, k)
        if self.structure == "full":
            values = [Value(f"A[{r + 1},{c + 1}]", rate, -spread[r] if r == c else 0.0, SPREAD if r == c else 0.1)
                      for r in range(k) for c in range(k)]  # fmt: skip
        elif self.structure == "diagonal":
            values = [Value(f"pole[{r + 1}]", rate, float(spread[r]), SPREAD, positive=True) for r in range(k)]
        else:
            values = []
            for r in range(k // 2):
                values += [Value(f"frequency[{r + 1}]", rate, float(spread[2 * r]), SPREAD, positive=True),
                           Value(f"damping[{r + 1}]", 1.0, 0.5, SPREAD, positive=True)]  # fmt: skip
            if k % 2:
                values.append(Value("pole", rate, float(spread[-1]), SPREAD, positive=True))
        if not self._drive_is_fixed:
            values += [Value(f"B[{r + 1},{c + 1}]", float(rate / s), float(r % len(self.inputs) == c), 0.3)
                       for r in range(k) for c, s in enumerate(sizes.sensors)]  # fmt: skip
        to = sizes.actuators if not self._drive_is_fixed else sizes.actuators / sizes.sensors[0]
        values += [Value(f"C[{r + 1},{c + 1}]", float(to[r]), 0.0, SMALL) for r in range(len(to)) for c in range(k)]
        if self.feedthrough:
            values += _matrix("D", sizes.actuators, sizes.sensors, -SMALL)
        return values

    def at(self, values: Complex) -> Realization:
        k, o, i = self.order, len(self.outputs), len(self.inputs)
        x = np.zeros((values.shape[1], k + o, k + i), dtype=complex)
        v = self._dynamics(values, x)
        blocks = [] if self._drive_is_fixed else [(slice(0, k), slice(k, None))]
        blocks += [(slice(k, None), slice(0, k))]
        blocks += [(slice(k, None), slice(k, None))] if self.feedthrough else []
        for rows, columns in blocks:
            at = x[:, rows, columns]
            count = at[0].size
            at[:] = values[v : v + count].T.reshape(at.shape)
            v += count
        return Realization(k, x)

    def _dynamics(self, values: Complex, x: Complex) -> int:
        """Enter A, and B where it is given by A; return the number of values that were used."""
        k = self.order
        if self.structure == "full":
            x[:, :k, :k] = values[: k * k].T.reshape(-1, k, k)
            return k * k
        driven, v = self._drive_is_fixed, 0
        pairs = k // 2 if self.structure == "modal" else 0
        for r in range(0, 2 * pairs, 2):
            w, damping = values[v : v + 2]
            x[:, r, r + 1], x[:, r + 1, r], x[:, r + 1, r + 1] = w, -w, -2.0 * damping * w
            if driven:
                x[:, r + 1, k] = w
            v += 2
        for r in range(2 * pairs, k):
            x[:, r, r] = -values[v]
            if driven:
                x[:, r, k] = values[v]
            v += 1
        return v
