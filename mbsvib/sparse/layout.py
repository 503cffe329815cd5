"""Layout: where the unknowns of the tableau are, body after body from the leaves of the tree to its root.

A body brings its displacements x (those directions in which it can move), the forces h that its joint hands on, and
its joint's coordinates q; multipliers of a loop come right behind the last body that the loop touches. Equations stand
where the unknown stands that they are solved for: the joint's kinematics at x, the balance of forces at h, the joint's
own force law at q. The diagonal is then 1, 1 and a stiffness, and eliminating in this order is the recursion of
articulated bodies: no zero to pivot on, no fill beyond the parent's block.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.groups import spread

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.sparse.tree import Tree


@dataclass(frozen=True, slots=True)
class Layout:
    """Places of the unknowns: ``displacement`` (bodies, 6), -1 where a body cannot move, ``coordinate`` (m,) and
    ``multiplier`` (rows,); ``behind`` (bodies,) is the distance from x to h of a body. ``size`` counts them all.
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
        """Place of h for every body and direction, -1 where the body cannot move, shape (bodies, 6)."""
        return np.where(self.displacement >= 0, self.displacement + self.behind[:, None], -1)

    def balance(self) -> tuple[Index, Array]:
        """Return for every unknown the equation that holds the forces which work on it, and their sign there.

        Returns
        -------
        tuple of arrays, shape (size,)
            Row of the tableau, and -1 for displacements, +1 for coordinates and multipliers, 0 for h.
        """
        row, sign = np.arange(self.size), np.zeros(self.size)
        at = self.displacement >= 0
        row[self.displacement[at]] = self.force[at]
        sign[self.displacement[at]] = -1.0
        sign[self.coordinate] = 1.0
        sign[self.multiplier] = 1.0
        return row, sign


def layout(tree: Tree, loops: int = 0, touched: tuple[Index, Index] | None = None) -> Layout:
    """Return the layout of a tree with multipliers.

    Parameters
    ----------
    tree : Tree
        The spanning tree.
    loops : int
        Number of multipliers.
    touched : pair of arrays, optional
        Multiplier and body of every joint on a loop's path.

    Returns
    -------
    Layout
        Places of all unknowns.
    """
    n = len(tree.parent)
    inward = tree.outward[::-1]
    rank = np.empty(n, dtype=np.intp)
    rank[inward] = np.arange(n)
    last = np.zeros(loops, dtype=np.intp)
    if touched is not None:
        np.maximum.at(last, touched[0], rank[touched[1]])
    own = tree.moves.sum(axis=1)
    block = 2 * own + tree.count
    block[inward] += np.bincount(last, minlength=n)
    start = np.empty(n, dtype=np.intp)
    ends = np.cumsum(block[inward])
    start[inward] = ends - block[inward]
    displacement = np.where(tree.moves, start[:, None] + np.cumsum(tree.moves, axis=1) - 1, -1)
    coordinate = (start + 2 * own)[tree.carried] + np.arange(len(tree.carried)) - tree.first[tree.carried]
    order = np.argsort(last, kind="stable")
    multiplier = np.empty(loops, dtype=np.intp)
    group, nth = spread(np.bincount(last, minlength=n))
    multiplier[order] = (start + 2 * own + tree.count)[inward[group]] + nth
    return Layout(displacement, coordinate, multiplier, own, int(ends[-1]))


def kinematics(tree: Tree, place: Layout) -> csr_matrix:
    """Return what joints demand, whatever the stiffness: x = X(c - c_parent) x_parent + T q, and the forces' balance.

    Parameters
    ----------
    tree : Tree
        The spanning tree.
    place : Layout
        Where the unknowns are.

    Returns
    -------
    csr_matrix, shape (size, size)
        The equations of kinematics, and in the other equations what the joints' forces contribute.
    """
    from scipy.sparse import csr_matrix

    x, force = place.displacement, place.force
    here = x[tree.moves]
    parts = [(here, here, np.ones(len(here))), (force[tree.moves], force[tree.moves], np.ones(len(here)))]
    # x - X x_parent - T q = 0,  h - sum of X^T h_child - ... = 0,  T^T h + ... = 0
    child = np.flatnonzero(tree.parent < len(tree.parent))
    parent = tree.parent[child]
    rx, ry, rz = (tree.position[child] - tree.position[parent]).T
    one = np.ones(len(child))
    carried = [(i, i, one) for i in range(6)]
    carried += [(0, 4, rz), (0, 5, -ry), (1, 5, rx), (1, 3, -rz), (2, 3, ry), (2, 4, -rx)]
    for i, j, value in carried:
        used = (value != 0.0) & (x[child, i] >= 0) & (x[parent, j] >= 0)
        a, b = child[used], parent[used]
        parts.append((x[a, i], x[b, j], -value[used]))
        parts.append((force[b, j], force[a, i], -value[used]))
    k, direction = np.nonzero(tree.motion)
    twist, body = tree.motion[k, direction], tree.carried[k]
    parts.append((x[body, direction], place.coordinate[k], -twist))
    parts.append((place.coordinate[k], force[body, direction], twist))
    row, column, entry = (np.concatenate([part[i] for part in parts]) for i in range(3))
    return csr_matrix((entry, (row, column)), shape=(place.size, place.size))
