"""Constraints: which of the rows that cut joints lock are independent, loop by loop.

Redundant rows are legal (planar loops in space have three each) but their multipliers are not determined, so the
tableau contains independent rows only. Loops that share a coordinate form a group. The rank of a small group is decided
by the dense path's pivoted QR on the coordinates of the group. In a large group, rows that are redundant within one
loop are removed first. For the remaining rows S, scaled, the pivots of S S^T + delta are the squared distances of each
row from the rows before it. By these most rows are certainly independent; the others are projected on the complement of
the certain ones, and a pivoted QR decides.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.tables import listed
from mbsvib.elements.rows import Rows
from mbsvib.equations.scene import cut_rows
from mbsvib.errors import SingularPoseError
from mbsvib.kinematics.loop_group import LoopGroup, decided, measures
from mbsvib.kinematics.relative_motion import arm
from mbsvib.linalg.groups import by_label, connected_parts, items_of_groups
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import (
    CERTAIN_DISTANCE,
    DEPENDENT_DISTANCE,
    NEAR_SINGULAR,
    RANK_FACTOR,
    RANK_GAP,
    REGULARISATION,
    TIE_BREAK,
)
from mbsvib.sparse.couplers import locked_entries, row_scale
from mbsvib.sparse.rows import relative_rows

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray
    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Body
    from mbsvib.mechanism.topology import Topology
    from mbsvib.sparse.couplers import Coupled
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.tree import Tree

    Mask = NDArray[np.bool_]
    Rod = tuple[int, int, int, int, Array, Array]

# Groups up to this many entries (rows times coordinates) are decided by one dense QR: 0.1 s.
MOST_DENSE_ENTRIES = 250_000


@dataclass(frozen=True, slots=True)
class Constraints:
    """Locked ``rows`` of the cut joints with their ``names`` and the number ``loop`` of the cut joint.

    ``is_independent`` is the mask of independent rows, ``groups`` are those of coupled loops. ``crossing`` are locked
    rotations normal to an axis of each body (row, axis in first, axis in second), ``rods`` those of distance joints,
    cut or in the tree (row or -1, coordinate or -1, first, second, start, end). ``path_joints`` are pairs of an
    independent row, numbered among these, and the outer body of a joint on its path. In ``names``, ``loop``,
    ``is_independent`` and ``groups`` one entry for each coupler follows those of the rows.
    """

    rows: Rows
    names: tuple[str, ...]
    loop: Index
    is_independent: Mask
    groups: tuple[LoopGroup, ...]
    crossing: tuple[tuple[int, tuple[float, ...], tuple[float, ...]], ...]
    rods: tuple[Rod, ...]
    path_joints: tuple[Index, Index]
    couplers: Coupled | None = None

    @property
    def independent(self) -> Rows:
        """The rows of cut joints that the tableau contains."""
        return self.rows.take(np.flatnonzero(self.is_independent[: len(self.rows.first)]))

    @property
    def translational(self) -> Mask:
        """Mask of the independent rows that lock translations, so that their multipliers are forces."""
        of_rows = np.asarray(self.independent.force.any(axis=0), dtype=bool)
        if self.couplers is None:
            return of_rows
        return np.concatenate((of_rows, self.couplers.translational[self.is_independent[len(self.rows.first) :]]))

    def entries(self, tree: Tree) -> Entries:
        """Return the entries of all rows over the joint coordinates."""
        return Entries(*locked_entries(tree, self.rows, self.couplers), self.loop, len(self.names))

    def independent_entries(self, tree: Tree) -> tuple[Index, Index, Array]:
        """Return row (numbered among the independent rows), coordinate and value of their entries."""
        row, column, value = locked_entries(tree, self.rows, self.couplers)
        used = self.is_independent[row]
        return (np.cumsum(self.is_independent) - 1)[row[used]], column[used], value[used]

    def over_unknowns(self, tree: Tree, layout: Layout) -> csr_matrix:
        """Return the independent rows over the unknowns of the tableau."""
        rows = relative_rows(tree, layout, self.independent)
        if self.couplers is None:
            return rows
        from scipy.sparse import vstack

        couplers = np.flatnonzero(self.is_independent[len(self.rows.first) :])
        return vstack((rows, self.couplers.rows(tree, layout)[couplers])).tocsr()


def constraints(
    topology: Topology, bodies: list[Body], number: Mapping[str, int], tree: Tree, couplers: Coupled | None = None
) -> Constraints:
    """Return the locked rows of the cut joints and which of them are independent; refused if a rank is in doubt."""
    cuts = cut_rows(topology, bodies, number)
    rows = Rows.stack([]) if cuts is None else cuts.rows
    names: list[str] = [] if cuts is None else [*cuts.names]
    loop: list[int] = [] if cuts is None else cuts.joint.tolist()
    row_of = {name: i for i, name in enumerate(names)}
    crossing = []
    for joint in [topology.joints[k] for k in topology.cut]:
        if joint.successive:
            rotation = next(direction for direction, six in joint.locked if any(six[3:]))
            (_, first_twist), (_, second_twist) = joint.freedom[-2:]
            crossing.append((row_of[f"{joint.name}.{rotation}"], first_twist[3:], second_twist[3:]))
    cut = [topology.joints[k].name for k in topology.cut]
    rods = _rods(topology, number, tree, names)
    if couplers is not None:
        loop += range(len(cut), len(cut) + len(couplers.names))
        names += couplers.names
        cut += couplers.names
    entries = Entries(*locked_entries(tree, rows, couplers), np.array(loop, dtype=np.intp), len(names))
    decision = _Decision(topology, tree, rows, couplers, names, cut, entries)
    decisions = [decision.of(members) for members in entries.groups()]
    independent = np.ones(len(names), dtype=bool)
    for _, redundant in decisions:
        independent[redundant] = False
    number_of = np.cumsum(independent) - 1
    used = independent[entries.row]
    path_joints = number_of[entries.row[used]], tree.coordinate_body[entries.column[used]]
    groups = tuple([group for group, _ in decisions])
    return Constraints(rows, tuple(names), entries.loop, independent, groups, tuple(crossing), rods, path_joints,
                       couplers)  # fmt: skip


def _rods(topology: Topology, number: Mapping[str, int], tree: Tree, names: list[str]) -> tuple[Rod, ...]:
    rods = [joint for joint in topology.joints if joint.is_rod]
    if not rods:
        return ()
    row = {name: i for i, name in enumerate(names)}
    column = {name: i for i, name in enumerate(tree.names)}
    return tuple((row.get(f"{joint.name}.z", -1), column.get(f"{joint.name}.x", -1), number[joint.first],
                  number[joint.second], np.array(joint.position), np.array(joint.end)) for joint in rods)  # fmt: skip


class Entries:
    """Entries of Phi by row, coordinate and value, and the loop of every row."""

    def __init__(self, row: Index, column: Index, value: Array, loop: Index, rows: int) -> None:
        self.row, self.column, self.value, self.loop = row, column, value, loop
        self.begin = np.searchsorted(row, np.arange(rows + 1))

    def groups(self) -> list[Index]:
        """Rows of loops that share a coordinate."""
        if not len(self.loop):
            return []
        shape = int(self.loop.max()) + 1, int(self.column.max(initial=-1)) + 1
        parts = by_label(connected_parts(self.loop[self.row], self.column, shape)[0][self.loop])
        return sorted(parts, key=lambda part: int(part[0]))

    def of(self, rows: Index) -> tuple[Index, Index, Array]:
        """Return the entries of some rows, numbered among these."""
        counts = self.begin[rows + 1] - self.begin[rows]
        row, nth = items_of_groups(counts)
        entry = self.begin[rows][row] + nth
        return row, self.column[entry], self.value[entry]

    def dense(self, rows: Index) -> tuple[Index, Array]:
        """Return the coordinates (n,) that some rows contain, and the rows over these, (rows, n)."""
        row, column, value = self.of(rows)
        columns, local_column = np.unique(column, return_inverse=True)
        result = np.zeros((len(rows), len(columns)))
        result[row, local_column] = value
        return columns, result


@dataclass(frozen=True, slots=True)
class _Decision:
    """What the rank of locked ``rows`` and couplers depends on, with the ``names`` of both and of the ``cut`` loops."""

    topology: Topology
    tree: Tree
    rows: Rows
    couplers: Coupled | None
    names: list[str]
    cut: list[str]
    entries: Entries

    def of(self, members: Index) -> tuple[LoopGroup, list[int]]:
        """Return the decision for the rows of one group of loops, and the redundant ones."""
        columns = np.unique(self.entries.of(members)[1])
        loop = self.entries.loop[members]
        loops = np.unique(loop)
        if len(loops) == 1 or len(members) * len(columns) <= MOST_DENSE_ENTRIES:
            return self._dense(members)
        parts, redundant_rows = zip(*[self._dense(members[loop == k]) for k in loops], strict=True)
        redundant = [row for part in redundant_rows for row in part]
        remaining = np.setdiff1d(members, redundant)
        noise = max(part.noise for part in parts)
        limit = max(DEPENDENT_DISTANCE, RANK_FACTOR * noise)
        dependent, smallest_kept, dropped = _dependent(self._unit_rows(remaining, columns), limit)
        joints = tuple(name for part in parts for name in part.joints)
        _check_gap(joints, smallest_kept, dropped)
        redundant = sorted([*redundant, *remaining[dependent].tolist()])
        return LoopGroup(
            joints, members, columns, len(members) - len(redundant), smallest_kept,
            max([dropped, *(part.dropped for part in parts)]), max(part.length for part in parts), noise,
            partial(tuple, [self.names[row] for row in redundant]),
        ), redundant  # fmt: skip

    def _dense(self, members: Index, reach: float = 0.0) -> tuple[LoopGroup, list[int]]:
        """The dense path's rank decision for some rows, in the coordinates that they contain."""
        tree, count = self.tree, len(members)
        columns, phi = self.entries.dense(members)
        of_joints = members[members < len(self.rows.first)]
        points = np.concatenate((self.rows.point[:, of_joints], tree.point[:, columns]), axis=1)
        length, noise = measures(points, max(phi.shape), tree.pitch, reach)
        scale = np.where(tree.turns[columns], 1.0, length)
        scale *= 1.0 - TIE_BREAK / max(1, len(columns)) * np.arange(len(columns))
        a = phi * row_scale(self.rows, self.couplers, members, length)[:, None] * scale
        rank, smallest_kept, dropped, limit = decided(pivoted_qr(a)[0].diagonal().tolist(), noise)
        joints = tuple(self.cut[k] for k in dict.fromkeys(self.entries.loop[members].tolist()))
        if not reach and (smallest_kept < NEAR_SINGULAR or limit > NEAR_SINGULAR):
            names = [*joints, *(tree.names[k].rpartition(".")[0] for k in columns.tolist())]
            reach = arm(self.topology, tree.position, names)
            if reach:
                return self._dense(members, reach)
        redundant: list[int] = []
        if rank < count:
            weight = 1.0 - TIE_BREAK * np.arange(count) / count
            redundant = members[np.sort(pivoted_qr((a * weight[:, None]).T)[1][rank:])].tolist()
        _check_gap(joints, smallest_kept, dropped)
        implied = partial(tuple, [self.names[row] for row in redundant])
        return LoopGroup(joints, members, columns, rank, smallest_kept, dropped, length, noise, implied), redundant

    def _unit_rows(self, rows: Index, columns: Index) -> csr_matrix:
        """Some rows of Phi with lengths in links, scaled to unit length."""
        from scipy.sparse import csr_matrix

        row, column, value = self.entries.of(rows)
        length = self.tree.length
        value = value * np.where(self.tree.turns[column], 1.0, length)
        value *= row_scale(self.rows, self.couplers, rows, length)[row]
        norm = np.sqrt(np.bincount(row, value * value, minlength=len(rows)))
        return csr_matrix((value / norm[row], (row, np.searchsorted(columns, column))), shape=(len(rows), len(columns)))


def _check_gap(joints: Sequence[str], smallest_kept: float, dropped: float) -> None:
    if dropped * RANK_GAP > smallest_kept:
        raise SingularPoseError(
            f"loops closed by {listed(joints)}: constraint pivots {smallest_kept:.1e} (kept) and {dropped:.1e} "
            f"(dropped) are too close to tell how many constraints are independent. Move the pose away from the "
            f"singular one, or give the geometry with all its digits."
        )


def _dependent(s: csr_matrix, limit: float) -> tuple[Index, float, float]:
    """Rows no farther than ``limit`` from the span of the others; the smallest distance of an independent row, and the
    largest of a dependent one.
    """
    distance, _ = _distances(s)
    is_certain = distance > CERTAIN_DISTANCE
    smallest_kept = float(np.sqrt(distance[is_certain].min(initial=1.0)))
    if is_certain.all():
        return np.zeros(0, dtype=np.intp), smallest_kept, 0.0
    while True:
        distance, lu = _distances(s[is_certain])
        close = distance < 0.5 * CERTAIN_DISTANCE
        if not close.any():
            break
        is_certain[np.flatnonzero(is_certain)[close]] = False
    certain, rest = s[is_certain], s[~is_certain].toarray().T
    for _ in range(3):  # each pass reduces the errors of the previous one by rounding and the condition of S S^T
        rest = rest - certain.T @ lu.solve(certain @ rest)
    qr, order, _ = pivoted_qr(rest)
    pivots = np.abs(qr.diagonal())
    rank = int(np.count_nonzero(pivots > limit))
    dependent = np.sort(np.flatnonzero(~is_certain)[order[rank:]])
    return dependent, min([smallest_kept, *pivots[:rank].tolist()]), float(pivots[rank:].max(initial=0.0))


def _distances(s: csr_matrix) -> tuple[Array, Any]:
    """Squared distance of every row from the span of those before it in the order of elimination, and the factors."""
    from scipy.sparse import eye
    from scipy.sparse.linalg import splu

    lu = splu((s @ s.T + REGULARISATION * eye(s.shape[0])).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
              options={"SymmetricMode": True})  # fmt: skip
    return np.abs(lu.U.diagonal())[lu.perm_c], lu
