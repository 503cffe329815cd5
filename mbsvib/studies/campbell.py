"""Modes of a mechanism with rotors over their speeds: frequencies, whirl directions and critical speeds.

Spin enters linearly, C = C0 + W G and K = K0 + W N, so that two linearizations serve all speeds. Modes are followed
from speed to speed by their shapes, with more speeds in between where these change much. Critical speeds are those at
which frequencies are multiples of the speed: in ascending order frequencies are continuous functions of it, whatever
becomes of the shapes of modes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbsvib.api.model import Model
from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.common.columnar import Columnar, numbered
from mbsvib.common.display import Displayed
from mbsvib.common.expected import a_model, ascending, names, reals
from mbsvib.errors import ModelError
from mbsvib.feedback.pole_track import ratios
from mbsvib.linalg.matching import Station, match_next, reference, track_modes, upper
from mbsvib.modes import Modes
from mbsvib.modes.pairs import growing
from mbsvib.modes.result import digits

# Speeds are found to this relative accuracy.
XTOL = 1e-13
# Intervals between speeds are divided where a frequency may meet the line. The bottom of a dip towards it is found to a
# share of its length, slopes over another share of the speed; so many steps of Newton's method at most follow.
PARTS, BOTTOM, STEP, NEWTON_STEPS = 4, 1e-6, 1e-6, 4
# Crossings of one frequency that are closer than this are one, found more than once by rounding.
SAME = 1e-9


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

    def station(self, speed: float, modes: Modes | None = None) -> Station:
        """Return the modes at a speed with their shapes weighted by the energies of both kinds."""
        modes = self.at(speed) if modes is None else modes
        return Station(speed, upper(modes.pairs), self.energy @ modes.shapes)

    def followed(self, first: tuple[float, Modes], second: tuple[float, Modes]) -> Index:
        """Return the number at the other speed of each mode at the one."""
        return match_next(reference(self.station(*first)), first[0], self.station(*second), self.station)[0]

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
    """Return the speeds at which the number of growing modes changes, by bisection between the given speeds."""
    counts = [int(modes.growing.sum()) for modes in modes_at]
    left = list(zip(w[:-1].tolist(), w[1:].tolist(), counts[:-1], counts[1:], strict=True))[::-1]
    result = []
    while left:
        low, high, before, after = left.pop()
        middle = 0.5 * (low + high)
        if before == after:
            continue
        if not low < middle < high or high - low <= XTOL * max(abs(low), abs(high)):
            result.append(middle)
            continue
        count = int(sweep.at(middle).growing.sum())
        left += [(middle, high, count, after), (low, middle, before, count)]
    return tuple(result)


class _Frequencies:
    """Damped frequencies of a sweep over the speed [rad/s], in ascending order, ``known`` at some speeds."""

    def __init__(self, sweep: SpeedSweep, known: dict[float, Array]) -> None:
        self.sweep, self.known, system = sweep, known, sweep.standstill
        self.matrices: tuple[Array, Array] | None = None
        if not system.massless:
            m = system.dof
            still, added = (np.linalg.solve(system.M, np.hstack(pair)) for pair in (
                (-system.K, -system.C), (-sweep.circulatory, -sweep.gyroscopic)))  # fmt: skip
            self.matrices = np.vstack((np.eye(m, 2 * m, k=m), still)), np.vstack((np.zeros((m, 2 * m)), added))

    def exact(self, speed: float) -> Array:
        """Return the frequencies to the accuracy of modes."""
        return np.sort(upper(self.sweep.at(speed).pairs).imag)

    def near(self, speed: float) -> Array:
        """Return the frequencies, but at known speeds to the accuracy of a dense solver."""
        if speed not in self.known:
            if self.matrices is None:
                self.known[speed] = self.exact(speed)
            else:
                values = np.sort(np.linalg.eigvals(self.matrices[0] + speed * self.matrices[1]).imag)
                self.known[speed] = values[len(values) // 2 :]
        return self.known[speed]

    def crossings(self, w: Array, times: float) -> Iterator[tuple[float, int]]:
        """Yield the speeds at which frequencies are ``times`` |speed|, and their places in ascending order.

        ``w`` (n,): ascending speeds; the search is from the first to the last, in steps that need not be small.
        """
        beside = STEP * (w[-1] - w[0]) * np.array([-1.0, 1.0])  # of standstill, where |speed| has a corner
        ends = np.union1d(w[w != 0.0], beside[(beside > w[0]) & (beside < w[-1])])
        if not len(ends):
            return
        gaps = np.array([self.near(speed) - times * abs(speed) for speed in ends.tolist()])
        length = np.diff(ends)[:, None]
        steep = 2.0 * float((np.abs(np.diff(gaps, axis=0)) / length).max(initial=abs(times)))
        may_meet = (np.minimum(np.abs(gaps[:-1]), np.abs(gaps[1:])) < steep * length).any(axis=1)
        divided = [np.linspace(ends[k], ends[k + 1], PARTS + 1) for k in np.flatnonzero(may_meet)]
        w = np.unique(np.concatenate([ends, *divided]))
        w = w[w != 0.0]
        table = np.array([self.near(speed) - times * abs(speed) for speed in w.tolist()])
        for rank, row in enumerate(table.T):

            def off(speed: float, of: Callable[[float], Array] = self.near, rank: int = rank) -> float:
                return float(of(float(speed))[rank] - times * abs(speed))

            last = np.inf
            for speed in sorted(_improved(partial(off, of=self.exact), start) for start in _roots(off, w, row)):
                if abs(speed - last) > SAME * abs(speed):
                    yield speed, rank
                last = speed


def critical_speeds(
    sweep: SpeedSweep, w: Array, modes_at: Sequence[Modes], order: Sequence[Index], lines: Iterable[float]
) -> list[CriticalSpeed]:
    """Return where damped frequencies are multiples, ``lines``, of the speed's size, between the first and the last."""
    known = {speed: np.sort(upper(modes.pairs).imag) for speed, modes in zip(w.tolist(), modes_at, strict=True)}
    of = _Frequencies(sweep, known)
    found = [(times, *crossing) for times in lines for crossing in of.crossings(w, times)]
    result = []
    for times, speed, rank in sorted(found):
        k = int(np.abs(w - speed).argmin())
        modes = sweep.at(speed)
        number = int(np.argsort(upper(modes.pairs).imag, kind="stable")[rank])
        if modes.pairs[number, 0].imag != 0.0:
            there = np.flatnonzero(sweep.followed((float(w[k]), modes_at[k]), (speed, modes)) == number)[0]
            mode = int(np.flatnonzero(order[k] == there)[0])
            value = upper(modes.pairs)[number]
            result.append(CriticalSpeed(
                mode + 1, times, speed, float(value.imag) / (2.0 * np.pi), float(0.0 - value.real / abs(value)),
                float(sweep.whirl(modes, speed)[number])))  # fmt: skip
    return result


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
        for point in self.critical:
            word = "no whirl" if abs(point.whirl) <= ROUND else "forward" if point.whirl > 0.0 else "backward"
            notes.append(f"Critical speed: {digits(point.speed)} rad/s, mode {point.mode} at {point.order:g} x speed "
                         f"({digits(point.frequency)} Hz, {word}).")  # fmt: skip
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
    w = ascending(speeds, "campbell", "speeds", "speeds [rad/s], each higher than the one before", ModelError, ndmin=1)
    sweep = speed_sweep(model, ratios)
    modes_of_speed = [sweep.at(speed) for speed in w.tolist()]
    stations = [sweep.station(*point) for point in zip(w.tolist(), modes_of_speed, strict=True)]
    order = track_modes(stations, sweep.station)
    steps = list(zip(modes_of_speed, w.tolist(), order, strict=True))
    eigenvalues = np.array([upper(modes.pairs)[which] for modes, _, which in steps])
    whirl = np.array([sweep.whirl(modes, speed)[which] for modes, speed, which in steps])
    errors = np.array([modes.pair_errors.max(axis=1)[which] for modes, _, which in steps])
    lines = reals(orders, "campbell", "orders", "multiples of the speed", ModelError)
    if lines.ndim > 1 or not np.isfinite(lines).all():
        raise check.refuse("campbell", "orders", orders, "finite multiples of the speed, (1.0, 2.0)")
    critical = critical_speeds(sweep, w, modes_of_speed, order, np.atleast_1d(lines).tolist())
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
        check.known(name, model.rotors, f"campbell: there is no rotor '{name}' in model '{model.name}'", "rotors")
    return {name: check.number(ratio, "campbell", "rotors", "how many times W a rotor turns")
            for name, ratio in ratios.items()}  # fmt: skip


def _improved(off: Callable[[float], float], speed: float) -> float:
    """The zero next to a speed, by Newton's method with central differences; the speed itself in a dip's bottom."""
    for _ in range(NEWTON_STEPS):
        step = STEP * speed
        slope = (off(speed + step) - off(speed - step)) / (2.0 * step)
        if abs(slope) <= STEP:
            break
        change = off(speed) / slope
        speed -= change
        if abs(change) <= STEP * abs(speed):  # the nearer to a zero, the less the slope has to be accurate
            break
    return speed


def _roots(off: Callable[[float], float], w: Array, gaps: Array) -> Iterator[float]:
    """The zeros of one distance from the line, from its values at some speeds."""
    from scipy.optimize import brentq, minimize_scalar

    points = list(zip(w.tolist(), gaps.tolist(), strict=True))
    for k in range(len(w)):
        low, high = max(k - 1, 0), min(k + 1, len(w) - 1)
        side, size = np.sign(gaps[low : high + 1]), np.abs(gaps[low : high + 1])
        if low < high and (side == side[0]).all() and size[k - low] == size.min() < 2.0 * np.ptp(size):
            found = minimize_scalar(lambda speed, sign=side[0]: sign * off(speed), bounds=(w[low], w[high]),
                                    method="bounded", options={"xatol": BOTTOM * (w[high] - w[low])})  # fmt: skip
            points.append((float(found.x), float(side[0] * found.fun)))  # the bottom of a dip
    points.sort()
    yield from [speed for speed, gap in points if gap == 0.0]
    for (low, first), (high, last) in pairwise(points):
        if first * last < 0.0:
            yield float(brentq(off, low, high, xtol=XTOL * (high - low), rtol=4.0 * XTOL))
