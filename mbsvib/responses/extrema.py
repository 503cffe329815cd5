"""Extrema and crossings of a frequency response over a band, also between samples.

On a panel no longer than the distance of its middle to the nearest pole, a response is a polynomial of degree 15 in the
frequency up to 1e-9 of its size. It is sampled at the Chebyshev nodes of each panel, interpolated on a fine grid, and
evaluated again at each extremum and crossing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import AnyArray, Array, Complex, Index
from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import EPS

Measure = Callable[[AnyArray], Array]

# A pole is at least two half-lengths away from the middle of a panel, where the error falls by (2 + sqrt 3) a node.
NODES = 16
# Interpolated samples of a panel: an extremum between two of them is missed only below 1e-4 of the response.
SAMPLES = 64
# A pole with a smaller damping ratio counts as undamped. Panels end at the second number, times its frequency, from it:
# next to a pole the response is not a polynomial.
UNDAMPED, NEAREST = 1e-12, 1e-7
# If an undamped mode is excited, a response grows tenfold from ten of these distances, in parts of the frequency, to
# one. A smaller growth than the second number means that the mode is not excited.
CLOSE, GROWTH = 1e-9, 5.0
BEYOND = 4.0  # times the error of a pole: where its response is known
SHORTEST = 1e-13  # in parts of the frequency: rounding leaves no panel shorter than that
MOST_PANELS = 100_000
BATCH, BLOCK = 2048, 4_000_000  # frequencies and interpolated numbers at a time
# The largest value is searched for about every sample that reaches this share of it.
NEAR = 0.9
FLAT = 1e-9  # in parts of a value: the error of interpolation, no extremum
GOLDEN = 0.5 * (3.0 - 5.0**0.5)
SECTIONS = 8  # golden ones: brackets shrink by 50, to 1e-3 of the distance to the nearest pole
# Steps of Newton, and their differences as a share of the bracket: errors of 1e-13 by the fourth order and by rounding.
NEWTON, STEP = 2, 0.02
LEVEL = 8.0 * EPS  # in parts of a value: rounding of equal ones
SECANTS = 30  # at most; some six where the function is nearly straight


def panels(
    poles: Complex, low: float, high: float, marks: ArrayLike = (), longest: float = np.inf, period: float = np.inf
) -> Array:  # fmt: skip
    """Return the ends (panels + 1,) of panels over a band, none longer than the way from its middle to the nearest
    pole.

    ``poles``: in units of the frequencies. ``marks``: frequencies at which a panel is to end, where they are in the
    band. ``longest``: largest length of a panel, for responses that are not rational. ``period``: that of the poles
    along the frequency, for sampled responses.
    """
    if high - low > MOST_PANELS * longest:
        raise ResponseError(f"the band from {low:.4g} to {high:.4g} Hz is {(high - low) / longest:.1e} times the "
                            f"{longest:.3g} Hz in which a sampled response changes; give a narrower one.")  # fmt: skip
    folded = np.unique(np.abs(poles.real) + 1j * np.abs(poles.imag))
    size = np.maximum(np.abs(folded), float(np.abs(folded[folded != 0.0]).min(initial=high)))
    folded = np.where(folded.real > UNDAMPED * size, folded, NEAREST * size + 1j * folded.imag)
    if period < np.inf:
        folded = np.concatenate((folded, folded - 1j * period, folded.conj(), folded.conj() + 1j * period))
    within = np.ravel(np.asarray(marks, dtype=float))
    ends = np.unique(np.concatenate(([low, high], within[(within > low) & (within < high)])))
    start, end, result = ends[:-1], ends[1:], [float(high)]
    while len(start):
        middle, length = 0.5 * (start + end), end - start
        limit = np.array([np.abs(1j * w - folded).min(initial=longest) for w in np.mod(middle, period)])
        long = (length > limit) & (length > SHORTEST * middle)
        result.extend(start[~long].tolist())
        start, end = np.concatenate((start[long], middle[long])), np.concatenate((middle[long], end[long]))
    return np.sort(result)


def excited(
    size: Callable[[Array], Array], poles: Complex, low: float, high: float, errors: Array | float = 0.0
) -> Array:  # fmt: skip
    """Return the frequencies of undamped poles in a band at which a response has no bound, ascending.

    ``size`` takes frequencies (n,), and returns how large the response is, (n,). ``poles``, and bounds of the
    ``errors`` within which rounding leaves them: in units of the frequencies.
    """
    errors = np.maximum(UNDAMPED * np.abs(poles), errors)
    undamped, at = np.unique(np.abs(poles), return_index=True)
    inside = (np.abs(poles.real) <= errors)[at] & (undamped >= low) & (undamped <= high) & (undamped > 0.0)
    undamped, distance = undamped[inside], np.maximum(CLOSE * undamped, BEYOND * errors[at])[inside]
    if not len(undamped):
        return undamped
    near, farther = (size(undamped + factor * distance) for factor in (1.0, 10.0))
    return np.asarray(undamped[near > GROWTH * farther])


@dataclass(frozen=True, eq=False)
class Band:
    """A response over panels: ``response`` takes frequencies (n,) and returns values (n, ...); a ``measure`` maps them
    to numbers (n,); ``ends`` (panels + 1,) are the ends of the panels.
    """

    response: Callable[[Array], AnyArray] = field(repr=False)
    ends: Array

    @cached_property
    def nodes(self) -> AnyArray:
        """Values at the nodes of each panel, (panels, nodes, ...)."""
        middle, half = 0.5 * (self.ends[1:] + self.ends[:-1]), 0.5 * np.diff(self.ends)
        w = (middle[:, None] + half[:, None] * _interpolation()[0]).reshape(-1)
        values = np.concatenate([self.response(w[start : start + BATCH]) for start in range(0, len(w), BATCH)])
        return values.reshape(len(half), NODES, *values.shape[1:])

    def highest(self, measure: Measure) -> tuple[float, float]:
        """Return the frequency of the largest value, and this value; of several that are equally large, one."""
        where, value = self.maxima(measure, NEAR)
        at = int(value.argmax())
        return float(where[at]), float(value[at])

    def maxima(self, measure: Measure, share: float = 0.0) -> tuple[Array, Array]:
        """Return frequencies and values of the local maxima, one at least, those at the ends of the band among them.

        ``share``: smallest value to be returned, in parts of the largest.
        """
        w, value = self._samples(measure, share)
        before, after = np.concatenate(([-np.inf], value[:-1])), np.concatenate((value[1:], [-np.inf]))
        top = (value >= before) & (value >= after) & (value >= share * value.max())
        top &= value - np.minimum(before, after) > FLAT * np.abs(value)
        top[value.argmax()] = True
        return _raised(lambda x: measure(self.response(x)), w, np.flatnonzero(top))

    def crossings(self, measure: Measure) -> Array:
        """Return the frequencies, ascending, at which a number changes its sign; next to no numbers there are none."""
        w, value = self._samples(measure)
        # between samples near an extremum close to zero there may be two crossings
        near, curvature = value[1:-1], np.abs(value[:-2] - 2.0 * value[1:-1] + value[2:])
        side = np.sign(near)
        turns = (side * (near - value[:-2]) <= 0.0) & (side * (near - value[2:]) <= 0.0) & (np.abs(near) <= curvature)
        for sign in (-1.0, 1.0):
            at = 1 + np.flatnonzero(turns & (side == sign))
            if len(at):
                where, height = _raised(lambda x, sign=sign: -sign * measure(self.response(x)), w, at)  # type: ignore[misc]
                w, value = np.concatenate((w, where)), np.concatenate((value, -sign * height))
        order = np.argsort(w, kind="stable")
        w, value = w[order], value[order]
        known = np.isfinite(value)
        changes = known[1:] & known[:-1] & ((value[1:] >= 0.0) != (value[:-1] >= 0.0))
        return _roots(lambda x: measure(self.response(x)), w, np.flatnonzero(changes))

    def _samples(self, measure: Measure, share: float = 0.0) -> tuple[Array, Array]:
        """Frequencies and interpolated numbers, ends included, of panels that reach a share of the largest node."""
        _, fine, weights = _interpolation()
        nodes, searched = self.nodes, np.arange(len(self.ends) - 1)
        if share > 0.0:
            size = measure(nodes.reshape(-1, *nodes.shape[2:])).reshape(-1, NODES).max(axis=1)
            searched = searched[size >= share * size.max()]
        step = max(1, BLOCK // (SAMPLES * max(1, nodes[0, 0].size)))
        values = []
        for start in range(0, len(searched), step):
            part = np.tensordot(nodes[searched[start : start + step]], weights, axes=(1, 1))
            values.append(measure(np.moveaxis(part, -1, 1).reshape(-1, *nodes.shape[2:])))
        low, high = self.ends[searched, None], self.ends[searched + 1, None]
        w = 0.5 * (low + high) + 0.5 * (high - low) * fine
        w[:, :1], w[:, -1:] = low, high
        w, index = np.unique(w, return_index=True)
        return w, np.concatenate(values)[index]


@lru_cache(maxsize=1)
def _interpolation() -> tuple[Array, Array, Array]:
    """Nodes and samples of the panel from -1 to 1, and the matrix from values at the nodes to values at the samples."""
    from numpy.polynomial.chebyshev import chebpts1, chebvander

    nodes, fine = chebpts1(NODES), np.linspace(-1.0, 1.0, SAMPLES + 1)
    return nodes, fine, chebvander(fine, NODES - 1) @ np.linalg.inv(chebvander(nodes, NODES - 1))


def _raised(value: Callable[[Array], Array], w: Array, at: Index) -> tuple[Array, Array]:
    """Maxima about samples: golden sections between their neighbours, then Newton's steps with differences."""
    low, high = w[np.maximum(at - 1, 0)], w[np.minimum(at + 1, len(w) - 1)]
    step = STEP * (high - low)
    first, second = low + GOLDEN * (high - low), high - GOLDEN * (high - low)
    first_height, second_height = value(first), value(second)
    for _ in range(SECTIONS):
        left = first_height > second_height
        low, high = np.where(left, low, first), np.where(left, second, high)
        new = np.where(left, low + GOLDEN * (high - low), high - GOLDEN * (high - low))
        height = value(new)
        first, second = np.where(left, new, second), np.where(left, first, new)
        first_height, second_height = np.where(left, height, second_height), np.where(left, first_height, height)
    best, top = w[at], value(w[at])
    middle = 0.5 * (low + high)
    for _ in range(NEWTON + 1):
        f = [value(np.abs(middle + k * step)) for k in (-2.0, -1.0, 0.0, 1.0, 2.0)]
        # a later step is nearer to the maximum, whose values differ by rounding only
        best, top = np.where(f[2] >= top - LEVEL * np.abs(top), middle, best), np.maximum(top, f[2])
        slope = (f[0] - 8.0 * f[1] + 8.0 * f[3] - f[4]) / 12.0
        curvature = (-f[0] + 16.0 * f[1] - 30.0 * f[2] + 16.0 * f[3] - f[4]) / 12.0
        middle = middle - step * np.divide(slope, curvature, out=np.zeros_like(curvature), where=curvature < 0.0)
        middle = np.clip(middle, low, high)
    return best, top


def _roots(value: Callable[[Array], Array], w: Array, at: Index) -> Array:
    """Changes of sign between samples and the next ones, by false position that halves stale ends (Illinois)."""
    if not len(at):
        return np.zeros(0)
    low, high = w[at], w[at + 1]
    # interpolation may have given the wrong sign of a value next to 0
    same = (value(low) >= 0.0) == (value(high) >= 0.0)
    low, high = np.where(same, w[np.maximum(at - 1, 0)], low), np.where(same, w[np.minimum(at + 2, len(w) - 1)], high)
    f_low, f_high = value(low), value(high)
    brackets = np.isfinite(f_low) & np.isfinite(f_high) & ((f_low >= 0.0) != (f_high >= 0.0))
    low, high, f_low, f_high = low[brackets], high[brackets], f_low[brackets], f_high[brackets]
    middle, last = low, np.zeros(len(low))
    for _ in range(SECANTS):
        rise = f_high - f_low
        known = np.isfinite(rise) & (rise != 0.0)
        middle = np.divide(f_high * low - f_low * high, rise, out=0.5 * (low + high), where=known)
        middle = np.clip(middle, low, high)
        if not ((middle > low) & (middle < high)).any():
            break
        f = value(middle)
        side = np.where((f >= 0.0) == (f_low >= 0.0), -1.0, 1.0)
        stale = np.where(side == last, 0.5, 1.0)
        f_low, f_high = np.where(side < 0.0, f, stale * f_low), np.where(side < 0.0, stale * f_high, f)
        low, high, last = np.where(side < 0.0, middle, low), np.where(side < 0.0, high, middle), side
    return np.unique(middle)
