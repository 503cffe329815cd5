"""Which tree coordinates are independent: chosen by pivots, and chosen anew where loops have moved on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

from mbsvib.linalg.minimum_norm import minimum_norm_solution
from mbsvib.linalg.rank import REDUNDANT_LOOPS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.simulation.equations import MotionEquations

# Independent coordinates are chosen anew where the dependent ones follow worse than the best choice by this factor.
POOR_IN_BLOCK = 0.2
# A rotation vector is started anew from 0 beyond this angle [rad]; beyond LONGEST_TURN it must not go in one step.
LONG_TURN, LONGEST_TURN = 1.0, 2.8
# The smallest singular value of the closures, in units of like size, below which the pose is a singular one.
SINGULAR = 1e-8
# Newton's method of projection: corrections at most, and where they count as rounding.
CORRECTIONS, CLOSED = 12, 1e-14


@dataclass(frozen=True)
class ScaledClosures:
    """The closures of a mechanism in units of like size.

    ``coordinate_scale`` (n,) and ``row_scale`` (rows,) make one of 1 rad and the size of the mechanism; ``rank`` is
    that of the derivative of the closures.
    """

    equations: MotionEquations
    coordinate_scale: Array
    row_scale: Array

    def scaled(self, q: Array, bases: Array) -> tuple[Array, Array]:
        """Return phi (rows,) and J (rows, n) in units of like size."""
        phi, jacobian = self.equations.closures(q, bases)
        return (np.asarray(phi)[:, 0] * self.row_scale,
                np.asarray(jacobian) * self.row_scale[:, None] * self.coordinate_scale)  # fmt: skip

    def projected(self, q: Array, bases: Array, may_move: Index | None = None) -> tuple[Array, float]:
        """Return the coordinates nearest by that close the loops, and how far they are left open.

        ``q`` (n,): coordinates next to such a pose. ``bases`` (9 b,): rotations on top of which those of q come.
        ``may_move``: coordinates that may change; default: all. Returns (n,): the coordinates; the largest opening
        left, in units of 1 rad and the size of the mechanism.
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

    def rank(self, q: Array, bases: Array) -> int:
        """Return the number of independent closures in a pose."""
        if not len(self.row_scale):
            return 0
        values = np.linalg.svd(self.scaled(q, bases)[1], compute_uv=False)
        return int(np.count_nonzero(values > REDUNDANT_LOOPS * max(1.0, float(values.max(initial=0.0)))))


@dataclass(frozen=True)
class Chart:
    """A choice of independent coordinates.

    ``independent`` (m,) and ``dependent`` (rank,) number the coordinates, ``select`` Y (m, n) takes the first, ``rows``
    W (rank, rows) combines closures to as many as are independent; ``bases`` (9 b,) are the rotations on top of which
    rotation vectors come. The choice holds while dependent coordinates go less than ``limit`` times as fast as
    independent ones, in units of like size.
    """

    independent: Index
    dependent: Index
    select: Array
    rows: Array
    bases: Array
    limit: float


def chart_at(loops: ScaledClosures, q: Array, bases: Array) -> Chart:
    """Return the choice of independent coordinates that is best in a pose, by pivots.

    ``q`` (n,): the pose. ``bases`` (9 b,): rotations on top of which those of q come.
    """
    n, rank = loops.equations.n, loops.equations.rank
    dependent = np.zeros(0, dtype=np.intp)
    rows = np.zeros((0, len(loops.row_scale)))
    if rank:
        jacobian = loops.scaled(q, bases)[1]
        left = np.linalg.svd(jacobian, full_matrices=False)[0][:, :rank].T
        dependent = np.sort(qr(left @ jacobian, mode="r", pivoting=True)[1][:rank])
        rows = left * loops.row_scale
    independent = np.setdiff1d(np.arange(n), dependent)
    ratio = 1.0
    if rank:
        closures = left @ jacobian
        ratio = float(np.abs(np.linalg.solve(closures[:, dependent], closures[:, independent])).max(initial=1.0))
    return Chart(independent, dependent, np.eye(n)[independent], rows, bases, ratio / POOR_IN_BLOCK)


def conditioning(loops: ScaledClosures, chart: Chart, q: Array) -> tuple[float, float]:
    """Return how well the dependent coordinates of a choice follow, and how near the pose is to a singular one.

    ``q`` (n,): the pose. Returns smallest singular value of the closures' derivative to the dependent coordinates over
    that of all; the latter over the largest.
    """
    rank = loops.equations.rank
    if not rank:
        return 1.0, 1.0
    jacobian = loops.scaled(q, chart.bases)[1]
    closures = (chart.rows / loops.row_scale) @ jacobian
    values = np.linalg.svd(closures, compute_uv=False)
    dependent_values = np.linalg.svd(closures[:, chart.dependent], compute_uv=False)
    return float(dependent_values[-1] / max(values[-1], 1e-300)), float(values[-1] / values[0])
