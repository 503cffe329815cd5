"""Layout: positions of the unknowns of the tableau, body after body from the leaves of the tree to its root.

Each body has its displacements x (in the directions in which it can move), the forces h that its joint transmits, and
its joint's coordinates q; multipliers of a loop follow the last body on the loop. Each equation has the index of the
unknown for which it is solved: the joint's kinematics that of x, the balance of forces that of h, the force law of the
joint that of q. The diagonal is then 1, 1 and a stiffness, and elimination in this order is the recursion of
articulated bodies, without zero pivots and without fill beyond the parent's block.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.groups import items_of_groups

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.sparse.tree import Tree


@dataclass(frozen=True, slots=True)
class Layout:
    """Positions of the unknowns: ``displacement`` (bodies, 6), -1 where a body cannot move, ``coordinate`` (m,) and
    ``multiplier`` (rows,); ``behind`` (bodies,) is the offset from x to h of a body. ``size`` is their number.
    """

    displacement: Index
    coordinate: Index
    multiplier: Index
    behind: Index
    size: int

    @property
    def moving(self) -> tuple[Index, Index]:
        """Body and direction of every displacement that is an unknown."""
        body, direction = np.nonzero(self.displacement >= 0)
        return body, direction

    @property
    def force(self) -> Index:
        """Position of h for every body and direction, -1 where the body cannot move, shape (bodies, 6)."""
        return np.where(self.displacement >= 0, self.displacement + self.behind[:, None], -1)

    def balance(self) -> tuple[Index, Array]:
        """Return for every unknown the equation with the forces that do work on it, and their sign in it, (size,) each.

        The sign is -1 for displacements, +1 for coordinates and multipliers, 0 for h.
        """
        row, sign = np.arange(self.size), np.zeros(self.size)
        at = self.displacement >= 0
        row[self.displacement[at]] = self.force[at]
        sign[self.displacement[at]] = -1.0
        sign[self.coordinate] = 1.0
        sign[self.multiplier] = 1.0
        return row, sign


def layout(tree: Tree, loops: int = 0, path_joints: tuple[Index, Index] | None = None) -> Layout:
    """Return the layout of a tree with ``loops`` multipliers.

    ``path_joints``: multiplier and outer body of every joint on the path of a loop.
    """
    n = len(tree.parent)
    inward = tree.outward[::-1]
    rank = np.empty(n, dtype=np.intp)
    rank[inward] = np.arange(n)
    last = np.zeros(loops, dtype=np.intp)
    if path_joints is not None:
        np.maximum.at(last, path_joints[0], rank[path_joints[1]])
    directions = tree.moves.sum(axis=1)
    block = 2 * directions + tree.count
    block[inward] += np.bincount(last, minlength=n)
    start = np.empty(n, dtype=np.intp)
    ends = np.cumsum(block[inward])
    start[inward] = ends - block[inward]
    displacement = np.where(tree.moves, start[:, None] + np.cumsum(tree.moves, axis=1) - 1, -1)
    body = tree.coordinate_body
    coordinate = (start + 2 * directions)[body] + np.arange(len(body)) - tree.first[body]
    order = np.argsort(last, kind="stable")
    multiplier = np.empty(loops, dtype=np.intp)
    group, nth = items_of_groups(np.bincount(last, minlength=n))
    multiplier[order] = (start + 2 * directions + tree.count)[inward[group]] + nth
    return Layout(displacement, coordinate, multiplier, directions, int(ends[-1]))


def kinematics(tree: Tree, layout: Layout) -> csr_matrix:
    """Return the equations of the joints without stiffness (size, size), and their forces in the other equations.

    x = X(c - c_parent) x_parent + T q, h = sum of X^T h_child + ..., T^T h + ... = 0
    """
    from scipy.sparse import csr_matrix

    x, force = layout.displacement, layout.force
    moving, h = x[tree.moves], force[tree.moves]
    parts = [(moving, moving, np.ones(len(moving))), (h, h, np.ones(len(h)))]
    # x - X x_parent - T q = 0,  h - sum of X^T h_child - ... = 0,  T^T h + ... = 0
    child = np.flatnonzero(tree.parent < len(tree.parent))
    parent = tree.parent[child]
    rx, ry, rz = (tree.position[child] - tree.position[parent]).T
    ones = np.ones(len(child))
    transport = [(i, i, ones) for i in range(6)]
    transport += [(0, 4, rz), (0, 5, -ry), (1, 5, rx), (1, 3, -rz), (2, 3, ry), (2, 4, -rx)]
    for i, j, value in transport:
        used = (value != 0.0) & (x[child, i] >= 0) & (x[parent, j] >= 0)
        a, b = child[used], parent[used]
        parts.append((x[a, i], x[b, j], -value[used]))
        parts.append((force[b, j], force[a, i], -value[used]))
    k, direction = np.nonzero(tree.motion)
    twist, body = tree.motion[k, direction], tree.coordinate_body[k]
    parts.append((x[body, direction], layout.coordinate[k], -twist))
    parts.append((layout.coordinate[k], force[body, direction], twist))
    row, column, entry = (np.concatenate([part[i] for part in parts]) for i in range(3))
    return csr_matrix((entry, (row, column)), shape=(layout.size, layout.size))


def motions(tree: Tree, layout: Layout) -> Callable[[Array], Array]:
    """Return the function that maps joint coordinates (m, ...) to motions over the unknowns (size, ...).

    x = X(c - c_parent) x_parent + T q from the root to the leaves
    """
    from scipy.sparse.linalg import splu

    x = layout.displacement[tree.outward][tree.moves[tree.outward]]
    rows = kinematics(tree, layout)[x].tocsc()
    factor, twists = splu(rows[:, x], permc_spec="NATURAL", diag_pivot_thresh=0.0), rows[:, layout.coordinate]

    def of(q: Array) -> Array:
        result = np.zeros((layout.size, *q.shape[1:]))
        result[layout.coordinate] = q
        result[x] = factor.solve(-(twists @ q))
        return result

    return of
