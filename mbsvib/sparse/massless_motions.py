"""Massless motions of many bodies, determined part by part, with all bodies with mass at rest.

A body whose inertia resists every motion is at rest in a massless motion. So is a body whose parent is at rest and
whose inertia resists every motion of its joint. The remaining bodies form small parts, mostly of one light body; in
each part a pivoted QR decides the rank, as in the dense path. Motions are columns over the unknowns, scaled so that no
point of the part moves by more than about one metre.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse import csc_matrix, csr_matrix, vstack

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.equations.inertia import SpatialInertia
from mbsvib.equations.massless_separation import check_gap
from mbsvib.equations.unresisted_motion import independent_coordinates, null_space, without_rounding
from mbsvib.kinematics.shared_rows import Shared
from mbsvib.linalg.groups import connected_parts
from mbsvib.linalg.rank import CERTAIN_INERTIA, EPS, RANK_FACTOR, ZERO_SUM
from mbsvib.sparse.layout import Layout, kinematics
from mbsvib.sparse.tree import Tree

TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, slots=True)
class Motions:
    """Massless motions: ``shapes`` (size, n) over the unknowns, and the number ``coordinate`` (n,) of each of them.

    The coordinate is nonzero in one motion only. Of the pivots of inertia rows ``kept_pivot`` is the smallest that
    counts as mass, ``dropped_pivot`` the largest that counts as zero.
    """

    shapes: csc_matrix
    coordinate: Index
    kept_pivot: float
    dropped_pivot: float


def massless_motions(
    tree: Tree, layout: Layout, inertia: SpatialInertia, shared: Shared | None, factor: csr_matrix, loops: csr_matrix
) -> Motions | None:
    """Return the motions without mass that joints and loops allow, None if there are none.

    x - X x_parent - T q = 0, W x = 0, Phi (x, q) = 0

    ``factor`` (inertia rows, size): W of M = W^T W. ``loops`` (multipliers, size): independent locked rows.
    """
    if inertia.regular:
        return None
    movable = ~_bodies_at_rest(tree, inertia, shared)
    return _by_parts(tree, layout, movable, factor, loops) if movable.any() else None


def _bodies_at_rest(tree: Tree, inertia: SpatialInertia, shared: Shared | None) -> Bools:
    """Bodies that are certainly at rest in every massless motion."""
    n = len(tree.parent)
    at_rest = _nodes_with_mass(tree, shared)
    with_mass = np.flatnonzero(inertia.linear > 0.0)
    at_rest[with_mass[_smallest(inertia.angular[with_mass]) > CERTAIN_INERTIA]] = True
    others = np.flatnonzero(~at_rest)
    if not len(others):
        return at_rest
    rows = np.zeros((len(others), 6, 6))
    rows[:, [0, 1, 2], [0, 1, 2]] = inertia.linear[others, None]
    rows[:, 3:, 3:] = inertia.angular[others]
    # motions of a joint without inertia: columns of W T, relative to their maximum size
    joint = np.zeros((n, 6, 6))
    nth = np.arange(len(tree.coordinate_body)) - tree.first[tree.coordinate_body]
    joint[tree.coordinate_body, :, nth] = tree.motion
    inertia_rows, largest = rows @ joint[others], (np.abs(rows) @ np.abs(joint[others])).max(axis=1, keepdims=True)
    inertia_rows = np.divide(inertia_rows, largest, out=np.zeros_like(inertia_rows), where=largest > 0.0)
    unused = np.arange(6) >= tree.count[others, None]  # columns that the joint does not have
    inertia_rows = np.concatenate((inertia_rows, np.eye(6) * unused[:, None]), axis=1)
    resists_joint = np.zeros(n, dtype=bool)
    resists_joint[others] = np.linalg.svd(inertia_rows, compute_uv=False)[:, -1] > CERTAIN_INERTIA
    result, parent = [*at_rest.tolist(), True], tree.parent.tolist()
    for body in tree.outward.tolist():
        result[body] = result[body] or bool(resists_joint[body] and result[parent[body]])
    return np.array(result[:n], dtype=bool)


def _smallest(rows: Array) -> Array:
    """The smallest singular value (n,) of square matrices (n, k, k) with rows scaled to unit length."""
    size = np.sqrt((rows**2).sum(axis=2, keepdims=True))
    unit = np.divide(rows, size, out=np.zeros_like(rows), where=size > 0.0)
    return np.asarray(np.linalg.svd(unit, compute_uv=False)[:, -1])


def _nodes_with_mass(tree: Tree, shared: Shared | None) -> Bools:
    """Nodes of beams and superelements whose shared mass resists all of their motions."""
    n = len(tree.parent)
    result = np.zeros(n + 1, dtype=bool)
    if shared is None or shared.mass is None:
        return result[:n]
    rows = shared.mass.rows
    moves = np.concatenate((tree.moves, np.zeros((1, 6), dtype=bool)))
    for index, matrices in shared.mass.blocks:
        body, free = rows.second[index], moves[rows.second[index], index % 6]
        grounded = (rows.first[index] == n).all(axis=1)
        known: dict[tuple[bytes, bytes], bool] = {}
        for nodes, matrix, used, on_ground in zip(body, matrices, free, grounded.tolist(), strict=True):
            key = (matrix.tobytes(), used.tobytes())
            if key not in known:
                part = matrix[:, used]
                part = part / np.maximum(np.abs(part).max(axis=0, initial=0.0), TINY)
                sizes = np.linalg.svd(part, compute_uv=False)
                known[key] = int(np.count_nonzero(sizes > CERTAIN_INERTIA)) == part.shape[1]
            result[nodes[used]] |= on_ground and known[key]
    return result[:n]


def _by_parts(
    tree: Tree, layout: Layout, movable: Bools, factor: csr_matrix, loops: csr_matrix
) -> Motions | None:
    """The motions of light bodies, part by part; the unknowns are their displacements and all coordinates at them."""
    joint_rows = kinematics(tree, layout)
    near = movable | np.concatenate((movable, [False]))[tree.parent]
    inward = np.argsort(tree.depth[:-1], kind="stable")
    moving, at_rest = (layout.displacement[inward[mask[inward]]] for mask in (movable, near & ~movable))
    moving, at_rest = moving[moving >= 0], at_rest[at_rest >= 0]
    coordinate = np.flatnonzero(near[tree.coordinate_body])
    column = np.concatenate((moving, layout.coordinate[coordinate]))
    rows = vstack((joint_rows[moving], joint_rows[at_rest], factor, loops)).tocsr()
    turns = np.zeros(layout.size, dtype=bool)
    turns[layout.displacement[:, 3:][layout.displacement[:, 3:] >= 0]] = True
    turns[layout.coordinate[tree.turns]] = True
    size = np.stack([np.asarray(abs(rows) @ kind.astype(float)) for kind in (~turns, turns)])
    entries = rows.tocsc()[:, column].tocoo()
    body = np.zeros(layout.size, dtype=np.intp)
    body[layout.displacement[layout.displacement >= 0]] = np.nonzero(layout.displacement >= 0)[0]
    body[layout.coordinate] = tree.coordinate_body
    points = tree.position[body[column]]
    points[len(moving) :] = tree.point[:, coordinate].T
    shapes: list[tuple[Index, Index, Array]] = []
    own_coordinate: list[Index] = []
    kept_pivot, dropped_pivot, count, length = 1.0, 0.0, 0, tree.length
    for row, columns, block in _connected(entries.row, entries.col, entries.data, rows.shape[0], len(column)):
        displacements = int(np.searchsorted(columns, len(moving)))
        part = _Part(block, displacements, size[:, row], turns[column[columns]], points[columns], length)
        numbers = coordinate[columns[displacements:] - len(moving)]
        motions, smallest, largest, first = part.null(tuple([tree.names[k] for k in numbers.tolist()]))
        kept_pivot, dropped_pivot = min(kept_pivot, smallest), max(dropped_pivot, largest)
        at, which = np.nonzero(motions)
        shapes.append((column[columns[at]], count + which, motions[at, which]))
        own_coordinate.append(numbers[first])
        count += motions.shape[1]
    if not count:
        return None
    unknown, number, value = (np.concatenate([shape[i] for shape in shapes]) for i in range(3))
    matrix = csc_matrix((value, (unknown, number)), shape=(layout.size, count))
    return Motions(matrix, np.concatenate(own_coordinate), kept_pivot, dropped_pivot)


def _connected(
    row: Index, column: Index, value: Array, rows: int, columns: int
) -> Iterator[tuple[Index, Index, Array]]:
    """Rows, columns (ascending) and dense block of each connected part of a sparse matrix."""
    row_part, column_part = connected_parts(row, column, (rows, columns))
    ranges = []
    for part in (row_part[row], row_part, column_part):
        order = np.argsort(part, kind="stable")
        ranges.append((order, np.searchsorted(part[order], np.arange(rows + columns + 1))))
    for k in np.unique(column_part).tolist():
        entry, part_rows, part_columns = (order[begin[k] : begin[k + 1]] for order, begin in ranges)
        block = np.zeros((len(part_rows), len(part_columns)))
        block[np.searchsorted(part_rows, row[entry]), np.searchsorted(part_columns, column[entry])] = value[entry]
        yield part_rows, part_columns, block


@dataclass(frozen=True, slots=True)
class _Part:
    """One part: its equations ``block`` (rows, unknowns), of which the first ``displacements`` are those of these.

    ``size`` (2, rows) is the size of each row's terms in translations and rotations, ``turns`` is the mask of rotations
    among the unknowns, ``points`` [m] are their points and ``length`` [m] is the typical length of the scene.
    """

    block: Array
    displacements: int
    size: Array
    turns: Bools
    points: Array
    length: float

    def null(self, names: tuple[str, ...]) -> tuple[Array, float, float, Index]:
        """Return motions (unknowns, n), smallest nonzero and largest zero pivot, and a coordinate of each motion."""
        d, n = self.displacements, len(names)
        per_coordinate = solve_triangular(self.block[:d, :d], -self.block[:d, d:], lower=True, unit_diagonal=True,
                                          check_finite=False)  # fmt: skip
        length = float(np.ptp(self.points, axis=0).max()) or self.length
        unit = np.where(self.turns, 1.0 / length, 1.0)
        noise = RANK_FACTOR * EPS * max(1, n) * max(1.0, float(np.abs(self.points).max()) / length)
        null, smallest, largest = np.eye(n), 1.0, 0.0
        if len(self.block) > d:
            constraints = self.block[d:]
            rows = constraints[:, :d] @ per_coordinate + constraints[:, d:]
            terms = np.abs(constraints[:, :d]) @ np.abs(per_coordinate) + np.abs(constraints[:, d:])
            rows[np.abs(rows) <= ZERO_SUM * terms] = 0.0
            scale = 1.0 / (self.size[0, d:] + self.size[1, d:] / length)
            null, smallest, largest = null_space(rows * scale[:, None], (terms * scale[:, None]).max(axis=0), noise)
        coordinate = independent_coordinates(null)[0]
        null = without_rounding(null, unit[d:], noise)
        if null.shape[1]:
            check_gap(null[:, 0], unit[d:], names, smallest, largest)
        displacements = per_coordinate @ null
        displacements[np.abs(displacements) <= noise * unit[:d, None]] = 0.0
        return np.concatenate((displacements, null)), smallest, largest, coordinate
