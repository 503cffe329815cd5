"""Modes of a mechanism with rotors over their speeds: frequencies, whirl directions and critical speeds.

Spin enters linearly, C = C0 + W G and K = K0 + W N, so that two linearizations serve all speeds. Modes are followed
from speed to speed by their shapes, with more speeds in between where these change much.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbsvib.api.model import Model
from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.common.columnar import Columnar, numbered
from mbsvib.common.display import Displayed
from mbsvib.common.expected import a_model, names, reals
from mbsvib.errors import ModelError, nearest
from mbsvib.feedback.pole_track import ratios
from mbsvib.linalg.matching import Station, is_simple, match_next, reference, track_modes, upper
from mbsvib.modes import Modes
from mbsvib.modes.pairs import growing
from mbsvib.modes.result import digits

# Critical speeds are found to this relative accuracy.
XTOL = 1e-13


@dataclass(frozen=True, slots=True)
class CriticalSpeed:
    """Where mode ``mode``, which counts from 1 as printed (its column in arrays is ``mode - 1``), has ``order`` times
    the ``speed`` [rad/s] as its damped ``frequency`` [Hz]; ``damping_ratio`` and ``whirl`` there.
    """

    mode: int
    order: float
    speed: float
    frequency: float
    damping_ratio: float
    whirl: float


@dataclass(frozen=True, slots=True)
class SpeedSweep:
    """A system at any speed: ``standstill`` at speed 0, with what speed 1 adds."""

    standstill: System
    gyroscopic: Array
    circulatory: Array
    stations: tuple[tuple[int, Array, float], ...]  # number of a body with a rotor, its axis, its ratio
    energy: Array

    def at(self, speed: float) -> Modes:
        """Return the modes at a speed."""
        system = self.standstill
        changes: dict[str, Any] = {}
        for name, letter, part in (("gyroscopic", "C", self.gyroscopic), ("circulatory", "K", self.circulatory)):
            if part.any() and speed != 0.0:
                original = getattr(system, name)
                changes[name] = speed * part if original is None else original + speed * part
                changes[letter] = getattr(system, letter) + speed * part
        return (replace(system, **changes) if changes else system).modes()

    def station(self, speed: float, modes: Modes) -> Station:
        """Return modes with their shapes weighted by the energies of both kinds."""
        return Station(speed, upper(modes.pairs), self.energy @ modes.shapes)

    def between(self, speed: float) -> Station:
        """Return the modes at another speed."""
        return self.station(speed, self.at(speed))

    def followed(self, first: tuple[float, Modes], second: tuple[float, Modes]) -> Index:
        """Return the number at the other speed of each mode at the one."""
        return match_next(reference(self.station(*first)), first[0], self.station(*second), self.between)[0]

    def whirl(self, modes: Modes, speed: float) -> Array:
        """Return the area of the rotors' orbits as a part of that of circles, positive as they spin, (modes,)."""
        motion = self.standstill.body_motion @ modes.shapes
        count = len(self.standstill.bodies)
        factor = self.standstill.inertia_factor[: 6 * count].reshape(count, 6, -1)
        weigh = np.linalg.norm(factor, axis=2)
        area, size = np.zeros(motion.shape[2]), np.zeros(motion.shape[2])
        for body, axis, ratio in self.stations:
            sign = np.sign(ratio * speed) or 1.0
            across = np.eye(3) - np.outer(axis, axis)
            for part in (slice(3), slice(3, 6)):
                u = across @ motion[body, part] * (weigh[body, part].max() or 1.0)
                area += sign * 2.0 * (axis @ np.cross(u.imag, u.real, axis=0))
                size += (np.abs(u) ** 2).sum(axis=0)
        result = np.divide(area, size, out=np.zeros_like(area), where=size > 1e-20 * size.max(initial=0.0))
        return np.where(upper(modes.pairs).imag > 0.0, result, 0.0)


def speed_sweep(model: Model, ratios: Mapping[str, float]) -> SpeedSweep:
    """Return the equations of a model at any speed, for ratios of rotors' speeds to it."""
    system_at_rest, spinning_system = (
        model.with_values({f"{name}.speed": ratio * speed for name, ratio in ratios.items()}).linearize(method="dense")
        for speed in (0.0, 1.0)
    )
    added = []
    for name in ("gyroscopic", "circulatory"):
        at_rest, at_speed = (getattr(system, name) for system in (system_at_rest, spinning_system))
        zeros = np.zeros_like(system_at_rest.K)
        added.append((zeros if at_speed is None else at_speed) - (zeros if at_rest is None else at_rest))
    k, rows = np.sqrt(np.abs(system_at_rest.row_stiffness))[:, None], system_at_rest.elastic_rows
    typical = np.linalg.norm(rows * k) / (np.linalg.norm(system_at_rest.inertia_factor) or 1.0)
    energy = np.concatenate((system_at_rest.inertia_factor * (typical or 1.0), rows * k))
    number = {name: i for i, name in enumerate(system_at_rest.bodies)}
    stations = tuple([(number[model.rotors[name].body], np.array(model.rotors[name].axis), ratio)
                      for name, ratio in ratios.items()])  # fmt: skip
    return SpeedSweep(system_at_rest, added[0], added[1], stations, energy)


def stability_limits(sweep: SpeedSweep, w: Array, modes_at: Sequence[Modes]) -> tuple[float, ...]:
    """Return the speeds at which the stability of modes changes, by bisection between the given speeds."""
    stable = [modes.stable for modes in modes_at]
    result = []
    for k in np.flatnonzero(np.diff(stable)).tolist():
        low, high = float(w[k]), float(w[k + 1])
        while low < 0.5 * (low + high) < high and high - low > XTOL * max(abs(low), abs(high)):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if sweep.at(middle).stable == stable[k] else (low, middle)
        result.append(0.5 * (low + high))
    return tuple(result)


def critical_speeds(
    sweep: SpeedSweep, w: Array, modes_at: Sequence[Modes], order: Sequence[Index], times: float
) -> list[CriticalSpeed]:
    """Return where tracks cross frequency = times |speed|: at samples, or between two by a bracketing root finder."""
    from scipy.optimize import brentq

    eigenvalues = np.array([upper(modes.pairs)[which] for modes, which in zip(modes_at, order, strict=True)])
    frequency_gap = eigenvalues.imag - times * np.abs(w)[:, None]
    result = []
    for k in range(len(w)):
        for mode in range(eigenvalues.shape[1]):
            if frequency_gap[k, mode] == 0.0 and w[k] != 0.0 and eigenvalues[k, mode] != 0.0:
                result.append(_point(sweep, modes_at[k], int(order[k][mode]), (mode, times, float(w[k]))))
            if k + 1 < len(w) and frequency_gap[k, mode] * frequency_gap[k + 1, mode] < 0.0 and w[k] * w[k + 1] >= 0.0:
                sides = [(float(w[i]), modes_at[i], int(order[i][mode])) for i in (k, k + 1)]
                ends = _Ends(sweep, sides, times)
                speed = float(brentq(ends.off, w[k], w[k + 1], xtol=XTOL * abs(w[k + 1] - w[k]), rtol=4.0 * XTOL))
                modes, number = ends.mode(speed)
                if modes.pairs[number, 0].imag != 0.0:
                    result.append(_point(sweep, modes, number, (mode, times, speed)))
    return result


class _Ends:
    """One mode between two speeds, followed from the nearest speed at which it was computed and is separate."""

    def __init__(self, sweep: SpeedSweep, sides: list[tuple[float, Modes, int]], times: float) -> None:
        single = [side for side in sides if is_simple(upper(side[1].pairs))[side[2]]]
        self.sweep, self.known, self.times = sweep, single or sides, times

    def mode(self, speed: float) -> tuple[Modes, int]:
        near, modes, number = min(self.known, key=lambda known: abs(known[0] - speed))
        if near == speed:
            return modes, number
        modes_here = self.sweep.at(speed)
        at = int(self.sweep.followed((near, modes), (speed, modes_here))[number])
        if is_simple(upper(modes_here.pairs))[at]:
            self.known.append((speed, modes_here, at))
        return modes_here, at

    def off(self, speed: float) -> float:
        modes, number = self.mode(speed)
        return float(upper(modes.pairs)[number].imag - self.times * abs(speed))


def _point(sweep: SpeedSweep, modes: Modes, number: int, at: tuple[int, float, float]) -> CriticalSpeed:
    mode, times, speed = at
    value = upper(modes.pairs)[number]
    ratio = float(0.0 - value.real / abs(value))
    return CriticalSpeed(mode + 1, times, speed, float(value.imag) / (2.0 * np.pi), ratio,
                         float(sweep.whirl(modes, speed)[number]))  # fmt: skip


# A whirl is one if its area, in parts of that of a circle, is larger.
ROUND = 1e-3
SHOWN_SPEEDS, SHOWN_MODES = 20, 8  # of a table that is printed


@dataclass(frozen=True, repr=False, eq=False)
class Campbell(Columnar, Displayed):
    """Modes over the speed of rotors: one row for each of the ``speeds`` (n,) [rad/s], one column for each mode.

    ``eigenvalues`` (n, modes) [1/s] have no negative imaginary part; ``errors`` (n, modes) are their relative errors.
    ``whirl`` (n, modes) is 1 where all rotors go round in circles as they spin, forward, -1 for circles backward, and
    0 for motions without whirl. ``ratios`` are the speeds of the rotors at speed 1; ``critical`` lists critical
    speeds, ``limits`` the speeds [rad/s] at which the stability of a mode changes.
    """

    name: str
    speeds: Array
    ratios: Mapping[str, float]
    eigenvalues: Complex
    errors: Array
    whirl: Array
    critical: tuple[CriticalSpeed, ...]
    limits: tuple[float, ...]
    modes: tuple[Modes, ...] = field(repr=False)
    """Modes at each speed."""

    @cached_property
    def frequencies(self) -> Array:
        """Damped frequencies [Hz], shape (n, modes)."""
        return np.abs(self.eigenvalues.imag) / (2.0 * np.pi)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return a row for each speed [rad/s]: damped frequencies [Hz], damping ratios and whirl of modes 1, 2, ..."""
        by_mode = {"frequency_hz": self.frequencies, "damping_ratio": self.damping_ratios, "whirl": self.whirl}
        return {"speed": self.speeds, **numbered(by_mode)}

    @cached_property
    def damping_ratios(self) -> Array:
        """Damping ratios, shape (n, modes); 0 where the eigenvalue is."""
        return ratios(self.eigenvalues)

    @cached_property
    def directions(self) -> NDArray[np.str_]:
        """"forward", "backward" or "" for each entry of ``whirl``, shape (n, modes)."""
        return np.where(self.whirl > ROUND, "forward", np.where(self.whirl < -ROUND, "backward", ""))

    @cached_property
    def stable(self) -> NDArray[np.bool_]:
        """Whether the system is stable at each speed, shape (n,)."""
        return np.asarray(~self.growing.any(axis=1))

    @property
    def growing(self) -> NDArray[np.bool_]:
        """Whether each mode is unstable, by more than rounding, at each speed, shape (n, modes)."""
        return growing(self.eigenvalues, self.errors)

    def table(self) -> dict[str, Any]:
        """Return frequencies, critical speeds and instability as arguments of ``mbsvib.common.tables.text``."""
        signs = {"forward": " F", "backward": " B", "": "  "}
        speeds, modes = self.whirl.shape
        rows = [(digits(speed), *(digits(f) + signs[d] for f, d in zip(row, which, strict=True)))
                for speed, row, which in zip(self.speeds[:SHOWN_SPEEDS], self.frequencies[:, :SHOWN_MODES],
                                             self.directions[:, :SHOWN_MODES], strict=False)]  # fmt: skip
        shown = range(1, min(modes, SHOWN_MODES) + 1)
        columns = [("speed [rad/s]", "right"), *((f"mode {number} [Hz]", "right") for number in shown)]
        notes = ["F: forward whirl, B: backward."]
        if speeds > SHOWN_SPEEDS or modes > SHOWN_MODES:
            notes.append(f"{speeds} speeds, {modes} modes in all: .speeds, .frequencies, .directions.")
        notes += [f"Critical speed: {digits(point.speed)} rad/s, mode {point.mode} at {point.order:g} x speed "
                  f"({digits(point.frequency)} Hz, {_word(point.whirl)})." for point in self.critical]  # fmt: skip
        growing = self.speeds[~self.stable]
        if len(growing):
            limits = f"; stability changes at {', '.join(map(digits, self.limits))} rad/s" if self.limits else ""
            notes.append(f"Unstable at {len(growing)} of the speeds, first at {digits(growing[0])} rad/s{limits}.")
        return {"title": f"Campbell data of {self.name}", "columns": columns, "rows": rows, "notes": notes}

    def __repr__(self) -> str:
        return (f"Campbell({self.name!r}: {len(self.speeds)} speeds, {self.whirl.shape[1]} modes, {len(self.critical)} "
                f"critical speeds)")  # fmt: skip


def campbell(
    model: Model, speeds: ArrayLike, rotors: str | Sequence[str] | Mapping[str, float] | None = None,
    orders: ArrayLike = (1.0,),
) -> Campbell:  # fmt: skip
    """Return frequencies over the speed of rotors.

    (lambda^2 M + lambda (C0 + W G) + K0 + W N) phi = 0 at each speed W

    Parameters
    ----------
    model : Model
        The mechanism.
    speeds : array-like, shape (n,)
        Ascending speeds W [rad/s].
    rotors : str, sequence of str or mapping of str to float, optional
        The rotors that turn at W, or at how many times W each turns; the others keep their speeds. Default: all,
        at the ratios of the speeds that they have to that of the first (1 each if one of them rests).
    orders : array-like, shape (k,)
        Critical speeds are those at which a damped angular frequency is this multiple of W.

    Returns
    -------
    Campbell
        Eigenvalues, whirl directions and critical speeds between the first and the last speed.

    Raises
    ------
    ModelError
        If a rotor is unknown, there is none, or the speeds do not ascend.
    """
    a_model(model, "campbell")
    ratios = _ratios(model, rotors)
    w = _ascending(speeds)
    sweep = speed_sweep(model, ratios)
    modes_of_speed = [sweep.at(speed) for speed in w.tolist()]
    stations = [sweep.station(*point) for point in zip(w.tolist(), modes_of_speed, strict=True)]
    order = track_modes(stations, sweep.between)
    steps = list(zip(modes_of_speed, w.tolist(), order, strict=True))
    eigenvalues = np.array([upper(modes.pairs)[which] for modes, _, which in steps])
    whirl = np.array([sweep.whirl(modes, speed)[which] for modes, speed, which in steps])
    errors = np.array([modes.pair_errors.max(axis=1)[which] for modes, _, which in steps])
    lines = reals(orders, "campbell", "orders", "multiples of the speed", ModelError)
    if lines.ndim > 1 or not np.isfinite(lines).all():
        raise check.refuse("campbell", "orders", orders, "finite multiples of the speed, (1.0, 2.0)")
    critical = [point for n in np.atleast_1d(lines).tolist()
                for point in critical_speeds(sweep, w, modes_of_speed, order, n)]  # fmt: skip
    critical.sort(key=lambda point: (point.order, point.speed))
    return Campbell(model.name, w, dict(ratios), eigenvalues, errors, whirl, tuple(critical),
                    stability_limits(sweep, w, modes_of_speed), tuple(modes_of_speed))  # fmt: skip


def _ratios(model: Model, rotors: str | Sequence[str] | Mapping[str, float] | None) -> dict[str, float]:
    if not model.rotors:
        hub = next(iter(model.hubs), None)
        way = "add one by add_rotor" if hub is None else \
            f"its hub turns with all that is on it, sweep(model, {{'{hub}.speed': [...]}}, 'modes.frequencies')"
        raise ModelError(f"campbell: model '{model.name}' has no rotor; {way}.", field="rotors")
    if rotors is None:
        now = {name: rotor.speed for name, rotor in model.rotors.items()}
        first = next(iter(now.values()))
        return {name: speed / first if all(now.values()) else 1.0 for name, speed in now.items()}
    ratios = dict(rotors) if isinstance(rotors, Mapping) else dict.fromkeys(
        names(rotors, "campbell", "rotors", ModelError), 1.0)  # fmt: skip
    for name in ratios:
        if name not in model.rotors:
            raise ModelError(f"campbell: there is no rotor '{name}' in model '{model.name}'."
                             f"{nearest(str(name), model.rotors)}", element=str(name), field="rotors")  # fmt: skip
    return {name: check.number(ratio, "campbell", "rotors", "how many times W a rotor turns")
            for name, ratio in ratios.items()}  # fmt: skip


def _ascending(speeds: ArrayLike) -> Array:
    w = np.atleast_1d(reals(speeds, "campbell", "speeds", "ascending speeds [rad/s]", ModelError))
    if w.ndim != 1 or not len(w) or not np.isfinite(w).all() or (np.diff(w) <= 0.0).any():
        raise ModelError(f"campbell: speeds has shape {w.shape}; expected finite speeds [rad/s], each higher than the "
                         f"one before.", field="speeds")  # fmt: skip
    return w


def _word(whirl: float) -> str:
    return "forward" if whirl > ROUND else "backward" if whirl < -ROUND else "no whirl"
