"""Double-double arithmetic: numbers as sums of two doubles, and matrix products in that precision.

For a matrix product the rows of one factor and the columns of the other are split into slices of so few bits that
ordinary matrix products of slices are exact.

Source: Ozaki, Ogita, Oishi & Rump, Error-free transformations of matrix multiplication (2012).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbsvib.common.arrays import Array

SLICES = 5
SPLIT = 134217729.0  # 2^27 + 1: halves the digits of a double


@dataclass(frozen=True, slots=True)
class DoubleDouble:
    """``high`` + ``low``, arrays of one shape, with ``low`` smaller than the last digit of ``high``."""

    high: Array
    low: Array

    def __add__(self, addend: DoubleDouble) -> DoubleDouble:
        high, low = two_sum(self.high, addend.high)
        return DoubleDouble(*two_sum(high, low + self.low + addend.low))

    def __neg__(self) -> DoubleDouble:
        return DoubleDouble(-self.high, -self.low)

    def times(self, factor: DoubleDouble) -> DoubleDouble:
        """Return the product, entry by entry."""
        product = self.high * factor.high
        a, b = _halved(self.high), _halved(factor.high)
        low = a[0] * b[0]
        low -= product
        low += a[0] * b[1]
        low += a[1] * b[0]
        low += a[1] * b[1]
        low += self.low * factor.high
        low += self.high * factor.low
        return DoubleDouble(*two_sum(product, low))

    def times_i(self) -> DoubleDouble:
        """Return the product with i, real and imaginary parts being side by side along the last axis."""
        parts = [np.empty_like(self.high), np.empty_like(self.high)]
        for part, values in zip(parts, (self.high, self.low), strict=True):
            np.negative(values[..., 1], out=part[..., 0])
            part[..., 1] = values[..., 0]
        return DoubleDouble(*parts)


def double_double(values: Array) -> DoubleDouble:
    """Return doubles in double-double form."""
    return DoubleDouble(values, np.zeros_like(values))


def two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """Return the rounded sum and its rounding error (Knuth)."""
    total = a + b
    part = total - a
    rest = b - part
    # in place, as new memory costs more time than the sums
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
    """A matrix (rows, n) in slices, those of the leading digits first, for exact products."""

    slices: tuple[Array, ...]
    bits: int

    @staticmethod
    def of(matrix: Array | DoubleDouble) -> Sliced:
        """Return the slices of a matrix."""
        value = matrix if isinstance(matrix, DoubleDouble) else double_double(matrix)
        # sums of as many products as there are slices are exact as well
        bits = (52 - int(np.ceil(np.log2(max(2, SLICES * max(value.high.shape)))))) // 2
        return Sliced(_slices(value, bits, 1), bits)

    def transposed(self, matrix: Array) -> Sliced:
        """Return the slices of the transpose of a matrix of the same shape as this."""
        return Sliced(_slices(double_double(np.ascontiguousarray(matrix.T)), self.bits, 1), self.bits)

    def product(self, x: DoubleDouble) -> DoubleDouble:
        """Return the product with x (n, ...), accurate to about 100 bits of its terms."""
        shape = x.high.shape
        columns = _slices(DoubleDouble(x.high.reshape(len(x.high), -1), x.low.reshape(len(x.high), -1)), self.bits, 0)
        used = [i for i, part in enumerate(self.slices) if part.any()]
        nonzero = [part.any() for part in columns]

        def total(first: int, last: int) -> Array:
            pairs = [(i, k - i) for k in range(first, last) for i in used if i <= k and nonzero[k - i]]
            if not pairs:
                return np.zeros((len(self.slices[0]), columns[0].shape[1]))
            left = np.concatenate([self.slices[i] for i, _ in pairs], axis=1)
            return np.asarray(left @ np.concatenate([columns[j] for _, j in pairs]))

        high, low = two_sum(total(0, 1), total(1, 2))
        # ordinary sums are accurate enough for the trailing digits
        low += total(2, SLICES)
        return DoubleDouble(*(part.reshape(-1, *shape[1:]) for part in two_sum(high, low)))


def _slices(x: DoubleDouble, bits: int, axis: int) -> tuple[Array, ...]:
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
