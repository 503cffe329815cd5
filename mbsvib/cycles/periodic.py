"""Linear periodic equations of small motions about a cycle: frozen and averaged modes, Floquet multipliers.

Drives that are released keep the torque tau(t) of the cycle, and may deviate from their prescribed motion by delta:

M(t) delta'' + (C(t) + c) delta' + (K(t) + k) delta = 0,
M = d tau / d q'', C = d tau / d q', K = d tau / d q

along the motion, where c and k are what the drives themselves have of damping and stiffness. The other drives stay on
their motion. With x = (delta, delta') and x' = A(t) x, the multipliers are the eigenvalues of the solution after one
period: all deviations decay if they are within the unit circle (G. Floquet, 1883).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar, numbered
from mbsvib.common.display import Displayed
from mbsvib.cycles.elastic import with_elastic_drives
from mbsvib.cycles.machine import Machine
from mbsvib.cycles.prescribed import EVEN, RESOLVED, period_of
from mbsvib.cycles.result import CycleData
from mbsvib.cycles.total_derivatives import total_derivatives
from mbsvib.errors import AccuracyWarning, ModelError

# Relative tolerance of scipy's integrator, well below what multipliers are told to.
TOLERANCE = 1e-11
# Multipliers this near to the unit circle are on it.
NEUTRAL = 1e-7


@dataclass(frozen=True, repr=False, eq=False)
class Periodic(Columnar, Displayed):
    """Linear periodic equations at n samples, evenly spread over the ``period`` [s].

    ``M``, ``C`` and ``K`` (n, m, m) are those of the deviations of ``coordinates``, with what drives have of stiffness
    and damping.
    """

    name: str
    """Name of the model."""
    coordinates: tuple[str, ...]
    period: float
    M: Array = field(repr=False)
    C: Array = field(repr=False)
    K: Array = field(repr=False)

    @property
    def time(self) -> Array:
        """Times (n,) of the samples [s]."""
        return np.asarray(np.arange(len(self.M)) * (self.period / len(self.M)))

    def columns(self) -> dict[str, Any]:
        """Return the frozen eigenvalues over time as columns by name.

        Returns
        -------
        dict of str to array, shape (n,)
            ``time_s``; ``eigenvalue_re(1)``, ``eigenvalue_im(1)``, ... [1/s].
        """
        frozen = self.frozen
        return {"time_s": self.time, **numbered({"eigenvalue_re": frozen.real, "eigenvalue_im": frozen.imag})}

    @property
    def frozen(self) -> Complex:
        """Eigenvalues (n, 2 m) of the equations with the coefficients of each sample [1/s], ascending by size."""
        return _eigenvalues(_first_order(self.M, self.C, self.K))

    @property
    def averaged(self) -> Complex:
        """Eigenvalues (2 m,) of the equations with mean coefficients [1/s], ascending by size."""
        mean = (samples.mean(axis=0)[None] for samples in (self.M, self.C, self.K))
        return np.asarray(_eigenvalues(_first_order(*mean))[0])

    @property
    def unresolved(self) -> float:
        """The highest harmonics of the coefficients as a share of the largest: how far samples leave gaps.

        They are compared as M, C / w and K / w^2 in coordinates of unit mean inertia, w the angular frequency of the
        cycle.
        """
        size = np.abs(np.fft.rfft(_in_unit_inertia(self.M, self.C, self.K, self.period), axis=0))
        highest = size[max(1, len(size) - 2) :]
        return float(highest.max(initial=0.0)) / (float(size.max()) or 1.0)

    def multipliers(self) -> Complex:
        """Return the Floquet multipliers.

        Between the samples, coefficients follow their trigonometric interpolation.

        Returns
        -------
        array, shape (2 m,)
            Eigenvalues of the solution after one period, descending by size.

        Warns
        -----
        AccuracyWarning
            If the samples do not resolve the coefficients.
        """
        from scipy.integrate import solve_ivp

        if self.unresolved > RESOLVED:
            warnings.warn(f"cycle: {len(self.M)} samples leave {self.unresolved:.1e} of the coefficients of "
                          f"'{self.name}' to harmonics that they do not resolve; take more.",
                          AccuracyWarning, stacklevel=2)  # fmt: skip
        m = len(self.coordinates)
        series = [_series(samples) for samples in (self.M, self.C, self.K)]
        rate = 2.0 * np.pi / self.period

        def slope(t: float, x: Array) -> Array:
            angle = rate * t
            mass, damping, stiffness = (_at(samples, angle) for samples in series)
            deviations = x.reshape(2 * m, 2 * m)
            accelerations = -np.linalg.solve(mass, stiffness @ deviations[:m] + damping @ deviations[m:])
            return np.concatenate((deviations[m:], accelerations)).ravel()

        end = solve_ivp(slope, (0.0, self.period), np.eye(2 * m).ravel(), method="DOP853", rtol=TOLERANCE,
                        atol=TOLERANCE, max_step=self.period / 16.0)  # fmt: skip
        if not end.success:
            raise ModelError(f"cycle: the deviations of '{self.name}' cannot be followed over a period: {end.message}",
                             element=self.name)  # fmt: skip
        values = np.linalg.eigvals(end.y[:, -1].reshape(2 * m, 2 * m))
        return np.asarray(values[np.argsort(-np.abs(values), kind="stable")])

    @property
    def stable(self) -> bool:
        """Whether no deviation grows: all multipliers are within the unit circle, or on it."""
        return bool(np.abs(self.multipliers()).max() <= 1.0 + NEUTRAL)

    def __repr__(self) -> str:
        return f"Periodic({self.name!r}: {', '.join(self.coordinates)}, period {self.period:.6g} s)"


def periodic(cycle: CycleData, released: Any = None, period: float | None = None) -> Periodic:
    """Return the linear periodic equations of small motions about a cycle; see ``Cycle.periodic``.

    ``released``: drives that may deviate. ``period``: period [s].
    """
    plant = with_elastic_drives(cycle.machine)
    impedances = _released(cycle, released) | dict.fromkeys(plant.motion.names[len(cycle.drives) :], (0.0, 0.0))
    which = [plant.motion.names.index(name) for name in impedances]
    length = period_of(plant.motion, period) if plant.period is None else plant.period
    if period is not None and not math.isclose(period, length, rel_tol=EVEN):
        raise check.refuse("cycle", "period", period, f"{length:.6g} s, over which its beams bend")
    _check_repeats(plant, which, length)
    mass, damping, stiffness = _coefficients(plant, which)
    impedance = np.array([impedances[name] for name in impedances])
    symmetric = 0.5 * (mass + mass.transpose(0, 2, 1))
    result = Periodic(plant.model.name, tuple(impedances), length, symmetric,
                      damping + np.diag(impedance[:, 1]), stiffness + np.diag(impedance[:, 0]))  # fmt: skip
    for array in (result.M, result.C, result.K):
        array.flags.writeable = False
    return result


def _coefficients(plant: Machine, which: list[int]) -> tuple[Array, Array, Array]:
    """d tau / d q'', d tau / d q' and d tau / d q (n, m, m) of some drives."""
    drives = plant.motion.names
    m = len(drives)
    names = [f"{name}{mark}" for mark in ("", "'", "''") for name in drives]
    slopes = total_derivatives(plant, "drives", names).results[:, :m]
    stiffness, damping, mass = (slopes[:, which, k * m : (k + 1) * m][:, :, which] for k in range(3))
    return mass, damping, stiffness


def _in_unit_inertia(mass: Array, damping: Array, stiffness: Array, period: float) -> Array:
    """M, C / w and K / w^2 (n, 3, m, m) in coordinates of unit mean inertia."""
    scale = 1.0 / np.sqrt(np.abs(np.einsum("nii->ni", mass)).mean(axis=0))
    rate = 2.0 * np.pi / period
    return np.asarray(np.stack((mass, damping / rate, stiffness / rate**2), axis=1) * scale[:, None] * scale)


def _check_repeats(plant: Machine, which: list[int], period: float) -> None:
    """Refuse a period after which drives at constant speed leave the mechanism with other coefficients."""
    ends = plant.motion.ends(period)
    if ends is None:
        return
    after = replace(plant, motion=ends, known=None)
    start, end = _in_unit_inertia(*_coefficients(after, which), period)
    if np.abs(end - start).max() > RESOLVED * np.abs(start).max():
        raise ModelError(f"cycle: the coefficients of '{plant.model.name}' do not repeat after {period:.6g} s; "
                         f"sample the whole period, over several turns where gears reduce the speed, and give it as "
                         f"period= [s].", element=plant.motion.names[0], field="period")  # fmt: skip


def _released(cycle: CycleData, released: Any) -> dict[str, tuple[float, float]]:
    who = "cycle"
    requested = dict.fromkeys(cycle.drives, (0.0, 0.0)) if released is None else released
    if isinstance(requested, str) or not hasattr(requested, "__iter__"):
        raise check.refuse(who, "released", released, "{'crank.rz': (stiffness, damping), ...}")
    pairs: Mapping[str, Any] = requested if hasattr(requested, "items") else dict.fromkeys(requested, (0.0, 0.0))
    if not pairs and cycle.machine.period is None:
        raise check.refuse(who, "released", released, "at least one of the drives")
    result = {}
    for name, pair in pairs.items():
        check.known(name, cycle.drives, f"cycle: released '{name}' is none of its drives", "released", "They are")
        k, c = check.numbers(pair, (2,), f"drive '{name}'", "released", "stiffness and damping, two numbers")
        result[name] = (k, c)
    return result


def _first_order(mass: Array, damping: Array, stiffness: Array) -> Array:
    """A (n, 2 m, 2 m) with x' = A x."""
    n, m, _ = mass.shape
    result = np.zeros((n, 2 * m, 2 * m))
    result[:, :m, m:] = np.eye(m)
    result[:, m:, :m], result[:, m:, m:] = -np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)
    return result


def _eigenvalues(matrices: Array) -> Complex:
    values = np.linalg.eigvals(matrices)
    order = np.lexsort((values.imag, np.abs(values)), axis=-1)
    return np.asarray(np.take_along_axis(values.astype(complex), order, axis=-1))


def _series(samples: Array) -> tuple[Array, Complex]:
    """Harmonics and coefficients of the trigonometric interpolation."""
    n = len(samples)
    coefficients = np.fft.rfft(samples, axis=0) / n
    coefficients[1:] *= 2.0
    if n % 2 == 0:
        coefficients[-1] *= 0.5
    return np.arange(len(coefficients), dtype=float), coefficients


def _at(series: tuple[Array, Complex], angle: float) -> Array:
    harmonics, coefficients = series
    return np.asarray(np.tensordot(np.exp(1j * harmonics * angle), coefficients, axes=1).real)
