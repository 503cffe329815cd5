"""Coordinates that no spring holds: rigid-body modes are counted where springs touch, not by what is small."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.loops import pivoted_qr
from mbsvib.sparse.rows import spread

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.kinematics import Index
    from mbsvib.sparse.system import SparseSystem

# As in the dense path: unit rows that depend on each other differ by rounding of the geometry, far below this.
RANK = 1e-11
# Coordinates that springs and loops tie together in larger parts than this are taken to be held.
PART = 600


def unsprung(system: SparseSystem) -> Index:
    """Return coordinates which, locked, leave no motion that meets no spring.

    Springs and loops tie coordinates into parts; within each part a pivoted QR of all its rows tells which coordinates
    are free. Parts that are too large, or held by rows which act on displacements, are taken to be held.

    Parameters
    ----------
    system : SparseSystem
        The equations of motion.

    Returns
    -------
    array
        Numbers of the coordinates, one for each rigid-body mode.
    """
    from scipy.sparse import csr_matrix, vstack
    from scipy.sparse.csgraph import connected_components

    m = len(system.joint_coordinates)
    place = np.full(system.layout.size, -1)
    place[system.layout.coordinate] = np.arange(m)
    stiff = system.elastic_rows[system.stiffness != 0.0]
    entries = vstack([stiff, system.loop_rows]).tocoo()
    far = np.zeros(entries.shape[0], dtype=bool)
    far[entries.row[place[entries.col] < 0]] = True
    used = place[entries.col] >= 0
    row, column, value = entries.row[used], place[entries.col[used]], entries.data[used]
    # unit rows and columns: neither the size of a stiffness nor the unit of a coordinate decides a rank
    value = value / np.sqrt(np.bincount(row, value * value, minlength=len(far)))[row]
    size = np.sqrt(np.bincount(column, value * value, minlength=m))
    value = value / size[column]
    held = size > 0.0
    rows = len(far)
    ends = (row, rows + column)
    graph = csr_matrix((np.ones(len(row), dtype=bool), ends), shape=(rows + m, rows + m))
    label = connected_components(graph, directed=False)[1]
    doubtful = np.zeros(int(label.max(initial=-1)) + 1, dtype=bool)
    doubtful[label[:rows][far]] = True
    unheld = ~held
    if far.any():
        unheld &= ~_under_far_rows(system)
    free = np.flatnonzero(unheld).tolist()
    label_of = label[rows:]
    matrix = csr_matrix((value, (row, column)), shape=(rows, m)).tocsc()
    order = np.flatnonzero(held & ~doubtful[label_of])
    order = order[np.argsort(label_of[order], kind="stable")]
    sizes = np.bincount(label_of[order], minlength=len(doubtful))
    start = np.cumsum(sizes) - sizes
    for part in np.flatnonzero((sizes > 1) & (sizes <= PART)).tolist():
        columns = order[start[part] : start[part] + sizes[part]]
        counts = np.diff(matrix.indptr)[columns]
        of, nth = spread(counts)
        at = matrix.indptr[columns][of] + nth
        here, place_of = np.unique(matrix.indices[at], return_inverse=True)
        block = np.zeros((len(here), len(columns)))
        block[place_of, of] = matrix.data[at]
        qr, pivoting, _ = pivoted_qr(block)
        pivots = np.abs(qr.diagonal())
        rank = int(np.count_nonzero(pivots > RANK * pivots[0]))
        free += columns[pivoting[rank:]].tolist()
    return np.array(sorted(free), dtype=np.intp)


def _under_far_rows(system: SparseSystem) -> NDArray[np.bool_]:
    """Coordinates on the path of a row that acts on displacements: bodies whose subtree holds an end of it."""
    tree = system.structure
    n = len(tree.parent)
    place = np.full(system.layout.size, -1)
    body, direction = system.layout.moving
    place[system.layout.displacement[body, direction]] = body
    count = np.zeros(n + 1, dtype=np.int64)
    for rows in (system.elastic_rows[system.stiffness != 0.0], system.loop_rows):
        entries = rows.tocoo()
        far = place[entries.col] >= 0
        count[np.unique(place[entries.col[far]])] += 1
    total, parent = count.tolist(), tree.parent.tolist()
    for k in tree.outward[::-1].tolist():
        total[parent[k]] += total[k]
    return np.array(total[:n])[tree.carried] > 0
