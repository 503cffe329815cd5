"""Profiles of roads over distance, what a wheel meets of them over time, and how the heights under several wheels are
related.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arguments import count
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import one_of, positive, real, reals
from mbsvib.common.memory import BATCH_BYTES
from mbsvib.errors import ResponseError
from mbsvib.random.curves import ORDER, ROAD_REFERENCE, ROAD_SPAN, road_roughness


@dataclass(frozen=True, repr=False, eq=False)
class RoadProfile(Columnar, Displayed):
    """The height of a road [m] over the distance x [m]: h(x) = sum of a cos(2 pi n x + phi) from ``start`` on.

    ``waves`` (w,) are spatial frequencies n [cycles/m], ``amplitudes`` (w,) [m] and ``phases`` (w,) [rad]. It is 0
    outside of ``start`` to ``stop`` [m]. Arrays are read-only.
    """

    name: str
    """Name for figures."""
    waves: Array
    amplitudes: Array
    phases: Array
    start: float = -np.inf
    stop: float = np.inf

    def __post_init__(self) -> None:
        for array in (self.waves, self.amplitudes, self.phases):
            array.setflags(write=False)

    def columns(self) -> dict[str, Any]:
        """Return the waves as columns ``spatial_frequency_1/m``, ``amplitude_m`` and ``phase_rad``."""
        return {"spatial_frequency_1/m": self.waves, "amplitude_m": self.amplitudes, "phase_rad": self.phases}

    def at(self, distance: ArrayLike, derivative: int = 0) -> Array:
        """Return the height, or a derivative of it to the distance.

        Parameters
        ----------
        distance : array-like, shape (n,)
            Distances x [m].
        derivative : int
            0: height [m]; 1: slope [m/m]; 2: curvature [1/m].

        Returns
        -------
        array, shape (n,)
            Values.

        Raises
        ------
        ResponseError
            If distances are not numbers.
        """
        x = reals(distance, "RoadProfile.at", "distance", "distances [m]")
        turn = 2.0 * np.pi * self.waves
        amplitude, phase = self.amplitudes * turn**derivative, self.phases + 0.5 * np.pi * derivative
        flat, result = x.reshape(-1), np.zeros(x.size)
        size = max(1, BATCH_BYTES // (8 * max(1, len(turn))))
        for k in range(0, len(flat), size):
            part = flat[k : k + size, None]
            result[k : k + size] = np.cos(turn * part + phase) @ amplitude
        return np.where((flat >= self.start) & (flat <= self.stop), result, 0.0).reshape(x.shape)

    def under(self, t: ArrayLike, speed: float, behind: float = 0.0, quantity: str = "displacement") -> Array:
        """Return what a wheel meets that drives at a constant speed: the height of the road at x = v t - behind.

        Parameters
        ----------
        t : array-like, shape (n,)
            Times [s].
        speed : float
            v [m/s].
        behind : float
            How far the wheel is behind the point that is at x = 0 at t = 0 [m], such as the wheelbase of a rear axle,
            which repeats the front one behind / v later.
        quantity : str
            "displacement" [m], "velocity" [m/s] or "acceleration" [m/s^2].

        Returns
        -------
        array, shape (n,)
            Values at these times, for an input of this quantity.

        Raises
        ------
        ResponseError
            If the speed is not positive, or the quantity is another one.
        """
        v = positive("under", "speed", speed, "a speed [m/s]")
        order = ORDER[one_of(quantity, ORDER, "under", "quantity")]
        x = v * reals(t, "under", "t", "times [s]") - real(behind, "under", "behind", "a distance [m]")
        return np.asarray(v**order * self.at(x, order))

    def __repr__(self) -> str:
        return f"RoadProfile({self.name!r})"


def road_profile(name: str, length: float = 500.0, seed: int = 0) -> RoadProfile:
    """Return a random profile of a road of a class, always the same one for a seed.

    h(x) = sum a_k cos(2 pi n_k x + phi_k),  a_k^2 / 2 = integral of G(n) over the band of n_k

    Parameters
    ----------
    name : str
        Class of the road, "A" (very good) to "H", as of ``road_spectrum``.
    length : float
        Distance [m] after which the profile repeats itself; n_k are multiples of its inverse.
    seed : int
        Seed of the phases phi_k, which are independent and uniform.

    Returns
    -------
    RoadProfile
        Its mean square is that of the density from 0.011 to 2.83 cycles/m.

    Raises
    ------
    ResponseError
        If there is no such class, or the length is below 91 m, the longest wave.

    Source: ISO 8608:2016, table C.2; Shinozuka & Jan, Journal of Sound and Vibration 25 (1972) 111.
    """
    roughness = road_roughness(name, "road_profile")
    low, high = ROAD_SPAN
    size = positive("road_profile", "length", length, f"a length of at least {1.0 / low:.1f} m, the longest wave")
    if size * low < 1.0:
        raise ResponseError(f"road_profile: length = {size:g} m; expected at least {1.0 / low:.1f} m, the longest wave "
                            f"of the class.")  # fmt: skip
    waves = np.arange(np.ceil(low * size), np.floor(high * size) + 1.0) / size
    edges = np.concatenate(([low], 0.5 * (waves[1:] + waves[:-1]), [high]))
    square = roughness * ROAD_REFERENCE**2 * -np.diff(1.0 / edges)  # of G ~ n^-2
    phases = 2.0 * np.pi * np.random.default_rng(count(seed, "road_profile", "seed", 0)).random(len(waves))
    return RoadProfile(f"class {name}", waves, np.sqrt(2.0 * square), phases)


def road_bump(height: float, length: float, start: float = 0.0) -> RoadProfile:
    """Return a single bump, h(x) = H/2 (1 - cos(2 pi (x - start) / L)).

    Parameters
    ----------
    height : float
        H [m], negative for a hole.
    length : float
        L [m].
    start : float
        Where it begins [m].

    Returns
    -------
    RoadProfile
        Zero before and behind it.

    Raises
    ------
    ResponseError
        If a value is not a number, or the length is not positive.
    """
    size = positive("road_bump", "length", length, "a length [m]")
    half = 0.5 * real(height, "road_bump", "height", "a height [m]")
    begin = real(start, "road_bump", "start", "a distance [m]")
    return RoadProfile("bump", np.array([0.0, 1.0 / size]), np.array([half, -half]),
                       np.array([0.0, -2.0 * np.pi * begin / size]), begin, begin + size)  # fmt: skip


FAR = 700.0  # argument beyond which K_1 is below the smallest double


@dataclass(frozen=True, repr=False, eq=False)
class RoadCorrelation(Displayed):
    """The correlation of a road under wheels that are ``behind`` (s,) [m] a common line, at ``across`` (s,) [m], at a
    ``speed`` [m/s]. Called with frequencies (n,) [Hz] it returns the matrices (n, s, s). Arrays are read-only.
    """

    behind: Array
    across: Array
    speed: float

    def __post_init__(self) -> None:
        for array in (self.behind, self.across):
            array.setflags(write=False)

    def __call__(self, f: ArrayLike) -> Complex:
        """Return the correlation matrices (n, s, s) at frequencies (n,) [Hz], or one (s, s) at a single frequency."""
        from scipy.special import k1

        w = 2.0 * np.pi * np.asarray(f, dtype=float)[..., None, None] / self.speed  # rad/m
        late, apart = self.behind[None, :] - self.behind[:, None], np.abs(self.across[None, :] - self.across[:, None])
        x = np.abs(w) * apart
        inside = np.where(x > 0.0, np.minimum(x, FAR), 1.0)
        return np.asarray(np.where(x > 0.0, inside * k1(inside), 1.0) * np.exp(1j * w * late))


def road_correlation(behind: ArrayLike, speed: float, across: ArrayLike | None = None) -> RoadCorrelation:
    """Return the correlation of the heights of one road under several wheels.

    R_ij(f) = x K_1(x) exp(2 pi i f (b_j - b_i) / v),  x = 2 pi f |y_j - y_i| / v

    A wheel meets what another one on its track has met, later by its distance behind it. Wheels on different tracks
    meet a surface that is alike in all directions (isotropic), whose density over the distance falls with n^-2 as in
    ISO 8608: long waves lift both, short ones are independent. K_1 is a modified Bessel function.

    Parameters
    ----------
    behind : array-like, shape (s,)
        b [m]: how far each wheel is behind a common line, such as the front axle, in the order of the sources.
    speed : float
        v [m/s].
    across : array-like, shape (s,), optional
        y [m]: where each wheel is across the road; default: all on one track.

    Returns
    -------
    RoadCorrelation
        A function of the frequency, ``correlation`` of ``rms``, ``psd`` and ``budget``.

    Raises
    ------
    ResponseError
        If the speed is not positive, or positions are not as many finite numbers.

    Source: Kamash & Robson, The application of isotropy in road surface modelling, J. Sound Vib. 57 (1978) 89.
    """
    late = np.atleast_1d(reals(behind, "road_correlation", "behind", "distances [m]")).copy()
    side = np.zeros_like(late) if across is None else \
        np.atleast_1d(reals(across, "road_correlation", "across", "positions [m]")).copy()  # fmt: skip
    if late.ndim != 1 or late.shape != side.shape or not np.isfinite((late, side)).all():
        raise ResponseError(f"road_correlation: behind has the shape {late.shape} and across {side.shape}; expected as "
                            f"many finite numbers of both, one for each wheel.")  # fmt: skip
    return RoadCorrelation(late, side, positive("road_correlation", "speed", speed, "a speed [m/s]"))
