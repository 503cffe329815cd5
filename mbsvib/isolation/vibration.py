"""Vibration under base noise: root mean squares, cumulative ones, one-third octaves, strokes and forces."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import hertz
from mbsvib.isolation.study_scene import ACCELERATIONS, DIRECTIONS
from mbsvib.random import curves
from mbsvib.random.budget import random
from mbsvib.random.sources import base_sources

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array
    from mbsvib.isolation.figures import Figures
    from mbsvib.random.mean_squares import Random
    from mbsvib.random.sources import BaseNoise

# Accelerations below this share of the largest, rotations times the study's length, are 0 in the table: the root of
# what rounding leaves of their squares, a few units in the last place.
ROUNDED = 1e-7


@dataclass(frozen=True, repr=False, eq=False)
class Vibration(Columnar, Displayed):
    """Root mean squares while the base is shaken by ``noise``, over ``band`` [Hz] or all frequencies (None).

    ``acceleration`` (6,) [m/s^2, rad/s^2] is that of the body, absolute, at the reference point; ``stroke`` [m] and
    ``force`` [N] those of each leg or spring. ``exact`` states whether they are moments of white noise through filters
    or integrals over frequency; both are accurate to rounding.
    """

    _engine = "exact judged"

    study: Figures
    """Transmissibilities of which it is made."""
    noise: BaseNoise
    band: tuple[float, float] | None
    acceleration: Array
    stroke: Mapping[str, float]
    force: Mapping[str, float]
    exact: bool
    _random: Random = field(repr=False)

    def cumulative(self, frequencies: ArrayLike | None = None) -> Array:
        """Return the cumulative root mean square acceleration, from the first frequency up to each frequency.

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
        return np.asarray(np.sqrt(self._random.below(f)[:6].sum(axis=1)))

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
        return np.asarray(self._random.densities(f)[:6].sum(axis=1))

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
        middle = curves.centres() if centres is None else hertz(centres)
        limits = curves.edges(middle)
        squares = self._random.below(limits, lambda f: (2.0 * np.pi * f) ** -2.0, float(limits[0]))[:6].sum(axis=1)
        return np.asarray(np.sqrt(np.maximum(np.diff(squares, axis=1), 0.0)))

    @cached_property
    def criterion(self) -> str:
        """The strictest vibration criterion, VC-A to VC-G, that x, y and z keep from 1 to 80 Hz, as far as the band
        goes; empty if none.
        """
        low, high = self.judged
        return curves.strictest(curves.centres(), self.velocity()[:3]) if low < high else ""

    @property
    def judged(self) -> tuple[float, float]:
        """First and last frequency [Hz] of the comparison with the criteria."""
        band = (curves.LOWEST, curves.HIGHEST) if self.band is None else self.band
        return max(curves.LOWEST, band[0]), min(curves.HIGHEST, band[1])

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
            words = f"Meets {criterion}" if criterion else f"Meets no vibration criterion, not even {min(curves.VC)},"
            notes.append(f"{words} from {low:g} to {high:g} Hz.")
        else:
            notes.append("Vibration criteria are for 1 to 80 Hz, which is not in the band.")
        return {"title": f"Vibration of {self.study.name}", "columns": columns, "rows": rows, "notes": notes}

    _index = "frequency_hz"

    def columns(self) -> dict[str, Array]:
        """Return frequencies [Hz], densities and cumulative root mean squares as columns by name.

        Returns
        -------
        dict of str to array, shape (n,)
            ``frequency_hz``, ``density_x_(m/s2)2/hz``, ..., ``cumulative_rms_x_m/s2``, ...
        """
        f = self.study.frequencies
        units = ["m/s2" if len(direction) == 1 else "rad/s2" for direction in DIRECTIONS]
        columns = {"frequency_hz": f}
        for form, values in (("density_{}_({})2/hz", self.density(f)), ("cumulative_rms_{}_{}", self.cumulative(f))):
            columns |= {form.format(d, u): row for d, u, row in zip(DIRECTIONS, units, values, strict=True)}
        return columns

    def __repr__(self) -> str:
        return f"Vibration({self.study.name!r}: base shaken along {' '.join(self.noise.directions)})"


def vibration(study: Figures, noise: BaseNoise, band: tuple[float, float] | None) -> Vibration:
    """Return root mean squares of a study's body, strokes and forces over a ``band`` [Hz]; None: all frequencies."""
    legs = study.scene.legs
    outputs = [*ACCELERATIONS, *(leg.stroke for leg in legs), *(leg.force for leg in legs)]
    under = random(study.linear, base_sources(noise), outputs, band, None, None)
    exact = under.exact
    if (not exact and not noise.unbounded) or band is not None:
        under.check_finite()
    root = np.sqrt(under.mean_squares().total)
    k = len(legs)
    names = [leg.name for leg in legs]
    return Vibration(study, noise, under.band, root[:6], dict(zip(names, root[6 : 6 + k].tolist(), strict=True)),
                     dict(zip(names, root[6 + k :].tolist(), strict=True)), exact, under)  # fmt: skip
