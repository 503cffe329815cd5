"""Coordinates without stiffness: the structure of the springs, and no tolerance, determines the rigid-body modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.groups import by_label, connected_parts
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import DEPENDENT_ROWS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.sparse.equations import SparseEquations

# In larger parts of coordinates that springs and loops couple, all coordinates are assumed to have stiffness.
PART = 600


def far_rows(system: SparseEquations) -> NDArray[np.bool_]:
    """Return the mask of rows with stiffness that act on displacements, since the path between their ends is long."""
    is_displacement = np.zeros(system.layout.size, dtype=bool)
    is_displacement[system.layout.displacement[system.layout.displacement >= 0]] = True
    entries = system.elastic_rows.tocoo()
    result = np.zeros(entries.shape[0], dtype=bool)
    result[entries.row[is_displacement[entries.col]]] = True
    return np.asarray(result & (system.row_stiffness != 0.0))


def coordinates_without_stiffness(system: SparseEquations) -> Index:
    """Return the coordinates that must be locked so that every motion deforms a spring along a short path.

    Springs and loops couple coordinates into parts; within each part a pivoted QR of all its rows determines the free
    coordinates. A coordinate that is the only entry of some row is not free. Parts that are too large are assumed to
    have no free coordinates.
    """
    m = len(system.joint_coordinates)
    row, column, value = _entries(system)
    resisted = np.zeros(m, dtype=bool)
    while True:
        single_entry = np.bincount(row, minlength=1)[row] == 1
        if not single_entry.any():
            break
        resisted[column[single_entry]] = True
        others = ~resisted[column]
        row, column, value = row[others], column[others], value[others]
    has_entry = np.zeros(m, dtype=bool)
    has_entry[column] = True
    free = np.flatnonzero(~resisted & ~has_entry).tolist()
    for rows, columns, values in _parts(row, column, value):
        coordinates, local_column = np.unique(columns, return_inverse=True)
        if len(coordinates) > PART:
            continue
        part_rows, local_row = np.unique(rows, return_inverse=True)
        block = np.zeros((len(part_rows), len(coordinates)))
        block[local_row, local_column] = values
        # unit rows and columns: the rank depends neither on the size of a stiffness nor on the unit of a coordinate
        block /= np.linalg.norm(block, axis=1)[:, None]
        block /= np.linalg.norm(block, axis=0)
        qr, order, _ = pivoted_qr(block)
        pivots = np.abs(qr.diagonal())
        free += coordinates[order[int(np.count_nonzero(pivots > DEPENDENT_ROWS * pivots[0])) :]].tolist()
    return np.array(sorted(free), dtype=np.intp)


def _entries(system: SparseEquations) -> tuple[Index, Index, Array]:
    """Entries of springs along short paths and of all loops over the joint coordinates."""
    near = system.elastic_rows[(system.row_stiffness != 0.0) & ~far_rows(system)].tocoo()
    coordinate_number = np.full(system.layout.size, -1)
    coordinate_number[system.layout.coordinate] = np.arange(len(system.joint_coordinates))
    row, column, value = system.constraints.independent_entries(system.structure)
    used = value != 0.0
    return (np.concatenate((near.row, near.shape[0] + row[used])),
            np.concatenate((coordinate_number[near.col], column[used])),
            np.concatenate((near.data, value[used])))  # fmt: skip


def _parts(row: Index, column: Index, value: Array) -> list[tuple[Index, Index, Array]]:
    """Entries by independent parts."""
    if not len(row):
        return []
    shape = int(row.max()) + 1, int(column.max()) + 1
    return [(row[part], column[part], value[part]) for part in by_label(connected_parts(row, column, shape)[0][row])]


def without_far(system: SparseEquations, lock: Index, modes: Array) -> tuple[Index, Array]:
    """Return the remaining locks and free motions, after springs along long paths are taken into account.

    ``lock`` (n,): coordinates that the other springs leave free. ``modes`` (size, n): the free motions: each moves its
    own lock by one, and no other.
    """
    rows = system.elastic_rows[far_rows(system)]
    block = np.asarray(rows @ modes)
    block /= np.maximum(np.asarray(abs(rows) @ np.abs(modes)).max(axis=1, initial=0.0), 1e-300)[:, None]
    qr, order, _ = pivoted_qr(block)
    pivots = np.abs(qr.diagonal())
    rank = int(np.count_nonzero(pivots > DEPENDENT_ROWS))
    null = np.zeros((len(lock), len(lock) - rank))
    null[order[rank:], np.arange(len(lock) - rank)] = 1.0
    if 0 < rank < len(lock):
        null[order[:rank]] = -np.linalg.solve(np.triu(qr[:rank, :rank]), qr[:rank, rank:])
    return lock[order[rank:]], modes @ null
