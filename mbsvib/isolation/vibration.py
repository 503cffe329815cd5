"""Vibration under base noise: root mean squares, cumulative ones, one-third octaves, strokes and forces."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.csv_columns import write_columns
from mbsvib.common.display import Displayed
from mbsvib.common.expected import hertz
from mbsvib.errors import ResponseError
from mbsvib.isolation import octaves
from mbsvib.isolation.linear import responses
from mbsvib.isolation.mean_square import integrals, moments, panels
from mbsvib.isolation.study_scene import ACCELERATIONS, DIRECTIONS
from mbsvib.responses.densities import Shaped
from mbsvib.responses.power_spectra import BaseNoise

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.isolation.figures import Figures

# Accelerations below this share of the largest, rotations times the study's length, are 0 in the table: the root of
# what rounding leaves of their squares.
ROUNDED = 1e-8


@dataclass(frozen=True, repr=False, eq=False)
class Vibration(Displayed):
    """Root mean squares while the base is shaken by ``noise``, over ``band`` [Hz] or all frequencies (None).

    ``acceleration`` (6,) [m/s^2, rad/s^2] is that of the body, absolute, at the reference point; ``stroke`` [m] and
    ``force`` [N] those of each leg or spring. ``exact`` tells whether they are moments of white noise through filters
    or integrals over frequency; both are accurate to rounding.
    """

    study: Figures
    noise: BaseNoise
    band: tuple[float, float] | None
    acceleration: Array
    stroke: Mapping[str, float]
    force: Mapping[str, float]
    exact: bool
    _inputs: tuple[str, ...] = field(repr=False, default=())

    def cumulative(self, frequencies: ArrayLike | None = None) -> Array:
        """Return the cumulative root mean square acceleration: what frequencies from the first one on contribute.

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Ascending frequencies [Hz]; default: those of the study.

        Returns
        -------
        array, shape (6, n)
            Root mean squares of the part below each frequency [m/s^2, rad/s^2].

        Raises
        ------
        ResponseError
            If frequencies do not ascend.
        """
        f = hertz(self.study.frequencies if frequencies is None else frequencies)
        low, high = _span(self.noise, self.band, float(f[-1]))
        inside = np.clip(f, low, high)
        return np.sqrt(self._below(inside, (low, high)))

    def _below(self, frequencies: Array, band: tuple[float, float], power: int = 0) -> Array:
        """Mean squares (6, n) of what a band contributes below frequencies in it [Hz]; ``power``: of ``integrals``."""
        ends = panels(self.study.linear, self.noise, band, frequencies)
        parts = integrals(self.study.linear, self._inputs, ACCELERATIONS, self.noise, ends, power)
        total = np.concatenate((np.zeros((6, 1)), np.cumsum(parts, axis=1)), axis=1)
        return np.asarray(total[:, np.searchsorted(ends, frequencies)])

    def density(self, frequencies: ArrayLike | None = None) -> Array:
        """Return the one-sided power spectral density of the body's acceleration.

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Frequencies [Hz]; default: those of the study.

        Returns
        -------
        array, shape (6, n)
            Densities [(m/s^2)^2/Hz, (rad/s^2)^2/Hz].
        """
        f = hertz(self.study.frequencies if frequencies is None else frequencies)
        g = responses(self.study.linear, 2.0 * np.pi * f, ACCELERATIONS, self._inputs)
        return np.asarray(np.einsum("oin,nij,ojn->on", g, self.noise.at(f), g.conj()).real)

    def velocity(self, centres: ArrayLike | None = None) -> Array:
        """Return the root mean square velocity of the body in one-third octaves.

        Parameters
        ----------
        centres : array-like, shape (bands,), optional
            Middle frequencies of adjacent one-third octaves [Hz]; default: 1 to 80 Hz.

        Returns
        -------
        array, shape (6, bands)
            Velocities [m/s, rad/s].
        """
        middle = octaves.centres() if centres is None else hertz(centres)
        limits = octaves.edges(middle)
        if self.band is not None:
            limits = np.clip(limits, *self.band)
        if limits[0] == limits[-1]:
            return np.zeros((6, len(middle)))
        below = self._below(limits, (float(limits[0]), float(limits[-1])), power=-2)
        return np.sqrt(np.maximum(np.diff(below, axis=1), 0.0))

    @cached_property
    def criterion(self) -> str:
        """The strictest vibration criterion, VC-A to VC-G, that x, y and z keep from 1 to 80 Hz, as far as the band
        goes; empty if none.
        """
        low, high = self.judged
        return octaves.strictest(octaves.centres(), self.velocity()[:3]) if low < high else ""

    @property
    def judged(self) -> tuple[float, float]:
        """First and last frequency [Hz] of the comparison with the criteria."""
        band = (octaves.LOWEST, octaves.HIGHEST) if self.band is None else self.band
        return max(octaves.LOWEST, band[0]), min(octaves.HIGHEST, band[1])

    def table(self) -> dict[str, Any]:
        """Return the table of root mean squares as arguments of ``mbsvib.common.tables.text`` and ``show``.

        Returns
        -------
        dict
            Title, columns, rows and notes.
        """
        size = self.acceleration * self.study.scene.scale(DIRECTIONS)
        rest = size <= ROUNDED * size.max()
        rows = [(f"{self.study.scene.body} {direction}", "0" if none else f"{value:.4g}",
                 "m/s^2" if len(direction) == 1 else "rad/s^2", "", "")
                for direction, value, none in zip(DIRECTIONS, self.acceleration, rest, strict=True)]  # fmt: skip
        rows += [(name, "", "", f"{1e6 * self.stroke[name]:.4g}", f"{self.force[name]:.4g}") for name in self.stroke]
        columns: list[tuple[str, Any]] = [("rms", "left"), ("acceleration", "right"), ("", "left"),
                                          ("stroke [um]", "right"), ("force [N]", "right")]  # fmt: skip
        band = "all frequencies" if self.band is None else f"{self.band[0]:g} to {self.band[1]:g} Hz"
        notes = [f"Base motion along {' '.join(self.noise.directions)}, {band}."]
        if np.isinf(self.acceleration).any():
            notes.append("Infinite: noise without upper frequency limit passes through the masses; give a band.")
        (low, high), criterion = self.judged, self.criterion
        if low < high:
            words = f"Meets {criterion}" if criterion else f"Meets no vibration criterion, not even {min(octaves.VC)},"
            notes.append(f"{words} from {low:g} to {high:g} Hz.")
        else:
            notes.append("Vibration criteria are for 1 to 80 Hz, which is not in the band.")
        return {"title": f"Vibration of {self.study.name}", "columns": columns, "rows": rows, "notes": notes}

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write density and cumulative root mean square of the acceleration over frequency as comma-separated values.

        Parameters
        ----------
        path : str or path-like
            Where to.

        Returns
        -------
        Path
            The path.
        """
        f = self.study.frequencies
        units = ["m/s2" if len(direction) == 1 else "rad/s2" for direction in DIRECTIONS]
        columns = {"frequency_hz": f}
        for form, values in (("density_{}_({})2/hz", self.density(f)), ("cumulative_rms_{}_{}", self.cumulative(f))):
            columns |= {form.format(d, u): row for d, u, row in zip(DIRECTIONS, units, values, strict=True)}
        return write_columns(path, columns)

    def __repr__(self) -> str:
        return f"Vibration({self.study.name!r}: base shaken along {' '.join(self.noise.directions)})"


def vibration(study: Figures, noise: BaseNoise, band: tuple[float, float] | None) -> Vibration:
    """Return root mean squares of a study's body, strokes and forces over a ``band`` [Hz]; None: all frequencies."""
    legs = study.scene.legs
    outputs = [*ACCELERATIONS, *(leg.stroke for leg in legs), *(leg.force for leg in legs)]
    inputs = tuple([f"base.{direction}" for direction in noise.directions])
    if band is not None:
        band = float(band[0]), float(band[1])
    square, exact = _squares(study, inputs, outputs, noise, band)
    root = np.sqrt(square)
    k = len(legs)
    names = [leg.name for leg in legs]
    return Vibration(study, noise, band, root[:6], dict(zip(names, root[6 : 6 + k].tolist(), strict=True)),
                     dict(zip(names, root[6 + k :].tolist(), strict=True)), exact, inputs)  # fmt: skip


def _squares(
    study: Figures, inputs: tuple[str, ...], outputs: list[str], noise: BaseNoise, band: tuple[float, float] | None
) -> tuple[Array, bool]:
    linear = study.linear
    if band is None and noise.unbounded:
        if noise.filters is not None:
            return moments(linear, inputs, outputs, noise.filters, noise.correlation.real), True
        if not np.array_equal(noise.correlation, np.eye(len(inputs))):
            raise ResponseError("rms: correlated noise of different shapes has no moments in closed form; give a band, "
                                "(first, last) [Hz], over which it is integrated.")  # fmt: skip
        total = np.zeros(len(outputs))
        for i, spectrum in enumerate(noise.spectra):
            single = replace(noise, directions=noise.directions[i : i + 1], spectra=(spectrum,),
                             correlation=np.eye(1, dtype=complex))  # fmt: skip
            total += _squares(study, inputs[i : i + 1], outputs, single, None)[0]
        return total, False
    ends = panels(linear, noise, _span(noise, band, 0.0))
    return integrals(linear, inputs, outputs, noise, ends).sum(axis=1), False


def _span(noise: BaseNoise, band: tuple[float, float] | None, last: float) -> tuple[float, float]:
    """The band, or that of the tables; of noise without a last frequency up to ``last``."""
    if band is not None:
        return band
    breaks: NDArray[np.float64] = noise.breaks
    if all(not isinstance(spectrum, Shaped) for spectrum in noise.spectra):
        return float(breaks[0]), float(breaks[-1])
    return 0.0, max(last, float(breaks[-1]) if len(breaks) else 0.0)
