"""Polynomials of several variables from -1 to 1: sums of products of Chebyshev polynomials, with matrices as factors.

f(x) = sum over |alpha| <= degree of F_alpha T_alpha1(x_1) T_alpha2(x_2) ...

Every product of T is between -1 and 1, so that |f| is at most the sum of |F_alpha|.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index

Powers = tuple[int, ...]


@dataclass(frozen=True)
class Basis:
    """All products of Chebyshev polynomials of ``count`` variables up to a total ``degree``."""

    count: int
    degree: int

    @cached_property
    def powers(self) -> tuple[Powers, ...]:
        """The degrees of each product in each variable, lowest total degree first."""
        found: list[Powers] = [()]
        for _ in range(self.count):
            found = [(*p, k) for p in found for k in range(self.degree - sum(p) + 1)]
        return tuple(sorted(found, key=lambda p: (sum(p), p)))

    @cached_property
    def place(self) -> dict[Powers, int]:
        """The number of each product."""
        return {p: k for k, p in enumerate(self.powers)}

    @cached_property
    def nodes(self) -> Array:
        """Points (m, count) at which a polynomial is sampled, twice as many as products, spread at random."""
        rng = np.random.default_rng(0)
        return np.asarray(np.cos(np.pi * rng.random((2 * len(self.powers) + 8, self.count))))

    def at(self, x: Array) -> Array:
        """Return the products (m, products) at points (m, count)."""
        single = np.ones((self.degree + 1, *x.shape))
        single[1:2] = x
        for k in range(2, self.degree + 1):
            single[k] = 2.0 * x * single[k - 1] - single[k - 2]
        result = np.ones((len(x), len(self.powers)))
        for j, of_variable in enumerate(np.array(self.powers, dtype=np.intp).T.reshape(self.count, -1)):
            result *= single[of_variable, :, j].T
        return result

    @cached_property
    def inverse(self) -> Array:
        """Coefficients by values at the nodes, (products, m)."""
        return np.asarray(np.linalg.pinv(self.at(self.nodes)), dtype=float)

    def fitted(self, values: Array) -> Array:
        """Return coefficients (products, ...) of values (m, ...) at the nodes, by least squares."""
        return np.asarray((self.inverse @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:]))

    def raised(self, j: int) -> tuple[Index, Index]:
        """Products in the next basis of which half the sum is each product times x_j."""
        above = basis(self.count, self.degree + 1).place
        up, down = (np.array([above[(*p[:j], abs(p[j] + step), *p[j + 1 :])] for p in self.powers], dtype=np.intp)
                    for step in (1, -1))  # fmt: skip
        return up, down

    @cached_property
    def raises(self) -> tuple[tuple[Index, Index], ...]:
        """``raised`` for each variable."""
        return tuple([self.raised(j) for j in range(self.count)])

    @cached_property
    def halves(self) -> Array:
        """Matrices (count, 2, products, products) to coefficients on the half of the box in which x_j is below or above
        0, where it is from -1 to 1 again.
        """
        result = np.empty((self.count, 2, len(self.powers), len(self.powers)))
        for j, side in np.ndindex(self.count, 2):
            x = self.nodes.copy()
            x[:, j] = 0.5 * x[:, j] + side - 0.5
            result[j, side] = self.inverse @ self.at(x)
        return result


@lru_cache(maxsize=32)
def basis(count: int, degree: int) -> Basis:
    """Return the products of so many variables up to a total degree."""
    return Basis(count, degree)


def times(coefficients: Array, own: Basis, affine: Array) -> Array:
    """Return a polynomial of matrices (products, k, n) times the transpose of ``affine`` (count + 1, m, n), the matrix
    at 0 and the slopes, in the next basis.
    """
    above = basis(own.count, own.degree + 1)
    result = np.zeros((len(above.powers), coefficients.shape[1], affine.shape[1]))
    result[[above.place[p] for p in own.powers]] = coefficients @ affine[0].T
    for slope, (up, down) in zip(affine[1:], own.raises, strict=True):
        if slope.any():
            term = 0.5 * (coefficients @ slope.T)
            np.add.at(result, up, term)
            np.add.at(result, down, term)
    return result


def largest(coefficients: Array, own: Basis, reached: float, near: float, most: int) -> float:
    """Return a number that a polynomial (products,) does not exceed.

    It is at most by the share ``near`` above its largest value, or above ``reached``, a value of interest, unless
    ``most`` halvings of the box do not suffice.
    """
    boxes = [(_bound(coefficients), coefficients)]
    for _ in range(most):
        k = int(np.argmax([bound for bound, _ in boxes]))
        bound, here = boxes[k]
        reached = max(reached, _corner(here, own))
        if bound <= (1.0 + near) * reached:
            break
        weights = np.abs(here) @ np.array(own.powers, dtype=float).reshape(len(here), own.count)
        boxes[k : k + 1] = [(_bound(part), part) for part in own.halves[int(weights.argmax())] @ here]
    return max(bound for bound, _ in boxes)


def _bound(coefficients: Array) -> float:
    return float(coefficients[0] + np.abs(coefficients[1:]).sum())


def _corner(coefficients: Array, own: Basis) -> float:
    """The value at the corner to which the linear terms point."""
    slopes = np.array([coefficients[own.place[tuple(row)]] for row in np.eye(own.count, dtype=int).tolist()])
    return float((own.at(np.where(slopes < 0.0, -1.0, 1.0)[None]) @ coefficients)[0])
