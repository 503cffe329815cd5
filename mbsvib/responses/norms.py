"""Norms of linear equations by their responses: H2, the rms under white noise, and Hinf, the highest peak."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.display import Displayed
from mbsvib.errors import ResponseError
from mbsvib.linalg.balancing import scaled
from mbsvib.linalg.rank import EPS
from mbsvib.responses.extrema import Band, panels

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array, Complex


# The response has its peaks below this times the fastest pole, and is D from there; heights that differ by less are
# the same.
LAST, ROUNDING = 1e3, 1e-9
LASTS = 64.0  # a pole whose real part is below so many roundings of it does not decay


@dataclass(frozen=True, repr=False)
class Norm(Displayed):
    """A norm's ``value`` and its derivatives ``slopes`` (v,) to ``variables`` (v,); ``omega`` [rad/s] is the frequency
    of the peak, inf where the response only tends to it, None for the H2 norm.
    """

    value: float
    variables: tuple[str, ...] = ()
    slopes: Array = field(default_factory=lambda: np.zeros(0))
    omega: float | None = None


def check_decays(poles: Complex, name: str, norm: str) -> None:
    """Refuse the norm of equations that do not decay, by their ``poles`` (poles,) [1/s]."""
    lasting = np.flatnonzero(poles.real >= -LASTS * EPS * np.abs(poles))
    if len(lasting):
        s = complex(poles[lasting[0]])
        raise ResponseError(f"{norm} norm of '{name}': the pole {s:.6g} 1/s ({abs(s) / (2.0 * np.pi):.4g} Hz) does not "
                            f"decay, so that the norm is infinite. Give it damping, or change the controller."
                            )  # fmt: skip


def h2(space: tuple[Array, Array, Array, Array], names: tuple[tuple[str, ...], tuple[str, ...]], name: str) -> Norm:
    """Return the H2 norm of first-order equations.

    ||G||^2 = tr(C P C^T),  A P + P A^T + B B^T = 0
    """
    from scipy.linalg import solve_continuous_lyapunov

    a, b, c, d = space
    if d.any():
        o, i = np.unravel_index(int(np.abs(d).argmax()), d.shape)
        raise ResponseError(f"H2 norm of '{name}': input '{names[1][i]}' acts directly on output '{names[0][o]}', so "
                            f"that the norm is infinite. Choose displacements or velocities: outputs=[...]."
                            )  # fmt: skip
    if not len(a):
        return Norm(0.0)
    a, b, c = scaled(a, b, c)
    covariance = solve_continuous_lyapunov(a, -b @ b.T)
    return Norm(float(np.sqrt(max(0.0, np.sum(c @ covariance * c)))))


def hinf(response: Callable[[Array], Complex], poles: Complex, direct: Array | Complex) -> Norm:
    """Return the highest peak of a frequency response: max over w of sigma(G(i w)).

    ``response`` takes w (n,) [rad/s] and returns G (outputs, inputs, n); all ``poles`` have negative real parts;
    ``direct``: D, the response at infinite frequency. The frequency is inf where the response only tends to its largest
    value.
    """
    if not direct.size:
        return Norm(0.0, omega=0.0)
    fastest = float(np.abs(poles).max(initial=0.0)) or 1.0
    band = Band(lambda w: response(w).transpose(2, 0, 1), panels(poles, 0.0, LAST * fastest))
    omega, value = band.highest(lambda g: np.asarray(np.linalg.svd(g, compute_uv=False)[:, 0]))
    far = float(np.linalg.svd(direct, compute_uv=False)[0])
    return Norm(far, omega=np.inf) if far > value * (1.0 + ROUNDING) else Norm(value, omega=omega)
