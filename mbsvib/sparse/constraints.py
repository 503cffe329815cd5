"""Constraints: which of the rows that cut joints lock are independent, loop by loop.

Redundant rows are legal (planar loops in space have three each) but their multipliers are not determined, so the
tableau holds independent rows only. Loops that share a coordinate form a group. A small group is decided by the dense
path's own pivoted QR on the group's own coordinates. In a large one each loop is first freed of what is redundant in
itself; what is left is decided by the pivots of S S^T + delta, S the scaled rows, which are squared distances of a row
from those before it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import SingularPoseError
from mbsvib.kinematics import Rows, Twists
from mbsvib.loops import Cuts, LoopGroup, reduce
from mbsvib.sparse.rows import path_entries

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from mbsvib.kinematics import Array, Index
    from mbsvib.parts import Body
    from mbsvib.sparse.tree import Tree
    from mbsvib.topology import Topology

    Mask = NDArray[np.bool_]

# Groups up to this many entries (rows times coordinates) are decided whole by a dense QR: 0.1 s.
WHOLE = 250_000
# Regularisation of S S^T: far above the rounding of its entries, far below the square of a distance that counts.
DELTA = 1e-13
# Squared distances below DEPENDENT are redundant rows, above CERTAIN independent ones; between them rank is in doubt.
DEPENDENT, CERTAIN = 1e-11, 1e-9


@dataclass(frozen=True, slots=True)
class Constraints:
    """Locked rows of the cut joints: all ``rows`` with their ``names`` and the number of the cut joint
    (``loop``), the mask ``kept`` of the independent ones,
    ``groups`` of loops, and ``touched``, the row and body of every joint on the path of a kept row (rows counted among
    the kept ones).
    """

    rows: Rows
    names: tuple[str, ...]
    loop: Index
    kept: Mask
    groups: tuple[LoopGroup, ...]
    touched: tuple[Index, Index]

    @property
    def independent(self) -> Rows:
        """The rows that the tableau holds."""
        return Rows(*(getattr(self.rows, key)[..., self.kept] for key in Rows.__slots__))


def constraints(topology: Topology, bodies: list[Body], number: Mapping[str, int], tree: Tree) -> Constraints:
    """Return the locked rows of the cut joints and which of them are independent.

    Parameters
    ----------
    topology : Topology
        The spanning tree and the cut joints.
    bodies : list of Body
        The bodies in order.
    number : mapping
        Number of each body, ground included.
    tree : Tree
        The tree's arrays.

    Returns
    -------
    Constraints
        Rows and rank decisions.

    Raises
    ------
    SingularPoseError
        If the rank of a group is in doubt.
    """
    tuples: list[tuple[float, ...]] = []
    names: list[str] = []
    loop: list[int] = []
    for count, k in enumerate(topology.cut):
        joint = topology.joints[k]
        a, b = number[joint.first], number[joint.second]
        point = joint.position or bodies[min(a, b)].position
        for direction, six in joint.locked:
            tuples.append((a, b, *point, *six))
            names.append(f"{joint.name}.{direction}")
            loop.append(count)
    rows = Rows.stack(tuples)
    entries = Entries(*path_entries(tree, rows, None)[:3], np.array(loop, dtype=np.intp), len(names))
    cut = [topology.joints[k].name for k in topology.cut]
    kept = np.ones(len(names), dtype=bool)
    found: list[LoopGroup] = []
    for members in entries.groups():
        group = _decide(tree, rows, names, cut, entries, members)
        found.append(group)
        redundant = set(group.redundant)
        kept[[row for row in group.rows.tolist() if names[row] in redundant]] = False
    place = np.cumsum(kept) - 1
    used = kept[entries.row]
    return Constraints(rows, tuple(names), entries.loop, kept, tuple(found),
                       (place[entries.row[used]], tree.carried[entries.column[used]]))  # fmt: skip


class Entries:
    """Entries of Phi by row, coordinate and value, and the loop of every row."""

    def __init__(self, row: Index, column: Index, value: Array, loop: Index, rows: int) -> None:
        self.row, self.column, self.value, self.loop = row, column, value, loop
        self.begin = np.searchsorted(row, np.arange(rows + 1))

    def groups(self) -> list[Index]:
        """Rows of loops that share a coordinate."""
        from scipy.sparse import csr_matrix
        from scipy.sparse.csgraph import connected_components

        if not len(self.loop):
            return []
        loops, columns = int(self.loop.max()) + 1, int(self.column.max(initial=-1)) + 1
        ends = (self.loop[self.row], loops + self.column)
        graph = csr_matrix((np.ones(len(self.row), dtype=bool), ends), shape=(loops + columns, loops + columns))
        label = connected_components(graph, directed=False)[1][self.loop]
        order = np.argsort(label, kind="stable")
        parts = np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
        return sorted(parts, key=lambda part: int(part[0]))

    def of(self, rows: Index) -> tuple[Index, Index, Array]:
        """Return the entries of some rows, numbered among these."""
        counts = self.begin[rows + 1] - self.begin[rows]
        here = np.repeat(np.arange(len(rows)), counts)
        at = np.arange(len(here)) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(self.begin[rows], counts)
        return here, self.column[at], self.value[at]


def _decide(
    tree: Tree, rows: Rows, names: list[str], cut: list[str], entries: Entries, members: Index
) -> LoopGroup:
    columns = np.unique(entries.of(members)[1])
    if len(members) * len(columns) <= WHOLE:
        return _whole(tree, rows, names, cut, entries, members)
    loops = entries.loop[members]
    parts = [_whole(tree, rows, names, cut, entries, members[loops == k]) for k in np.unique(loops)]
    gone = {name for part in parts for name in part.redundant}
    left = np.array([row for row in members.tolist() if names[row] not in gone], dtype=np.intp)
    distance = _distances(tree, rows, entries, left, columns)
    _check_doubt(distance, [names[row] for row in left], parts)
    more = [names[left[k]] for k in np.flatnonzero(distance < DEPENDENT)]
    certain = distance[distance >= DEPENDENT]
    dropped = np.sqrt(distance[distance < DEPENDENT].max(initial=0.0))
    redundant = gone.union(more)
    return LoopGroup(
        tuple(name for part in parts for name in part.joints), members, columns, len(certain),
        float(np.sqrt(certain.min(initial=1.0))), max([float(dropped), *(part.dropped for part in parts)]),
        max(part.length for part in parts), tuple(names[row] for row in members if names[row] in redundant),
    )  # fmt: skip


def _whole(tree: Tree, rows: Rows, names: list[str], cut: list[str], entries: Entries, members: Index) -> LoopGroup:
    """The dense path's decision on some rows alone, in their own coordinates."""
    row, column, value = entries.of(members)
    columns, place = np.unique(column, return_inverse=True)
    phi = np.zeros((len(members), len(columns)))
    phi[row, place] = value
    loops, joint = np.unique(entries.loop[members], return_inverse=True)
    # one path that holds everything makes one group
    path = np.ones((2, len(columns)), dtype=np.int8)
    path[0] = 0
    twists = Twists(tuple(tree.names[k] for k in columns), tree.linear[:, columns], tree.angular[:, columns],
                    tree.point[:, columns], path, tree.turns[columns])  # fmt: skip
    here = Rows(np.zeros(len(members), dtype=np.intp), np.ones(len(members), dtype=np.intp), rows.point[:, members],
                rows.force[:, members], rows.moment[:, members])  # fmt: skip
    start = np.searchsorted(joint, np.arange(len(loops)))
    cuts = Cuts(here, tuple(names[k] for k in members), joint, tuple(cut[k] for k in loops), start,
                np.asarray(here.force.any(axis=0)))  # fmt: skip
    group = reduce(twists, cuts, phi).groups[0]
    return LoopGroup(group.joints, members, columns, group.rank, group.kept, group.dropped, group.length,
                     group.redundant)  # fmt: skip


def _distances(tree: Tree, rows: Rows, entries: Entries, left: Index, columns: Index) -> Array:
    """Squared distance of every row from the span of those before it in the order of elimination."""
    from scipy.sparse import csr_matrix, eye
    from scipy.sparse.linalg import splu

    row, column, value = entries.of(left)
    length = tree.length
    value = value * np.where(tree.turns[column], 1.0, length)
    value /= np.where(rows.force[:, left].any(axis=0), length, 1.0)[row]
    norm = np.sqrt(np.bincount(row, value * value, minlength=len(left)))
    s = csr_matrix((value / norm[row], (row, np.searchsorted(columns, column))), shape=(len(left), len(columns)))
    lu = splu((s @ s.T + DELTA * eye(len(left))).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
              options={"SymmetricMode": True})  # fmt: skip
    result = np.empty(len(left))
    result[np.argsort(lu.perm_c)] = np.abs(lu.U.diagonal())
    return result


def _check_doubt(distance: Array, names: list[str], parts: list[LoopGroup]) -> None:
    doubt = np.flatnonzero((distance >= DEPENDENT) & (distance < CERTAIN))
    if len(doubt):
        raise SingularPoseError(
            f"loops closed by {', '.join(part.joints[0] for part in parts[:8])}, ...: row {names[doubt[0]]} is at a "
            f"distance of {np.sqrt(distance[doubt[0]]):.1e} from depending on the others, too close to tell whether it "
            f"does. Move the pose away from the singular one, or give the geometry with all its digits."
        )
