"""Stability margins of loops with several actuators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.isolation.figures import checked

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mbsvib.isolation.closed_loop import ClosedLoop
    from mbsvib.kinematics import Array

    Complex = NDArray[np.complex128]

POINTS, AROUND, SHARPEST = 2000, 41, 1e-6


@dataclass(frozen=True, repr=False, eq=False)
class Margins:
    """How far closed loops are from instability.

    ``modulus`` is the least singular value of 1 - K G at the actuators, over frequency, at ``frequency`` [Hz]: gains
    of all loops at once may change by the factors ``all_gains``, or phases by ``all_phases`` [deg] either way, in any
    combination. ``gain`` (factor), ``phase`` [deg] and ``modulus_each`` are those of each of the ``actuators`` alone,
    the other loops closed; infinite where nothing limits them.
    """

    name: str
    actuators: tuple[str, ...]
    modulus: float
    frequency: float
    gain: Array
    phase: Array
    modulus_each: Array
    stable: bool

    @property
    def all_gains(self) -> tuple[float, float]:
        """Factors between which all gains may change at once."""
        return 1.0 / (1.0 + self.modulus), 1.0 / (1.0 - self.modulus) if self.modulus < 1.0 else np.inf

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
        low, high = self.all_gains
        each = zip(self.actuators, self.gain, self.phase, self.modulus_each, strict=True)
        rows = [(name, f"{g:.4g}", f"{p:.4g}", f"{m:.4g}") for name, g, p, m in each]
        rows.append(("all at once", f"{low:.3g} ... {high:.3g}", f"{self.all_phases:.4g}", f"{self.modulus:.4g}"))
        notes = [f"Nearest to instability at {self.frequency:.4g} Hz."] if self.stable else [
            "The closed loop is not stable: margins tell nothing."]  # fmt: skip
        headers = ("actuator", "gain margin", "phase margin [deg]", "modulus")
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
        Where to look [Hz].

    Returns
    -------
    Margins
        Of all loops, and of each.
    """
    import control

    f = _grid(loop) if frequencies is None else checked(frequencies)
    difference = 1.0 * np.eye(len(loop.actuators)) - returned(loop, 2.0 * np.pi * f)
    least = np.linalg.svd(difference, compute_uv=False)[:, -1]
    at = int(least.argmin())
    sensitivity = np.linalg.inv(difference)
    gain, phase, modulus = [], [], []
    for i in range(len(loop.actuators)):
        # the loop that is left of one actuator when all others are closed: 1 + L = 1 / S
        own = 1.0 / sensitivity[:, i, i] - 1.0
        g, p, s = control.stability_margins(control.FRD(own, 2.0 * np.pi * f))[:3]
        gain.append(g)
        phase.append(p)
        modulus.append(s)
    return Margins(loop.law.name, loop.actuators, float(least[at]), float(f[at]), np.array(gain, dtype=float),
                   np.array(phase, dtype=float), np.array(modulus, dtype=float), loop.stable)  # fmt: skip


def returned(loop: ClosedLoop, omega: Array) -> Complex:
    """Return K G_yu, what comes back of a signal at the actuators, (n, actuators, actuators)."""
    g = loop.plant.system.frequency_response(omega)
    y = [loop.outputs.index(name) for name in loop.sensors]
    u = [loop.inputs.index(name) for name in loop.actuators]
    return np.asarray(loop.gains(omega) @ g[np.ix_(y, u)].transpose(2, 0, 1))


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
