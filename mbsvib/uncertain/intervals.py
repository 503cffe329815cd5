"""From one frequency to all: on which interval scalings D and G keep Phi positive, and a cover of all frequencies.

With M(i w) = C (i w - A)^-1 B + D0 the least eigenvalue of Phi changes its sign at imaginary eigenvalues of

H = [T, -B R^-1 B^T; S R^-1 S^H - Q, -T^H],  T = A - B R^-1 S^H,  Q = -C^T W C,  S = -C^T W D0 + i C^T G,
R = P - D0^T W D0 + i (D0^T G - G D0)

only. Rounding moves these off the axis: all eigenvalues near it are candidates, and the least eigenvalue of Phi at and
between them decides.

Source: Roos, Lescher, Biannic, Doell & Ferreres, A set of mu-analysis based tools to evaluate the robustness properties
of high-dimensional uncertain systems (2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.feedback.closing import on_axis, transfer
from mbsvib.uncertain.scalings import Scalings, best_scalings
from mbsvib.uncertain.search import halved

NEAR_AXIS = 0.05  # share of an eigenvalue of H that its real part may have for a candidate
ENOUGH = 0.1  # least eigenvalue of Phi, against D, at which scalings are good enough to try how far they hold
SHORT = 2e-3  # share of a gap below which an interval that scalings cover does not count as progress
MARGIN = 1e-9  # least eigenvalue of Phi, as a share of its size, that counts as positive
FINE = 24  # points beside each pole at which Phi is looked at as well


@dataclass(frozen=True, eq=False)
class Channels:
    """M(s) = C (s - A)^-1 B + D: channels of the parameters first, then ``inputs`` and outputs of a gain, if any;
    ``sizes``: repetitions of each parameter. Time is in units of the mean pole.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    sizes: tuple[int, ...]
    inputs: int

    @property
    def count(self) -> int:
        """Number of channels of the parameters."""
        return sum(self.sizes)

    def at(self, w: Array) -> Complex:
        """Return M (k, rows, columns) at angular frequencies, of which the last may be infinite."""
        return transfer((self.a, self.b, self.c, self.d), on_axis(w))

    def over(self, gain: float) -> Channels:
        """Return channels in which a gain is 1."""
        left, right = (np.where(np.arange(count) < self.count, 1.0, 1.0 / np.sqrt(gain)) for count in self.d.shape)
        return replace(self, b=self.b * right, c=left[:, None] * self.c, d=left[:, None] * self.d * right)

    def poles(self) -> Complex:
        """Return the eigenvalues of A."""
        return np.linalg.eigvals(self.a).astype(complex) if len(self.a) else np.zeros(0, dtype=complex)


def least(channels: Channels, scalings: Scalings, w: Array) -> Array:
    """Return the least eigenvalue of Phi at frequencies (k,), as a share of its size, in channels in which D has a
    diagonal of ones.
    """
    unit = np.ones(channels.count + channels.inputs)
    unit[: channels.count] = 1.0 / np.sqrt(np.diagonal(scalings.d).real)
    phi = unit[:, None] * scalings.phi(channels.at(w), channels.inputs) * unit
    return np.asarray(np.linalg.eigvalsh(phi)[:, 0] / np.maximum(1.0, np.linalg.norm(phi, axis=(1, 2))))


def interval(channels: Channels, scalings: Scalings, w0: float) -> tuple[float, float]:
    """Return the ends of an interval about ``w0`` on which Phi is positive; empty (w0, w0) if it is not there."""
    if least(channels, scalings, np.array([w0]))[0] <= MARGIN:
        return w0, w0
    stops = np.unique(np.concatenate(([0.0, w0], _candidates(channels, scalings), _beside(channels.poles()))))
    points = np.sort(np.concatenate((stops, 0.5 * (stops[1:] + stops[:-1]), [2.0 * stops[-1] + 1.0, np.inf])))
    at = int(np.searchsorted(points, w0))
    bad = np.flatnonzero(least(channels, scalings, points) <= MARGIN)
    before, after = bad[bad < at], bad[bad > at]
    low = _edge(channels, scalings, points[before[-1] + 1], points[before[-1]]) if len(before) else 0.0
    return low, _edge(channels, scalings, points[after[0] - 1], points[after[0]]) if len(after) else np.inf


def _edge(channels: Channels, scalings: Scalings, good: float, bad: float) -> float:
    """The last frequency known to be good on the way to a bad one."""
    bad = 1e6 * max(good, 1.0) if np.isinf(bad) else bad
    return float(halved(lambda w: bool(least(channels, scalings, np.array([w]))[0] > MARGIN), good, bad, 12)[0])


def _beside(poles: Complex) -> Array:
    """Frequencies about each pole that resolve its peak."""
    share = np.geomspace(0.05, 20.0, FINE // 2)
    offsets = np.concatenate((-share[::-1], [0.0], share))
    points = np.abs(poles.imag)[:, None] + np.abs(poles.real)[:, None] * offsets
    return np.asarray(np.unique(points[points > 0.0]))


def _candidates(channels: Channels, scalings: Scalings) -> Array:
    """Frequencies at which the least eigenvalue of Phi may change its sign."""
    a, b, c, d0 = channels.a, channels.b, channels.c, channels.d
    n, size, rows = channels.count, channels.count + channels.inputs, len(d0)
    p, w = np.eye(size, dtype=complex), np.eye(rows, dtype=complex)
    p[:n, :n], w[:n, :n] = scalings.d, scalings.d
    g = np.zeros((size, rows), dtype=complex)
    g[:n, :n] = scalings.g
    r = p - d0.T @ w @ d0 + 1j * (d0.T @ g.conj().T - g @ d0)
    s = -c.T @ w @ d0 + 1j * c.T @ g.conj().T
    try:
        inner = np.linalg.solve(r, np.concatenate((s.conj().T, b.T), axis=1))
    except np.linalg.LinAlgError:
        return np.zeros(0)
    k = len(a)
    t = a - b @ inner[:, :k]
    h = np.block([[t, -b @ inner[:, k:]], [s @ inner[:, :k] + c.T @ w @ c, -t.conj().T]])
    values = np.linalg.eigvals(h)
    near = values[np.abs(values.real) < NEAR_AXIS * np.abs(values)]
    return np.asarray(np.abs(near.imag))


def cover(channels: Channels, known: list[Scalings], starts: Sequence[float] = (), most: int = 100) -> float | None:
    """Prove that Phi can be positive at all frequencies; return a frequency at which it cannot, None if it is proven.

    ``known``: scalings that were found before, which are tried first; new ones are added. ``starts``: frequencies to
    begin with; ``most``: how many more are tried.
    """
    gaps: list[tuple[float, float]] = [(0.0, np.inf)]
    for scalings in known:
        gaps = _without(gaps, _all_intervals(channels, scalings, gaps))
    queue = [*starts, 0.0]
    for _ in range(most):
        if not gaps:
            return None
        w = next((start for start in queue if any(low <= start <= high for low, high in gaps)), None)
        if w is None:
            low, high = max(gaps, key=_width)
            w = _middle(low, high)
        else:
            queue.remove(w)
        low, high = next(gap for gap in gaps if gap[0] <= w <= gap[1])
        scalings = best_scalings(channels.at(np.array([w]))[0], channels.sizes, channels.inputs, ENOUGH)[0]
        covered = interval(channels, scalings, w)
        if covered[1] <= covered[0]:
            return w
        known.append(scalings)
        before = sum(map(_width, gaps))
        gaps = _without(gaps, [covered])
        if sum(map(_width, gaps)) > before - SHORT * _width((low, high)):
            return w
    return max(gaps, key=_width)[0] if gaps else None


def _width(gap: tuple[float, float]) -> float:
    """Length of a gap on the scale of atan, on which all frequencies are from 0 to pi / 2."""
    return float(np.arctan(gap[1]) - np.arctan(gap[0]))


def _middle(low: float, high: float) -> float:
    return float(np.tan(0.5 * (np.arctan(low) + np.arctan(high))))


def _all_intervals(
    channels: Channels, scalings: Scalings, gaps: list[tuple[float, float]]
) -> list[tuple[float, float]]:  # fmt: skip
    """Intervals about the middles of gaps, and their ends, on which known scalings keep Phi positive."""
    result: list[tuple[float, float]] = []
    for low, high in gaps:
        for w in (low, _middle(low, high)):
            if not any(a <= w < b for a, b in result):
                found = interval(channels, scalings, w)
                if found[1] > found[0]:
                    result.append(found)
    return result


def _without(gaps: list[tuple[float, float]], covered: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Gaps without some intervals."""
    for a, b in covered:
        gaps = [piece for low, high in gaps for piece in ((low, min(high, a)), (max(low, b), high))
                if piece[1] > piece[0]]  # fmt: skip
    return gaps
