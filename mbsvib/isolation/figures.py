"""Figures of an isolation: transmissibility and compliance over frequency, and what is read off them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.errors import ResponseError
from mbsvib.isolation.asymptote import Asymptote, asymptote
from mbsvib.isolation.integrand import response as summed
from mbsvib.isolation.mean_square import resolution
from mbsvib.isolation.study_scene import DIRECTIONS, Scene, scene
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.responses import extrema

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.isolation.mean_square import Linear
    from mbsvib.isolation.vibration import Vibration


POINTS = 400  # evenly spaced ones of the default frequencies; beside them others follow the resonances
THINNING = 3.0  # these are so many half-widths away, and so many times as far each
SAME = 1e-10  # share of a frequency within which points are one
BELOW, ABOVE = 0.02, 20.0  # default band, in parts of the lowest and highest natural frequency
ACCELERATIONS = tuple(f"acceleration.{direction}" for direction in DIRECTIONS)
DISPLACEMENTS = tuple(f"displacement.{direction}" for direction in DIRECTIONS)
LOADS = tuple(f"load.{direction}" for direction in DIRECTIONS)


@dataclass(frozen=True, repr=False, eq=False)
class Isolation:
    """Transmissibility from a base to a body and the body's compliance, over ``frequencies`` (n,) [Hz].

    ``transmissibility`` (6, base directions, n) is acceleration over acceleration, ``compliance`` (6, 6, n)
    displacement against the base over wrench [m/N, rad/N, ...], both at ``scene.point``. Measures of all directions at
    once take rotations times ``scene.length``. Resonance, amplification and crossover are those of the band from the
    first to the last frequency, whatever frequencies are between.
    """

    scene: Scene
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
        left, right = self.scene.scale(), self.scene.scale(self.scene.moved)
        return np.asarray(left[:, None, None] * g / right[:, None])

    @cached_property
    def index(self) -> Array:
        """Frobenius index ||T||_F / sqrt(base directions), shape (n,): 1 where the body moves as the base does."""
        return _frobenius(self.scaled)

    @cached_property
    def singular_values(self) -> Array:
        """Singular values of the transmissibility, in descending order, shape (base directions, n)."""
        return np.asarray(np.linalg.svd(self.scaled.transpose(2, 0, 1), compute_uv=False).T)

    @cached_property
    def compliance_values(self) -> Array:
        """Singular values of the compliance [m/N], moments over the length and rotations times it, shape (6, n)."""
        scale = self.scene.scale()[:, None, None]
        scaled = (scale * self.compliance * scale.transpose(1, 0, 2)).transpose(2, 0, 1)
        return np.asarray(np.linalg.svd(scaled, compute_uv=False).T)

    @cached_property
    def _undamped(self) -> Array:
        """Frequencies [Hz] of undamped modes that the base excites."""
        poles = self.linear.poles() / (2.0 * np.pi)
        return extrema.excited(self._index_at, poles, float(self.frequencies[0]), float(self.frequencies[-1]))

    def _index_at(self, frequencies: ArrayLike) -> Array:
        w = 2.0 * np.pi * np.asarray(frequencies, dtype=float)
        if isinstance(self.linear, System):
            return _frobenius(self._scaled(summed(self.linear, w, ACCELERATIONS, self.scene.inputs)))
        into = [self.linear.inputs.index(name) for name in self.scene.inputs]
        out = [self.linear.outputs.index(name) for name in ACCELERATIONS]
        return _frobenius(self._scaled(self.linear.frequency_response(w)[np.ix_(out, into)]))

    @cached_property
    def _band(self) -> extrema.Band | None:
        """The square of the index over the band; None if that is a single frequency."""
        low, high = float(self.frequencies[0]), float(self.frequencies[-1])
        poles, longest, period = resolution(self.linear)
        ends = extrema.panels(poles / (2.0 * np.pi), low, high, longest=longest, period=period)
        return extrema.Band(lambda f: self._index_at(f) ** 2, ends) if high > low else None

    @cached_property
    def _peak(self) -> tuple[float, float]:
        if len(self._undamped):
            return float(self._undamped[0]), float("inf")
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
        found = self._band.crossings(lambda square: square - 1.0) if self._band else np.zeros(0)
        return float(found[-1] if len(found) else self.frequencies[0])

    @property
    def decade(self) -> float:
        """Index a decade above the crossover; not a number where the band has no crossover."""
        inside = self.frequencies[0] < self.crossover < np.inf
        return float(self._index_at([10.0 * self.crossover])[0]) if inside else float("nan")

    @cached_property
    def _asymptote(self) -> Asymptote | None:
        far = self._far
        into = [far.inputs.index(name) for name in self.scene.inputs]
        out = [far.outputs.index(name) for name in ACCELERATIONS]
        left = self.scene.scale() / np.sqrt(len(into))
        result = asymptote(far, into, out, left, 1.0 / self.scene.scale(self.scene.moved))
        # what a hold does at high frequency has ripples, and falls with the frequency
        return result if result is None or not self.sampled or not result.order else None

    @property
    def _far(self) -> Linear:
        """What has the response at high frequency."""
        return self.linear if isinstance(self.linear, System) else self.linear.far

    @property
    def sampled(self) -> bool:
        """Whether there are controllers on a computer."""
        return self._far is not self.linear

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

    def under(
        self, spectra: Mapping[str, Any], correlation: ArrayLike | None = None,
        band: tuple[float, float] | None = None,
    ) -> Vibration:  # fmt: skip
        """Return how much the body vibrates, and what legs stroke and carry, while noise shakes the base.

        S_y(f) = G(f) S(f) G(f)^H, mean square = integral of S_y over f

        Parameters
        ----------
        spectra : mapping of str to float, array-like or noise
            One-sided density of the base's acceleration by direction [(m/s^2)^2/Hz, (rad/s^2)^2/Hz]: a number is white
            noise, pairs (frequency [Hz], density) a table, straight on log-log axes; ``isolation.shaped`` a filter's.
        correlation : array-like, shape (directions, directions), optional
            Hermitian, ones on the diagonal; default: directions are independent.
        band : (float, float), optional
            First and last frequency [Hz]; default: all of them.

        Returns
        -------
        Vibration
            Root mean squares, cumulative ones, one-third octaves.

        Raises
        ------
        ResponseError
            If a spectrum is refused, or the vibration grows without bound.
        """
        from mbsvib.isolation.vibration import vibration
        from mbsvib.responses.power_spectra import base_noise

        return vibration(self, base_noise(spectra, self.scene.moved, correlation), band)

    def table(self) -> dict[str, Any]:
        """Return the table of figures as arguments of ``mbsvib.common.tables.text`` and ``show``.

        Returns
        -------
        dict
            Title, columns, rows and notes.
        """
        from mbsvib.isolation.tables import isolation_table

        return isolation_table(self)

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write index, singular values, transmissibility and compliance over frequency as comma-separated values.

        Parameters
        ----------
        path : str or path-like
            Where to.

        Returns
        -------
        Path
            The path.
        """
        from mbsvib.isolation.tables import isolation_csv

        return isolation_csv(self, path)

    def __str__(self) -> str:
        from mbsvib.common import tables

        return tables.text(**self.table())

    def __repr__(self) -> str:
        return (f"Isolation({self.name!r}: {self.scene.base} to {self.scene.body}, {len(self.frequencies)} frequencies "
                f"from {self.frequencies[0]:g} to {self.frequencies[-1]:g} Hz)")  # fmt: skip


def study(
    model: Model, body: str, base: str = GROUND, *, point: ArrayLike | None = None, length: float | None = None,
    frequencies: ArrayLike | None = None, directions: Sequence[str] | None = None,
) -> Isolation:  # fmt: skip
    """Return how well a body is isolated from the motion of its base.

    Base motions, wrenches and outputs are added on a copy; what the model has of these plays no part.

    Parameters
    ----------
    model : Model
        The mechanism.
    body : str
        The isolated body.
    base : str
        What is shaken: the ground, or a body whose motion is prescribed.
    point : array-like, shape (3,), optional
        Reference point on base and body [m]; default: the body's centre of mass.
    length : float, optional
        Length [m] that makes rotations comparable; default: the root mean square distance of the body's mass from its
        centre.
    frequencies : array-like, shape (n,), optional
        Ascending frequencies [Hz]; default: from well below the lowest to well above the highest mode,
        resolving every resonance.
    directions : sequence of str, optional
        In which the base is shaken; default: all six, or x y z where weight does not turn with the base.

    Returns
    -------
    Isolation
        Transmissibility, compliance and figures; prints as a table.

    Raises
    ------
    ModelError
        If a body is unknown, or the length is not positive.
    ResponseError
        If frequencies do not ascend, or one is that of an undamped mode.
    """
    made = scene(model, body, base, point, length, directions)
    return figures(made, made.system, frequencies)


def figures(made: Scene, linear: Linear, frequencies: ArrayLike | None = None) -> Isolation:
    """Return the figures of a scene, with its loops open or closed.

    Parameters
    ----------
    made : Scene
        The mechanism and its ports.
    linear : Linear
        Its system, or that with closed loops.
    frequencies : array-like, shape (n,), optional
        Ascending frequencies [Hz].

    Returns
    -------
    Isolation
        Transmissibility, compliance and figures.

    Raises
    ------
    ResponseError
        If frequencies do not ascend, or one is that of an undamped mode.
    """
    f = _default(linear) if frequencies is None else checked(frequencies)
    response = linear.frequency_response(2.0 * np.pi * f)
    into, out = linear.inputs.index, linear.outputs.index
    shaken = response[np.ix_([out(name) for name in ACCELERATIONS], [into(name) for name in made.inputs])]
    loaded = response[np.ix_([out(name) for name in DISPLACEMENTS], [into(name) for name in LOADS])]
    for array in (f, shaken, loaded):
        array.setflags(write=False)
    return Isolation(made, linear, f, shaken, loaded)


def checked(frequencies: ArrayLike) -> Array:
    """Return frequencies [Hz] as an array.

    Parameters
    ----------
    frequencies : array-like, shape (n,)
        From 0 Hz on, ascending.

    Returns
    -------
    array, shape (n,)
        A copy.

    Raises
    ------
    ResponseError
        If there are none, or they do not ascend.
    """
    try:
        f = np.array(frequencies, dtype=float, ndmin=1)
    except (TypeError, ValueError) as error:
        raise ResponseError(f"isolation: frequencies = {frequencies!r}; expected numbers [Hz].") from error
    if f.ndim != 1 or not len(f) or not np.isfinite(f).all() or f[0] < 0.0 or (np.diff(f) <= 0.0).any():
        what = "an empty range" if not f.size else f"shape {f.shape}, from {f.flat[0]:g} to {f.flat[-1]:g} Hz"
        raise ResponseError(f"isolation: frequencies: {what}; expected at least one frequency from 0 Hz on, each "
                            f"higher than the one before.")  # fmt: skip
    return f


def _default(linear: Linear) -> Array:
    """Frequencies [Hz] around all poles, of a closed loop also those of the mechanism with open loops."""
    system = linear if isinstance(linear, System) else linear.plant.system
    size = np.abs(system.poles()) / (2.0 * np.pi)
    size = size[size > 1e-9 * size.max(initial=0.0)]
    if not len(size):
        raise ResponseError("isolation: nothing vibrates, so that no band suggests itself; give frequencies [Hz].")
    low, high = BELOW * float(size.min()), ABOVE * float(size.max())
    poles, _, period = resolution(linear)
    poles = np.concatenate((system.poles(), poles)) / (2.0 * np.pi)
    if period < np.inf:
        count = int(high / period) + 1
        poles = (poles[:, None] + 1j * period * np.arange(-count, count + 1)).reshape(-1)
    even = np.geomspace(low, high, POINTS)
    found = np.unique(np.concatenate((even, _around(poles, even[1] / even[0] - 1.0))))
    found = found[(found >= low) & (found <= high)]
    return found[np.concatenate(([True], np.diff(found) > SAME * found[1:]))]


def _around(poles: Complex, spacing: float) -> Array:
    """Tops and half-power points of resonances, and points about them that thin out to an even spacing."""
    half, centre = np.abs(poles.real)[:, None], np.abs(poles.imag)[:, None]
    away = THINNING ** np.arange(np.ceil(-np.log(extrema.UNDAMPED) / np.log(THINNING)))
    away = half * np.concatenate(([0.0], away, -away))
    return (centre + away)[(half > extrema.UNDAMPED * centre) & (np.abs(away) <= spacing * centre)]


def _frobenius(g: Complex) -> Array:
    return np.asarray(np.sqrt((np.abs(g) ** 2).sum(axis=(0, 1)) / g.shape[1]))
