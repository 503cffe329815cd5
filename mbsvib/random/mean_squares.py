"""Mean squares of outputs under noise, by source: exact moments where spectra are rational, integrals elsewhere."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import OutsideTableWarning, ResponseError
from mbsvib.linalg.bands import within
from mbsvib.linalg.lasting import Lasting, Separation, separated
from mbsvib.random.moments import NARROWEST, Equations, Filtered, Rule, check_stable, filtered, moments, rule
from mbsvib.random.sources import Sources
from mbsvib.random.weights import Weight
from mbsvib.responses.feedthrough import direct
from mbsvib.responses.realizations import first_order

Band = tuple[float, float]

SHOWN = 3  # tables named in a warning


@dataclass(frozen=True, eq=False)
class MeanSquares:
    """Mean squares ``parts`` (outputs, sources) of independent sources, what their ``correlation`` (outputs,) adds, and
    a bound of the relative ``error`` of integrals over functions that are not known, 0 of all others.
    """

    parts: Array
    correlation: Array
    error: float = 0.0

    @property
    def total(self) -> Array:
        """The mean squares (outputs,)."""
        return np.asarray(np.maximum(self.parts.sum(axis=1) + self.correlation, 0.0))


@dataclass(frozen=True, eq=False)
class Random:
    """A system, state space or closed loop ``linear``, with the outputs asked for, under noise at the ``sources``.

    ``weights`` (outputs,) are filters of the outputs, None for none; ``band``: first and last frequency [Hz], None for
    all.
    """

    linear: Any
    sources: Sources
    weights: tuple[Weight | None, ...]
    band: Band | None

    @cached_property
    def plant(self) -> Equations:
        """First-order equations from the sources to the outputs."""
        space = first_order(self.linear)
        return Equations(space.A, space.B, space.C, direct(self.linear))

    @cached_property
    def _separation(self) -> Separation:
        parts = separated(*self.plant[:3], lambda of_a: ~of_a.decaying | (
            np.abs(of_a.values.real) <= NARROWEST * np.abs(of_a.values)))  # fmt: skip
        check_stable(parts, self.linear.name)
        return parts

    def mean_squares(self) -> MeanSquares:
        """Return the mean squares over the band."""
        count, rational = len(self.sources.names), self.rational
        parts, extra, error = np.zeros((len(self.plant.c), count)), np.zeros(len(self.plant.c)), 0.0
        if len(rational):
            windows = [None if weight is None else weight.window for weight in self.weights]
            equations = self.behind_filters(rational).all
            for row, window in enumerate(windows):
                if window is not None and equations.d[row].any():
                    name = self.sources.names[rational[int(np.flatnonzero(equations.d[row])[0])]]
                    raise ResponseError(f"noise: white noise at '{name}' acts directly on the output "
                                        f"'{self.outputs[row]}', whose average over {window.time:g} s has no exact "
                                        f"moments then; give a band, (first, last) [Hz].")  # fmt: skip
            parts[:, rational], extra = moments(equations, self.linear.name, self.cross, windows)
        others = [k for k in range(count) if k not in rational]
        if others:
            part = self._only(others) if len(rational) else self
            total = part.rule().integral(part.densities)
            parts[:, others], extra, error = total.value[:, :-1], extra + total.value[:, -1], total.error
            parts[:, others] = np.where(self._infinite()[:, others], np.inf, parts[:, others])
        return MeanSquares(parts, np.where(np.isinf(parts).any(axis=1), 0.0, extra), error)

    def _only(self, which: list[int]) -> Random:
        """Return the same equations under some of the sources, which are independent."""
        names = [self.sources.names[k] for k in which]
        densities = tuple([self.sources.densities[k] for k in which])
        return replace(self, linear=self.linear.with_ports(None, names),
                       sources=replace(self.sources, names=tuple(names), densities=densities))  # fmt: skip

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(self.linear.outputs)

    @property
    def exact(self) -> bool:
        """Whether all mean squares are moments of filtered white noise."""
        return len(self.rational) == len(self.sources.names)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the outputs behind their weights."""
        pairs = zip(self.linear.output_units, self.weights, strict=True)
        return tuple([unit if weight is None else weight.unit(unit) for unit, weight in pairs])

    @cached_property
    def rational(self) -> list[int]:
        """The sources that have exact moments: all or none of correlated ones."""
        filters = [part.filter for part in self.sources.densities]
        exact = self.band is None and all(
            weight is None or weight.filter is not None or weight.window is not None for weight in self.weights)
        if not exact or (self.sources.correlation is not None and self.cross is None):
            return []
        return [k for k, part in enumerate(filters) if part is not None]

    @cached_property
    def cross(self) -> Array | None:
        """R without its diagonal, where correlated sources share a filter: sqrt(S_i S_j) is rational there only."""
        r, densities = self.sources.constant, self.sources.densities
        first = densities[0].filter
        if r is None or first is None or not all(
                part.filter is not None and first.alike(part.filter) for part in densities):  # fmt: skip
            return None
        return r - np.eye(len(r))

    def behind_filters(self, which: list[int], plant: Equations | None = None) -> Filtered:
        """Return the equations, or others from the sources, with the filters of some sources and of all outputs."""
        a, b, c, d = plant or self.plant
        before = [self.sources.densities[k].filter for k in which]
        after = [None if weight is None else weight.filter for weight in self.weights]
        return filtered(Equations(a, b[:, which], c, d[:, which]), before, after)

    @cached_property
    def span(self) -> Band:
        """First and last frequency [Hz] at which there is noise within the band."""
        spans = np.array([part.span for part in self.sources.densities])
        low, high = float(spans[:, 0].min()), float(spans[:, 1].max())
        if self.band is None:
            return low, high
        if not (self.band[0] < high and low < self.band[1]):
            names = ", ".join(self.sources.names[:3])
            raise ResponseError(f"noise: the band from {self.band[0]:g} to {self.band[1]:g} Hz has no noise: that of "
                                f"{names} is given from {low:g} to {high:g} Hz.")  # fmt: skip
        return max(low, self.band[0]), min(high, self.band[1])

    def below(self, f: Array, factor: Callable[[Array], Array] | None = None, first: float = 0.0) -> Array:
        """Return the integrals (outputs, s + 1, n) of the densities, times a factor, up to ascending frequencies [Hz].

        ``first``: where integrals begin [Hz], if not at the first frequency of the span.
        """
        low, high = max(self.span[0], first), self.span[1]
        inside = np.clip(f, low, max(low, high))
        result = np.zeros((len(self.outputs), len(self.sources.names) + 1, len(f)))
        if inside[-1] > low:
            rule = self.rule(inside, low)
            weighted = self.densities if factor is None else lambda f: self.densities(f) * factor(f)
            parts = rule.integral(weighted, marks=True).value
            total = np.concatenate((np.zeros_like(parts[..., :1]), np.cumsum(parts, axis=-1)), axis=-1)
            result = total[..., np.searchsorted(rule.ends, inside)]
        for at, which in self._divergences():
            beyond = np.logical_and(inside >= at, inside > low)
            result[:, :-1] = np.where(which[..., None] & beyond, np.inf, result[:, :-1])
            result[:, -1] = np.where(which.any(axis=1, keepdims=True) & beyond, 0.0, result[:, -1])
        return result

    def rule(self, marks: Array | None = None, first: float = 0.0) -> Rule:
        """Return the panels of integrals over the span, which end at ``marks`` [Hz] too; up to the last of these."""
        low, high = max(self.span[0], first), self.span[1]
        poles = [self.linear_poles, self.sources.poles, *[w.poles for w in self.weights if w is not None]]
        breaks = np.unique(np.concatenate((self.sources.breaks, *[w.breaks for w in self.weights if w is not None])))
        if marks is not None:
            breaks, high = np.unique(np.concatenate((breaks, marks))), min(high, float(marks[-1]))
        unknown = callable(self.sources.correlation) or any(
            part.filter is None and not len(part.breaks) for part in self.sources.densities) or any(
            weight is not None and not weight.known for weight in self.weights)  # fmt: skip
        _, longest, period = self.resolution
        windows = [weight.window for weight in self.weights if weight is not None and weight.window is not None]
        longest = min([longest, *(1.0 / window.time for window in windows)])
        if windows and high == np.inf:
            raise ResponseError("noise: averages over a time need a last frequency, unless all noise is filtered white "
                                "noise; give a band, (first, last) [Hz].")  # fmt: skip
        return rule(np.concatenate(poles), breaks, (low, high), unknown, longest, period)

    @property
    def linear_poles(self) -> Complex:
        """Poles of the responses [1/s]."""
        return np.asarray(self.resolution[0])

    @cached_property
    def resolution(self) -> tuple[Complex, float, float]:
        """Poles of the responses [1/s], longest panel and period [Hz]."""
        known = getattr(self.linear, "resolution", None)
        return (self.linear.poles(), np.inf, np.inf) if known is None else tuple(known)

    def densities(self, f: Array) -> Array:
        """Return the densities (outputs, s + 1, n) due to each source and, last, to their correlation."""
        g = np.asarray(self.linear.frequency_response(2.0 * np.pi * f))
        for row, weight in enumerate(self.weights):
            if weight is not None:
                g[row] *= weight.at(f)
        density = self.sources.of(f)
        result = np.empty((len(g), len(density) + 1, len(f)))
        result[:, :-1] = np.abs(g) ** 2 * density
        cross, root = self.sources.across(f), np.sqrt(density)
        if cross is None:
            result[:, -1] = 0.0
            return result
        driven = (g * root).transpose(2, 0, 1)
        result[:, -1] = (((driven @ cross) * driven.conj()).sum(axis=2)).real.T
        return result

    def check_finite(self) -> None:
        """Refuse mean squares that are infinite, by the mode or the source that makes them so."""
        name, low = self.linear.name, self.span[0]
        for group, at in self._lasting():
            if group.pole.imag:
                raise ResponseError(f"rms: the mode of '{name}' at {at:.6g} Hz is not damped, and noise at its "
                                    f"frequency drives it without bound; give the mechanism damping, or a band "
                                    f"without it.")  # fmt: skip
            raise ResponseError(f"rms: noise drives a rigid-body mode of '{name}' away without bound; hold it, or give "
                                f"a band that starts above {low:g} Hz.")  # fmt: skip
        row, source = (int(k[0]) if len(k) else -1 for k in np.nonzero(self._infinite()))
        if row >= 0:
            raise ResponseError(f"rms: noise comes from '{self.sources.names[source]}' to '{self.outputs[row]}' at all "
                                f"frequencies, so that its mean square has no bound; give a band, (first, last) [Hz]."
                                )  # fmt: skip

    def _lasting(self) -> Iterator[tuple[Lasting, float]]:
        """Groups of poles that do not decay, with their frequencies [Hz], where noise drives them within the span."""
        for group in self._separation.shown:
            at = abs(group.pole.imag) / (2.0 * np.pi)
            if self.span[0] <= at <= self.span[1] and (group.shown & self._driven(at)).any():
                yield group, at

    def _driven(self, at: float) -> NDArray[np.bool_]:
        """Which outputs see noise of which sources at a frequency [Hz], (outputs, s)."""
        return np.asarray(self._weighted(np.array([at]))[:, :, 0] > 0.0)

    def _infinite(self) -> NDArray[np.bool_]:
        """Which mean squares (outputs, s) over the span are infinite."""
        result = np.zeros((len(self.outputs), len(self.sources.names)), dtype=bool)
        for _, which in self._divergences():
            result |= which
        return result

    def _divergences(self) -> Iterator[tuple[float, NDArray[np.bool_]]]:
        """Frequencies [Hz] within the span at which integrals have no bound, and which (outputs, s) these are."""
        low, high = self.span
        for group, at in self._lasting():
            yield at, group.shown & self._driven(at)
        if low == 0.0:
            slowest = float(np.abs(self.linear_poles[self.linear_poles != 0.0]).min(initial=1.0))
            f = slowest * np.array([1e-9, 1e-6])
            first, second = np.moveaxis(f * self.densities(f)[:, :-1], 2, 0)
            yield 0.0, (first >= second) & (first > 0.0)
        if high == np.inf:
            f = float(np.abs(self.linear_poles).max(initial=1.0)) * np.array([1e3, 1e6])
            first, second = np.moveaxis(f * self._weighted(f), 2, 0)
            # what falls no faster than 1/f beyond all poles has no bound
            yield np.inf, (self.plant.d != 0.0) & (second >= first) & (first > 0.0)

    def warn_outside(self, low: float, high: float) -> None:
        """Warn of tables that end within frequencies from ``low`` (0: the first of all) to ``high`` [Hz]."""
        ends = {name: part.span for name, part in zip(self.sources.names, self.sources.densities, strict=True)
                if len(part.breaks)}  # fmt: skip
        shown = [f"{name} from {first:g} to {last:g} Hz" for name, (first, last) in ends.items()
                 if not within(np.array([low or first, max(high, first)]), first, last).all()]  # fmt: skip
        if shown and self.span:  # refuses bands without any noise
            more = f" and {len(shown) - SHOWN} more" if len(shown) > SHOWN else ""
            warnings.warn(f"noise is asked for from {low:g} to {high:g} Hz, but tables give that of "
                          f"{', '.join(shown[:SHOWN])}{more}; it counts as 0 outside. Extend the tables, or ask within "
                          f"them.", OutsideTableWarning, stacklevel=4)  # fmt: skip

    def reasons(self) -> dict[str, str]:
        """Return why mean squares are infinite, {output: words}."""
        result: dict[str, str] = {}
        causes = sorted(self._divergences(), key=lambda cause: cause[0])
        for row, name in enumerate(self.outputs):
            own = [(at, which[row]) for at, which in causes if which[row].any()]
            if own:
                at, which = own[0]
                effect = _effect(self.linear, at, len({f for f, _ in own if f < np.inf}) - 1)
                result[name] = f"the noise of {self.sources.names[int(which.argmax())]} {effect}"
        return result

    def _weighted(self, f: Array) -> Array:
        """Densities of the sources as the weights of the outputs see them, (outputs, s, n)."""
        gains = [np.ones(len(f)) if weight is None else np.abs(weight.at(f)) ** 2 for weight in self.weights]
        return np.array(gains)[:, None] * self.sources.of(f)


def _effect(linear: Any, at: float, more: int) -> str:
    """What noise does at a frequency [Hz] where its mean square has no bound, and at how many ``more`` ones."""
    if at == np.inf:
        return "comes through directly at all frequencies; give a band"
    motion = f"{_motion(linear, at)}{f' and {more} more' if more else ''}"
    if at == 0.0:
        return f"drives {motion} away; hold it, or give a band that starts above 0 Hz"
    return f"drives {motion} without damping; give it damping, or a band without it"


def _motion(linear: Any, at: float) -> str:
    """What moves at a frequency [Hz] without damping, in words: a mode, where states have modes."""
    if linear.kind == "closed loop":
        poles, words = linear.poles(), linear.sources
    elif linear.kind == "system":
        modes = linear.modes()
        poles = modes.pairs
        words = [f"mode {k + 1} ({f:.4g} Hz, {' '.join(most)})"
                 for k, (f, most) in enumerate(zip(modes.frequencies, modes.strongest(), strict=True))]  # fmt: skip
    else:
        return f"a motion at {at:.6g} Hz"
    distance = np.abs(np.nan_to_num(poles) - 2j * np.pi * at).reshape(len(words), -1).min(axis=1)
    return str(words[int(distance.argmin())])
