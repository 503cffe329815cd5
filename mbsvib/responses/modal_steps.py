"""Exact steps of single modes: from the state at one sample to that at the next, for held and linear inputs.

z'' + tau z' + p z = f has, with roots l1, l2 and a = l1 h, b = l2 h, the divided differences of the exponential

S = h exp[a, b],  I = h^2 exp[a, b, 0],  J = h^3 exp[a, b, 0, 0],  C = 1 - p I

as responses to an impulse, a step, a ramp and an initial displacement. Each is computed in a form without cancellation:
by a power series where |a|, |b| < 1, by divided differences where the roots are real and well separated, and elsewhere
by cosines (or hyperbolic ones) of the distance to the middle, which are smooth through critical damping.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.modes.classical import quadratic_roots

# |a|, |b| up to which a power series is summed, and its terms: the next one is below 1e-18.
SERIES_RADIUS = 1.0
TERMS = 21
# Real roots are well separated if their difference times the step exceeds this: quotients lose one digit at most.
SEPARATE = 0.5


@dataclass(frozen=True, slots=True)
class Oscillators:
    """Modes z'' + ``total`` z' + ``square`` z = f, (k,) each, with the states z and z'."""

    square: Array
    total: Array

    def step(self, h: Array) -> tuple[Array, Array, Array]:
        """Return the transition matrices over steps ``h`` (n,), (2, 2, k, n), and the contributions of a constant force
        and of a force that grows from 0 to 1 within the step, (2, k, n) each.
        """
        shape = (len(self.square), len(h))
        p, tau, flat = (np.broadcast_to(x, shape).reshape(-1) for x in (self.square[:, None], self.total[:, None], h))
        c, s, i, j, rate = _answers(p, tau, flat)
        transition = np.array([[c, s], [-p * s, rate]]).reshape(2, 2, *shape)
        return transition, np.array([i, s]).reshape(2, *shape), np.array([j / flat, i / flat]).reshape(2, *shape)


@dataclass(frozen=True, slots=True)
class Exponentials:
    """Modes x' = ``value`` x + g, (k,) complex, one state each."""

    value: Complex

    def step(self, h: Array) -> tuple[Complex, Complex, Complex]:
        """Return the same as ``Oscillators.step``, (1, 1, k, n) and twice (1, k, n)."""
        x = self.value[:, None] * h
        first, second = phi(x)
        return np.exp(x)[None, None], (h * first)[None], (h * second)[None]


def phi(x: Any) -> tuple[Any, Any]:
    """Return (exp(x) - 1) / x and (exp(x) - 1 - x) / x^2 without cancellation, for real or complex x."""
    x = np.asarray(x)
    small = np.abs(x) < SERIES_RADIUS
    safe = np.where(small, 1.0, x)
    first = np.expm1(safe) / safe
    second = (first - 1.0) / safe
    inner = np.where(small, x, 0.0)
    series = np.zeros_like(inner)
    for n in range(TERMS, 1, -1):  # 1/2 + x/6 + x^2/24 + ..., by Horner's rule
        series = (1.0 + inner * series) / n
    return np.where(small, 1.0 + inner * series, first), np.where(small, series, second)


def _answers(p: Array, tau: Array, h: Array) -> tuple[Array, Array, Array, Array, Array]:
    """C, S, I, J and S' for arrays of one shape (n,)."""
    half = 0.5 * tau
    omega = np.sqrt(np.abs(p))
    inside = np.where(p >= 0.0, (half - omega) * (half + omega), half * half - p)
    root = np.sqrt(np.abs(inside))
    reach = np.where(inside > 0.0, np.abs(half) + root, omega) * h
    series = reach < SERIES_RADIUS
    separate = ~series & (inside > 0.0) & (2.0 * root * h > SEPARATE)
    result = np.empty((5, len(p)))
    for mask, road in ((series, _by_series), (separate, _by_quotients), (~series & ~separate, _by_cosines)):
        if mask.any():
            result[:, mask] = road(p[mask], tau[mask], h[mask])
    return tuple(result)  # type: ignore[return-value]


def _by_series(p: Array, tau: Array, h: Array) -> tuple[Array, ...]:
    """Sums of the complete symmetric polynomials of a and b over factorials."""
    u, v = -tau * h, p * h * h
    before, now = np.zeros_like(u), np.ones_like(u)
    s, i, j = np.zeros_like(u), np.zeros_like(u), np.zeros_like(u)
    factorial = 1.0
    for n in range(TERMS):
        factorial *= n + 1
        s += now / factorial
        i += now / (factorial * (n + 2))
        j += now / (factorial * (n + 2) * (n + 3))
        before, now = now, u * now - v * before
    s, i, j = h * s, h * h * i, h**3 * j
    c = 1.0 - p * i
    return c, s, i, j, c - tau * s


def _by_quotients(p: Array, tau: Array, h: Array) -> tuple[Array, ...]:
    """Differences over the distance of the roots: a is the one nearer to zero."""
    slow, fast = quadratic_roots(p, tau).real.T
    a, b = slow * h, fast * h
    (first_a, second_a), (first_b, second_b) = phi(a), phi(b)
    gap = a - b
    upper, lower = np.maximum(a, b), np.minimum(a, b)
    quotient = -np.exp(upper) * np.expm1(lower - upper) / (upper - lower)
    c = np.exp(a) - a * quotient
    return c, h * quotient, h * h * (first_a - first_b) / gap, h**3 * (second_a - second_b) / gap, (
        np.exp(b) + a * quotient
    )


def _by_cosines(p: Array, tau: Array, h: Array) -> tuple[Array, ...]:
    """The middle of the roots, and cosine and sine over argument of the distance from it."""
    half = 0.5 * tau
    omega = np.sqrt(np.abs(p))
    inside = (half - omega) * (half + omega)
    y = np.sqrt(np.abs(inside)) * h
    turns = inside < 0.0
    hyperbolic = np.where(turns, 0.0, y)  # below 0.25
    cosine = np.where(turns, np.cos(y), np.cosh(hyperbolic))
    sine = np.divide(np.where(turns, np.sin(y), np.sinh(hyperbolic)), y, out=np.ones_like(y), where=y != 0.0)
    decay = np.exp(-half * h)
    s = h * decay * sine
    c = decay * (cosine + half * h * sine)
    i = (1.0 - c) / p
    return c, s, i, (h - s - tau * i) / p, decay * (cosine - half * h * sine)
