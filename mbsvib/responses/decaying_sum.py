"""Decaying sums of exponentials: largest values and crossings, proven between samples and after the last of them.

On an interval [a, b] a sum differs from the chord through its ends by at most (b - a)^2 / 8 times the largest second
derivative, and after a by at most its envelope. Intervals in which this leaves a question open are halved.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammaln, xlogy

from mbsvib.common.arrays import Array, Bools, Complex
from mbsvib.errors import ResponseError
from mbsvib.linalg.groups import linked_items

# Samples of a period of the fastest term that counts, and the share of a level from which on all other terms count.
PER_PERIOD, COUNTS = 16, 1e-2
# Samples at a time, and of one question at most: some hundred thousand periods of a vibration.
CHUNK, MOST_SAMPLES = 1024, 2_000_000
# Halvings of an interval between samples; what differs by less than this share of the terms is equal.
HALVINGS, EQUAL = 60, 1e-14
# Halvings after which a single interval in which a level is passed counts as a bracket of one root.
BRACKETED = 10
# Exponents closer than this, relative, are tried as divided differences: their terms may cancel.
NEIGHBOURS = 1e-2
NEWTON = 3  # corrections of the time of a largest value


@dataclass(frozen=True, eq=False)
class DecayingSum:
    """f(t) = Re sum of r_k exp(lambda_k t) for t >= 0, the response of the system ``name`` but for its final value.

    ``residues`` r (k,), ``values`` lambda (k,) [1/s], with negative real parts.
    """

    name: str
    residues: Complex
    values: Complex

    def at(self, t: Array, order: int = 0) -> Array:
        """Return f, or its derivative of an order, at times (n,) [s]."""
        rows = np.array_split(t, max(1, t.size * len(self.values) // 1_000_000))
        weights = self.residues * self.values**order
        return np.concatenate([(np.exp(np.multiply.outer(part, self.values)) @ weights).real for part in rows])

    @cached_property
    def _bounds(self) -> tuple[Array, Array, Array, Array]:
        """Sizes c, powers p, rates s and largest |lambda| of terms c t^p / p! exp(-s t), whose sum is no less than |f|.

        Neighbouring exponents are Newton's divided differences of exp(lambda t) where these are the smaller bound.
        """
        size = np.abs(self.values)
        near = np.abs(self.values[:, None] - self.values) <= NEIGHBOURS * np.minimum(size[:, None], size)
        groups = linked_items(near)
        single = np.setdiff1d(np.arange(len(size)), np.concatenate([*groups, np.zeros(0, dtype=int)]))
        terms = [(abs(self.residues[k]), 0, -self.values[k].real, size[k]) for k in single.tolist()]
        for group in groups:
            value, residue = self.values[group], self.residues[group]
            rate, fastest = float((-value.real).min()), float(size[group].max())
            apart = [(abs(r), 0, -v.real, abs(v)) for r, v in zip(residue.tolist(), value.tolist(), strict=True)]
            together = []
            with np.errstate(over="ignore", invalid="ignore"):  # of hundreds of modes; these are no smaller bound
                for p in range(len(group)):
                    product = np.prod(value[p:, None] - value[None, :p], axis=1)
                    together.append((abs(complex(residue[p:] @ product)), p, rate, fastest))
                smaller = sum(c * _term(p, s, p / s) for c, p, s, _ in together) < np.abs(residue).sum()
            terms += together if smaller else apart
        table: Array = np.array(terms, dtype=float).reshape(-1, 4)
        return table[:, 0], table[:, 1], table[:, 2], table[:, 3]

    def _terms(self, t: Array, fall: int = 0) -> Array:
        """Bounds (terms, n) of t^(p - fall) / (p - fall)! exp(-s t) after times (n,), which never grow."""
        _, p, s, _ = self._bounds
        power = np.maximum(p - fall, 0.0)[:, None]
        late = np.maximum(t, power / s[:, None])
        return np.asarray((p >= fall)[:, None] * _term(power, s[:, None], late))

    def envelope(self, t: float) -> float:
        """Return what |f| never exceeds after a time [s]."""
        return float(self._bounds[0] @ self._terms(np.array([t]))[:, 0])

    def until(self, level: float) -> float:
        """Return a time [s] after which the envelope is at most a level."""
        if self.envelope(0.0) <= level:
            return 0.0
        late = 1.0 / float(self._bounds[2].min())
        while self.envelope(late) > level:
            late *= 2.0
        time = float(brentq(lambda t: self.envelope(t) - level, 0.0, late, xtol=1e-12 * late, rtol=1e-12))
        return min(time * (1.0 + 1e-9), late)

    def _off_chord(self, start: Array, length: Array) -> Array:
        """How far f may be off the chords of intervals (n,), term by term: by its curvature, or its size."""
        c, _, _, size = self._bounds
        size = size[:, None]
        bend = size**2 * self._terms(start) + 2.0 * size * self._terms(start, 1) + self._terms(start, 2)
        return np.asarray(c @ np.minimum(0.125 * length**2 * bend, 2.0 * self._terms(start)))

    def _open(self, a: Array, b: Array, top: Array, limit: float) -> Bools:
        """Whether f may exceed a limit on intervals, the larger of whose ends is ``top`` (n,)."""
        if not len(a):
            return np.zeros(0, dtype=bool)
        first, longest = a.min(keepdims=True), (b - a).max(keepdims=True)
        result = top + self._off_chord(first, longest) > limit
        result[result] = top[result] + self._off_chord(a[result], (b - a)[result]) > limit
        return result

    def _signed(self, t: Array, sign: float) -> Array:
        """sign f, or |f| if the sign is 0."""
        return sign * self.at(t) if sign else np.abs(self.at(t))

    def last(self, level: float) -> float:
        """Return the last time [s] at which |f| exceeds a level, 0 if it never does."""
        chunks = self._samples(level, self.until(level), backward=True)
        times = (self._edge(t, level, 0.0, last=True) for t in chunks)
        return next((time for time in times if time is not None), 0.0)

    def first(self, level: float, sign: float) -> float:
        """Return the first time [s] at which sign f exceeds a level below 0, which it ends above."""
        end = self.until(-level)
        times = (self._edge(t, level, sign, last=False) for t in self._samples(-level, end))
        return next((time for time in times if time is not None), end)

    def highest(self, sign: float, floor: float) -> tuple[float, float]:
        """Return the largest value of sign f and its time [s], (-inf, inf) if it is not above a floor."""
        best, at = floor, np.inf
        equal = EQUAL * self.envelope(0.0)
        for t in self._samples(floor, self.until(floor)):
            if self.envelope(float(t[0])) <= best:
                break
            f = sign * self.at(t)
            a, b, low, high = t[:-1], t[1:], f[:-1], f[1:]
            k = int(np.argmax(f))
            if f[k] > best:
                best, at = float(f[k]), float(t[k])
            for _ in range(HALVINGS):
                open_ = self._open(a, b, np.maximum(low, high), best + equal)
                if not open_.any():
                    break
                a, b, low, high = (x[open_] for x in (a, b, low, high))
                middle = 0.5 * (a + b)
                values = sign * self.at(middle)
                k = int(np.argmax(values))
                if values[k] > best:
                    best, at = float(values[k]), float(middle[k])
                a, b = np.concatenate((a, middle)), np.concatenate((middle, b))
                low, high = np.concatenate((low, values)), np.concatenate((values, high))
        return (best, self._stationary(at)) if at < np.inf else (-np.inf, np.inf)

    def _stationary(self, time: float) -> float:
        """The time near by at which f' is 0, by Newton's method."""
        for _ in range(NEWTON if time > 0.0 else 0):
            point = np.array([time])
            slope, bend = float(self.at(point, 1)[0]), float(self.at(point, 2)[0])
            step = -slope / bend if bend else 0.0
            if abs(step) > 1e-3 / float(np.abs(self.values).max()):
                break
            time += step
        return time

    def _edge(self, t: Array, level: float, sign: float, last: bool) -> float | None:
        """The last or first time at which a function exceeds a level in a chunk of samples; None if it does not."""
        f, side = self._signed(t, sign), 1.0 if last else -1.0
        best = float((side * t[f > level]).max(initial=-np.inf))
        limit = level + EQUAL * self.envelope(0.0)
        a, b, low, high = t[:-1], t[1:], f[:-1], f[1:]
        for k in range(HALVINGS):
            open_ = self._open(a, b, np.maximum(low, high), limit) & (side * (b if last else a) > best)
            a, b, low, high = (x[open_] for x in (a, b, low, high))
            if not len(a):
                break
            if k > BRACKETED and len(a) == 1 and (low[0] > level) != (high[0] > level):
                return float(brentq(lambda x: self._signed(np.array([x]), sign)[0] - level, a[0], b[0],
                                    xtol=1e-14 * b[0], rtol=1e-14))  # fmt: skip
            middle = 0.5 * (a + b)
            f = self._signed(middle, sign)
            best = max(best, float((side * middle[f > level]).max(initial=-np.inf)))
            a, b = np.concatenate((a, middle)), np.concatenate((middle, b))
            low, high = np.concatenate((low, f)), np.concatenate((f, high))
        return side * best if np.isfinite(best) else None

    def _samples(self, level: float, end: float, backward: bool = False) -> Iterator[Array]:
        """Chunks of times from 0 to an end, or back, that resolve every term as long as it counts beside a level."""
        size, rate = np.abs(self.residues), -self.values.real
        least = COUNTS * level / len(size)
        drop = np.log(np.maximum(size / least, 1.0)) / rate
        marks = np.unique(np.concatenate(([0.0, end], drop[(drop > 0.0) & (drop < end)])))
        taken = 0
        pieces = list(zip(marks[:-1].tolist(), marks[1:].tolist(), strict=True))
        for start, stop in reversed(pieces) if backward else pieces:
            counted = drop >= stop
            fastest = float(np.abs(self.values[counted]).max(initial=0.0))
            count = max(1, int(np.ceil((stop - start) * PER_PERIOD * fastest / (2.0 * np.pi))))
            chunks = range(0, count, CHUNK)
            for k in reversed(chunks) if backward else chunks:
                indices = np.arange(k, min(k + CHUNK, count) + 1)
                taken += len(indices)
                if taken > MOST_SAMPLES:
                    raise self._too_long(counted)
                yield start + (stop - start) / count * indices
        if not pieces:
            yield np.zeros(1)

    def _too_long(self, counted: Array) -> ResponseError:
        slow = self.values[counted] if counted.any() else self.values
        worst = slow[np.argmax(np.abs(slow) / -slow.real)]
        return ResponseError(
            f"step_info: '{self.name}' vibrates at {abs(worst) / (2.0 * np.pi):.4g} Hz with a damping ratio of "
            f"{-worst.real / abs(worst):.1e}: it takes more than {MOST_SAMPLES:,} samples until it has settled."
        )


def _term(p: Any, s: Any, t: Any) -> Any:
    """t^p / p! exp(-s t), also of large powers."""
    return np.exp(xlogy(p, t) - gammaln(p + 1.0) - s * t)
