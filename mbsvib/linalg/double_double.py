"""Sums to twice the digits: a number is held as two doubles, products are cut into pieces that doubles hold exactly.

A matrix product needs no arithmetic of its own: rows of the one factor and columns of the other are cut into slices of
so few bits that their products add up without rounding, and these are the products of ordinary matrices.

Source: Ozaki, Ogita, Oishi & Rump, Error-free transformations of matrix multiplication (2012).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


SLICES = 5
SPLIT = 134217729.0  # 2^27 + 1: halves the digits of a double


@dataclass(frozen=True, slots=True)
class Twofold:
    """``high`` + ``low``, arrays of one shape, ``low`` being below the last digit of ``high``."""

    high: Array
    low: Array

    def __add__(self, other: Twofold) -> Twofold:
        high, low = two_sum(self.high, other.high)
        return Twofold(*two_sum(high, low + self.low + other.low))

    def __neg__(self) -> Twofold:
        return Twofold(-self.high, -self.low)

    def times(self, factor: Twofold) -> Twofold:
        """Return the product with numbers of as many digits."""
        product = self.high * factor.high
        a, b = _halved(self.high), _halved(factor.high)
        low = a[0] * b[0]
        low -= product
        low += a[0] * b[1]
        low += a[1] * b[0]
        low += a[1] * b[1]
        low += self.low * factor.high
        low += self.high * factor.low
        return Twofold(*two_sum(product, low))

    def turned(self) -> Twofold:
        """Return the product with i, real and imaginary parts being side by side along the last axis."""
        parts = [np.empty_like(self.high), np.empty_like(self.high)]
        for part, given in zip(parts, (self.high, self.low), strict=True):
            np.negative(given[..., 1], out=part[..., 0])
            part[..., 1] = given[..., 0]
        return Twofold(*parts)


def twofold(values: Array) -> Twofold:
    """Return doubles as they are."""
    return Twofold(values, np.zeros_like(values))


def two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """Return the rounded sum and what rounding left out (Knuth)."""
    total = a + b
    part = total - a
    rest = b - part
    # in place: fresh memory costs more than the sums
    np.subtract(total, part, out=part)
    np.subtract(a, part, out=part)
    rest += part
    return total, rest


def _halved(a: Array) -> tuple[Array, Array]:
    product = SPLIT * a
    high = product - a
    np.subtract(product, high, out=high)
    return high, np.subtract(a, high, out=product)


@dataclass(frozen=True, slots=True)
class Sliced:
    """A matrix (rows, n) in slices, the largest digits first, ready to be multiplied exactly."""

    slices: tuple[Array, ...]
    bits: int

    @staticmethod
    def of(matrix: Array | Twofold) -> Sliced:
        """Cut a matrix."""
        whole = matrix if isinstance(matrix, Twofold) else twofold(matrix)
        # sums of as many products as there are slices are exact as well
        bits = (52 - int(np.ceil(np.log2(max(2, SLICES * max(whole.high.shape)))))) // 2
        return Sliced(_slices(whole, bits, 1), bits)

    def transposed(self, matrix: Array) -> Sliced:
        """Cut the transpose of a matrix of the same shape as this."""
        return Sliced(_slices(twofold(np.ascontiguousarray(matrix.T)), self.bits, 1), self.bits)

    def product(self, x: Twofold) -> Twofold:
        """Return the product with x (n, ...), about as accurate as its terms' 100 first bits."""
        shape = x.high.shape
        columns = _slices(Twofold(x.high.reshape(len(x.high), -1), x.low.reshape(len(x.high), -1)), self.bits, 0)
        used = [i for i, part in enumerate(self.slices) if part.any()]
        given = [part.any() for part in columns]

        def total(first: int, last: int) -> Array:
            pairs = [(i, k - i) for k in range(first, last) for i in used if i <= k and given[k - i]]
            if not pairs:
                return np.zeros((len(self.slices[0]), columns[0].shape[1]))
            left = np.concatenate([self.slices[i] for i, _ in pairs], axis=1)
            return np.asarray(left @ np.concatenate([columns[j] for _, j in pairs]))

        high, low = two_sum(total(0, 1), total(1, 2))
        # what is that far below the first digits needs no more than ordinary sums
        low += total(2, SLICES)
        return Twofold(*(part.reshape(-1, *shape[1:]) for part in two_sum(high, low)))


def _slices(x: Twofold, bits: int, axis: int) -> tuple[Array, ...]:
    """Slices of ``bits`` bits each, counted along ``axis`` from the largest entry."""
    size = np.abs(x.high).max(axis=axis, keepdims=True, initial=0.0)
    unit = np.ldexp(1.0, np.frexp(size)[1])
    high, low, result = x.high, x.low, []
    for k in range(SLICES):
        shift = unit * (1.5 * 2.0 ** (53 - bits * (k + 1)))
        top = (high + shift) - shift
        high, low = two_sum(high - top, low)
        result.append(top)
    return tuple(result)
