"""Stability margins of loops with several actuators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import hertz
from mbsvib.common.units import time_unit
from mbsvib.errors import ResponseError
from mbsvib.feedback.loop import Loop
from mbsvib.feedback.loop_rounding import evaluated
from mbsvib.linalg.diagonal_norms import highest_norms
from mbsvib.linalg.rank import EPS
from mbsvib.responses.extrema import Band, excited, panels

# Band, in parts of the lowest and highest pole that rounding can tell from 0.
LOWEST, HIGHEST = 1e-6, 1e6
UNIT = 1.0  # [Hz], about which the band lies if no pole has a size
# At both ends of the band the loop gain is near its limit, which is real, or tends to 0 or infinity.
REAL = 1e-3
# A loop gain below this, or above its inverse, limits no gain: its sign is rounding.
NONE = 1e-6
# Distances from a pole of the closed loop, in parts of it: S at the first one where it is known stands for the value at
# the pole.
BESIDE = (1e-9, 1e-7, 1e-5, 1e-3)
# The modulus comes this near to 1 only where the loop gain vanishes.
VANISHES = 1e-6


@dataclass(frozen=True, repr=False, eq=False)
class Margins(Columnar, Displayed):
    """How far closed loops are from instability.

    Disk margin of all loops simultaneously, 1 / max over w of mu(S), S = (1 - K G)^-1 at the actuators, mu the
    structured singular value of diagonal complex perturbations: ``modulus`` has the bound min over diagonal D of
    sigma(D S D^-1) for mu(S), which no units of the actuators change; it is mu for up to three actuators. ``frequency``
    [Hz] is the critical frequency where it occurs. All gains may change within ``all_gains``, or all phases by
    +-``all_phases`` [deg], in any combination. For each of the ``actuators``, the other loops closed: ``lower`` and
    ``gain`` are the gain margins, ``phase`` [deg] the phase margin, ``delay`` [s] the delay margin and ``modulus_each``
    the modulus margin, the smallest distance of its locus from -1; 0 and infinite without limit. ``lower_at``,
    ``gain_at``, ``phase_at``, ``delay_at``, ``modulus_at`` [Hz] are where they occur, NaN without limit. A loop gain
    that stays above 1 however high the frequency, as of accelerations, has no delay margin: 0 at infinity. In sampled
    loops the delay is that between a sample and its force, as the ``delay`` of ``sampled``.
    """

    name: str
    """Name of the controller."""
    actuators: tuple[str, ...]
    modulus: float
    frequency: float
    lower: Array
    gain: Array
    phase: Array
    delay: Array
    modulus_each: Array
    lower_at: Array
    gain_at: Array
    phase_at: Array
    delay_at: Array
    modulus_at: Array
    stable: bool
    """Whether the loop is stable; an unstable one has no margins."""

    @property
    def all_gains(self) -> tuple[float, float]:
        """Factors between which all gains may change simultaneously."""
        limited = self.modulus <= 1.0 - VANISHES
        return 1.0 / (1.0 + self.modulus), 1.0 / (1.0 - self.modulus) if limited else float("inf")

    @property
    def all_phases(self) -> float:
        """Phase [deg] by which all loops may change simultaneously."""
        return float(np.degrees(2.0 * np.arcsin(min(0.5 * self.modulus, 1.0))))

    _index = "actuator"

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the margins of each loop as columns by name.

        Returns
        -------
        dict of str to array, shape (actuators,)
            ``actuator``, ``lower_gain``, ``upper_gain``, ``phase_deg``, ``delay_s``, ``modulus``.
        """
        return {"actuator": np.array(self.actuators), "lower_gain": self.lower, "upper_gain": self.gain,
                "phase_deg": self.phase, "delay_s": self.delay, "modulus": self.modulus_each}  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return the margins as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        factor, unit = time_unit(float(self.delay[np.isfinite(self.delay)].max(initial=0.0)))
        loops = zip(self.actuators, self.lower, self.gain, self.phase, self.delay, self.modulus_each, strict=True)
        rows = [(name, f"{low:.3g} ... {high:.3g}", f"{phase:.3g}", f"{factor * delay:.3g}", f"{modulus:.3g}")
                for name, low, high, phase, delay, modulus in loops]  # fmt: skip
        low, high = self.all_gains
        rows.append(("disk margin (simultaneous)", f"{low:.3g} ... {high:.3g}", f"{self.all_phases:.3g}", "",
                     f"{self.modulus:.3g}"))  # fmt: skip
        if not self.stable:
            rows = [(name, *[""] * 4) for name, *_ in rows]
            notes = ["The closed loop is unstable: it has no margins."]
        elif self.modulus > 1.0 - VANISHES:
            notes = ["No critical frequency: the sensitivity is largest, 1, where the loop gain vanishes."]
        else:
            notes = [f"Critical frequency, where the sensitivity of all loops together is largest: "
                     f"{self.frequency:.4g} Hz."]  # fmt: skip
        headers = ("actuator", "gain margin", "phase margin [deg]", f"delay margin [{unit}]", "modulus margin")
        columns = [(header, "left" if header == "actuator" else "right") for header in headers]
        return {"title": f"Stability margins: {self.name}", "columns": columns, "rows": rows, "notes": notes}


def margins(loop: Loop, frequencies: ArrayLike | None = None) -> Margins:
    """Return the margins of a closed loop.

    ``frequencies`` (n,): the first and the last are the limits of the band [Hz]; default: all frequencies, of a sampled
    loop up to half its rate.

    Source: P. Seiler, A. Packard and P. Gahinet, IEEE Control Systems Magazine 40 (2020) 78, for the disk margin; M. G.
    Safonov, IEE Proc. D 129 (1982) 251, and J. C. Doyle, IEE Proc. D 129 (1982) 242, for the scalings.
    """
    band, largest, frequency = _disk(loop, frequencies)
    limits = band.response(band.ends[[0, -1]])[: 2 if frequencies is None else 0]
    endless = np.isinf(loop.resolution.period)
    each = [_single(band, loop, limits[:, i, i], i, endless) for i in range(len(loop.actuators))]
    (lower, gain, phase, delay, modulus), at = np.array(each).transpose(2, 1, 0)
    lower_at, gain_at, phase_at, delay_at, modulus_at = at
    if loop.stable:
        delay, delay_at = np.array([loop.delay_limit(i, (delay[i], delay_at[i]), (band.ends[0], band.ends[-1]))
                                    for i in range(len(delay))]).reshape(-1, 2).T  # fmt: skip
    return Margins(loop.law.name, loop.actuators, 1.0 / largest, frequency, lower, gain, phase, delay, modulus,
                   lower_at, gain_at, phase_at, delay_at, modulus_at, loop.stable)  # fmt: skip


def modulus_margin(loop: Loop) -> tuple[float, float]:
    """Return the modulus margin of all loops simultaneously, and the critical frequency [Hz]."""
    _, largest, frequency = _disk(loop, None)
    return 1.0 / largest, frequency


def _disk(loop: Loop, frequencies: ArrayLike | None) -> tuple[Band, float, float]:
    """The sensitivity over a band, and the largest bound of its structured singular value with its frequency [Hz]."""
    poles, longest, period = loop.resolution
    if frequencies is None:
        size = np.abs(np.concatenate((poles, loop.open_loop.poles()))) / (2.0 * np.pi)
        size = size[size > 0.0]
        if not len(size):
            size = np.array([min(UNIT, 0.5 * period)])
        low, high = LOWEST * float(size.min()), min(HIGHEST * float(size.max()), 0.5 * period)
    else:
        f = hertz(frequencies)
        low, high = float(f[0]), float(f[-1])
        if low == high:
            raise ResponseError(f"margins: frequencies: only {low:g} Hz; expected the first and the last of a band.")
    ends = panels(poles / (2.0 * np.pi), low, high, longest=longest, period=period)
    # 1 / (1 - K G) has only the poles of the closed loop
    band = Band(lambda hertz: _sensitivity(loop, hertz), ends)
    frequency, largest = band.highest(highest_norms)
    critical = _critical(loop, band, lambda s: np.asarray(np.abs(s).max(axis=(1, 2))))
    if len(critical):
        frequency, largest = float(critical[0]), np.inf
    return band, largest, frequency


def _critical(loop: Loop, band: Band, size: Callable[[Complex], Array]) -> Array:
    """Frequencies [Hz] of poles at which some size of the sensitivity has no bound, as far as rounding lets one know.
    """
    poles, errors = loop.rounded_poles
    low, high = band.ends[[0, -1]].tolist()
    turn = 2.0 * np.pi
    return excited(lambda hertz: size(band.response(hertz)), poles / turn, low, high, errors / turn)


def _sensitivity(loop: Loop, hertz: Array) -> Complex:
    """S (n, actuators, actuators); at a pole of the closed loop as large as next to it."""

    def at(f: Array) -> Complex:
        return np.asarray(loop.sensitivity(2.0 * np.pi * f).transpose(2, 0, 1))

    shape = (len(loop.actuators),) * 2
    s = evaluated(at, hertz, shape)
    for distance in BESIDE:
        pole = np.isnan(s).any(axis=(1, 2))
        if not pole.any():
            return s
        s[pole] = evaluated(at, hertz[pole] * (1.0 + distance), shape)
    return np.nan_to_num(s, nan=1.0 / EPS)


def _single(band: Band, loop: Loop, limits: Complex, i: int, endless: bool) -> list[tuple[float, float]]:
    """Lower and upper gain margin, phase [deg], delay [s] and modulus margin of one actuator's loop, the others closed,
    each with its frequency [Hz]: L = 1 / S - 1, with the critical point -1. ``limits`` of S.

    ``endless``: the last limit is that of infinite frequency. Where L is 1 or more there, any delay turns it to -1.
    """
    ends = band.ends[[0, -1]]
    critical = _critical(loop, band, lambda s: np.asarray(np.abs(s[:, i, i])))
    if len(critical):
        return [(value, float(critical[0])) for value in (1.0, 1.0, 0.0, 0.0, 0.0)]

    def tells(s: Complex) -> NDArray[np.bool_]:
        return np.asarray(np.minimum(np.abs(s), np.abs(s - 1.0)) > NONE)

    at = band.crossings(lambda s: np.where(tells(s[:, i, i]), s[:, i, i].imag, np.nan))
    s = np.concatenate((band.response(at)[:, i, i], limits))
    at = np.concatenate((at, ends[: len(limits)]))
    real = tells(s) & (np.abs(s.imag) <= REAL * np.minimum(np.abs(s), np.abs(s - 1.0)))
    factors, at = np.divide(s[real].real, s[real].real - 1.0), at[real]
    unit = band.crossings(lambda s: s[:, i, i].real - 0.5)
    turn = np.angle(1.0 - 1.0 / band.response(unit)[:, i, i])
    delays = _limit(np.mod(turn, 2.0 * np.pi) / (2.0 * np.pi * unit), unit, np.inf)
    if endless and (limits[1:].real <= 0.5).any():
        delays = 0.0, np.inf
    where, largest = band.highest(lambda s: np.abs(s[:, i, i]) ** 2)
    below, above = (factors > 0.0) & (factors < 1.0), factors >= 1.0
    return [
        _limit(-factors[below], at[below], 0.0, -1.0), _limit(factors[above], at[above], np.inf),
        _limit(np.degrees(np.abs(turn)), unit, np.inf), delays, (largest**-0.5, float(where)),
    ]  # fmt: skip


def _limit(values: Array, at: Array, without: float, sign: float = 1.0) -> tuple[float, float]:
    """The least of some values, times a sign, and where it is; ``without`` and NaN if there are none."""
    if not len(values):
        return without, np.nan
    least = int(values.argmin())
    return sign * float(values[least]), float(at[least])
