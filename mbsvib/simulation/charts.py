"""Which tree coordinates are independent: chosen by pivots, and chosen anew where loops have moved on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

from mbsvib.finite_motion.loops import CLOSED
from mbsvib.linalg.dead_points import is_unknown

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.finite_motion.loops import Loops

# Independent coordinates are chosen anew where the dependent ones follow worse than the best choice by this factor.
POOR_IN_BLOCK = 0.2
# A rotation vector is started anew from 0 beyond this angle [rad]; beyond LONGEST_TURN it must not go in one step.
LONG_TURN, LONGEST_TURN = 1.0, 2.8


@dataclass(frozen=True)
class Chart:
    """A choice of independent coordinates.

    ``independent`` (m,) and ``dependent`` (rank,) number the coordinates, ``order`` P (n, n) takes the independent ones
    and then the dependent ones, ``rows`` W (rank, rows) combines closures to as many as are independent; ``bases``
    (9 b,) are the rotations on top of which rotation vectors come. The choice holds while dependent coordinates go less
    than ``limit`` times as fast as independent ones, in units of like size.
    """

    independent: Index
    dependent: Index
    order: Array
    rows: Array
    bases: Array
    limit: float


def chart_at(loops: Loops, q: Array, bases: Array) -> Chart:
    """Return the choice of independent coordinates that is best in a pose, by pivots.

    ``q`` (n,): the pose. ``bases`` (9 b,): rotations on top of which those of q come.
    """
    n, rank = len(loops.coordinate_scale), loops.rank
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
    order = np.eye(n)[np.concatenate((independent, dependent))]
    return Chart(independent, dependent, order, rows, bases, ratio / POOR_IN_BLOCK)


@dataclass(frozen=True, slots=True)
class Conditioning:
    """How well the dependent coordinates of a choice follow in a pose.

    ``share`` is the smallest singular value of the closures' derivative to the dependent coordinates over that of all;
    ``smallest`` is the latter over the largest.
    """

    share: float = 1.0
    smallest: float = 1.0

    @property
    def is_singular(self) -> bool:
        """Whether the pose is a singular one, as far as loops that count as closed can tell."""
        return is_unknown(self.smallest, CLOSED)


def conditioning(loops: Loops, chart: Chart, q: Array) -> Conditioning:
    """Return how well the dependent coordinates of a choice follow in a pose q (n,)."""
    if not loops.rank:
        return Conditioning()
    jacobian = loops.scaled(q, chart.bases)[1]
    closures = (chart.rows / loops.row_scale) @ jacobian
    values = np.linalg.svd(closures, compute_uv=False)
    dependent_values = np.linalg.svd(closures[:, chart.dependent], compute_uv=False)
    return Conditioning(float(dependent_values[-1] / max(values[-1], 1e-300)), float(values[-1] / values[0]))
