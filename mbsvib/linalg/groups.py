"""Groups of items: numbers within them, groups of linked items, and connected parts of matrices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arrays import Bools, Index

if TYPE_CHECKING:
    from scipy.sparse import sparray, spmatrix

# Up to so many items and links, plain Python takes less time than the set-up of a sparse matrix.
FEW = 500


def items_of_groups(count: Index) -> tuple[Index, Index]:
    """Return the group and the number within it of every item, for groups of ``count`` items."""
    group = np.repeat(np.arange(len(count)), count)
    return group, np.arange(len(group)) - np.repeat(np.cumsum(count) - count, count)


def by_label(label: Index) -> list[Index]:
    """Return the items with each label, ascending, in the order of the labels."""
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1) if len(order) else []


def part_numbers(links: Bools | spmatrix | sparray, strong: bool = False) -> Index:
    """Return the number (n,), from 0 on, of the connected part of each item, linked by the nonzero entries of a matrix.

    ``links`` (n, n) work in both directions; with ``strong`` in one only, and items of one part reach each other.
    """
    if isinstance(links, np.ndarray) and not strong and len(links) + np.count_nonzero(links) <= FEW:
        first, second = links.nonzero()
        return _few_parts(first.tolist(), second.tolist(), len(links))
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    if isinstance(links, np.ndarray):
        if links.all():  # the most frequent case
            return np.zeros(len(links), dtype=np.intp)
        row, column = links.nonzero()
        start = np.searchsorted(row, np.arange(len(links) + 1))
        # what the constructor does, in a third of its time
        links = csr_matrix((np.ones(len(row)), column, start), shape=links.shape)
    numbers = connected_components(links, directed=strong, connection="strong")[1]
    return np.asarray(numbers, dtype=np.intp)


def connected_parts(row: Index, column: Index, shape: tuple[int, int]) -> tuple[Index, Index]:
    """Return the number of the connected part of each row and of each column of a matrix, by its nonzero entries.

    Parts are numbered in the order of their first row or column, rows first.
    """
    rows, size = shape[0], sum(shape)
    if size + len(row) <= FEW:
        part = _few_parts(row.tolist(), (rows + column).tolist(), size)
        return part[:rows], part[rows:]
    from scipy.sparse import csr_matrix

    part = part_numbers(csr_matrix((np.ones(len(row), dtype=bool), (row, rows + column)), shape=(size, size)))
    return part[:rows], part[rows:]


def _few_parts(first: list[int], second: list[int], size: int) -> Index:
    """The number of the connected part of each of ``size`` items, of which pairs are linked."""
    parent = list(range(size))

    def root(item: int) -> int:
        while parent[item] != item:
            parent[item] = item = parent[parent[item]]
        return item

    for a, b in zip(first, second, strict=True):
        parent[root(b)] = root(a)
    number: dict[int, int] = {}
    return np.array([number.setdefault(root(item), len(number)) for item in range(size)], dtype=np.intp)


def linked_items(links: Bools) -> list[Index]:
    """Return the groups of two or more items that are linked, directly or through others, each in ascending order.

    ``links`` (n, n): which items are linked, symmetric.
    """
    if not (links & ~np.eye(len(links), dtype=bool)).any():  # the most frequent case
        return []
    part = part_numbers(links)
    return [np.flatnonzero(part == number) for number in np.flatnonzero(np.bincount(part) > 1).tolist()]
