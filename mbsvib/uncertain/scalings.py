"""Scalings D and G that prove, at one frequency, that no uncertain parameter within its limits makes a loop singular.

Phi = P - M^H W M - i (G M - M^H G) > 0,  P = diag(D, 1), W = diag(D, 1), D > 0, G = G^H

D and G are Hermitian blocks, one of the size of its repetitions for each real parameter; the last part of P and W
belongs to the gain that is to be below 1, if there is one. The least eigenvalue of Phi is maximized by a barrier
method.

Source: Fan, Tits & Doyle, IEEE Trans. Automatic Control 36 (1991) 25: mixed structured singular values.

From one frequency to all: on which interval scalings D and G keep Phi positive, and a cover of all frequencies.

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
from mbsvib.uncertain.search import halved

STEPS = 60  # of Newton's method at one weight of the barrier
FACTOR = 12.0  # from one weight of the barrier to the next
GAP = 1e-4  # of the least eigenvalue of Phi at which the search ends
LARGEST = 30.0  # times 1 + |M|^2: the bound of Phi
REACH = 10.0  # times 1 + |M|^2: G of light damping, which does not count in the decision that there are no scalings
SWEEPS = 30  # of balancing
LEAST = 1e-9  # share below which entries do not count in balancing


@dataclass(frozen=True, eq=False)
class Scalings:
    """Hermitian D and G (n, n) of the channels of the parameters."""

    d: Complex
    g: Complex

    def phi(self, m: Complex, inputs: int) -> Complex:
        """Return Phi (..., n + inputs, n + inputs) of M (..., n + outputs, n + inputs); ``inputs`` of the gain."""
        n = len(self.d)
        right, left = np.eye(n + inputs, dtype=complex), np.eye(m.shape[-2], dtype=complex)
        right[:n, :n], left[:n, :n] = self.d, self.d
        turned = np.zeros((n + inputs, m.shape[-2]), dtype=complex)
        turned[:n, :n] = self.g
        product = turned @ m
        adjoint = m.conj().swapaxes(-1, -2)
        return np.asarray(right - adjoint @ left @ m - 1j * (product - product.conj().swapaxes(-1, -2)))


def bases(sizes: Sequence[int]) -> Complex:
    """Return a basis (k, n, n) of Hermitian matrices with blocks of some sizes."""
    n, result = sum(sizes), []
    start = 0
    for size in sizes:
        for i in range(start, start + size):
            for j in range(i, start + size):
                for value in (1.0,) if i == j else (1.0, 1j):
                    matrix = np.zeros((n, n), dtype=complex)
                    matrix[i, j], matrix[j, i] = value, np.conj(value)
                    result.append(matrix)
        start += size
    return np.array(result)


def balancing(m: Complex, n: int) -> Array:
    """Return factors (n,) of channels, T in T M T^-1, that make rows and columns of like size."""
    factors = np.ones(n)
    size = np.abs(m) ** 2
    for _ in range(SWEEPS):
        for k in range(n):
            row = size[k].sum() - size[k, k]
            column = size[:, k].sum() - size[k, k]
            if row > LEAST**2 * column and column > LEAST**2 * row and row * column > 0.0:
                factor = (column / row) ** 0.25
                factors[k] *= factor
                size[k] *= factor**2
                size[:, k] /= factor**2
    return factors


def best_scalings(m: Complex, sizes: Sequence[int], inputs: int, enough: float = np.inf) -> tuple[Scalings, float]:
    """Return scalings for M (n + outputs, n + inputs), and the least eigenvalue s of Phi, which they make large.

    ``sizes``: repetitions of each parameter; ``inputs``: those of the gain, 0 without. The search ends as soon as s
    exceeds ``enough``; the trace of D with what scales the gain is fixed until then. s < 0 means that there are none.
    """
    n = sum(sizes)
    factors = _factors(m, n, inputs)
    scale, back = (np.concatenate((factors[:n], np.full(count - n, factors[-1]))) for count in m.shape)
    basis = bases(sizes)
    x, s = _Problem(scale[:, None] * m / back, basis, n, inputs).solved(enough)
    k = len(basis)
    both = np.outer(factors[:n], factors[:n]) / (x[k] * factors[-1] ** 2 if inputs else 1.0)
    return Scalings(np.tensordot(x[:k], basis, axes=1) * both, np.tensordot(x[-k:], basis, axes=1) * both), s


def _factors(m: Complex, n: int, inputs: int) -> Array:
    """Factors of ``balancing`` (n + 1,) of the channels of the parameters and of the gain as one more."""
    size = np.zeros((n + 1, n + 1), dtype=complex)
    size[:n, :n] = np.abs(m[:n, :n])
    size[:n, n], size[n, :n] = np.linalg.norm(m[:n, n:], axis=1), np.linalg.norm(m[n:, :n], axis=0)
    return balancing(size, n + 1)


class _Problem:
    """Maximize s with Phi(x) > s and D(x) > 0, with no more of G than that needs: what is small holds farther.

    x has D, the factor on the gain's part of P and W where there is one, and G.
    """

    def __init__(self, m: Complex, basis: Complex, n: int, inputs: int) -> None:
        size, k, last = n + inputs, len(basis), int(inputs > 0)
        adjoint = m.conj().T
        wide = np.zeros((k + last, size, size), dtype=complex)
        wide[:k, :n, :n] = basis
        tall = np.zeros((k + last, m.shape[0], m.shape[0]), dtype=complex)
        tall[:k, :n, :n] = basis
        positive = np.zeros((k + last, n + last, n + last), dtype=complex)
        positive[:k, :n, :n] = basis
        if last:
            wide[k, n:, n:], tall[k, n:, n:], positive[k, n, n] = np.eye(inputs), np.eye(m.shape[0] - n), 1.0
        turned = np.zeros((k, size, m.shape[0]), dtype=complex)
        turned[:, :n, :n] = basis
        product = turned @ m
        self.slopes = np.concatenate((wide - adjoint @ tall @ m, -1j * (product - product.conj().swapaxes(1, 2))))
        self.basis, self.n, self.size = positive, n + last, size
        self.trace = np.concatenate((np.trace(positive, axis1=1, axis2=2).real, np.zeros(k)))
        largest = 1.0 + float(np.linalg.norm(m, 2)) ** 2
        self.bound = LARGEST * largest  # G could grow without end else
        self.price = 1.0 / (REACH * largest) ** 2

    def solved(self, enough: float) -> tuple[Array, float]:
        k = len(self.basis)
        x = np.zeros(len(self.slopes))
        x[:k] = np.einsum("kii->k", self.basis).real  # D = 1
        s = float(np.linalg.eigvalsh(self._phi(x))[0])
        if s > enough:
            return x, s
        s -= max(1.0, abs(s))
        weight = 1.0
        while True:
            x, s = self._centred(x, s, weight, enough)
            gap = (2 * self.size + self.n + 0.5 * self.n**2 / weight) / weight
            if s > enough or s < -4.0 * gap or gap < GAP:
                return x, s
            weight *= FACTOR

    def _phi(self, x: Array) -> Complex:
        return np.asarray(np.tensordot(x, self.slopes, axes=1))

    def _d(self, x: Array) -> Complex:
        return np.asarray(np.tensordot(x[: len(self.basis)], self.basis, axes=1))

    def _value(self, x: Array, s: float, weight: float) -> float:
        """The barrier's value; infinite where a matrix is not positive definite."""
        phi, one = self._phi(x), np.eye(self.size)
        total = 0.5 * self.price * float(np.square(x[len(self.basis) :]).sum()) / weight - weight * s
        try:
            for matrix in (phi - s * one, self.bound * one - phi, self._d(x)):
                total -= 2.0 * float(np.log(np.diagonal(np.linalg.cholesky(matrix)).real).sum())
        except np.linalg.LinAlgError:
            return np.inf
        return total

    def _centred(self, x: Array, s: float, weight: float, enough: float) -> tuple[Array, float]:
        """Newton's method at one weight of the barrier."""
        k, value = len(self.basis), self._value(x, s, weight)
        for _ in range(STEPS):
            phi, one = self._phi(x), np.eye(self.size)
            inverse, beyond = np.linalg.inv(phi - s * one), np.linalg.inv(self.bound * one - phi)
            of_d = np.linalg.inv(self._d(x))
            left, right, of_basis = (np.asarray(factor @ part, dtype=complex) for factor, part in (
                (inverse, self.slopes), (beyond, self.slopes), (of_d, self.basis)))  # fmt: skip
            along = np.trace(right - left, axis1=1, axis2=2).real
            gradient = np.concatenate((along, [np.trace(inverse).real - weight]))
            gradient[:k] -= np.trace(of_basis, axis1=1, axis2=2).real
            gradient[k:-1] += self.price * x[k:] / weight
            hessian = np.zeros((len(gradient), len(gradient)))
            hessian[:-1, :-1] = _traces(left) + _traces(right)
            hessian[:k, :k] += _traces(of_basis)
            hessian[range(k, len(x)), range(k, len(x))] += self.price / weight
            hessian[:-1, -1] = hessian[-1, :-1] = -np.einsum("kij,ji->k", left, inverse).real
            hessian[-1, -1] = np.einsum("ij,ji->", inverse, inverse).real
            step = self._step(gradient, hessian)
            decrement = -float(gradient @ step)
            if decrement < 1e-6:
                break
            length = 1.0
            while length > 1e-8:
                there = self._value(x + length * step[:-1], s + length * step[-1], weight)
                if there <= value - 0.1 * length * decrement:
                    break
                length *= 0.5
            else:
                break
            x, s, value = x + length * step[:-1], s + length * float(step[-1]), there
            if s > enough:
                break
        return x, s

    def _step(self, gradient: Array, hessian: Array) -> Array:
        """Newton's step, along which the trace of D stays."""
        unit = 1.0 / np.sqrt(np.maximum(np.diagonal(hessian), np.finfo(float).tiny))
        matrix = hessian * np.outer(unit, unit) + 1e-13 * np.eye(len(unit))
        rows = np.append(self.trace, 0.0) * unit
        right = np.linalg.solve(matrix, np.stack((-gradient * unit, rows), axis=1))
        step = right[:, 0] - right[:, 1] * (rows @ right[:, 0]) / (rows @ right[:, 1])
        return np.asarray(step * unit)


def _traces(matrices: Complex) -> Array:
    """Traces of all products (k, k) of some matrices (k, n, n)."""
    flat = matrices.reshape(len(matrices), -1)
    return np.asarray((flat @ matrices.swapaxes(1, 2).reshape(len(matrices), -1).T).real)


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

    ``known``: to which the scalings that prove it are added. ``starts``: frequencies to begin with; ``most``: how many
    more are tried.
    """
    gaps: list[tuple[float, float]] = [(0.0, np.inf)]
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


def _without(gaps: list[tuple[float, float]], covered: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Gaps without some intervals."""
    for a, b in covered:
        gaps = [piece for low, high in gaps for piece in ((low, min(high, a)), (max(low, b), high))
                if piece[1] > piece[0]]  # fmt: skip
    return gaps
