"""Loops with discrete-time controllers under noise: mean squares over time, with what sampling folds.

The density of an output is that of its component at the same frequency, |G|^2 S, and what the controllers make of all
other frequencies: the forces that they demand are a sequence, the density of which repeats after the rate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.tables import listed
from mbsvib.errors import ResponseError
from mbsvib.feedback.closing import Gathered
from mbsvib.feedback.loop import NOISE, LoopPlant
from mbsvib.feedback.sampled_norm import Slopes, mean_squares, square_slopes
from mbsvib.feedback.sampled_power import demanded, held, mean_powers, power_slopes, white_densities
from mbsvib.random.mean_squares import MeanSquares, Random
from mbsvib.random.moments import Equations, Filtered, filtered
from mbsvib.random.sources import Sources
from mbsvib.responses import extrema
from mbsvib.responses.densities import Table

if TYPE_CHECKING:
    from mbsvib.feedback.sampled import SampledLoop

WHITE = "white."  # inputs of the filters of noise
# From a pole at 0 to where a density shows it, in parts of the slowest other pole: rounding moves the pole by less.
BESIDE_ZERO = 1e-4


@dataclass(frozen=True, eq=False)
class SampledRandom(Random):
    """A sampled loop under noise. White noise of a sensor is a sequence of numbers, one a sample, with this density up
    to half the rate.
    """

    linear: SampledLoop

    def mean_squares(self) -> MeanSquares:
        """Return the mean squares over the band, averaged over time."""
        self._check()
        count, correlated = len(self.sources.names), self.sources.correlation is not None
        if self.band is not None:
            total = self.rule().integral(self.densities)
            parts = np.where(self._infinite(), np.inf, total.value[:, :-1])
            return MeanSquares(parts, np.where(np.isinf(parts).any(axis=1), 0.0, total.value[:, -1]), total.error)
        parts, extra, error = np.zeros((len(self.linear.outputs), count)), np.zeros(len(self.linear.outputs)), 0.0
        tables, rational = self._kinds
        if rational:
            parts[:, rational] = self._moments(rational)
            if correlated:
                with np.errstate(invalid="ignore"):
                    extra = self._moments(rational, together=True).sum(axis=1) - parts.sum(axis=1)
        if tables:
            loop, chosen = self._under_tables(self._among_filters([])[0], tables)

            def powers(f: Array) -> Array:
                """Mean squares (outputs, tables + 1, n) due to each table and to their correlation."""
                cases = np.asarray(np.sqrt(chosen.of(f)).T[:, :, None] * np.eye(len(tables)), dtype=complex)
                if correlated:
                    cases = np.concatenate((cases, _roots_of(chosen, f)), axis=2)
                result = mean_powers(loop, 2.0 * np.pi * f, cases)
                alone, both = result[:, : len(tables)], result[:, len(tables) :]
                added = both.sum(axis=1) - alone.sum(axis=1) if correlated else np.zeros_like(alone[:, 0])
                return np.concatenate((alone, added[:, None]), axis=1)

            total = replace(self, sources=chosen).rule().integral(powers)
            parts[:, tables], extra, error = total.value[:, :-1], extra + total.value[:, -1], total.error
        return MeanSquares(parts, np.where(np.isinf(parts).any(axis=1), 0.0, extra), error)

    @property
    def span(self) -> tuple[float, float]:
        """First and last frequency [Hz] of outputs: sampling folds noise to all of them."""
        return super().span if self.band is None else self.band

    def _divergences(self) -> Iterator[tuple[float, NDArray[np.bool_]]]:
        """Undamped poles [Hz] within the span, and which outputs show what which sources do to them, (outputs, s)."""
        poles = self.linear_poles
        turns = np.abs(poles[np.abs(poles.real) <= extrema.UNDAMPED * np.abs(poles)]) / (2.0 * np.pi)
        at = np.unique(turns[(turns >= self.span[0]) & (turns <= self.span[1])])
        if not len(at):
            return
        slowest = float(np.abs(poles[poles != 0.0]).min(initial=2.0 * np.pi * self.linear.rate)) / (2.0 * np.pi)
        step = np.where(at > 0.0, extrema.CLOSE * at, BESIDE_ZERO * slowest)
        near, farther = (self.densities(at + k * step)[:, :-1] for k in (1.0, 10.0))
        yield from zip(at, np.moveaxis(near > extrema.GROWTH**2 * farther, 2, 0), strict=True)

    def warn_outside(self, low: float, high: float) -> None:
        """Warn of nothing: sampling folds noise to all frequencies."""

    def check_finite(self) -> None:
        if self.band is not None and self._infinite().any():
            raise ResponseError(f"rms: a mode of '{self.linear.name}' from {self.band[0]:g} to {self.band[1]:g} Hz is "
                                f"not damped, and noise at its frequency drives it without bound; give the mechanism "
                                f"damping, or a band without it.")  # fmt: skip

    def _check(self) -> None:
        """Refuse what there is no way to for sampled loops."""
        name = self.linear.name
        tables = [isinstance(part, Table) for part in self.sources.densities]
        if self.sources.correlation is not None and self.cross is None and not all(tables):
            raise ResponseError(f"noise: '{name}' is sampled; expected densities of correlated sources that are all "
                                f"tables, or white noise behind like filters and a real constant correlation."
                                )  # fmt: skip
        if self.cross is not None and np.delete(self.cross[self._sequences], self._sequences, axis=1).any():
            raise ResponseError(f"noise: '{name}' is sampled; white noise of its sensors is a sequence of numbers, "
                                f"which cannot be correlated with other noise; give both a filter.")  # fmt: skip
        for part, source in zip(self.sources.densities, self.sources.names, strict=True):
            if part.filter is None and not isinstance(part, Table):
                raise ResponseError(f"noise: '{name}' is sampled, and needs all that sampling folds; give the density "
                                    f"at '{source}' as a table, or as filtered white noise.")  # fmt: skip
        if self.band is None and any(weight is not None and weight.filter is None for weight in self.weights):
            raise ResponseError(f"noise: '{name}' is sampled; expected a rational weighting, 'Wk', 'Wd' or "
                                f"isolation.shaped(...), unless a band is given.")  # fmt: skip

    @cached_property
    def _sequences(self) -> list[int]:
        """White noises of sensors; filtered noise, or a table, has its own course between samples."""
        known = self.linear.plant.without_noise
        sensors = [] if known is None else [f"{name}{NOISE}" for name in known.outputs]
        return [k for k, (name, part) in enumerate(zip(self.sources.names, self.sources.densities, strict=True))
                if name in sensors and part.filter is not None and not len(part.poles)]

    def _moments(self, which: list[int], together: bool = False) -> Array:
        loop, intensities = self._by_white_noise(self._among_filters(which)[0], which, together)
        space, (shown, into), (y, _) = loop.plant.space, loop.selected_ports, loop.ports
        at_once = (space.D[np.ix_(y, into)] != 0.0).any(axis=0) & (intensities == 0.0)
        # what is sampled directly has no bound; it is left out of the sums, and told
        sampled = replace(loop, plant=LoopPlant(replace(space, D=_without(space.D, y, into, at_once))))
        squares = mean_squares(sampled, intensities)
        squares[:, at_once] = np.inf
        squares[space.D[np.ix_(shown, into)] != 0.0] = np.inf
        return squares

    def square_gradient(self, row: int) -> tuple[Array, Array]:
        """Return the gradients of the mean square of one output, which is finite, to [A B; C D] of the plant with its
        noise, and of the controller.
        """
        if self.band is not None:
            raise ResponseError(f"sensitivities: '{self.linear.name}' is sampled, and mean squares over a band have "
                                f"none; expected no band. Ask loop.continuous for others.")  # fmt: skip
        (tables, rational), parts = self._kinds, list[Slopes]()
        if rational:
            among, filters, ports = self._among_filters(rational)
            driven, intensities = self._by_white_noise(among, rational, together=self.cross is not None)
            slopes = square_slopes(driven.with_ports(driven.outputs[row], None), intensities)
            if self.cross is not None:
                slopes.plant[:, -len(rational) :] = slopes.plant[:, -len(rational) :] @ self._roots.T
            parts.append(self._before_filters(slopes, filters, ports))
        if tables:
            among, filters, ports = self._among_filters([])
            loop, chosen = self._under_tables(among, tables)
            f, weights = replace(self, sources=chosen).rule().nodes()
            slopes = power_slopes(loop.with_ports(loop.outputs[row], None), 2.0 * np.pi * f, _roots_of(chosen, f),
                                  weights)  # fmt: skip
            parts.append(self._before_filters(slopes, filters, ports))
        return np.sum([part.plant for part in parts], axis=0), np.sum([part.law for part in parts], axis=0)

    def _before_filters(self, slopes: Slopes, filters: Filtered, ports: Gathered) -> Slopes:
        """Gradients to the plant and the controller, of those to the loop among filters."""
        space = self.linear.plant.space
        plant = ports.back(filters.to_plant(slopes.plant), (space.A, space.B, space.C, space.D))
        return slopes._replace(plant=plant)

    @property
    def _kinds(self) -> tuple[list[int], list[int]]:
        """Numbers of the sources with tables, and of all others."""
        tables = [k for k, part in enumerate(self.sources.densities) if isinstance(part, Table)]
        return tables, [k for k in range(len(self.sources.names)) if k not in tables]

    def _under_tables(self, among: SampledLoop, tables: list[int]) -> tuple[SampledLoop, Sources]:
        """The loop before filters of its outputs from the sources with tables, and these."""
        loop = among.with_ports(None, [self.sources.names[k] for k in tables])
        return loop, replace(self.sources, names=loop.inputs,
                             densities=tuple([self.sources.densities[k] for k in tables]))  # fmt: skip

    def _by_white_noise(self, loop: SampledLoop, which: list[int], together: bool = False) -> tuple[SampledLoop, Array]:
        """The loop among filters from white noises of some sources, and the variances of those that are sequences.

        ``together``: from independent noises of which the correlated ones of all sources are sums.
        """
        driven = loop.with_ports(None, [f"{WHITE}{self.sources.names[k]}" for k in which])
        if together:
            space, into = driven.plant.space, driven.selected_ports[1]
            b, d = space.B.copy(), space.D.copy()
            b[:, into], d[:, into] = b[:, into] @ self._roots, d[:, into] @ self._roots
            driven = replace(driven, plant=LoopPlant(replace(space, B=b, D=d)))
        return driven, np.where(np.isin(which, self._sequences), loop.rate, 0.0)

    @cached_property
    def _roots(self) -> Array:
        """L with R = L L^T (s, s) of correlated white noises, of sequences and of all others."""
        assert self.cross is not None
        result = np.zeros_like(self.cross)
        sequence = np.isin(np.arange(len(result)), self._sequences)
        for own in (sequence, ~sequence):
            values, vectors = np.linalg.eigh(np.eye(own.sum()) + self.cross[np.ix_(own, own)])
            result[np.ix_(own, own)] = vectors * np.sqrt(np.maximum(values, 0.0))
        return result

    def _among_filters(self, which: list[int]) -> tuple[SampledLoop, Filtered, Gathered]:
        """The loop with outputs behind their filters, and white noise before those of some sources as inputs; its
        equations, and which of the ports among filters are which of the plant.
        """
        loop, space = self.linear, self.linear.plant.space
        ports = Gathered([*range(len(space.outputs)), *[space.outputs.index(name) for name in loop.outputs]],
                         [*range(len(space.inputs)), *[space.inputs.index(self.sources.names[k]) for k in which]]
                         )  # fmt: skip
        before = [*[None] * len(space.inputs), *[self.sources.densities[k].filter for k in which]]
        after = [*[None] * len(space.outputs), *[None if weight is None else weight.filter for weight in self.weights]]
        filters = filtered(Equations(*ports.of((space.A, space.B, space.C, space.D))), before, after)
        names = tuple([f"filtered.{name}" for name in loop.outputs])
        inputs = (*space.inputs, *[f"{WHITE}{self.sources.names[k]}" for k in which])
        whole = space.from_arrays(*filters.all, inputs, (*space.outputs, *names), name=space.name)
        return replace(loop, plant=LoopPlant(whole), selection=(names, inputs)), filters, ports

    def densities(self, f: Array) -> Array:
        self._check()
        loop, w = self.linear, 2.0 * np.pi * f
        g, out, gains = loop.frequency_response(w), held(loop, w), np.ones((len(loop.outputs), len(f)), dtype=complex)
        for row, weight in enumerate(self.weights):
            if weight is not None:
                gains[row] = weight.at(f)
        g, out = g * gains[:, None], out * gains[:, None]
        result = np.zeros((len(g), len(self.sources.names) + 1, len(f)))
        result[:, :-1] = np.abs(g) ** 2 * self.sources.of(f)

        def shown(demand: Complex) -> Array:
            return np.asarray(np.einsum("oun,nuv,ovn->on", out, demand, out.conj(), optimize=True).real)

        for k, part in enumerate(self.sources.densities):
            if isinstance(part, Table):
                own = self._folded_tables([k], f, lambda f, part=part: part.at(f)[:, None, None] + 0j)  # type: ignore[misc]
                result[:, k] += shown(own)
            elif k not in self._sequences:
                result[:, k] = np.abs(gains) ** 2 * self._of_white_noise([k], w)
        if self.sources.correlation is not None:
            across, everything = self._across(f), [*range(len(self.sources.names))]
            if self.cross is None:
                result[:, -1] = shown(self._folded_tables(everything, f, self._across))
            else:
                apart = np.isin(everything, self._sequences)
                across = across * np.outer(apart, apart)
                both, alone = (self._of_white_noise(everything, w, together) for together in (True, False))
                result[:, -1] = np.abs(gains) ** 2 * (both - alone)
            result[:, -1] += np.einsum("oin,nij,ojn->on", g, across, g.conj(), optimize=True).real
        return result

    def _across(self, f: Array) -> Complex:
        """Cross-densities (n, s, s) of the sources, 0 of each with itself."""
        return self.sources.matrix(f) * (1.0 - np.eye(len(self.sources.names)))

    def _of_white_noise(self, which: list[int], w: Array, together: bool = False) -> Array:
        """Densities (outputs, n) due to filtered white noises that are not sampled sequences."""
        loop, _ = self._by_white_noise(self._among_filters(which)[0], which, together)
        noises = [name for name, k in zip(loop.inputs, which, strict=True) if k not in self._sequences]
        loop = replace(loop, selection=(self.linear.outputs, tuple(noises)))
        if loop.plant.space.D[np.ix_(loop.ports[0], loop.selected_ports[1])].any():
            raise ResponseError(f"noise: '{self.linear.name}' samples what white noise acts on at once, so that its "
                                f"density has no bound; give it a filter, or a table: "
                                f"{listed([self.sources.names[k] for k in which])}.")  # fmt: skip
        return np.asarray(2.0 * white_densities(loop, w).sum(axis=1))  # unit intensity is a density of 2

    def _folded_tables(self, which: list[int], f: Array, density: Callable[[Array], Complex]) -> Complex:
        """The same of tables, whose frequencies end, with densities (n, s, s) of some sources."""
        loop = self.linear.with_ports(None, [self.sources.names[k] for k in which])
        last = max(self.sources.densities[k].span[1] for k in which)
        result = np.zeros((len(f), len(loop.actuators), len(loop.actuators)), dtype=complex)
        for fold in range(-int((last + f.max()) / loop.rate), int((last + f.max()) / loop.rate) + 1):
            there = f - fold * loop.rate
            inside = (np.abs(there) <= last) & (fold != 0)
            if not inside.any():
                continue
            size = density(np.abs(there[inside]))
            u = demanded(loop, 2.0 * np.pi * there[inside]).transpose(2, 0, 1)
            size = np.where(there[inside, None, None] < 0.0, size.conj(), size)
            result[inside] += u @ size @ u.conj().swapaxes(1, 2)
        return result


def _roots_of(sources: Sources, f: Array) -> Complex:
    """Amplitudes (n, s, s) of independent inputs of unit density that add up to the sources."""
    values, vectors = np.linalg.eigh(sources.matrix(f))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[:, None])


def _without(d: Array, rows: list[int], columns: list[int], which: Array) -> Array:
    """D with zeros from some of the columns to some rows."""
    result = d.copy()
    result[np.ix_(rows, [column for column, zero in zip(columns, which, strict=True) if zero])] = 0.0
    return result
