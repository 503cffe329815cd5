"""State-space equations of controllers at many values at once, in sums and in series.

Complex values p + i h e_k give the derivatives to p_k as imaginary parts over h: no difference is taken, and none
cancels.

Source: Squire & Trapp, Using complex variables to estimate derivatives of real functions, SIAM Rev. 40 (1998) 110.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.feedback.closing import Matrices

STEP = 1e-60  # imaginary part of values: its square is nothing beside them


class Realization(NamedTuple):
    """Equations X = [A B; C D] (..., states + outputs, states + inputs) of ``order`` states."""

    order: int
    x: Any

    @property
    def matrices(self) -> Matrices:
        """A, B, C, D."""
        k = self.order
        return self.x[..., :k, :k], self.x[..., :k, k:], self.x[..., k:, :k], self.x[..., k:, k:]


def with_slopes(at: Callable[[Complex], Realization], p: Array) -> tuple[Realization, Array]:
    """Return equations for values p (v,), and dX/dp (v, ...); ``at`` takes many values (n, v)."""
    points = np.concatenate((p[None], p + 1j * STEP * np.eye(len(p))))
    result = at(points)
    return result._replace(x=result.x[0].real), result.x[1:].imag / STEP


def stacked(order: int, rows: Sequence[Sequence[Any]], count: int) -> Realization:
    """Return the equations of which all entries are given, numbers or arrays (n,), for so many values."""
    x = np.zeros((count, len(rows), len(rows[0])), dtype=complex)
    for r, row in enumerate(rows):
        for c, entry in enumerate(row):
            x[:, r, c] = entry
    return Realization(order, x)


def summed(parts: Sequence[Realization], rows: Sequence[list[int]], columns: Sequence[list[int]], shape: tuple[int, int]
           ) -> Realization:  # fmt: skip
    """Return controllers side by side, whose outputs and inputs have numbers among (outputs, inputs) of the sum."""
    order, start = sum(part.order for part in parts), 0
    x = np.zeros((len(parts[0].x), order + shape[0], order + shape[1]), dtype=complex)
    for part, to, of in zip(parts, rows, columns, strict=True):
        states = list(range(start, start + part.order))
        row, column = np.ix_([*states, *[order + k for k in to]], [*states, *[order + k for k in of]])
        x[:, row, column] += part.x
        start += part.order
    return Realization(order, x)


def in_series(last: Realization, first: Realization) -> Realization:
    """Return two controllers in series, ``first`` acting first: [A2 0 B2; B1 C2 A1 B1 D2; D1 C2 C1 D1 D2]."""
    (a1, b1, c1, d1), (a2, b2, c2, d2) = last.matrices, first.matrices
    none = np.zeros((len(a1), first.order, last.order))
    return Realization(first.order + last.order, np.block([[a2, none, b2], [b1 @ c2, a1, b1 @ d2],
                                                           [d1 @ c2, c1, d1 @ d2]]))  # fmt: skip
