"""A root mean square that no values within limits exceed: worst gains of bands of frequencies, each of them proven.

E[y^2] = (1 / pi) integral over w of |G(i w)|^2 <= (1 / pi) (sum over bands of g^2 (w2 - w1) + g'^2 / w_last)

g bounds the gain from white noise of intensity 1 to y within a band for all values of the parameters, and g' that of
i w G above the last band; both by scalings D and G. Values may differ from one frequency to the next: the bound is near
what is reached where resonances are wider than the parameters move them, and above it where they are not.

Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 4.3 (integral); Fan, Tits & Doyle, IEEE Trans.
Automatic Control 36 (1991) 25 (scalings).

A mean square that no values within limits exceed: energy against dissipation of a passive mechanism.

M q'' + C q' + K q = B w,  y = Cq q + Cv q',  w white noise of intensity 1:

A X + X A^T + B B^T <= 0  with  X = tau diag(K^-1, M^-1)  if  2 tau C >= B B^T,  so that
E[y^2] <= tau (Cq K^-1 Cq^T + Cv M^-1 Cv^T)

M, C and K are affine in the parameters, M0 + sum of x_k M_k with |x_k| <= 1, and so at least M0 - sum of |M_k|; what is
convex in B, Cq and Cv is largest at vertices. The bound is reached by one mode, and where noise is in proportion to
damping. It does not depend on how close or how lightly damped the modes are. What noise does not reach, or the output
does not see, is left out where nothing connects it.

Source: Lyapunov's theorem, Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 3.8, with the covariance of
mechanisms in thermal equilibrium; R. Kubo, Rep. Prog. Phys. 29 (1966) 255.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Index
from mbsvib.common.expected import kind_of
from mbsvib.linalg.groups import part_numbers
from mbsvib.linalg.rank import ZERO_RATE
from mbsvib.random.moments import Equations, filtered
from mbsvib.responses.densities import Shaped
from mbsvib.uncertain.blocks import Block
from mbsvib.uncertain.scalings import Channels, best_scalings, interval
from mbsvib.uncertain.search import Perturbed, peak_of, samples

Band = tuple[float, float]

CORNERS, INSIDE = 6, 64  # parameters of which all vertices are samples; samples at random beside them
VARIES = 0.1  # share by which gains of samples vary within a band
SMALL = 2e-3  # share of the mean square up to which a band is not divided
FACTORS = (1.01, 1.05, 1.2, 1.6, 3.0)  # on the gain of samples, at which a bound is to be proven in turn
ENOUGH = 1e-3  # least eigenvalue of Phi, against D, at which scalings are good enough
TAIL = (30.0, 100.0, 300.0, 1000.0)  # times the fastest pole, about which the last bound is to begin
LEAST = 1e-6  # share of the highest gain, below which gains are not told apart
MOST = 600  # bands


def behind_filters(problem: Perturbed, filters: Sequence[Shaped]) -> Perturbed:
    """Return the equations with white noise of intensity 1 before the filters of their sources."""
    (a, b, c, d), r = problem.space, len(problem.owner)
    columns = [*range(r), *problem.sources]
    space = filtered(Equations(a, b[:, columns], c, d[:, columns]), [*[None] * r, *filters], [None] * len(c)).all
    return replace(problem, space=space, sources=list(range(r, r + len(filters))))


def mean_square_bound(channels: Channels, beyond: Channels) -> float:
    """Return a mean square, in units of time of the channels, that no values exceed; infinite if none is proven.

    ``beyond``: the same plant, in which noise comes through to no signal directly, for high frequencies.
    """
    if not len(channels.a) or beyond.d[:, beyond.count :].any():
        return np.inf
    deltas = _samples(channels)
    tail = _tail(beyond, deltas)
    if tail is None:
        return np.inf
    total = tail[1] ** 2 / tail[0]
    bands, highest = _bands(channels, deltas, tail[0])
    if highest == 0.0:
        return 0.0
    for band in bands:
        bound = _over_band(channels, deltas, band, LEAST * highest)
        if bound is None:
            return np.inf
        total += bound
    return float(total / np.pi)


def _samples(channels: Channels) -> Array:
    """Changes (k, channels) of the parameters from -1 to 1: none, vertices, and points at random."""
    limits = np.tile([-1.0, 1.0], (len(channels.sizes), 1))
    return np.repeat(samples(limits, CORNERS, INSIDE, INSIDE), channels.sizes, axis=1)


def _reached(channels: Channels, deltas: Array, w: Array) -> Array:
    """The largest gains (len(w),) of samples."""
    n, m = channels.count, channels.at(w)[:, None]
    inner = np.eye(n) - m[..., :n, :n] * deltas[:, None, :]
    gain = m[..., n:, n:] + (m[..., n:, :n] * deltas[:, None, :]) @ np.linalg.solve(inner, np.broadcast_to(
        m[..., :n, n:], (*inner.shape[:-1], channels.inputs)))  # fmt: skip
    return np.asarray(np.linalg.norm(gain, axis=(-2, -1)).max(axis=1))


def _bands(channels: Channels, deltas: Array, last: float) -> tuple[list[Band], float]:
    """Bands from 0 to ``last`` in which the gains of samples vary little, or count little, and the highest gain."""
    poles = channels.poles()
    ends = np.unique(np.clip(np.concatenate(([0.0, last], np.abs(poles), np.abs(poles.imag))), 0.0, last))
    bands = list(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))
    gains = _reached(channels, deltas, np.concatenate((ends, 0.5 * (ends[1:] + ends[:-1]))))
    known = dict(zip([*ends.tolist(), *(0.5 * (ends[1:] + ends[:-1])).tolist()], gains.tolist(), strict=True))
    done: list[Band] = []
    while bands:
        unit = sum(_size(known, band) for band in (*done, *bands))
        split: list[Band] = []
        for low, high in bands:
            three = [known[w] for w in (low, 0.5 * (low + high), high)]
            flat = max(three) <= (1.0 + VARIES) * min(three)
            if flat or _size(known, (low, high)) <= SMALL * unit or len(done) + 2 * len(split) > MOST:
                done.append((low, high))
            else:
                split += [(low, 0.5 * (low + high)), (0.5 * (low + high), high)]
        bands = split
        new = np.array([0.5 * (low + high) for low, high in bands])
        known |= dict(zip(new.tolist(), _reached(channels, deltas, new).tolist(), strict=True)) if bands else {}
    return done, max(known.values())


def _size(known: dict[float, float], band: Band) -> float:
    """About what a band may add to the mean square."""
    low, high = band
    return max(known[w] for w in (low, 0.5 * (low + high), high)) ** 2 * (high - low)


def _over_band(channels: Channels, deltas: Array, band: Band, least: float) -> float | None:
    """A bound of the integral of the squared gain over a band, None if it is not proven."""
    left, total = [band], 0.0
    for _ in range(MOST):
        if not left:
            return total
        low, high = left.pop()
        w = 0.5 * (low + high)
        proven = _proven(channels, max(least, float(_reached(channels, deltas, np.array([low, w, high])).max())), w)
        if proven is None:
            return None
        bound, a, b = proven[0], max(low, proven[1]), min(high, proven[2])
        if b - a <= 1e-6 * (high - low):
            return None
        total += bound**2 * (b - a)
        left += [piece for piece in ((low, a), (b, high)) if piece[1] > piece[0]]
    return None


def _proven(channels: Channels, gain: float, w: float) -> tuple[float, float, float] | None:
    """A bound of the gain near that of samples, and an interval about ``w`` on which it is proven."""
    for factor in FACTORS:
        scaled = channels.over(factor * gain)
        scalings, s = best_scalings(scaled.at(np.array([w]))[0], channels.sizes, channels.inputs, ENOUGH)
        if s > 0.0:
            low, high = interval(scaled, scalings, w)
            if high > low:
                return factor * gain, low, high
    return None


def _tail(channels: Channels, deltas: Array) -> tuple[float, float] | None:
    """A frequency, and a bound of w |G| above it; None if it is not proven or infinite."""
    n = channels.count
    b, d = channels.b.copy(), channels.d.copy()
    b[:, n:], d[:, n:] = channels.a @ channels.b[:, n:], channels.c @ channels.b[:, n:]
    rate = replace(channels, b=b, d=d)
    fastest = float(np.abs(channels.poles()).max())
    for times in TAIL:
        last = times * fastest
        gain = float(_reached(rate, deltas, last * np.array([1.0, 2.0, 5.0, 20.0, np.inf])).max())
        if gain == 0.0:
            return last, 0.0
        proven = _proven(rate, gain, 2.0 * last)
        if proven is not None and np.isinf(proven[2]):
            return max(last, proven[1]), proven[0]
    return None


CHANGING = 8  # parameters in which inputs and outputs may change
ROUNDING = 1e-9  # share by which the bound is above what is computed


@dataclass(frozen=True, eq=False)
class Affine:
    """A matrix in the ``middle`` of a box, and its changes ``halves`` to the ends of each parameter."""

    middle: Array
    halves: list[Array]

    @classmethod
    def of(cls, nominal: Array, left: Array, right: Array, parameters: Sequence[Block]) -> Affine:
        """Return ``nominal`` + ``left`` delta ``right`` within the limits of parameters."""
        middle, halves, at = nominal.copy(), [], 0
        for block in parameters:
            own, (low, high) = slice(at, at + block.repetitions), block.changes
            slope, at = left[:, own] @ right[own], own.stop
            middle += 0.5 * (low + high) * slope
            halves.append(0.5 * (high - low) * slope)
        return cls(middle, halves)

    def within(self, rows: Index, columns: Index) -> Affine:
        """Return some rows and columns."""
        part = np.ix_(rows, columns)
        return Affine(self.middle[part], [half[part] for half in self.halves])

    @property
    def entries(self) -> NDArray[np.bool_]:
        """Which entries are not 0 everywhere."""
        return np.asarray(np.any([part != 0.0 for part in (self.middle, *self.halves)], axis=0), dtype=np.bool_)

    @property
    def size(self) -> float:
        """The largest entry."""
        return max(float(np.abs(part).max(initial=0.0)) for part in (self.middle, *self.halves))

    @property
    def skew(self) -> float:
        """The largest entry of what is not symmetric."""
        return max(float(np.abs(part - part.T).max(initial=0.0)) for part in (self.middle, *self.halves))

    @property
    def least(self) -> Array:
        """A symmetric matrix that the symmetric part is not below anywhere."""
        result = 0.5 * (self.middle + self.middle.T)
        for half in self.halves:
            values, vectors = np.linalg.eigh(0.5 * (half + half.T))
            result = result - (vectors * np.abs(values)) @ vectors.T
        return result

    def largest(self, function: Callable[[Array], float]) -> float:
        """The largest value of a convex function."""
        moving = [half for half in self.halves if half.any()]
        return max(function(self.middle + sum(x * half for x, half in zip(signs, moving, strict=True)))
                   for signs in product((-1.0, 1.0), repeat=len(moving)))  # fmt: skip


def energy_bound(
    linear: Any, parameters: Sequence[Block], output: str, sources: Sequence[str], filters: Sequence[Shaped]
) -> float:  # fmt: skip
    """Return a mean square of an output that no values exceed, infinite where there is no such proof, as of loops.

    ``linear``: the system with the inputs and outputs of changes first. Filtered noise counts as white noise of its
    highest density.
    """
    if kind_of(linear) != "system" or not set(sources) <= set(linear.inputs):
        return np.inf
    r = sum(block.repetitions for block in parameters)
    u, y = [linear.inputs.index(name) for name in sources], [linear.outputs.index(output)]
    into, out, seen = linear.B[:, :r], linear.D[y][:, :r], linear.D[:r, u]
    m, c, k = (Affine.of(base, -into, rows[:r], parameters) for base, rows in
               ((linear.M, linear.Ca), (linear.C, linear.Cv), (linear.K, linear.Cq)))  # fmt: skip
    b = Affine.of(linear.B[:, u], into, seen, parameters)
    cq, cv, ca = (Affine.of(rows[y], out, rows[:r], parameters) for rows in (linear.Cq, linear.Cv, linear.Ca))
    through = Affine.of(linear.D[np.ix_(y, u)], out, seen, parameters)
    varied = max(sum(bool(half.any()) for half in part.halves) for part in (b, cq, cv))
    if linear.D[:r, :r].any() or ca.size or through.size or k.skew > ZERO_RATE * k.size or varied > CHANGING:
        return np.inf
    number = part_numbers(np.any([part.entries for part in (m, c, k)], axis=0))
    kept = np.flatnonzero(np.isin(number, number[b.entries.any(axis=1)]) &
                          np.isin(number, number[(cq.entries | cv.entries)[0]]))  # fmt: skip
    every, one = np.arange(len(u)), np.arange(1)
    m, c, k = (part.within(kept, kept) for part in (m, c, k))
    b, cq, cv = b.within(kept, every), cq.within(one, kept), cv.within(one, kept)
    try:
        low = [np.linalg.cholesky(part.least) for part in (m, c, k)]
    except np.linalg.LinAlgError:
        return np.inf
    levels = [np.sqrt(0.5 * f.level) * (float(peak_of((f.a, f.b, f.c, np.array([[f.d]]))).value) if len(f.a) else
                                        abs(f.d)) for f in filters]  # fmt: skip
    tau = 0.5 * b.largest(lambda at: float(np.linalg.norm(np.linalg.solve(low[1], at * levels), 2)) ** 2)
    position = cq.largest(lambda at: float(np.square(np.linalg.solve(low[2], at.T)).sum()))
    speed = cv.largest(lambda at: float(np.square(np.linalg.solve(low[0], at.T)).sum()))
    return float((1.0 + ROUNDING) * tau * (position + speed))
