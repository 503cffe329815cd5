"""Mean squares of responses to noise: exact moments where white noise drives filters, integrals over frequency else.

Integrals are exact to rounding as well: each panel is no longer than half the distance from its middle to the nearest
pole, where Gauss' rule of eight points leaves an error of 1e-14 of the integrand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.isolation.noise import BaseNoise, Shaped
    from mbsvib.kinematics import Array

    Complex = NDArray[np.complex128]

POINTS = 8
REACH = 0.5
ON_AXIS = 1e-12  # damping ratio below which a mode is undamped
GROWTH = 100.0
# A feedthrough below this share of the response is rounding; noise through a larger one has no mean square.
DIRECT = 1e-10
HIDDEN = 1e-9
BATCH = 512
LAST = 1e-12  # panels are not halved beyond this share of their frequency


class Linear(Protocol):
    """What mean squares are taken of: a system, or a closed loop."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""

    def poles(self) -> Complex:
        """Poles [1/s]."""

    def frequency_response(self, omega: ArrayLike) -> Complex:
        """G(i w), shape (outputs, inputs, n)."""

    def state_space(self, realization: str = "modal") -> Any:
        """First-order equations .A .B .C .D."""


def moments(linear: Linear, inputs: Sequence[str], outputs: Sequence[str], filters: Sequence[Shaped],
            correlation: Array) -> Array:  # fmt: skip
    """Return the mean squares of outputs under filtered white noise, from A P + P A^T + B W B^T = 0.

    Parameters
    ----------
    linear : Linear
        A system or a closed loop.
    inputs, outputs : sequence of str
        Where noise enters, and what is asked for.
    filters : sequence of Shaped
        The filter of each input.
    correlation : array, shape (inputs, inputs)
        Of the white noise before the filters.

    Returns
    -------
    array, shape (outputs,)
        Mean squares; infinite where noise comes through at once, or where an integrator sums it up.

    Raises
    ------
    ResponseError
        If the system is not stable.
    """
    from scipy.linalg import block_diag, matrix_balance

    space = linear.state_space("modal")
    into = [linear.inputs.index(name) for name in inputs]
    out = [linear.outputs.index(name) for name in outputs]
    a, b, c, d = space.A, space.B[:, into], space.C[out], space.D[np.ix_(out, into)]
    fa, fb = block_diag(*[f.a for f in filters]), block_diag(*[f.b for f in filters])
    fc, fd = block_diag(*[f.c for f in filters]), np.diag([f.d for f in filters])
    n, k = len(a), len(fa)
    whole = np.zeros((n + k, n + k))
    whole[:n, :n], whole[:n, n:], whole[n:, n:] = a, b @ fc, fa
    enters, leaves, direct = np.concatenate((b @ fd, fb)), np.concatenate((c, d @ fc), axis=1), d @ fd
    root = np.sqrt([0.5 * f.level for f in filters])
    strength = root[:, None] * correlation * root
    balanced, (scale, _) = matrix_balance(whole, permute=False, separate=True)
    enters, leaves = enters / scale[:, None], leaves * scale
    result = _lyapunov(balanced, enters, leaves, strength)
    size = _size(linear, into, out)
    through = ((np.abs(direct) > DIRECT * size) & (root > 0.0)).any(axis=1)
    result[through] = np.inf
    return result


def _lyapunov(a: Array, b: Array, c: Array, strength: Array) -> Array:
    from scipy.linalg import schur, solve_continuous_lyapunov, solve_sylvester

    n = len(a)
    if not n:
        return np.zeros(len(c))
    fastest = float(np.abs(a).sum(axis=1).max())
    slow = 1e-13 * fastest
    upper, turn, stable = schur(a, sort=lambda x, y=0.0: x < -slow)
    b, c = turn.T @ b, c @ turn
    seen = np.zeros(len(c), dtype=bool)
    if stable < n:
        rest = upper[stable:, stable:]
        if np.linalg.eigvals(rest).real.max() > 1e4 * slow:
            raise ResponseError("rms: the system is not stable, so that its vibration grows without bound.")
        # block-diagonal: what does not decay is harmless only where no output shows it or no noise drives it
        mix = solve_sylvester(upper[:stable, :stable], -rest, -upper[:stable, stable:])
        driven, shown = b[stable:], c[:, stable:] + c[:, :stable] @ mix
        b = np.concatenate((b[:stable] - mix @ driven, driven))
        floor = HIDDEN * np.abs(shown).max(initial=0.0) * np.abs(b).max(initial=0.0)
        seen = (np.abs(shown) @ np.abs(driven) > max(floor, 1e-300)).any(axis=1)
    part = b[:stable]
    moment = solve_continuous_lyapunov(upper[:stable, :stable], -part @ strength @ part.T)
    result = np.einsum("on,nm,om->o", c[:, :stable], moment, c[:, :stable])
    result = np.maximum(result, 0.0)
    result[seen] = np.inf
    return np.asarray(result)


def _size(linear: Linear, into: list[int], out: list[int]) -> Array:
    """The largest response (outputs, 1) near the poles, also to motions of the base that are not asked for: what an
    output is to these by symmetry shows the rounding of what it is to others.
    """
    into = into + [i for i, name in enumerate(linear.inputs) if name.startswith("base.") and i not in into]
    size = np.abs(linear.poles())
    size = np.unique(size[size > 0.0])
    if not len(size):
        return np.ones((len(out), len(into)))
    g = linear.frequency_response(1.0001 * size[np.linspace(0, len(size) - 1, min(len(size), 50)).astype(int)])
    return np.asarray(np.abs(g[np.ix_(out, into)]).max(axis=2).max(axis=1, keepdims=True))


def panels(linear: Linear, noise: BaseNoise, band: tuple[float, float], more: ArrayLike = ()) -> Array:
    """Return the ends of panels over a band, short enough for Gauss' rule.

    Parameters
    ----------
    linear : Linear
        A system or a closed loop.
    noise : BaseNoise
        What shakes it.
    band : (float, float)
        First and last frequency [Hz].
    more : array-like
        Frequencies [Hz] that are to be among the ends.

    Returns
    -------
    array, shape (panels + 1,)
        Ascending frequencies [Hz].

    Raises
    ------
    ResponseError
        If the band is empty, or an undamped mode in it is excited.
    """
    low, high = band
    if not 0.0 <= low < high < np.inf:
        raise ResponseError(f"rms: band = ({low:g}, {high:g}) Hz; expected two ascending frequencies, from 0 Hz on.")
    poles = np.concatenate((linear.poles(), noise.poles)) / (2.0 * np.pi)
    still = np.abs(poles.real) <= ON_AXIS * np.abs(poles.imag)
    for f in np.unique(poles.imag[still & (poles.imag > low) & (poles.imag < high)]):
        near, beside = (_largest(linear, noise, f * (1.0 + step)) for step in (1e-7, 1e-4))
        if near > GROWTH * beside:
            raise ResponseError(f"rms: the mode at {f:.6g} Hz is not damped, and noise at its frequency drives it "
                                f"without bound; give the mechanism damping, or a band without it.")  # fmt: skip
    poles = poles[~still]
    within = np.concatenate((noise.breaks, np.abs(poles), np.ravel(np.asarray(more, dtype=float))))
    ends = np.unique(np.concatenate(([low, high], within[(within > low) & (within < high)])))
    tables = len(noise.breaks) > 0
    while True:
        middle, length = 0.5 * (ends[1:] + ends[:-1]), np.diff(ends)
        distance = np.abs(1j * middle[:, None] - poles).min(axis=1, initial=np.inf)
        if tables:
            distance = np.minimum(distance, middle)
        long = (length > REACH * distance) & (length > LAST * middle)
        if not long.any():
            return np.asarray(ends)
        ends = np.sort(np.concatenate((ends, middle[long])))


def integrals(linear: Linear, inputs: Sequence[str], outputs: Sequence[str], noise: BaseNoise, ends: Array,
              power: int = 0) -> Array:  # fmt: skip
    """Return the mean square of outputs in each panel, the integral of w^power (G S G^H).

    Parameters
    ----------
    linear : Linear
        A system or a closed loop.
    inputs, outputs : sequence of str
        Where noise enters, and what is asked for.
    noise : BaseNoise
        Its density, one direction an input.
    ends : array, shape (panels + 1,)
        Ends of the panels [Hz].
    power : int
        Of the angular frequency [rad/s]: -2 makes velocities of accelerations.

    Returns
    -------
    array, shape (outputs, panels)
        Mean squares.
    """
    into = [linear.inputs.index(name) for name in inputs]
    out = [linear.outputs.index(name) for name in outputs]
    node, weight = np.polynomial.legendre.leggauss(POINTS)
    half = 0.5 * np.diff(ends)
    f = ((0.5 * (ends[1:] + ends[:-1]))[:, None] + half[:, None] * node).reshape(-1)
    density = np.empty((len(out), len(f)))
    for start in range(0, len(f), BATCH):
        part = slice(start, start + BATCH)
        g = linear.frequency_response(2.0 * np.pi * f[part])[np.ix_(out, into)]
        density[:, part] = _density(g, noise.at(f[part]))
    if power:
        density *= (2.0 * np.pi * f) ** power
    return np.asarray((density.reshape(len(out), -1, POINTS) @ weight) * half)


def _density(g: Complex, s: Complex) -> Array:
    """Diagonal of G S G^H, (outputs, n)."""
    if g.shape[1] == 1:
        return np.asarray(np.abs(g[:, 0]) ** 2 * s[:, 0, 0].real)
    stack = np.ascontiguousarray(g.transpose(2, 0, 1))
    return np.asarray(((stack @ s) * stack.conj()).sum(axis=2).real.T)


def _largest(linear: Linear, noise: BaseNoise, frequency: float) -> float:
    into = [linear.inputs.index(f"base.{direction}") for direction in noise.directions]
    return float(np.abs(linear.frequency_response([2.0 * np.pi * frequency])[:, into]).max(initial=0.0))
