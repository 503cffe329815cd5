"""Modes of a mechanism with rotors over their speeds, and its critical speeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.matching import Station, is_simple, match_next, reference, upper

if TYPE_CHECKING:
    from mbsvib.api.model import Model
    from mbsvib.api.system import System
    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.modes import Modes


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


def upper_eigenvalues(modes: Modes) -> Complex:
    """Return one eigenvalue (modes,) for each mode; see ``matching.upper``."""
    return upper(modes.pairs)


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
        return Station(speed, upper_eigenvalues(modes), self.energy @ modes.shapes)

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
        return np.where(upper_eigenvalues(modes).imag > 0.0, result, 0.0)


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

    eigenvalues = np.array([upper_eigenvalues(modes)[which] for modes, which in zip(modes_at, order, strict=True)])
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
        single = [side for side in sides if is_simple(upper_eigenvalues(side[1]))[side[2]]]
        self.sweep, self.known, self.times = sweep, single or sides, times

    def mode(self, speed: float) -> tuple[Modes, int]:
        near, modes, number = min(self.known, key=lambda known: abs(known[0] - speed))
        if near == speed:
            return modes, number
        modes_here = self.sweep.at(speed)
        at = int(self.sweep.followed((near, modes), (speed, modes_here))[number])
        if is_simple(upper_eigenvalues(modes_here))[at]:
            self.known.append((speed, modes_here, at))
        return modes_here, at

    def off(self, speed: float) -> float:
        modes, number = self.mode(speed)
        return float(upper_eigenvalues(modes)[number].imag - self.times * abs(speed))


def _point(sweep: SpeedSweep, modes: Modes, number: int, at: tuple[int, float, float]) -> CriticalSpeed:
    mode, times, speed = at
    value = upper_eigenvalues(modes)[number]
    ratio = float(0.0 - value.real / abs(value))
    return CriticalSpeed(mode + 1, times, speed, float(value.imag) / (2.0 * np.pi), ratio,
                         float(sweep.whirl(modes, speed)[number]))  # fmt: skip
