"""Loops in finite motion, in units of like size: closed by coordinates nearest by, and rates that keep them so."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.qr import minimum_norm_solution
from mbsvib.linalg.rank import REDUNDANT_LOOPS

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array, Index

# Newton's method of projection: corrections at most, and where they count as rounding.
CORRECTIONS, CLOSED = 12, 1e-14


@dataclass(frozen=True)
class Loops:
    """The closures of a mechanism: a function (q, bases) -> (phi, J).

    ``coordinate_scale`` (n,) and ``row_scale`` (rows,) make one of 1 rad and the size of the mechanism; ``rank`` is
    that of J where it matters.
    """

    closures: Callable[[Array, Array], Any]
    coordinate_scale: Array
    row_scale: Array
    rank: int = 0

    def scaled(self, q: Array, bases: Array) -> tuple[Array, Array]:
        """Return phi (rows,) and J (rows, n) in units of like size."""
        phi, jacobian = self.closures(q, bases)
        return (np.asarray(phi)[:, 0] * self.row_scale,
                np.asarray(jacobian) * self.row_scale[:, None] * self.coordinate_scale)  # fmt: skip

    def projected(self, q: Array, bases: Array, may_move: Index | None = None) -> tuple[Array, float]:
        """Return the coordinates (n,) nearest by that close the loops, and the largest opening left, in units of 1 rad
        and the size of the mechanism.

        ``q`` (n,): coordinates next to such a pose. ``bases`` (9 b,): rotations on top of which those of q come.
        ``may_move``: coordinates that may change; default: all.
        """
        if not len(self.row_scale):
            return q, 0.0
        allowed = np.arange(len(q)) if may_move is None else may_move
        smallest = np.inf
        for _ in range(CORRECTIONS):
            phi, jacobian = self.scaled(q, bases)
            opening = float(np.abs(phi).max())
            if opening <= CLOSED or not opening < smallest:
                break
            smallest, best = opening, q
            q = q.copy()
            step = -minimum_norm_solution(jacobian[:, allowed], phi)
            q[allowed] += self.coordinate_scale[allowed] * step
        return (q, opening) if opening < smallest else (best, smallest)

    def rates(self, q: Array, bases: Array, qd: Array) -> Array:
        """Return the rates nearest by that keep the loops closed."""
        if not len(self.row_scale):
            return qd
        _, jacobian = self.scaled(q, bases)
        scaled = qd / self.coordinate_scale
        scaled = scaled - minimum_norm_solution(jacobian, jacobian @ scaled)
        return np.asarray(scaled * self.coordinate_scale)

    def rank_at(self, q: Array, bases: Array) -> int:
        """Return the number of independent closures in a pose."""
        values = np.linalg.svd(self.scaled(q, bases)[1], compute_uv=False)
        return int(np.count_nonzero(values > REDUNDANT_LOOPS * max(1.0, float(values.max(initial=0.0)))))
