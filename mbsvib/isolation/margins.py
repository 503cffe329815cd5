"""Stability margins of loops with several actuators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.isolation.figures import checked

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.isolation.closed_loop import ClosedLoop
    from mbsvib.kinematics import Array

    Complex = NDArray[np.complex128]

POINTS, AROUND, SHARPEST = 1000, 31, 1e-6
ZOOMS, ZOOM = 5, 17
JUMP = 1e-3
FLAT = 0.01  # what changes less towards 0 or infinity, and is real, is a limit: margins there need no crossing


@dataclass(frozen=True, repr=False, eq=False)
class Margins:
    """How far closed loops are from instability.

    ``modulus`` is the least singular value of 1 - K G at the actuators, over frequency, at ``frequency`` [Hz]: gains
    of all loops at once may change by the factors ``all_gains``, or phases by ``all_phases`` [deg] either way, in any
    combination. For each of the ``actuators`` alone, the other loops closed: ``lower`` and ``gain`` are the factors
    down and up to which its gain may change, ``phase`` [deg] its phase either way, ``delay`` [s] how late it may act,
    ``modulus_each`` the least distance of its locus from -1; 0 and infinite where nothing limits them.
    """

    name: str
    actuators: tuple[str, ...]
    modulus: float
    frequency: float
    lower: Array
    gain: Array
    phase: Array
    delay: Array
    modulus_each: Array
    stable: bool

    @property
    def all_gains(self) -> tuple[float, float]:
        """Factors between which all gains may change at once."""
        return 1.0 / (1.0 + self.modulus), 1.0 / (1.0 - self.modulus) if self.modulus < 1.0 else float("inf")

    @property
    def all_phases(self) -> float:
        """Phase [deg] by which all loops may change at once."""
        return float(np.degrees(2.0 * np.arcsin(min(0.5 * self.modulus, 1.0))))

    def table(self) -> dict[str, Any]:
        """Return the margins as arguments of ``mbsvib.tables.text`` and ``show``.

        Returns
        -------
        dict
            Title, columns, rows and notes.
        """
        each = zip(self.actuators, self.lower, self.gain, self.phase, self.delay, self.modulus_each, strict=True)
        rows = [(name, f"{low:.3g} ... {high:.3g}", f"{phase:.3g}", f"{1e3 * late:.3g}", f"{modulus:.3g}")
                for name, low, high, phase, late, modulus in each]  # fmt: skip
        low, high = self.all_gains
        rows.append(("all at once", f"{low:.3g} ... {high:.3g}", f"{self.all_phases:.3g}", "", f"{self.modulus:.3g}"))
        if not self.stable:
            rows = [(name, *[""] * 4) for name, *_ in rows]
        notes = [f"Nearest to instability at {self.frequency:.4g} Hz."] if self.stable else [
            "The closed loop is not stable: margins tell nothing."]  # fmt: skip
        headers = ("actuator", "gain may be times", "phase [deg]", "delay [ms]", "modulus")
        columns = [(header, "left" if header == "actuator" else "right") for header in headers]
        return {"title": f"Stability margins: {self.name}", "columns": columns, "rows": rows, "notes": notes}

    def __str__(self) -> str:
        from mbsvib import tables

        return tables.text(**self.table())


def margins(loop: ClosedLoop, frequencies: ArrayLike | None = None) -> Margins:
    """Return the margins of a closed loop.

    Parameters
    ----------
    loop : ClosedLoop
        The mechanism and its controllers.
    frequencies : array-like, shape (n,), optional
        Where to look [Hz]; between neighbours margins are followed to rounding.

    Returns
    -------
    Margins
        Of all loops, and of each.

    Source: N. A. Lehtomaki, N. R. Sandell and M. Athans, IEEE Trans. Autom. Control 26 (1981) 75, for all at once.
    """
    f = _grid(loop) if frequencies is None else checked(frequencies)

    def least(hertz: Array) -> Array:
        return np.asarray(np.linalg.svd(_difference(loop, hertz), compute_uv=False)[:, -1])

    modulus, frequency = _lowest(least, f, least(f))
    # the loop that is left of one actuator when all others are closed: 1 + L = 1 / S
    whole = np.asarray(1.0 / np.diagonal(np.linalg.inv(_difference(loop, f)), axis1=1, axis2=2) - 1.0, dtype=complex)
    found = []
    for i in range(len(loop.actuators)):

        def own(hertz: Array, i: int = i) -> Complex:
            return np.asarray(1.0 / np.linalg.inv(_difference(loop, hertz))[:, i, i] - 1.0)

        found.append(_single(own, f, whole[:, i]))
    lower, gain, phase, delay, each = np.array(found).T
    return Margins(loop.law.name, loop.actuators, modulus, frequency, lower, gain, phase, delay, each, loop.stable)


def _difference(loop: ClosedLoop, hertz: Array) -> Complex:
    return np.asarray(np.eye(len(loop.actuators)) - loop.returned(2.0 * np.pi * hertz))


def _single(own: Callable[[Array], Complex], f: Array, values: Complex) -> tuple[float, float, float, float, float]:
    """Gain down and up, phase [deg], delay [s] and modulus of one loop, -1 being critical."""
    if not values.any():
        return 0.0, float("inf"), float("inf"), float("inf"), 1.0
    real, _ = _crossings(own, f, values, lambda loop: loop.imag, lambda loop: loop.real < 0.0)
    limits = [end for end, inner in _ends(f, values) if abs(end - inner.real) <= FLAT * abs(end)]
    real = np.concatenate((real, limits))
    factors = -1.0 / real.real[real.real < 0.0]
    unit, at = _crossings(own, f, values, lambda loop: np.abs(loop) - 1.0,
                          lambda loop: np.abs(loop) < np.inf)  # fmt: skip
    turn = np.angle(-unit)
    late = np.mod(turn, 2.0 * np.pi) / (2.0 * np.pi * at)
    modulus = _lowest(lambda hertz: np.abs(1.0 + own(hertz)), f, np.abs(1.0 + values))[0]
    return (float(factors[factors < 1.0].max(initial=0.0)), float(factors[factors >= 1.0].min(initial=np.inf)),
            float(np.degrees(np.abs(turn).min(initial=np.inf))), float(late.min(initial=np.inf)), modulus)  # fmt: skip


def _ends(f: Array, values: Complex) -> list[tuple[complex, complex]]:
    """Values at both ends, each with that an octave further in."""
    inner = np.searchsorted(f, (2.0 * f[0], 0.5 * f[-1]))
    return list(zip(values[[0, -1]].tolist(), values[np.minimum(inner, len(f) - 1)].tolist(), strict=True))


def _crossings(
    own: Callable[[Array], Complex], f: Array, values: Complex, sign: Callable[[Complex], Array],
    near: Callable[[Complex], NDArray[np.bool_]],
) -> tuple[Complex, Array]:  # fmt: skip
    """Values of a loop, and frequencies [Hz], where a sign changes near some values."""
    at = np.flatnonzero(((sign(values[1:]) >= 0.0) != (sign(values[:-1]) >= 0.0)) & near(values[1:]))
    if not len(at):
        return np.zeros(0, dtype=complex), np.zeros(0)
    ends = f[at], f[at + 1]
    share, index = np.linspace(0.0, 1.0, ZOOM), np.arange(len(at))
    for _ in range(ZOOMS):
        fine = ends[0][:, None] + (ends[1] - ends[0])[:, None] * share
        inner = own(fine.reshape(-1)).reshape(fine.shape)
        side = sign(inner) >= 0.0
        after = np.maximum((side != side[:, :1]).argmax(axis=1), 1)
        ends, both = (fine[index, after - 1], fine[index, after]), (inner[index, after - 1], inner[index, after])
    low, high = sign(both[0]), sign(both[1])
    # where a loop jumps through infinity its sign changes without a crossing
    crosses = (low != high) & (np.abs(both[1] - both[0]) <= JUMP * np.abs(both[1]))
    part = np.divide(low, low - high, out=np.zeros_like(low), where=crosses)
    return (both[0] + part * (both[1] - both[0]))[crosses], (ends[0] + part * (ends[1] - ends[0]))[crosses]


def _lowest(what: Callable[[Array], Array], f: Array, values: Array) -> tuple[float, float]:
    """The least value and its frequency [Hz]."""
    at = int(values.argmin())
    best = float(values[at]), float(f[at])
    low, high = f[max(at - 1, 0)], f[min(at + 1, len(f) - 1)]
    for _ in range(ZOOMS if high > low else 0):
        fine = np.linspace(low, high, ZOOM)
        inner = what(fine)
        at = int(inner.argmin())
        best = min(best, (float(inner[at]), float(fine[at])))
        low, high = fine[max(at - 1, 0)], fine[min(at + 1, ZOOM - 1)]
    return best


def _grid(loop: ClosedLoop) -> Array:
    """Frequencies [Hz] that resolve every resonance of mechanism and closed loop."""
    poles = np.concatenate((loop.poles(), loop.plant.system.poles())) / (2.0 * np.pi)
    poles = poles[(poles.imag >= 0.0) & (np.abs(poles) > 1e-9 * np.abs(poles).max())]
    size, width = np.abs(poles), np.maximum(np.abs(poles.real), SHARPEST * np.abs(poles))
    around = np.geomspace(0.01, 30.0, AROUND)
    near = np.concatenate((size[:, None] - width[:, None] * around, size[:, None] + width[:, None] * around))
    low, high = 1e-3 * size.min(), 1e2 * size.max()
    whole = np.concatenate((np.geomspace(low, high, POINTS), near.reshape(-1)))
    return np.unique(whole[(whole >= low) & (whole <= high)])
