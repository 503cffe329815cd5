"""Figures of an isolation: transmissibility and compliance over frequency, values of these, the asymptote."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.system import System
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.selection import port_numbers
from mbsvib.common.units import prefix
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.feedback.loop import resolution
from mbsvib.feedback.loop_rounding import response
from mbsvib.feedback.sampled import SampledLoop
from mbsvib.isolation.study_scene import ACCELERATIONS, DIRECTIONS, StudyScene
from mbsvib.linalg.balancing import scaled
from mbsvib.linalg.singular_values import singular_values
from mbsvib.responses import extrema
from mbsvib.responses.feedthrough import direct, without_rounding
from mbsvib.responses.norms import growth

Linear: TypeAlias = System | FeedbackLoop

STEEPEST = 12  # maximum order: a response that falls faster is rounding where the asymptote holds
AFTER = 2  # parameters after the leading one, from which the start of the asymptote follows


@dataclass(frozen=True, slots=True)
class Asymptote:
    """||T(i w)|| -> ``size`` / w^``order``, the dominant term above the angular frequency ``start`` [rad/s]."""

    order: int
    size: float
    start: float


def asymptote(linear: Linear, into: list[int], out: list[int], left: Array, right: Array) -> Asymptote | None:
    """Return the asymptote of the Frobenius norm of diag(left) T diag(right).

    T(s) = H0 + H1 / s + H2 / s^2 + ...

    ``left`` (outputs,), ``right`` (inputs,): weights. Returns None where T is 0, or falls with more than the twelfth
    power of the frequency.
    """
    unit = float(np.abs(linear.poles()).max(initial=0.0)) or 1.0  # [1/s], so that powers stay of one size
    if isinstance(linear, System) and not linear.massless:
        parameters = _second_order(linear, into, out, unit)
    else:
        parameters = _first_order(linear, into, out, unit)
    sizes: list[float] = []
    order = 0
    for k, markov in zip(range(STEEPEST + AFTER + 1), parameters, strict=False):
        size = float(np.linalg.norm(left[:, None] * markov * right))
        if sizes or size > 0.0:
            order = order if sizes else k
            sizes.append(size)
        if len(sizes) > AFTER or (k == STEEPEST and not sizes):
            break
    if not sizes:
        return None
    start = max([(size / sizes[0]) ** (1.0 / j) for j, size in enumerate(sizes[1:], 1)]) or 1.0
    return Asymptote(order, sizes[0] * unit**order, start * unit)


def _second_order(system: System, into: list[int], out: list[int], unit: float) -> Iterator[Array]:
    """Markov parameters of M q'' + C q' + K q = B u with time in 1/``unit`` [s], zeros where they are rounding.

    q(s) = sum of x_k / s^(k + 2), M x_0 = B u, M x_k = -C x_(k-1) - K x_(k-2). Terms with the same number of damper
    factors are summed together, so that those of weak dampers are not taken for rounding of springs.
    """
    inverse = np.linalg.inv(system.M)
    size = np.abs(inverse)
    rounding = size @ np.abs(system.M) @ size
    rates = [system.C / unit, system.K / unit**2]
    rows = [system.Ca[out], system.Cv[out] / unit, system.Cq[out] / unit**2]
    b = system.B[:, into]
    none = np.zeros_like(b), np.zeros_like(b)
    yield direct(system)[np.ix_(out, into)]
    # by the number of damper factors: motions, and their rounding errors, in parts of ZERO_MARKOV
    motions: list[dict[int, tuple[Array, Array]]] = [{}, {0: (inverse @ b, rounding @ np.abs(b))}]
    while True:
        before, last = motions[-2:]
        following = {}
        for count in {count + 1 for count in last} | set(before):
            motion, error = np.zeros_like(b), np.zeros_like(b)
            for rate, part in zip(rates, (last.get(count - 1, none), before.get(count, none)), strict=True):
                motion = motion - inverse @ (rate @ part[0])
                error = error + rounding @ (np.abs(rate) @ np.abs(part[0])) + size @ (np.abs(rate) @ part[1])
            following[count] = motion, error
        motions = [before, last, following]
        total = np.zeros((len(out), len(into)))
        for count in {count for part in motions for count in part}:
            parts = [part.get(count, none) for part in reversed(motions)]
            value = np.sum([row @ part[0] for row, part in zip(rows, parts, strict=True)], axis=0)
            error = np.sum([np.abs(row) @ part[1] for row, part in zip(rows, parts, strict=True)], axis=0)
            total += without_rounding(value, error)
        yield total
        motions = motions[1:]


def _first_order(linear: Linear, into: list[int], out: list[int], unit: float) -> Iterator[Array]:
    """Markov parameters D, C B, C A B, ... with time in 1/``unit`` [s], zeros where they are rounding."""
    space = linear.state_space("physical" if isinstance(linear, System) else "modal")
    a, power, c = scaled(space.A / unit, space.B[:, into] / unit, space.C[out])
    yield direct(linear)[np.ix_(out, into)]
    while True:
        markov, size = c @ power, np.linalg.norm(c, axis=1)[:, None] * np.linalg.norm(power, axis=0)
        yield without_rounding(markov, size)
        power = a @ power


KILO = 1e4  # [Hz], from where frequencies are written in kHz and MHz


@dataclass(frozen=True, repr=False, eq=False)
class Figures(Columnar):
    """Transmissibility from a base to a body and the body's compliance, over ``frequencies`` (n,) [Hz].

    ``transmissibility`` (6, base directions, n) is acceleration over acceleration, ``compliance`` (6, 6, n)
    displacement against the base over wrench [m/N, rad/N, ...], both at ``scene.point``. Measures of all directions at
    once take rotations times ``scene.length``. Resonance, amplification and crossover are those of the band from the
    first to the last frequency, whatever frequencies are between.
    """

    scene: StudyScene
    linear: Linear = field(repr=False)
    frequencies: Array
    transmissibility: Complex = field(repr=False)
    compliance: Complex = field(repr=False)

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.scene.model.name

    @cached_property
    def scaled(self) -> Complex:
        """Transmissibility with rotations in metres at the characteristic length, dimensionless."""
        return self._scaled(self.transmissibility)

    def _scaled(self, g: Complex) -> Complex:
        left, right = self.scene.scale(), self.scene.scale(self.scene.base_directions)
        return np.asarray(left[:, None, None] * g / right[:, None])

    @cached_property
    def index(self) -> Array:
        """Frobenius index ||T||_F / sqrt(base directions), shape (n,): 1 where the body moves as the base does."""
        return _frobenius(self.scaled)

    @cached_property
    def singular_values(self) -> Array:
        """Singular values of the transmissibility, in descending order, shape (base directions, n)."""
        return singular_values(self.scaled)

    @cached_property
    def compliance_values(self) -> Array:
        """Singular values of the compliance [m/N], moments over the length and rotations times it, shape (6, n)."""
        scale = self.scene.scale()[:, None, None]
        return singular_values(scale * self.compliance * scale.transpose(1, 0, 2))

    @cached_property
    def undamped(self) -> Array:
        """Frequencies [Hz] of undamped modes that the base excites."""
        poles = self.linear.poles() / (2.0 * np.pi)
        return extrema.excited(self._index_at, poles, float(self.frequencies[0]), float(self.frequencies[-1]))

    def _index_at(self, frequencies: ArrayLike) -> Array:
        w = 2.0 * np.pi * np.asarray(frequencies, dtype=float)
        ports = ACCELERATIONS, self.scene.inputs
        g = (response(self.linear, w, *ports) if isinstance(self.linear, System)
             else self.linear.frequency_response(w, *ports))  # fmt: skip
        return _frobenius(self._scaled(g))

    @cached_property
    def _band(self) -> extrema.Band | None:
        """The square of the index over the band; None if that is a single frequency."""
        low, high = float(self.frequencies[0]), float(self.frequencies[-1])
        poles, longest, period = resolution(self.linear)
        ends = extrema.panels(poles / (2.0 * np.pi), low, high, longest=longest, period=period)
        return extrema.Band(lambda f: self._index_at(f) ** 2, ends) if high > low else None

    @cached_property
    def _peak(self) -> tuple[float, float]:
        if len(self.undamped):
            return float(self.undamped[0]), float("inf")
        if self._band is None:
            return float(self.frequencies[0]), float(self.index[0])
        where, square = self._band.highest(np.asarray)
        return where, float(np.sqrt(square))

    @property
    def resonance(self) -> float:
        """Frequency of the largest Frobenius index [Hz]."""
        return self._peak[0]

    @property
    def amplification(self) -> float:
        """The largest Frobenius index; infinite where the base excites an undamped mode."""
        return self._peak[1]

    @cached_property
    def crossover(self) -> float:
        """Frequency [Hz] above which the index stays below 1, so that the body is isolated; the first frequency if it
        is below 1 all over the band, infinite if it is not at the end.
        """
        if self.index[-1] >= 1.0:
            return float("inf")
        crossings = self._band.crossings(lambda square: square - 1.0) if self._band else np.zeros(0)
        return float(crossings[-1] if len(crossings) else self.frequencies[0])

    @property
    def decade(self) -> float:
        """Index a decade above the crossover; not a number where the band has no crossover."""
        inside = self.frequencies[0] < self.crossover < np.inf
        return float(self._index_at([10.0 * self.crossover])[0]) if inside else float("nan")

    @cached_property
    def _asymptote(self) -> Asymptote | None:
        far = self.linear.open_loop if isinstance(self.linear, SampledLoop) else self.linear  # a hold blocks the rest
        out, into = port_numbers(ACCELERATIONS, self.scene.inputs, (far.outputs, far.inputs), far.name)
        left = self.scene.scale() / np.sqrt(len(into))
        result = asymptote(far, into, out, left, 1.0 / self.scene.scale(self.scene.base_directions))
        # the response of a hold has ripples at high frequency, and decreases with the frequency
        return result if result is None or not self.sampled or not result.order else None

    @property
    def sampled(self) -> bool:
        """Whether the controllers are discrete-time ones."""
        return isinstance(self.linear, SampledLoop)

    @property
    def roll_off(self) -> float:
        """Slope [dB/decade] of the index at high frequency, a multiple of 20; 0 where the index levels off."""
        return 0.0 - 20.0 * self._asymptote.order if self._asymptote else float("nan")

    @property
    def roll_off_from(self) -> float:
        """Frequency [Hz] above which the index follows the slope of the roll-off."""
        return self._asymptote.start / (2.0 * np.pi) if self._asymptote else float("nan")

    @property
    def plateau(self) -> float:
        """The index at infinite frequency: 0 unless it levels off, as where masses of legs pass on vibration."""
        return self._asymptote.size if self._asymptote and not self._asymptote.order else 0.0

    def table(self) -> dict[str, Any]:
        """Return the table of figures as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        f = self.frequencies
        static = self.compliance_values[:, 0]
        # a maximum at the first frequency is the end of a response that only falls
        peak = (("resonance", _hertz(self.resonance)), ("amplification at resonance",
                f"{self.amplification:.4g} ({_decibel(self.amplification)})"))  # fmt: skip
        if self.resonance <= f[0] and not len(self.undamped):
            peak = (("resonance", "none in this band"), ("amplification at resonance", f"none: {peak[1][1]} at most"))
        rows = [
            *peak,
            ("isolation starts at (crossover)",
             f"{'below ' if self.crossover == f[0] else ''}{_hertz(self.crossover)}"),
            ("index one decade above crossover",
             f"{self.decade:.3g} ({_decibel(self.decade)})" if self.decade > 0.0 else "-"),
            ("roll-off", _roll_off(self)),
            (f"index at {_hertz(f[-1])}", f"{self.index[-1]:.3g} ({_decibel(self.index[-1])})"),
            (f"compliance at {_hertz(f[0])}, minimum and maximum", f"{static[-1]:.3g}, {static[0]:.3g} m/N"),
        ]
        if len(self.undamped):
            rows[1] = ("amplification at resonance", "infinite: undamped")
        scene, directions = self.scene, self.scene.base_directions
        point = ", ".join(f"{x:g}" for x in scene.point)
        notes = [f"Index ||T||_F/sqrt({len(directions)}) of accelerations at ({point}) m, rotations times "
                 f"{scene.length:.4g} m; base motion along {' '.join(directions)}.", *scene.notes]  # fmt: skip
        if words := unstable(self.linear):
            notes.append(f"Unstable: {words}")
        title = f"Isolation of {scene.body} from {scene.base}: {self.name}"
        return {"title": title, "columns": [("quantity", "left"), ("value", "right")], "rows": rows, "notes": notes}

    _index = "frequency_hz"

    def columns(self) -> dict[str, Array]:
        """Return frequencies [Hz], index, singular values, transmissibility and compliance as columns (n,) by name:
        ``frequency_hz``, ``index``, ``singular_value_1``, ..., ``T_x_x_re``, ``T_x_x_im``, ..., ``C_x_x_re``, ...
        """
        scene = self.scene
        columns = {"frequency_hz": self.frequencies, "index": self.index}
        columns |= {f"singular_value_{i}": values for i, values in enumerate(self.singular_values, 1)}
        for symbol, table, sources in (("T", self.transmissibility, scene.base_directions),
                                     ("C", self.compliance, DIRECTIONS)):  # fmt: skip
            for i, direction in enumerate(DIRECTIONS):
                for j, source in enumerate(sources):
                    columns[f"{symbol}_{direction}_{source}_re"] = table[i, j].real
                    columns[f"{symbol}_{direction}_{source}_im"] = table[i, j].imag
        return columns


def _frobenius(g: Complex) -> Array:
    return np.asarray(np.sqrt((np.abs(g) ** 2).sum(axis=(0, 1)) / g.shape[1]))


def _roll_off(study: Figures) -> str:
    if study.sampled and not study.plateau:
        return "none: the controller is sampled"
    if study.plateau:
        return f"none: levels off at {study.plateau:.3g} ({_decibel(study.plateau)})"
    if not np.isfinite(study.roll_off):
        return "too steep: the response is below rounding"
    return f"{study.roll_off:.0f} dB/decade above {_hertz(study.roll_off_from)}"


def unstable(linear: Any) -> str:
    """Return in words that a mechanism is not stable, "" if it is, and for closed loops, which are checked before."""
    words = growth(linear) if isinstance(linear, System) else ""
    return f"'{linear.name}' is not stable: {words} grows, and no steady vibration has this response." if words else ""


def _hertz(value: float) -> str:
    """A frequency in words."""
    if not np.isfinite(value):
        return "not in this band"
    factor, unit = prefix("Hz", value) if value >= KILO else (1.0, "Hz")
    return f"{factor * value:.4g} {unit}"


def _decibel(value: float) -> str:
    """A ratio in decibel."""
    return f"{20.0 * np.log10(value):+.1f} dB" if value > 0.0 else "none"
