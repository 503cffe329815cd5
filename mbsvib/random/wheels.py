"""How the heights of one road under several wheels are related."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.display import Displayed
from mbsvib.common.expected import positive, reals
from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex

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
