"""Layout: positions of the unknowns of the tableau, body after body from the leaves of the tree to its root.

Each body has its displacements x (in the directions in which it can move), the forces h that its joint transmits, and
its joint's coordinates q; multipliers of a loop follow the last body on the loop. Each equation has the index of the
unknown for which it is solved: the joint's kinematics that of x, the balance of forces that of h, the force law of the
joint that of q. The diagonal is then 1, 1 and a stiffness, and elimination in this order is the recursion of
articulated bodies, without zero pivots and without fill beyond the parent's block.

Unknowns with virtual motions have more columns behind these. Each joint whose force is an output has six virtual
coordinates before its own, translations and rotations of its second body against its first in world axes, at its point.
Bodies behind it move in all directions then, so that all of their displacements are unknowns. Rows over these unknowns
are made by the same functions. The virtual motion of a cut joint opens it: no body moves, its locked rows change.

Relative displacements of two bodies are sparse rows over displacements of bodies and joint coordinates. Along a short
path the row is in terms of the joint coordinates between the two bodies (the path rule), which loses no digits. Along a
long path it is in terms of the displacements of its two ends.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.elements.rows import Rows
from mbsvib.kinematics.relative_motion import entry_values
from mbsvib.linalg.groups import items_of_groups
from mbsvib.linalg.rotations import crossed_product as cross
from mbsvib.mechanism.topology import Topology
from mbsvib.sparse.tree import Tree

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


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


@dataclass(frozen=True, slots=True)
class VirtualUnknowns:
    """The unknowns of a ``tree`` and ``layout`` that contain virtual motions.

    ``column`` (joints,) is the first of the six virtual coordinates of a joint, -1 for none; ``point`` (3, joints) are
    their points.
    """

    tree: Tree
    layout: Layout
    column: Index
    point: Array

    def opened(self, matrix: csr_matrix, rows: Rows, joint: Index) -> csr_matrix:
        """Return ``rows`` of relative displacement of cut joints (n,), given over the unknowns by ``matrix``, without
        the virtual motions of these joints.
        """
        from scipy.sparse import csr_matrix

        used = np.flatnonzero(self.column[joint] >= 0)
        if not len(used):
            return matrix
        force = rows.force[:, used]
        moment = rows.moment[:, used] + cross(rows.point[:, used] - self.point[:, joint[used]], force)
        wrench = np.concatenate((force, moment)).T
        which, direction = np.nonzero(wrench)
        at = used[which], self.column[joint[used[which]]] + direction
        return (matrix - csr_matrix((wrench[which, direction], at), shape=matrix.shape)).tocsr()


def virtual_unknowns(
    topology: Topology, tree: Tree, layout: Layout, joints: Sequence[int], point: Array
) -> VirtualUnknowns:
    """Return the unknowns with virtual motions of some joints, at ``point`` (3, all joints)."""
    column, n = np.full(len(topology.joints), -1), len(tree.parent)
    branch_of = topology.branch_of
    in_tree = [branch_of[k] for k in joints if k in branch_of]
    displacement = layout.displacement.copy()
    missing = displacement < 0
    displacement[missing] = layout.size + np.arange(np.count_nonzero(missing))
    start = layout.size + int(np.count_nonzero(missing))
    ordered = [*(branch.joint for branch in in_tree), *(k for k in joints if k not in branch_of)]
    column[ordered] = start + 6 * np.arange(len(ordered))
    number = np.array([branch.joint for branch in in_tree], dtype=np.intp)
    body = np.array([branch.body for branch in in_tree], dtype=np.intp).repeat(6)
    sign = np.array([branch.sign for branch in in_tree], dtype=float).repeat(6)
    six = np.tile(np.eye(6), len(in_tree))
    body_of = np.concatenate((tree.coordinate_body, body))
    order = np.argsort(body_of, kind="stable")  # the coordinates of a body follow each other, its own first
    linear, angular, points = (np.concatenate(pair, axis=1)[:, order] for pair in (
        (tree.linear, six[:3]), (tree.angular, six[3:]), (tree.point, point[:, number].repeat(6, axis=1))))  # fmt: skip
    count = np.bincount(body_of, minlength=n)
    names = (*tree.names, *[f"{topology.joints[k].name}.v{i}" for k in number.tolist() for i in range(6)])
    wide = replace(
        tree, first=np.cumsum(count) - count, count=count, names=tuple([names[k] for k in order.tolist()]),
        coordinate_body=body_of[order], linear=linear, angular=angular, point=points,
        sign=np.concatenate((tree.sign, sign))[order],
        motion=np.concatenate((tree.motion, np.zeros((len(body), 6))))[order],
        turns=np.concatenate((tree.turns, six[3:].any(axis=0)))[order],
    )  # fmt: skip
    coordinate = np.concatenate((layout.coordinate, start + np.arange(len(body))))[order]
    return VirtualUnknowns(wide, Layout(displacement, coordinate, layout.multiplier, layout.behind,
                                        start + 6 * len(ordered)), column, point)  # fmt: skip


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
    values = entry_values((tree.linear, tree.angular, tree.point), (rows.force, rows.moment, rows.point), row, column,
                          sign[entry])  # fmt: skip
    return row, column, values, skipped[of_row]


def relative_rows(tree: Tree, layout: Layout, rows: Rows, by_ends: Bools | None = None) -> csr_matrix:
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
