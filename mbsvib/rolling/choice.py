"""Which coordinates follow from conditions: rows that tie them, eliminated one by one, with zeros kept exact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.linalg.rank import DEPENDENT_ROWS, EPS, ZERO_SUM

# A column may be eliminated while this share of it does not depend on those that are.
INDEPENDENT = 0.1


@dataclass(frozen=True, slots=True)
class RankDecision:
    """The rank of the conditions of wheels: the smallest pivot ``retained``, the largest ``dropped`` and rounding
    ``noise``, over the largest column.
    """

    joints: tuple[str, ...]
    retained: float
    dropped: float
    noise: float


def dependent_columns(
    rows: Array, groups: Sequence[Sequence[int]], wheels: Sequence[str]
) -> tuple[list[int], RankDecision]:
    """Return columns of ``rows`` (k, m), as many as the rank, that are a basis, and how the rank was decided.

    Columns of the first of the ``groups`` come first, of a group the one with the largest part that is independent of
    those before; what is left is taken at the end, whatever its share.
    """
    left, size = rows.copy(), np.linalg.norm(rows, axis=0)
    least = DEPENDENT_ROWS * size.max(initial=0.0)
    taken: list[int] = []
    pivots: list[float] = []
    for share in (INDEPENDENT, 0.0):
        for group in groups:
            while True:
                part = np.linalg.norm(left, axis=0)
                free = [k for k in group if k not in taken and part[k] > max(share * size[k], least)]
                if not free:
                    break
                best = max(part[k] for k in free)
                column = next(k for k in free if part[k] >= best * (1.0 - INDEPENDENT))
                way = left[:, column] / part[column]
                left = left - np.outer(way, way @ left)
                taken.append(column)
                pivots.append(float(part[column]))
    largest = float(size.max(initial=0.0)) or 1.0
    dropped = float(np.linalg.norm(left, axis=0).max(initial=0.0))
    return sorted(taken), RankDecision(tuple(wheels), min(pivots, default=largest) / largest, dropped / largest,
                                       EPS * len(size))  # fmt: skip


def dependence(rows: Array, taken: Sequence[int], others: Array) -> Array:
    """Return X with rows[:, taken] X = -others in the least squares, zeros for rounding."""
    inverse = np.linalg.pinv(rows[:, taken])
    # its rows answer to conditions of one unit, m/s
    inverse[np.abs(inverse) <= ZERO_SUM * np.abs(inverse).max(axis=1, initial=0.0, keepdims=True)] = 0.0
    result = -inverse @ others
    result[np.abs(result) <= ZERO_SUM * (np.abs(inverse) @ np.abs(others))] = 0.0
    return np.asarray(result)
