"""Figures of an isolation: transmissibility and compliance over frequency, and what is read off them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.isolation.scene import DIRECTIONS, Scene, scene
from mbsvib.isolation.summed import response as summed
from mbsvib.mechanism import GROUND
from mbsvib.system import System

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.isolation.mean_square import Linear
    from mbsvib.isolation.vibration import Vibration
    from mbsvib.kinematics import Array
    from mbsvib.model import Model

    Complex = NDArray[np.complex128]

POINTS = 400
BELOW, ABOVE = 0.02, 20.0  # default band, in parts of the lowest and highest natural frequency
UNDAMPED = 1e-12
ZOOMS, ZOOM_POINTS = 4, 41
FAR = 2.0  # roll-off is measured from so many times the cross-over on
STRAIGHT, FALLING = 0.15, -0.75  # it is a line if no point is farther off than 3 dB, and falls by 15 dB/decade
ACCELERATIONS = tuple(f"acceleration.{direction}" for direction in DIRECTIONS)
DISPLACEMENTS = tuple(f"displacement.{direction}" for direction in DIRECTIONS)
LOADS = tuple(f"load.{direction}" for direction in DIRECTIONS)


@dataclass(frozen=True, repr=False, eq=False)
class Isolation:
    """Transmissibility from a base to a body and the body's compliance, over ``frequencies`` (n,) [Hz].

    ``transmissibility`` (6, base directions, n) is acceleration over acceleration, ``compliance`` (6, 6, n)
    displacement against the base over wrench [m/N, rad/N, ...], both at ``scene.point``. Measures of all directions at
    once take rotations times ``scene.length``.
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
        poles = self.linear.poles()
        poles = poles[(poles.imag > 0.0) & (np.abs(poles.real) <= UNDAMPED * poles.imag)]
        f = np.unique(poles.imag) / (2.0 * np.pi)
        f = f[(f >= self.frequencies[0]) & (f <= self.frequencies[-1])]
        grows = [self._index_at(x * (1.0 + np.array([1e-7, 1e-4]))) for x in f]
        return np.asarray(f[[bool(near > 100.0 * beside) for near, beside in grows]] if len(f) else f)

    def _index_at(self, frequencies: ArrayLike) -> Array:
        w = 2.0 * np.pi * np.asarray(frequencies, dtype=float)
        if isinstance(self.linear, System):
            return _frobenius(self._scaled(summed(self.linear, w, ACCELERATIONS, self.scene.inputs)))
        into = [self.linear.inputs.index(name) for name in self.scene.inputs]
        out = [self.linear.outputs.index(name) for name in ACCELERATIONS]
        return _frobenius(self._scaled(self.linear.frequency_response(w)[np.ix_(out, into)]))

    @cached_property
    def _peak(self) -> tuple[float, float]:
        if len(self._undamped):
            return float(self._undamped[0]), float("inf")
        f, at = self.frequencies, int(self.index.argmax())
        low, high = f[max(at - 1, 0)], f[min(at + 1, len(f) - 1)]
        best = float(f[at]), float(self.index[at])
        for _ in range(ZOOMS if high > low else 0):
            fine = np.linspace(low, high, ZOOM_POINTS)
            values = self._index_at(fine)
            at = int(values.argmax())
            best = max(best, (float(fine[at]), float(values[at])), key=lambda pair: pair[1])
            low, high = fine[max(at - 1, 0)], fine[min(at + 1, ZOOM_POINTS - 1)]
        return best

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
        """Frequency [Hz] above which the index stays below 1, so that the body is isolated; infinite if never."""
        above = np.flatnonzero(self.index >= 1.0)
        if not len(above):
            return float(self.frequencies[0])
        last = int(above[-1])
        if last + 1 == len(self.frequencies):
            return float("inf")
        from scipy.optimize import brentq

        low, high = self.frequencies[last], self.frequencies[last + 1]
        if self.index[last] == 1.0 or low == 0.0:
            return float(low)
        return float(brentq(lambda f: float(self._index_at([f])[0]) - 1.0, low, high, xtol=1e-13 * high, rtol=1e-13))

    @cached_property
    def _line(self) -> tuple[float, float]:
        """Slope and constant of log10 index over log10 frequency in the decade above the resonances, if it is one."""
        f, start = self.frequencies, FAR * self.crossover
        far = (f >= start) & (f <= 10.0 * start) & (self.index > 0.0)
        if np.count_nonzero(far) < 3:
            return float("nan"), float("nan")
        x, y = np.log10(f[far]), np.log10(self.index[far])
        slope, constant = np.polyfit(x, y, 1)
        straight = np.abs(y - slope * x - constant).max() <= STRAIGHT and slope <= FALLING
        return float(slope), float(constant if straight else "nan")

    @property
    def roll_off(self) -> float:
        """Slope [dB/decade] of the index in the decade from twice the cross-over, as far as the band goes."""
        return 20.0 * self._line[0]

    @property
    def corner(self) -> float:
        """Frequency [Hz] at which the straight line of the roll-off meets 1; not a number where it is no such line."""
        slope, constant = self._line
        return float(10.0 ** (-constant / slope))

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
        from mbsvib.isolation.noise import base_noise
        from mbsvib.isolation.vibration import vibration

        return vibration(self, base_noise(spectra, self.scene.moved, correlation), band)

    def table(self) -> dict[str, Any]:
        """Return the table of figures as arguments of ``mbsvib.tables.text`` and ``show``.

        Returns
        -------
        dict
            Title, columns, rows and notes.
        """
        from mbsvib.isolation.writing import isolation_table

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
        from mbsvib.isolation.writing import isolation_csv

        return isolation_csv(self, path)

    def __str__(self) -> str:
        from mbsvib import tables

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
        Ascending frequencies [Hz]; default: 400, from well below the lowest to well above the highest mode.
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
    size = np.abs(linear.poles()) / (2.0 * np.pi)
    size = size[size > 1e-9 * size.max(initial=0.0)]
    if not len(size):
        raise ResponseError("isolation: nothing vibrates, so that no band suggests itself; give frequencies [Hz].")
    return np.geomspace(BELOW * size.min(), ABOVE * size.max(), POINTS)


def _frobenius(g: Complex) -> Array:
    return np.asarray(np.sqrt((np.abs(g) ** 2).sum(axis=(0, 1)) / g.shape[1]))
