"""Studies of isolation: how well a body is kept from the motion of its base, and how it vibrates under noise."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.model import Model
from mbsvib.api.system import System
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import hertz
from mbsvib.errors import ResponseError, UnstableWarning
from mbsvib.feedback.loop import resolution
from mbsvib.isolation.figures import Figures, Linear, unstable
from mbsvib.isolation.study_scene import ACCELERATIONS, DIRECTIONS, DISPLACEMENTS, LOADS, StudyScene, scene
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.random import curves
from mbsvib.random.budget import random
from mbsvib.random.mean_squares import Random
from mbsvib.random.sources import BaseNoise, base_noise, base_sources
from mbsvib.responses.frequency_grid import resolving_frequencies

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
        """Return the table of root mean squares as arguments of ``mbsvib.common.tables.text`` and ``show``."""
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
        """Return frequencies [Hz], densities and cumulative root mean squares as columns (n,) by name:
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


POINTS = 400  # evenly spaced default frequencies; more points are added at resonances
BELOW, ABOVE = 0.02, 20.0  # default band, in parts of the lowest and highest natural frequency


@dataclass(frozen=True, repr=False, eq=False)
class Isolation(Figures, Displayed):
    """Transmissibility from a base to a body and the body's compliance over frequency; prints as a table of figures."""

    _engine = "linear scene"

    def under(
        self, spectra: Mapping[str, Any], correlation: ArrayLike | None = None, band: tuple[float, float] | None = None
    ) -> Vibration:
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
            If a spectrum is refused, or the system is unstable.
        """
        return vibration(self, base_noise(spectra, self.scene.base_directions, correlation), band)

    def __repr__(self) -> str:
        return (f"Isolation({self.name!r}: {self.scene.base} to {self.scene.body}, {len(self.frequencies)} frequencies "
                f"from {self.frequencies[0]:g} to {self.frequencies[-1]:g} Hz)")  # fmt: skip


def study(
    model: Model, body: str, base: str = GROUND, *, point: ArrayLike | None = None, length: float | None = None,
    frequencies: ArrayLike | None = None, directions: Sequence[str] | None = None,
) -> Isolation:  # fmt: skip
    """Return how well a body is isolated from the motion of its base.

    Base motions, wrenches and outputs are added to a copy; those of the model are not used.

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
    study_scene = scene(model, body, base, point, length, directions)
    return figures(study_scene, study_scene.system, frequencies)


def figures(study_scene: StudyScene, linear: Linear, frequencies: ArrayLike | None = None) -> Isolation:
    """Return the figures of a scene at ascending ``frequencies`` (n,) [Hz], with its loops open or closed."""
    if words := unstable(linear):
        warnings.warn(f"isolation: {words}", UnstableWarning, stacklevel=3)
    f = _resolving(linear) if frequencies is None else hertz(frequencies)
    shaken, loaded = (np.asarray(linear.frequency_response(2.0 * np.pi * f, *ports)) for ports in
                      ((ACCELERATIONS, study_scene.inputs), (DISPLACEMENTS, LOADS)))  # fmt: skip
    for array in (f, shaken, loaded):
        array.setflags(write=False)
    return Isolation(study_scene, linear, f, shaken, loaded)


def _resolving(linear: Linear) -> Array:
    """Frequencies (n,) [Hz] that resolve all resonances, ascending; for closed loops also those of the open loop."""
    system: System = linear if isinstance(linear, System) else linear.open_loop
    size = np.abs(system.poles()) / (2.0 * np.pi)
    size = size[size > 1e-9 * size.max(initial=0.0)]
    if not len(size):
        raise ResponseError("isolation: nothing vibrates, so that no band suggests itself; give frequencies [Hz].")
    low, high = BELOW * float(size.min()), ABOVE * float(size.max())
    poles, _, period = resolution(linear)
    if period < np.inf:
        count = int(high / period) + 1
        poles = (poles[:, None] + 2j * np.pi * period * np.arange(-count, count + 1)).reshape(-1)
    poles = np.concatenate((system.poles(), poles))
    return resolving_frequencies(poles, poles, low, high, POINTS)
