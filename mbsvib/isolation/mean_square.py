"""Mean squares of responses to noise: exact moments where white noise drives filters, integrals over frequency else.

Integrals are exact to rounding as well: each panel is no longer than the distance from its middle to the nearest pole,
where Gauss' rule of twelve points leaves an error of 1e-14 of the integrand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.feedback.loop import resolution
from mbsvib.isolation.asymptote import direct as at_once
from mbsvib.isolation.linear import numbers, responses
from mbsvib.linalg.lasting import separated
from mbsvib.responses import extrema
from mbsvib.responses.norms import mean_squares
from mbsvib.responses.power_spectra import SEMIDEFINITE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.isolation.linear import Linear
    from mbsvib.responses.densities import Shaped
    from mbsvib.responses.power_spectra import BaseNoise


BATCH = 512  # frequencies at a time


def moments(linear: Linear, inputs: Sequence[str], outputs: Sequence[str], filters: Sequence[Shaped],
            correlation: Array) -> Array:  # fmt: skip
    """Return the mean squares (outputs,) of outputs under filtered white noise, from A P + P A^T + B W B^T = 0.

    ``correlation`` (inputs, inputs): of the white noise before the filters. A mean square is infinite where white noise
    reaches the output directly, or where an integrator accumulates it.
    """
    from scipy.linalg import block_diag

    space = linear.state_space("modal")
    out, into = numbers(linear, outputs, inputs)
    a, b, c, d = space.A, space.B[:, into], space.C[out], space.D[np.ix_(out, into)]
    fa, fb = block_diag(*[f.a for f in filters]), block_diag(*[f.b for f in filters])
    fc, fd = block_diag(*[f.c for f in filters]), np.diag([f.d for f in filters])
    n, k = len(a), len(fa)
    augmented = np.zeros((n + k, n + k))
    augmented[:n, :n], augmented[:n, n:], augmented[n:, n:] = a, b @ fc, fa
    enters, leaves = np.concatenate((b @ fd, fb)), np.concatenate((c, d @ fc), axis=1)
    root = np.sqrt([0.5 * f.level for f in filters])
    value, vectors = np.linalg.eigh(correlation)  # white noises that have nothing to do with each other
    drive = enters @ (root[:, None] * vectors * np.sqrt(np.where(value > SEMIDEFINITE, value, 0.0)))
    result = _lyapunov(space.name, augmented, drive, leaves)
    through = (at_once(linear)[np.ix_(out, into)] @ fd @ np.diag(root) != 0.0).any(axis=1)
    result[through] = np.inf
    return result


def _lyapunov(name: str, a: Array, b: Array, c: Array) -> Array:
    """Mean squares (outputs,) of C x, x' = A x + B w under white noise w; infinite where poles that last are driven."""
    parts = separated(a, b, c)
    if any((group.part.poles.real > group.part.errors[0]).any() for group in parts.lasting):
        raise ResponseError(f"rms: '{name}' is not stable, so its rms value is unbounded. Add stiffness or damping "
                            f"until no pole has a positive real part.")  # fmt: skip
    result = mean_squares(parts.decaying.a, parts.decaying.b, parts.decaying.c, name)
    for group in parts.shown:
        result[group.shown.any(axis=1)] = np.inf
    return result


def panels(linear: Linear, noise: BaseNoise, band: tuple[float, float], more: ArrayLike = ()) -> Array:
    """Return the ends (panels + 1,) [Hz] of panels over a band, short enough for Gauss' rule.

    ``band``: first and last frequency [Hz]. ``more``: frequencies [Hz] that are to be among the ends.
    """
    low, high = band
    if not 0.0 <= low < high < np.inf:
        raise ResponseError(f"rms: band = ({low:g}, {high:g}) Hz; expected two ascending frequencies, from 0 Hz on.")
    poles_of_system, longest, period = resolution(linear)
    poles = np.concatenate((poles_of_system, noise.poles)) / (2.0 * np.pi)
    grows = extrema.excited(lambda f: _largest(linear, noise, f), poles, low, high)
    if len(grows):
        raise ResponseError(f"rms: the mode at {grows[0]:.6g} Hz is not damped, and noise at its frequency drives it "
                            f"without bound; give the mechanism damping, or a band without it.")  # fmt: skip
    poles = poles[np.abs(poles.real) > extrema.UNDAMPED * np.abs(poles)]
    marks = np.concatenate((noise.breaks, np.abs(poles), np.ravel(np.asarray(more, dtype=float))))
    if len(noise.breaks):
        poles = np.append(poles, 0.0)  # tables are powers of the frequency
    return extrema.panels(poles, low, high, marks, longest, period)


def integrals(linear: Linear, inputs: Sequence[str], outputs: Sequence[str], noise: BaseNoise, ends: Array,
              power: int = 0) -> Array:  # fmt: skip
    """Return the mean square of outputs in each panel (outputs, panels), the integral of w^power (G S G^H).

    ``ends`` (panels + 1,) [Hz]. ``power`` of the angular frequency [rad/s]: -2 makes velocities of accelerations.
    """
    f, weight = extrema.gauss_rule(ends)
    density = np.empty((len(outputs), len(f)))
    for start in range(0, len(f), BATCH):
        part = slice(start, start + BATCH)
        density[:, part] = _density(responses(linear, 2.0 * np.pi * f[part], outputs, inputs), noise.at(f[part]))
    if power:
        density *= (2.0 * np.pi * f) ** power
    return np.asarray((density * weight).reshape(len(outputs), len(ends) - 1, -1).sum(axis=2))


def _density(g: Complex, s: Complex) -> Array:
    """Diagonal of G S G^H, (outputs, n)."""
    if g.shape[1] == 1:
        return np.asarray(np.abs(g[:, 0]) ** 2 * s[:, 0, 0].real)
    stack = np.ascontiguousarray(g.transpose(2, 0, 1))
    return np.asarray(((stack @ s) * stack.conj()).sum(axis=2).real.T)


def _largest(linear: Linear, noise: BaseNoise, frequencies: Array) -> Array:
    g = responses(linear, 2.0 * np.pi * frequencies, linear.outputs, [f"base.{name}" for name in noise.directions])
    return np.asarray(np.abs(g).max(axis=(0, 1)))
