"""State-space equations of controllers with their derivatives to values, in sums and in series."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.feedback.closing import Matrices


class Realization(NamedTuple):
    """Equations X = [A B; C D] (states + outputs, states + inputs) of ``order`` states, with dX/dp ``slopes``."""

    order: int
    x: Array
    slopes: Array

    @property
    def matrices(self) -> Matrices:
        """A, B, C, D."""
        k = self.order
        return self.x[:k, :k], self.x[:k, k:], self.x[k:, :k], self.x[k:, k:]

    def of_values(self, which: Sequence[int], count: int) -> Realization:
        """Return the same equations with derivatives to ``count`` values, of which its own are some."""
        slopes = np.zeros((count, *self.x.shape))
        np.add.at(slopes, list(which), self.slopes)
        return self._replace(slopes=slopes)


def summed(parts: Sequence[Realization], rows: Sequence[list[int]], columns: Sequence[list[int]], shape: tuple[int, int]
           ) -> Realization:  # fmt: skip
    """Return controllers side by side, whose outputs and inputs have numbers among (outputs, inputs) of the sum."""
    order, start = sum(part.order for part in parts), 0
    x = np.zeros((order + shape[0], order + shape[1]))
    slopes = np.zeros((len(parts[0].slopes), *x.shape))
    for part, to, of in zip(parts, rows, columns, strict=True):
        states = list(range(start, start + part.order))
        row, column = np.ix_([*states, *[order + k for k in to]], [*states, *[order + k for k in of]])
        x[row, column] += part.x
        slopes[:, row, column] += part.slopes
        start += part.order
    return Realization(order, x, slopes)


def in_series(last: Realization, first: Realization) -> Realization:
    """Return two controllers in series, ``first`` acting first: [A2 0 B2; B1 C2 A1 B1 D2; D1 C2 C1 D1 D2]."""
    k2, k1 = first.order, last.order
    (left, d_left), (right, d_right) = _before(last, k2), _after(first, k1)
    slopes = d_left @ right + left @ d_right
    return Realization(k2 + k1, left @ right, slopes)


def _after(first: Realization, k1: int) -> tuple[Array, Array]:
    """(x2', x1, y2) of (x2, x1, u), with derivatives."""
    k2, x, slopes = first.order, first.x, first.slopes
    rows, columns = x.shape
    result = np.zeros((rows + k1, columns + k1))
    change = np.zeros((len(slopes), *result.shape))
    row, column = np.ix_([*range(k2), *range(k2 + k1, rows + k1)], [*range(k2), *range(k2 + k1, columns + k1)])
    result[row, column] = x
    change[:, row, column] = slopes
    result[k2 : k2 + k1, k2 : k2 + k1] = np.eye(k1)
    return result, change


def _before(last: Realization, k2: int) -> tuple[Array, Array]:
    """(x2', x1', y) of (x2', x1, y2), with derivatives."""
    x, slopes = last.x, last.slopes
    result = np.zeros((k2 + len(x), k2 + x.shape[1]))
    change = np.zeros((len(slopes), *result.shape))
    result[:k2, :k2], result[k2:, k2:] = np.eye(k2), x
    change[:, k2:, k2:] = slopes
    return result, change
