"""Mobility of many bodies: redundant constraints must be redundant in neighbouring poses too.

This is the test of the dense path, without its matrices: the mechanism moves a little along all its freedoms, and the
rank of every group of loops with redundant rows is determined again. Large groups are checked loop by loop.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.kinematics.mobility import SmallMotion, crossing_axes, jump, rank_nearby, rods_in_loops
from mbsvib.linalg.rank import DEPENDENT_DISTANCE, NEIGHBOUR_PIVOT, NEIGHBOUR_STEP, RANK_FACTOR
from mbsvib.sparse.constraints import MOST_DENSE_ENTRIES

if TYPE_CHECKING:
    from mbsvib.mechanism.topology import Topology
    from mbsvib.sparse.constraints import Constraints
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.tableau import Tableau
    from mbsvib.sparse.tree import Tree


def check_mobility(topology: Topology, tree: Tree, closure: Constraints, layout: Layout, tableau: Tableau) -> None:
    """Refuse a pose in which fewer constraints are independent than in neighbouring poses."""
    groups = [group for group in closure.groups if group.redundant]
    if not groups or len(tree.names) <= len(layout.multiplier):
        return
    small = _small_motion(tree, layout, tableau, min(group.length for group in groups))
    (linear, angular, point), cuts = small.applied(topology, (tree.linear, tree.angular, tree.point), closure.cuts,
                                crossing_axes(topology, closure.cuts), rods_in_loops(topology, tree, closure.cuts))
    moved_tree = replace(tree, linear=linear, angular=angular, point=point)
    couplers = closure.couplers
    if couplers is not None and cuts.couplings is not None:
        couplers = replace(couplers, terms=cuts.couplings)
    entries = closure.entries(tree), replace(closure, cuts=cuts, couplers=couplers).entries(moved_tree)
    for group in groups:
        members = [group.rows]
        if len(group.rows) * len(group.columns) > MOST_DENSE_ENTRIES:
            members = [group.rows[closure.loop[group.rows] == k] for k in np.unique(closure.loop[group.rows])]
        for rows in members:
            ranks = []
            # a single loop may be nearly singular without being an error
            for part, limit in zip(entries, (DEPENDENT_DISTANCE, NEIGHBOUR_PIVOT), strict=True):
                columns, phi = part.dense(rows)
                scale = np.where(tree.turns[columns], 1.0, group.length)
                phi *= closure.cuts.row_scale(group.length, rows)[:, None] * scale
                ranks.append(rank_nearby(phi, max(limit, RANK_FACTOR * group.noise)))
            rank = group.rank if rows is group.rows else ranks[0]
            if ranks[1] > rank:
                raise jump(group.joints, len(rows), rank, ranks[1])


def _small_motion(tree: Tree, layout: Layout, tableau: Tableau, length: float) -> SmallMotion:
    """A small motion that every loop allows, with every joint on an equal spring."""
    right = np.zeros(layout.size)
    # an arbitrary direction, which no symmetry of the mechanism favours
    right[layout.coordinate] = np.cos(1.0 + np.arange(len(tree.names))) / tableau.row_scale[layout.coordinate]
    motion = tableau.with_equal_springs(layout).solve(right)
    q = motion[layout.coordinate]
    motion *= NEIGHBOUR_STEP / float(np.max(np.abs(q) / np.where(tree.turns, 1.0, length), initial=1e-300))
    six = np.zeros((6, len(tree.parent) + 1))
    six.T[:-1][tree.moves] = motion[layout.displacement[tree.moves]]
    return SmallMotion(six[:3], six[3:], np.concatenate((tree.position, np.zeros((1, 3)))).T)
