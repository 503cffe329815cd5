"""Error budgets: which source of noise contributes how much to each output."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import band_of, hertz
from mbsvib.common.selection import Names, selected
from mbsvib.common.units import pretty
from mbsvib.errors import ResponseError, counted
from mbsvib.random.mean_squares import Random
from mbsvib.random.sources import CORRELATION, Correlation, Sources, sources
from mbsvib.random.weights import weights
from mbsvib.responses.frequency_grid import frequency_grid

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.plots._sheet import Given
    from mbsvib.random.slopes import Requested

# Contributions to a variance below this share of it are counted together in the table.
SMALL = 1e-3
ROUNDING = 1e-10  # share of an rms below which what is left is rounding, which has no row


@dataclass(frozen=True, repr=False, eq=False)
class Budget(Columnar, Displayed):
    """Root mean squares of outputs under noise, by source.

    ``rms`` {output: value}; ``contributions`` {output: {source: value}}: the largest first; their squares add up to
    that of the rms. With correlated sources each is that of the source alone, and the entry "correlation" is the root
    of what correlation adds, negative where it takes away. ``weighting`` {output: filter} says in words by what an
    output is weighted; outputs without a filter are not in it. ``error`` bounds the relative error of integrals over
    densities given as functions, 0 of others, which are exact to rounding. ``units`` are those of the outputs behind
    their weighting, ``band`` [Hz] is None for all frequencies.
    """

    name: str
    """Name of the system or loop."""
    rms: Mapping[str, float]
    contributions: Mapping[str, Mapping[str, float]]
    units: Mapping[str, str]
    band: tuple[float, float] | None
    weighting: Mapping[str, str]
    error: float
    _random: Random = field(repr=False)
    _members: Mapping[str, tuple[int, ...]] = field(repr=False)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(self.rms)

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the inputs at which there is noise, or of groups of these."""
        return tuple(self._members)

    def grouped(self, groups: Mapping[str, Names]) -> Budget:
        """Return the budget with some sources counted together, such as all sensors.

        rms of a group = root of the sum of the squares of its sources

        Parameters
        ----------
        groups : mapping of str to str or sequence of str
            {name of the group: names or patterns of its sources}, such as ``{"sensors": "*.force.noise"}``. Sources
            in no group stay as they are. What correlation adds stays the entry "correlation".

        Returns
        -------
        Budget
            Ranked by group; ``psd``, ``cumulative`` and ``plot`` take groups as sources.

        Raises
        ------
        ResponseError
            If a name is unknown, or a source is in two groups.
        """
        members: dict[str, tuple[int, ...]] = {}
        taken: dict[str, str] = {}
        for group, names in groups.items():
            found = [self.sources[k] for k in selected(names, self.sources, "source", self.name)]
            for source in found:
                if source in taken:
                    raise ResponseError(f"budget of '{self.name}': the source '{source}' is in the groups "
                                        f"'{taken[source]}' and '{group}'; expected in one of them.")  # fmt: skip
                taken[source] = group
            members[group] = tuple(k for source in found for k in self._members[source])
        left = {source: numbers for source, numbers in self._members.items() if source not in taken}
        if clash := sorted({*left, CORRELATION} & set(members)):
            raise ResponseError(f"budget of '{self.name}': a group is called '{clash[0]}', as one of its other entries "
                                f"is; give it another name.")  # fmt: skip
        parts = {output: _ranked({name: float(np.sqrt(sum(values[source] ** 2 for source in self.sources
                                                          if source == name or taken.get(source) == name)))
                                  for name in {**members, **left}}, values.get(CORRELATION))
                 for output, values in self.contributions.items()}  # fmt: skip
        return replace(self, contributions=parts, _members=members | left)

    def frequencies(self) -> Array:
        """Return frequencies [Hz] that resolve all resonances, and show where densities begin and end, (n,)."""
        low, high = self._random.span
        f = frequency_grid(self._random.linear, self._random.linear_poles) / (2.0 * np.pi)
        breaks = self._random.sources.breaks
        f = np.concatenate((f, breaks[breaks > 0.0]))
        last = high if high < np.inf else float(f.max())
        return np.unique(np.clip(f, low if low > 0.0 else float(f.min()), last))

    def psd(self, frequencies: ArrayLike | None = None, source: str | None = None) -> Array:
        """Return the one-sided power spectral densities of the outputs.

        S_y = G S_x G^H

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Frequencies [Hz]; default: ``frequencies()``.
        source : str, optional
            A source, the contribution of which is asked for; default: all together.

        Returns
        -------
        array, shape (outputs, n)
            Densities [unit^2/Hz].

        Raises
        ------
        ResponseError
            If frequencies are no numbers, or there is no such source.
        """
        f = self.frequencies() if frequencies is None else hertz(frequencies)
        return np.asarray(self._of(self._random.densities(f), source))

    def cumulative(self, frequencies: ArrayLike | None = None, source: str | None = None) -> Array:
        """Return the cumulative root mean squares, from 0 or the first frequency of the band up to each frequency.

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Ascending frequencies [Hz]; default: ``frequencies()``.
        source : str, optional
            A source, the contribution of which is asked for; default: all together.

        Returns
        -------
        array, shape (outputs, n)
            Root mean squares of the part below each frequency, which tend to ``rms``.

        Raises
        ------
        ResponseError
            If frequencies do not ascend, or there is no such source.
        """
        f = self.frequencies() if frequencies is None else hertz(frequencies)
        return np.sqrt(np.maximum(self._of(self._random.below(f), source), 0.0))

    def _of(self, parts: Array, source: str | None) -> Array:
        """The sum over the sources of (outputs, sources + 1, ...), or the part of one."""
        if source is None:
            return np.asarray(parts.sum(axis=1))
        if source == CORRELATION:
            return np.asarray(parts[:, -1])
        if source not in self._members:
            raise ResponseError(f"budget of '{self.name}': there is no source '{source}'; expected one of "
                                f"{', '.join(self.sources)}.")  # fmt: skip
        return np.asarray(parts[:, list(self._members[source])].sum(axis=1))

    def sensitivities(self, parameters: Requested = None) -> dict[str, dict[str, float]]:
        """Return the derivatives of the root mean squares to parameters of the mechanism.

        d rms / dp = (2 tr(Q dA P) + 2 tr(Q dB W B^T) + 2 dC P C^T) / (2 rms), with the Gramians P and Q; likewise of
        integrals, and of the parts of a period of a sampled loop. Densities and weightings that are functions have
        to be smooth for it: jumps, as of bands, belong in pairs (frequency [Hz], value), which are exact.

        Parameters
        ----------
        parameters : str, sequence of str or mapping, optional
            Names, patterns or linear maps, as for ``eigenvalue_sensitivities``. Default: every parameter.

        Returns
        -------
        dict
            {output: {parameter: derivative}} [unit of the output per unit of the parameter]; infinite where a change
            makes the rms so, not a number of an rms that is 0 or infinite.

        Raises
        ------
        ModelError
            If a parameter is unknown, or there is no mechanism.
        ResponseError
            If the weighting is an average over a time, or the loop is sampled and there is a band.

        Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 4.3, for the Gramians.
        """
        from mbsvib.random.slopes import sensitivities

        return sensitivities(self._random, parameters)

    def controller_sensitivities(self) -> dict[str, dict[str, Array]]:
        """Return the derivatives of the root mean squares to the entries of the controller.

        Returns
        -------
        dict
            {output: {"A": (k, k), "B": (k, sensors), "C": (actuators, k), "D": (actuators, sensors)}}, of ``loop.law``.

        Raises
        ------
        ResponseError
            If there is no controller, or as of ``sensitivities``.
        """
        from mbsvib.random.slopes import law_sensitivities

        return law_sensitivities(self._random)

    def table(self) -> dict[str, Any]:
        """Return the table of contributions as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        rows: list[tuple[str, ...]] = []
        for name, parts in self.contributions.items():
            total, unit = self.rms[name], pretty(self.units[name])
            rows.append((name, "all", f"{total:.4g}", unit, ""))
            shown = {source: value for source, value in parts.items() if _share(value, total) > SMALL}
            rows += [("", source, f"{value:.4g}", unit, _percent(value, total)) for source, value in shown.items()]
            others = {source: value for source, value in parts.items() if source not in shown}
            rest = float(np.sqrt(np.sum(np.square(list(others.values())))))
            if rest > (ROUNDING * total if np.isfinite(total) else 0.0):
                label = f"{len(others)} more" if len(others) > 1 else next(iter(others))
                rows.append(("", label, f"{rest:.2g}", unit, _percent(rest, total)))
        notes = ["All frequencies." if self.band is None else f"From {self.band[0]:g} to {self.band[1]:g} Hz."]
        if self.weighting:
            notes.append(f"Weighted: {', '.join(f'{name} by {words}' for name, words in self.weighting.items())}.")
        infinite = [name for name, value in self.rms.items() if np.isinf(value)]
        reasons = self._random.reasons() if infinite else {}
        sampled = "samples of white noise have no bound, or add up to a drift"
        notes += [f"{name} is infinite: {reasons.get(name, sampled)}." for name in infinite]
        if self.error:
            notes.append(f"Integrals over densities given as functions: relative error at most {self.error:.1e}.")
        columns: list[tuple[str, Any]] = [("output", "left"), ("source", "left"), ("rms", "right"), ("unit", "left"),
                                          ("of the variance", "right")]  # fmt: skip
        return {"title": f"Error budget of {self.name}", "columns": columns, "rows": rows, "notes": notes}

    _index = "frequency_hz"

    def columns(self) -> dict[str, Array]:
        """Return frequencies [Hz], spectral densities and cumulative root mean squares as columns (n,) by name:
        ``frequency_hz``, ``psd OUTPUT [(unit)^2/Hz]``, ..., ``cumulative rms OUTPUT [unit]``, ...
        """
        f = self.frequencies()
        columns = {"frequency_hz": f}
        for form, values in (("psd {} [({})^2/Hz]", self.psd(f)), ("cumulative rms {} [{}]", self.cumulative(f))):
            columns |= {form.format(*unit): row for unit, row in zip(self.units.items(), values, strict=True)}
        return columns

    def plot(
        self, output: str | None = None, frequencies: ArrayLike | None = None, *, ax: Given | None = None
    ) -> Figure | Given:
        """Draw density and cumulative root mean square of an output with those of its largest sources.

        Parameters
        ----------
        output : str, optional
            Name; default: the first one.
        frequencies : array-like, shape (n,), optional
            Ascending frequencies [Hz]; default: ``frequencies()``.
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            The figure.

        Raises
        ------
        ResponseError
            If there is no such output.
        """
        from mbsvib.plots.budget import budget_figure

        name = self.outputs[0] if output is None else output
        if name not in self.outputs:
            raise ResponseError(f"budget of '{self.name}': there is no output '{name}'; expected one of "
                                f"{', '.join(self.outputs)}.")  # fmt: skip
        f = self.frequencies() if frequencies is None else hertz(frequencies)
        row = self.outputs.index(name)
        density, below = self._random.densities(f)[row], self._random.below(f)[row]
        shown = [source for source in self.contributions[name] if source != CORRELATION]
        curves = {source: (density[k].sum(axis=0), np.sqrt(np.maximum(below[k].sum(axis=0), 0.0)))
                  for source in shown for k in [list(self._members[source])]}  # fmt: skip
        total = density.sum(axis=0), np.sqrt(np.maximum(below.sum(axis=0), 0.0))
        words = f", {self.weighting[name]}" if name in self.weighting else ""
        return budget_figure(f"{name} of {self.name}{words}", self.units[name], f, total, curves,
                             self.contributions[name], self.rms[name], ax)  # fmt: skip

    def __repr__(self) -> str:
        return (f"Budget({self.name!r}: {counted(len(self.outputs), 'output')}, "
                f"{counted(len(self.sources), 'source')})")  # fmt: skip


def _share(value: float, total: float) -> float:
    return 1.0 if np.isinf(value) else (value / total) ** 2 if 0.0 < total < np.inf else 0.0


def _percent(value: float, total: float) -> str:
    share = 100.0 * _share(value, total)
    text = f"{'-' if value < 0.0 else ''}{share:.2f} %" if share >= 0.01 else "< 0.01 %"
    return text if np.isfinite(total) else ""


def random(
    linear: Any, floor: Mapping[str, Any] | Sources, outputs: Names, band: Iterable[float] | None,
    correlation: Correlation, weighting: Any,
) -> Random:  # fmt: skip
    """Return linear equations under noise; arguments as of ``RandomVerbs.budget``."""
    found = sources(floor, linear.inputs, linear.input_units, linear.name, correlation)
    part = linear.with_ports(outputs, list(found.names))
    if not part.outputs:
        raise ResponseError(f"noise: '{linear.name}' has no outputs; add one by add_output.")
    form = Random
    if getattr(linear, "period", None) is not None:
        from mbsvib.random.sampled import SampledRandom

        form = SampledRandom
    known = dict(zip(linear.outputs, weights(weighting, linear.outputs, linear.name), strict=True))
    for output, unit in zip(part.outputs, part.output_units, strict=True):
        if known[output] is not None:
            known[output].check_unit(output, unit)
    under = form(part, found, tuple([known[output] for output in part.outputs]), band_of(band, "noise"))
    under.warn_outside(*under.band or (0.0, 0.0))
    return under


def budget(under: Random) -> Budget:
    """Return the error budget of equations under noise."""
    result = under.mean_squares()
    root = np.sqrt(result.total)
    names, units = under.outputs, dict(zip(under.outputs, under.units, strict=True))
    extra = np.copysign(np.sqrt(np.abs(result.correlation)), result.correlation).tolist()
    parts = {name: _ranked(dict(zip(under.sources.names, np.sqrt(result.parts[row]).tolist(), strict=True)),
                           None if under.sources.correlation is None else extra[row])
             for row, name in enumerate(names)}  # fmt: skip
    weighting = {name: weight.words for name, weight in zip(names, under.weights, strict=True) if weight is not None}
    members = {name: (k,) for k, name in enumerate(under.sources.names)}
    return Budget(under.linear.name, dict(zip(names, root.tolist(), strict=True)), parts, units, under.band,
                  weighting, result.error, under, members)  # fmt: skip


def _ranked(parts: Mapping[str, float], correlation: float | None) -> dict[str, float]:
    """Contributions by source, the largest first; those that differ by rounding keep their order."""
    ranked = dict(sorted(parts.items(), key=lambda item: -float(f"{item[1]:.9e}")))
    return ranked if correlation is None else ranked | {CORRELATION: correlation}
