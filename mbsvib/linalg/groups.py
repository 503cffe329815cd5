"""Groups of items: numbers within them, groups of linked items, and connected parts of sparse patterns."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

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


def linked_items(links: NDArray[np.bool_]) -> list[Index]:
    """Return the groups of two or more items that are linked, directly or through others, each in ascending order.

    Parameters
    ----------
    links : array of bool, shape (n, n)
        Which items are linked, symmetric.

    Returns
    -------
    list of array
        Numbers of the items of each group.
    """
    count = len(links)
    linked = links | np.eye(count, dtype=bool)
    label = np.arange(count)
    while True:
        least = np.where(linked, label, count).min(axis=1, initial=count)
        if (least == label).all():
            break
        label = least
    return [np.flatnonzero(label == number) for number in np.flatnonzero(np.bincount(label, minlength=1) > 1).tolist()]
