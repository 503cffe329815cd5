"""Functions of one matrix: Lyapunov equations with many right-hand sides, exponentials over many lengths of time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.linalg.rank import EPS

REFINEMENTS = 2


@dataclass(frozen=True, eq=False)
class Lyapunov:
    """The equation A P + P A^T + W = 0 of a matrix ``a`` (n, n) whose eigenvalues have negative real parts.

    Source: Bartels & Stewart, Commun. ACM 15 (1972) 820: by the Schur form; its residual is solved for again.
    """

    a: Array

    @cached_property
    def _schur(self) -> tuple[Array, Array]:
        from scipy.linalg import schur

        triangle, vectors = schur(self.a, output="real")
        return triangle, vectors

    def controlled(self, w: Array) -> Array:
        """Return P with A P + P A^T + W = 0 for a symmetric W (n, n)."""
        return self.controlled_within(w)[0]

    def observed(self, w: Array) -> Array:
        """Return Q with A^T Q + Q A + W = 0 for a symmetric W (n, n)."""
        return self.observed_within(w)[0]

    def controlled_within(self, w: Array) -> tuple[Array, Array]:
        """Return P, and the correction that rounding kept from being made, 0 where there is none."""
        return self._solved(w, self.a, transposed=False)

    def observed_within(self, w: Array) -> tuple[Array, Array]:
        """Return Q, and the correction that rounding kept from being made, 0 where there is none."""
        return self._solved(w, self.a.T, transposed=True)

    def _solved(self, w: Array, a: Array, transposed: bool) -> tuple[Array, Array]:
        left = np.zeros(w.shape)
        if not len(w):
            return left, left
        result = self._once(w, transposed)
        for _ in range(REFINEMENTS):
            # one of the products is rounded as the other is: the residual is symmetric
            half = a @ result
            residual = half + half.T + w
            step = self._once(residual, transposed)
            if np.abs(step).max() > 0.5 * np.abs(result).max():
                left = step
                break
            result = result + step
        return result, left

    def _once(self, w: Array, transposed: bool) -> Array:
        from scipy.linalg import lapack

        triangle, z = self._schur
        inside, scale, _ = lapack.dtrsyl(triangle, triangle, -(z.T @ w @ z), trana="T" if transposed else "N",
                                         tranb="N" if transposed else "T")  # fmt: skip
        result = z @ (inside / scale) @ z.T
        return np.asarray(0.5 * (result + result.T))  # what rounding adds to it is not symmetric


# Lengths that so many vectors share have an exponential of their own.
SHARED = 16
# Other lengths are a sum of powers of two of a short one, over which rates times time stay below this, and of a rest,
# for which so many terms of the power series are exact to rounding.
SHORT, TERMS = 0.5, 15


@dataclass(frozen=True)
class Steps:
    """Steps of x' = A x: ``a`` (n, n); ``length`` (steps,) [s]; ``group`` (steps,) of those of equal length, whose
    exponential is ``shared``, -1 for others.
    """

    a: Array
    length: Array
    group: Index
    shared: tuple[Array, ...]

    def __call__(self, x: Array) -> Array:
        """Return exp(A length) x (n, steps), with a column for each step."""
        if len(self.shared) == 1 and (self.group == 0).all():
            return np.asarray(self.shared[0] @ x)
        result = np.empty_like(x)
        for k in range(-1, len(self.shared)):
            own = np.flatnonzero(self.group == k)
            if len(own):
                result[:, own] = self.shared[k] @ x[:, own] if k >= 0 else self._single(x[:, own], self.length[own])
        return result

    @cached_property
    def _short(self) -> tuple[float, list[Array]]:
        """A short time and the exponentials over 1, 2, 4, ... times it, up to the longest single step."""
        from scipy.linalg import expm

        longest = float(self.length[self.group < 0].max(initial=0.0))
        doublings = max(0, int(np.frexp(float(np.linalg.norm(self.a, 2)) * longest / SHORT)[1]))
        short = float(np.ldexp(longest, -doublings))
        powers = [expm(self.a * short)]
        for _ in range(doublings):
            powers.append(powers[-1] @ powers[-1])
        return short, powers

    def _single(self, x: Array, length: Array) -> Array:
        short, powers = self._short
        count = np.floor(length / short).astype(np.int64) if short else np.zeros(len(length), dtype=np.int64)
        rest = length - count * short
        term = result = x
        for k in range(1, TERMS + 1):
            term = (self.a @ term) * (rest / k)
            result = result + term
        for k, power in enumerate(powers):
            own = (count >> k) & 1 == 1
            result[:, own] = power @ result[:, own]
        return np.asarray(result)


def steps(a: Array, length: Array, latest: float) -> Steps:
    """Return steps of x' = A x, ``a`` (n, n), over times ``length`` (steps,) [s].

    Lengths are differences of times up to ``latest`` [s]: those that differ by the rounding of these are one, their
    mean.
    """
    from scipy.linalg import expm

    order = np.argsort(length)
    label = np.empty(len(length), dtype=np.intp)
    label[order] = np.cumsum(np.diff(length[order], prepend=length[order[:1]]) > EPS * abs(latest))
    count = np.bincount(label)
    often = np.flatnonzero(count >= SHARED)
    group = np.full(len(count), -1)
    group[often] = np.arange(len(often))
    mean = np.bincount(label, length) / count
    return Steps(a, length, group[label], tuple([expm(a * mean[k]) for k in often]))
