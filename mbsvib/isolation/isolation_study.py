"""Studies of isolation: how well a body is kept from the motion of its base, and how it vibrates under noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common.display import Displayed
from mbsvib.common.expected import hertz
from mbsvib.errors import ResponseError
from mbsvib.feedback.loop import resolution
from mbsvib.isolation.figures import Figures
from mbsvib.isolation.study_scene import ACCELERATIONS, DISPLACEMENTS, LOADS, StudyScene, scene
from mbsvib.isolation.vibration import vibration
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.random.sources import base_noise
from mbsvib.responses import extrema

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.isolation.figures import Linear
    from mbsvib.isolation.vibration import Vibration


POINTS = 400  # evenly spaced default frequencies; more points are added at resonances
THINNING = 3.0  # distance of the first added point in half-widths, and ratio of successive distances
SAME = 1e-10  # share of a frequency within which points are duplicates
BELOW, ABOVE = 0.02, 20.0  # default band, in parts of the lowest and highest natural frequency


@dataclass(frozen=True, repr=False, eq=False)
class Isolation(Figures, Displayed):
    """Transmissibility from a base to a body and the body's compliance over frequency; prints as a table of figures."""

    _engine = "linear scene"

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
    f = _resolving(linear) if frequencies is None else hertz(frequencies)
    shaken, loaded = (np.asarray(linear.frequency_response(2.0 * np.pi * f, *ports)) for ports in
                      ((ACCELERATIONS, study_scene.inputs), (DISPLACEMENTS, LOADS)))  # fmt: skip
    for array in (f, shaken, loaded):
        array.setflags(write=False)
    return Isolation(study_scene, linear, f, shaken, loaded)


def _resolving(linear: Linear) -> Array:
    """Return ascending frequencies (n,) [Hz] around all poles, for a closed loop also around those of the open loop.

    They are evenly spaced on a logarithmic axis, and denser around resonances.
    """
    system: System = linear if isinstance(linear, System) else linear.open_loop
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
    points = np.unique(np.concatenate((even, _around(poles, even[1] / even[0] - 1.0))))
    points = points[(points >= low) & (points <= high)]
    return points[np.concatenate(([True], np.diff(points) > SAME * points[1:]))]


def _around(poles: Complex, spacing: float) -> Array:
    """Peaks and half-power points of resonances, and points around them up to the even spacing."""
    half, centre = np.abs(poles.real)[:, None], np.abs(poles.imag)[:, None]
    away = THINNING ** np.arange(np.ceil(-np.log(extrema.UNDAMPED) / np.log(THINNING)))
    away = half * np.concatenate(([0.0], away, -away))
    return (centre + away)[(half > extrema.UNDAMPED * centre) & (np.abs(away) <= spacing * centre)]
