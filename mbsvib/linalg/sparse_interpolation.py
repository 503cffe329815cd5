"""Polynomials in several variables that interpolate at nested points, on index sets that grow where it is needed.

f(x) ~ sum over i of s_i N_i(x),  N_i(x) = product over k of N_{i_k}(x_k)
N_j(x) = product over l < j of (x - t_l) / (t_j - t_l)

``t_j`` are Leja points of [-1, 1]. With each index its predecessors in every variable are in the set, so that N_i
vanishes at the points of all indices that do not follow i: surpluses s_i = f(x_i) - (the sum before) need no solution
of equations, and no point is asked for twice.

Source: A. Chkifa, A. Cohen, C. Schwab, "High-dimensional adaptive sparse polynomial interpolation and applications to
parametric PDEs", Found. Comput. Math. 14 (2014), 601-633, sections 2 and 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index

# Highest degree in a variable, and candidates among which Leja points are chosen: neighbours of these are further
# apart than the candidates even at the ends.
HIGHEST, CANDIDATES = 60, 20_001
# Numbers in the table of products that is held at a time.
CHUNK = 4_000_000


@lru_cache(maxsize=1)
def leja_points() -> Array:
    """Return 1, -1, 0, and one point after the other where the product of distances to those before is largest."""
    candidates = np.cos(np.linspace(0.0, np.pi, CANDIDATES))
    points, distance = [1.0], np.zeros(CANDIDATES)
    for _ in range(HIGHEST):
        with np.errstate(divide="ignore"):
            distance += np.log(np.abs(candidates - points[-1]))
        best = float(candidates[int(np.argmax(distance))])
        points.append(0.0 if abs(best) < 1.0 / CANDIDATES else best)
    result = np.array(points)
    result.setflags(write=False)
    return result


@dataclass(frozen=True)
class SparseInterpolant:
    """A polynomial with ``indices`` (n, variables) and ``surpluses`` (n, values), in the order of their making."""

    indices: Index
    surpluses: Array

    @staticmethod
    def none(variables: int, values: int) -> SparseInterpolant:
        """Return the polynomial 0, without points."""
        return SparseInterpolant(np.zeros((0, variables), dtype=np.intp), np.zeros((0, values)))

    def __call__(self, x: Array) -> Array:
        """Return the values (p, values) at points (p, variables) of [-1, 1]."""
        result = np.zeros((len(x), self.surpluses.shape[1]))
        step = max(1, CHUNK // max(1, len(self.indices)))
        for start in range(0, len(x), step):
            result[start : start + step] = self._products(x[start : start + step]) @ self.surpluses
        return result

    def _products(self, x: Array) -> Array:
        """N_i(x) of all indices, (p, n)."""
        result = np.ones((len(x), len(self.indices)))
        for k in range(self.indices.shape[1]):
            degrees = self.indices[:, k]
            if degrees.any():
                result *= newton_basis(x[:, k], int(degrees.max()))[:, degrees]
        return result

    def with_values(self, indices: Index, values: Array) -> SparseInterpolant:
        """Return the polynomial with ``values`` (p, values) at more ``indices`` too, none of which follows another."""
        surpluses = values - self(points_of(indices))
        return SparseInterpolant(np.concatenate((self.indices, indices)), np.concatenate((self.surpluses, surpluses)))

    def following(self, which: Bools) -> Index:
        """Return the indices that follow some of the set and whose predecessors are all in it."""
        known = set(map(tuple, self.indices.tolist()))
        result: dict[tuple[int, ...], None] = {}
        for index in self.indices[which].tolist():
            for k, degree in enumerate(index):
                new = (*index[:k], degree + 1, *index[k + 1 :])
                if degree < HIGHEST and new not in known and all(
                    (*new[:j], d - 1, *new[j + 1 :]) in known for j, d in enumerate(new) if d
                ):  # fmt: skip
                    result[new] = None
        return np.array(list(result), dtype=np.intp).reshape(-1, self.indices.shape[1])


def points_of(indices: Index) -> Array:
    """Return the points (n, variables) of indices."""
    return np.asarray(leja_points()[indices])


def newton_basis(x: Array, degree: int) -> Array:
    """Return N_0 ... N_degree at points (p,), (p, degree + 1)."""
    t = leja_points()
    result = np.ones((len(x), degree + 1))
    for j in range(1, degree + 1):
        result[:, j] = ((x[:, None] - t[:j]) / (t[j] - t[:j])).prod(axis=1)
    return result
