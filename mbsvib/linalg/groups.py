"""Items of groups, and connected parts of sparse patterns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Index


def items_of_groups(count: Index) -> tuple[Index, Index]:
    """Return the group and the number within it of every item, for groups of ``count`` items."""
    group = np.repeat(np.arange(len(count)), count)
    return group, np.arange(len(group)) - np.repeat(np.cumsum(count) - count, count)


def connected_parts(row: Index, column: Index, shape: tuple[int, int]) -> tuple[Index, Index]:
    """Return the number of the connected part of each row and of each column of a matrix, by its nonzero entries."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    rows, size = shape[0], sum(shape)
    graph = csr_matrix((np.ones(len(row), dtype=bool), (row, rows + column)), shape=(size, size))
    part = np.asarray(connected_components(graph, directed=False)[1], dtype=np.intp)
    return part[:rows], part[rows:]
