"""Rows: relative displacements of two bodies, as sparse rows over displacements of bodies and joint coordinates.

Along a short path the row is in terms of the joint coordinates between the two bodies (the path rule), which loses no
digits. Along a long path it is in terms of the displacements of its two ends.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics.relative_motion import entry_values
from mbsvib.linalg.groups import items_of_groups

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.rows import Rows
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.tree import Mask, Tree

# Longer paths use the displacements of their ends: a row over all joints between would fill the factors.
SHORT = 32


def paths(tree: Tree, first: Index, second: Index, longest: int | None = SHORT) -> tuple[Index, Index, Array, Array]:
    """Return the joints between pairs of bodies (pairs,); ground is the number of bodies.

    Pairs with more than ``longest`` joints between them are skipped. Returns pair (ascending) and body of every joint
    on a path; its sign, +1 on the second body's side and -1 on the first's; and the mask (pairs,) of those skipped.
    """
    a, b = first.copy(), second.copy()
    parent = np.concatenate((tree.parent, [len(tree.parent)]))
    active = np.flatnonzero(a != b)
    path_parts: list[tuple[Index, Index, Array]] = []
    steps = 0
    while len(active) and (longest is None or steps <= longest):
        body_a, body_b = a[active], b[active]
        is_deeper = tree.depth[body_a] > tree.depth[body_b]
        path_parts.append((active, np.where(is_deeper, body_a, body_b), np.where(is_deeper, -1.0, 1.0)))
        a[active] = np.where(is_deeper, parent[body_a], body_a)
        b[active] = np.where(is_deeper, body_b, parent[body_b])
        active = active[a[active] != b[active]]
        steps += 1
        if longest is None and steps > SHORT:
            path_parts += _climbed(tree, active, a, b)
            break
    skipped = np.zeros(len(first), dtype=bool)
    skipped[active] = longest is not None
    if not path_parts:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0), skipped
    pair, body, sign = (np.concatenate([step[i] for step in path_parts]) for i in range(3))
    order = np.argsort(pair, kind="stable")
    order = order[~skipped[pair[order]]]
    return pair[order], body[order], sign[order], skipped


def _climbed(tree: Tree, active: Index, a: Index, b: Index) -> list[tuple[Index, Index, Array]]:
    """Complete a few long paths with Python integers, which is faster than arrays of a few entries."""
    parent, depth = [*tree.parent.tolist(), len(tree.parent)], tree.depth.tolist()
    result = []
    for pair in active.tolist():
        body_a, body_b, body, sign = int(a[pair]), int(b[pair]), [], []
        while body_a != body_b:
            if depth[body_a] > depth[body_b]:
                body.append(body_a)
                sign.append(-1.0)
                body_a = parent[body_a]
            else:
                body.append(body_b)
                sign.append(1.0)
                body_b = parent[body_b]
        result.append((np.full(len(body), pair), np.array(body, dtype=np.intp), np.array(sign)))
    return result


def path_entries(tree: Tree, rows: Rows, longest: int | None = SHORT) -> tuple[Index, Index, Array, Array]:
    """Return row, joint coordinate and value of all entries of rows, by the path rule, and the mask of rows skipped.

    d_r = sum over the coordinates k between first and second of +-(f_r . v_k + w_k . ((p_r - p_k) x f_r + m_r)) q_k

    Rows with more than ``longest`` joints on their path are skipped.
    """
    ends, of_row = np.unique(np.stack((rows.first, rows.second)), axis=1, return_inverse=True)
    of_row = of_row.reshape(-1)
    pair, body, sign, skipped = paths(tree, ends[0], ends[1], longest)
    # expand the joints of each path to coordinates, and each row to the coordinates of its pair
    joint, nth = items_of_groups(tree.count[body])
    coordinate, pair, sign = tree.first[body[joint]] + nth, pair[joint], sign[joint]
    sign = sign * tree.sign[coordinate]
    begin = np.searchsorted(pair, np.arange(ends.shape[1] + 1))
    row, nth = items_of_groups(begin[of_row + 1] - begin[of_row])
    entry = begin[of_row[row]] + nth
    column = coordinate[entry]
    values = entry_values((tree.linear, tree.angular, tree.point), rows, row, column, sign[entry])
    return row, column, values, skipped[of_row]


def relative_rows(tree: Tree, layout: Layout, rows: Rows, by_ends: Mask | None = None) -> csr_matrix:
    """Return rows of relative displacement over the unknowns of the tableau, (rows, size); those ``by_ends`` (rows,)
    along short paths too are in terms of the displacements of their ends.
    """
    from scipy.sparse import csr_matrix

    near = np.arange(len(rows.first)) if by_ends is None else np.flatnonzero(~by_ends)
    row, coordinate, value, skipped = path_entries(tree, rows if by_ends is None else rows.take(near))
    parts = [(near[row], layout.coordinate[coordinate], value)]
    is_far = np.ones(len(rows.first), dtype=bool)
    is_far[near] = skipped
    far = np.flatnonzero(is_far)
    for bodies, sign in ((rows.second, 1.0), (rows.first, -1.0)):
        moving = far[bodies[far] < len(tree.parent)]
        force = rows.force[:, moving]
        arm = rows.point[:, moving] - tree.position[bodies[moving]].T
        moment = rows.moment[:, moving] + np.cross(arm, force, axis=0)
        wrench = sign * np.concatenate((force, moment)).T
        column = layout.displacement[bodies[moving]]
        which, direction = np.nonzero((column >= 0) & (wrench != 0.0))
        parts.append((moving[which], column[which, direction], wrench[which, direction]))
    entries = [np.concatenate([part[i] for part in parts]) for i in range(3)]
    nonzero = entries[2] != 0.0
    row, column, value = (part[nonzero] for part in entries)
    return csr_matrix((value, (row, column)), shape=(len(rows.first), layout.size))


