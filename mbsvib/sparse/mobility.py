"""Mobility of many bodies: redundant constraints must be redundant in neighbouring poses too.

This is the test of the dense path, without its matrices: the mechanism moves a little along all its freedoms, and the
rank of every group of loops with redundant rows is determined again. Large groups are checked loop by loop.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import SingularPoseError
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import DEPENDENT_DISTANCE, NEIGHBOUR_PIVOT, NEIGHBOUR_STEP, RANK_FACTOR
from mbsvib.sparse.constraints import MOST_DENSE_ENTRIES
from mbsvib.sparse.couplers import row_scale

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.sparse.constraints import Constraints, Entries
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.tableau import Tableau
    from mbsvib.sparse.tree import Tree


def check_mobility(tree: Tree, closure: Constraints, layout: Layout, tableau: Tableau) -> None:
    """Refuse a pose in which fewer constraints are independent than in neighbouring poses."""
    groups = [group for group in closure.groups if group.redundant]
    if not groups or len(tree.names) <= len(layout.multiplier):
        return
    length = min(group.length for group in groups)
    moved_tree, moved_closure = _displaced(tree, closure, _displacement(tree, layout, tableau, length))
    entries = (closure.entries(tree), moved_closure.entries(moved_tree))
    for group in groups:
        members = [group.rows]
        if len(group.rows) * len(group.columns) > MOST_DENSE_ENTRIES:
            members = [group.rows[closure.loop[group.rows] == k] for k in np.unique(closure.loop[group.rows])]
        for rows in members:
            # a single loop may be nearly singular without being an error
            limits = DEPENDENT_DISTANCE, NEIGHBOUR_PIVOT
            rank, neighbour = (_rank(tree, closure, part, rows, group.length, max(limit, RANK_FACTOR * group.noise))
                               for part, limit in zip(entries, limits, strict=True))  # fmt: skip
            rank = group.rank if rows is group.rows else rank
            if neighbour > rank:
                raise SingularPoseError(
                    f"loops closed by {', '.join(group.joints[:8])}: singular pose. {rank} of {len(rows)} constraint "
                    f"rows are independent here, {neighbour} in neighbouring poses, so the number of degrees of "
                    f"freedom jumps and linear equations do not describe the motion. Move the pose off the singular "
                    f"one."
                )


def _displacement(tree: Tree, layout: Layout, tableau: Tableau, length: float) -> Array:
    """Displacements (bodies + 1, 6) of a small motion that every loop allows, with every joint on an equal spring."""
    data = tableau.fixed.copy()
    data[tableau.diagonal[layout.coordinate]] += 1.0
    right = np.zeros(layout.size)
    # an arbitrary direction, which no symmetry of the mechanism favours
    right[layout.coordinate] = np.cos(1.0 + np.arange(len(tree.names))) / tableau.row_scale[layout.coordinate]
    motion = tableau.factor_data(data).solve(right)
    q = motion[layout.coordinate]
    motion *= NEIGHBOUR_STEP / float(np.max(np.abs(q) / np.where(tree.turns, 1.0, length), initial=1e-300))
    result = np.zeros((len(tree.parent) + 1, 6))
    result[:-1][tree.moves] = motion[layout.displacement[tree.moves]]
    return result


def _displaced(tree: Tree, closure: Constraints, displacement: Array) -> tuple[Tree, Constraints]:
    """Joint axes and locked rows after a small motion, to first order."""
    centre = np.concatenate((tree.position, np.zeros((1, 3))))

    def displaced(body: Index, point: Array) -> Array:
        return point + displacement[body, :3].T + np.cross(displacement[body, 3:], point.T - centre[body]).T

    def rotated(body: Index, vector: Array) -> Array:
        return vector + np.cross(displacement[body, 3:], vector.T).T

    carrier, rows = tree.carrier, closure.rows
    linear, force = rotated(carrier, tree.linear), rotated(rows.first, rows.force)
    for row, column, first, second, start, end in closure.rods:
        line = displaced(np.array([second]), end[:, None])[:, 0] - displaced(np.array([first]), start[:, None])[:, 0]
        line /= np.sqrt(line @ line)
        if row >= 0:
            force[:, row] = line
        else:
            linear[:, column : column + 2] -= np.outer(line, line @ linear[:, column : column + 2])
    angular = 0.5 * (rotated(carrier, tree.angular) + rotated(tree.halfway, tree.angular))
    moment = 0.5 * (rotated(rows.first, rows.moment) + rotated(rows.second, rows.moment))
    moved_tree = replace(tree, linear=linear, angular=angular, point=displaced(tree.holder, tree.point))
    for row, first_axis, second_axis in closure.crossing:
        a = rotated(rows.first[row : row + 1], np.array([first_axis]).T)
        b = rotated(rows.second[row : row + 1], np.array([second_axis]).T)
        moment[:, row] = np.cross(a[:, 0], b[:, 0])
    couplers = None if closure.couplers is None else closure.couplers.nearby(rotated, displaced)
    rows = replace(rows, point=displaced(rows.second, rows.point), force=force, moment=moment)
    return moved_tree, replace(closure, rows=rows, couplers=couplers)


def _rank(tree: Tree, closure: Constraints, entries: Entries, members: Index, length: float, limit: float) -> int:
    columns, a = entries.dense(members)
    a *= np.where(tree.turns[columns], 1.0, length)
    a *= row_scale(closure.rows, closure.couplers, members, length)[:, None]
    pivots = np.abs(pivoted_qr(a)[0].diagonal())
    return int(np.count_nonzero(pivots > limit * max(1.0, float(pivots.max(initial=0.0)))))
