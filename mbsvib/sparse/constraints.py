"""Constraints: which of the rows that cut joints and couplers lock are independent, loop by loop.

Redundant rows are legal (planar loops in space have three each) but their multipliers are not determined, so the
tableau contains independent rows only. Loops that share a coordinate form a group. The rank of a small group is decided
by the dense path's pivoted QR on the coordinates of the group. In a large group, rows that are redundant within one
loop are removed first. For the remaining rows S, scaled, the pivots of S S^T + delta are the squared distances of each
row from the rows before it. By these most rows are certainly independent; the others are projected on the complement of
the certain ones, and a pivoted QR decides.

The coordinate of a joint in the tree that a coupler relates is an unknown of the tableau; that of a cut joint is the
relative motion of its bodies. Each coupler is a loop of its own, with one multiplier.

Redundant constraints must be redundant in neighbouring poses too: the mechanism moves a little along all its freedoms,
and the rank of every group of loops with redundant rows is determined again, of large groups loop by loop.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags, eye, vstack
from scipy.sparse.linalg import splu

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.elements import Body
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.rows import Rows
from mbsvib.equations.scene import cut_rows
from mbsvib.kinematics.couplers import appended, terms
from mbsvib.kinematics.couplings import Couplings
from mbsvib.kinematics.loops import Cuts, LoopGroup, check_gap, decided, measures, preference, redundant_members
from mbsvib.kinematics.mobility import jump, rank_nearby, rows_nearby
from mbsvib.kinematics.relative_motion import Twists, arm
from mbsvib.linalg.groups import by_label, connected_parts, items_of_groups
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import (
    CERTAIN_DISTANCE,
    DEPENDENT_DISTANCE,
    NEAR_SINGULAR,
    NEIGHBOUR_PIVOT,
    NEIGHBOUR_STEP,
    RANK_FACTOR,
    REGULARISATION,
)
from mbsvib.mechanism.topology import Topology
from mbsvib.sparse.layout import Layout, VirtualUnknowns, path_entries, relative_rows
from mbsvib.sparse.tableau import Tableau
from mbsvib.sparse.tree import Tree

Entry = tuple[Index, Index, Array]


# Groups up to this many entries (rows times coordinates) are decided by one dense QR: 0.1 s.
MOST_DENSE_ENTRIES = 250_000


@dataclass(frozen=True, slots=True)
class Constraints:
    """Locked rows of cut joints and couplers, ``cuts``.

    ``is_independent`` is the mask of independent rows, ``groups`` are those of coupled loops. ``path_joints`` are pairs
    of an independent row, numbered among these, and the outer body of a joint on its path. ``joint`` (rows,) are the
    numbers of the joints that lock the rows.
    """

    cuts: Cuts
    is_independent: Bools
    groups: tuple[LoopGroup, ...]
    path_joints: tuple[Index, Index]
    joint: Index

    @property
    def rows(self) -> Rows:
        """The locked rows of cut joints."""
        return self.cuts.rows

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the locked rows and of the couplers."""
        return self.cuts.names

    @property
    def loop(self) -> Index:
        """Number of the loop of each row: cut joints, then couplers."""
        return self.cuts.joint

    @property
    def independent(self) -> Rows:
        """The rows of cut joints that the tableau contains."""
        return self.rows.take(np.flatnonzero(self.is_independent[: len(self.rows.first)]))

    @property
    def translational(self) -> Bools:
        """Mask of the independent rows that lock translations, so that their multipliers are forces."""
        result = self.cuts.translates.copy()
        if self.cuts.couplings is not None:
            result[len(self.rows.first) :] = self.cuts.couplings.largest[1] > 0.0
        return np.asarray(result[self.is_independent])

    def entries(self, tree: Tree) -> Entries:
        """Return the entries of all rows over the joint coordinates."""
        return Entries(*_locked_entries(tree, self.cuts), self.loop, len(self.names))

    def independent_entries(self, tree: Tree) -> tuple[Index, Index, Array]:
        """Return row (numbered among the independent rows), coordinate and value of their entries."""
        row, column, value = _locked_entries(tree, self.cuts)
        used = self.is_independent[row]
        return (np.cumsum(self.is_independent) - 1)[row[used]], column[used], value[used]

    def over_unknowns(self, tree: Tree, layout: Layout, virtual: VirtualUnknowns | None = None) -> csr_matrix:
        """Return the independent rows over the unknowns of the tableau, or over these and virtual motions."""
        def moved(rows: Rows, joint: Index) -> csr_matrix:
            if virtual is None:
                return relative_rows(tree, layout, rows)
            return virtual.opened(relative_rows(virtual.tree, virtual.layout, rows), rows, joint)

        count, couplings = len(self.rows.first), self.cuts.couplings
        rows = moved(self.independent, self.joint[self.is_independent[:count]])
        if couplings is None:
            return rows
        measured = moved(couplings.measured, couplings.owner)
        couplers = np.flatnonzero(self.is_independent[count:])
        return vstack((rows, _coupler_rows(tree, layout, couplings, measured)[couplers])).tocsr()


def constraints(
    topology: Topology, bodies: list[Body], number: Mapping[str, int], tree: Tree, couplers: Sequence[Coupling] = ()
) -> Constraints:
    """Return the locked rows of the cut joints and which of them are independent; refused if a rank is in doubt."""
    cuts = appended(cut_rows(topology, bodies, number), tuple(part.name for part in couplers),
                    terms(couplers, tree.names, topology, bodies, number) if couplers else None)  # fmt: skip
    entries = Entries(*_locked_entries(tree, cuts), cuts.joint, len(cuts.names))
    decision = _Decision(topology, tree, cuts, entries)
    decisions = [decision.of(members) for members in entries.groups()]
    independent = np.ones(len(cuts.names), dtype=bool)
    for _, redundant in decisions:
        independent[redundant] = False
    number_of = np.cumsum(independent) - 1
    used = independent[entries.row]
    path_joints = number_of[entries.row[used]], tree.coordinate_body[entries.column[used]]
    joint = np.array(topology.cut, dtype=np.intp)[cuts.joint[: len(cuts.rows.first)]]
    return Constraints(cuts, independent, tuple([group for group, _ in decisions]), path_joints, joint)


def _locked_entries(tree: Tree, cuts: Cuts) -> Entry:
    """Row (ascending), joint coordinate and value of all entries of locked rows and, after them, of couplers."""
    row, column, value, _ = path_entries(tree, cuts.rows, None)
    couplings = cuts.couplings
    if couplings is None:
        return row, column, value
    coupler, coefficient = couplings.of_measured
    inside = np.flatnonzero(couplings.column >= 0)
    at, column_of, value_of, _ = path_entries(tree, couplings.measured, None)
    rows = np.concatenate((couplings.row[inside], coupler[at]))
    columns = np.concatenate((couplings.column[inside], column_of))
    values = np.concatenate((couplings.value[inside], coefficient[at] * value_of))
    shape = len(cuts.names) - len(cuts.rows.first), len(tree.names)
    total = coo_matrix((values, (rows, columns)), shape=shape).tocsr().tocoo()
    return (np.concatenate((row, len(cuts.rows.first) + total.row.astype(np.intp))),
            np.concatenate((column, total.col.astype(np.intp))), np.concatenate((value, total.data)))  # fmt: skip


def _coupler_rows(tree: Tree, layout: Layout, couplings: Couplings, measured: csr_matrix) -> csr_matrix:
    """Rows of couplers over the unknowns of ``measured`` (coordinates of cut joints, size), scaled to order one."""
    coupler, coefficient = couplings.of_measured
    count, inside = len(couplings.touched), np.flatnonzero(couplings.column >= 0)
    at = (couplings.row[inside], layout.coordinate[couplings.column[inside]])
    of_tree = csr_matrix((couplings.value[inside], at), shape=(count, measured.shape[1]))
    coefficients = csr_matrix((coefficient, (coupler, np.arange(len(coupler)))), shape=(count, len(coupler)))
    total = of_tree + coefficients @ measured
    unit = 2.0 ** np.round(np.log2(couplings.row_scale(tree.length)))
    unit[couplings.largest[1] > 0.0] *= tree.length  # the scale of the multiplier divides by it
    return (diags(unit) @ total).tocsr()


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
    """What the rank of locked rows and couplers depends on."""

    topology: Topology
    tree: Tree
    cuts: Cuts
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
        redundant = sorted([*redundant, *remaining[dependent].tolist()])
        group = LoopGroup(
            tuple(name for part in parts for name in part.joints), members, columns, len(members) - len(redundant),
            smallest_kept, max([dropped, *(part.dropped for part in parts)]), max(part.length for part in parts), noise,
            partial(_names, self.cuts.names, redundant),
        )  # fmt: skip
        check_gap(replace(group, dropped=dropped))
        return group, redundant

    def _dense(self, members: Index, reach: float = 0.0) -> tuple[LoopGroup, list[int]]:
        """The dense path's rank decision for some rows, in the coordinates that they contain."""
        tree, cuts = self.tree, self.cuts
        columns, phi = self.entries.dense(members)
        of_joints = members[members < len(cuts.rows.first)]
        points = np.concatenate((cuts.rows.point[:, of_joints], tree.point[:, columns]), axis=1)
        spare = partial(cuts.spare_length, tree.point, tree.pitch, members)
        length, noise = measures(points, max(phi.shape), spare, reach)
        scale = np.where(tree.turns[columns], 1.0, length) * preference(len(columns))
        a = phi * cuts.row_scale(length, members)[:, None] * scale
        rank, smallest_kept, dropped, limit = decided(pivoted_qr(a)[0].diagonal().tolist(), noise)
        joints = tuple(cuts.joints[k] for k in dict.fromkeys(self.entries.loop[members].tolist()))
        if not reach and (smallest_kept < NEAR_SINGULAR or limit > NEAR_SINGULAR):
            names = [*joints, *(tree.names[k].rpartition(".")[0] for k in columns.tolist())]
            reach = arm(self.topology, tree.position, names)
            if reach:
                return self._dense(members, reach)
        redundant = members[redundant_members(a, rank)].tolist() if rank < len(members) else []
        group = LoopGroup(joints, members, columns, rank, smallest_kept, dropped, length, noise,
                          partial(_names, cuts.names, redundant))  # fmt: skip
        check_gap(group)
        return group, redundant

    def _unit_rows(self, rows: Index, columns: Index) -> csr_matrix:
        """Some rows of Phi with lengths in links, scaled to unit length."""
        row, column, value = self.entries.of(rows)
        length = self.tree.length
        value = value * np.where(self.tree.turns[column], 1.0, length)
        value *= self.cuts.row_scale(length, rows)[row]
        norm = np.sqrt(np.bincount(row, value * value, minlength=len(rows)))
        return csr_matrix((value / norm[row], (row, np.searchsorted(columns, column))), shape=(len(rows), len(columns)))


def _names(names: tuple[str, ...], rows: list[int]) -> tuple[str, ...]:
    return tuple(names[row] for row in rows)


def _dependent(s: csr_matrix, limit: float) -> tuple[Index, float, float]:
    """Rows within ``limit`` of the span of the others; the smallest distance of others, and the largest of these."""
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
    lu = splu((s @ s.T + REGULARISATION * eye(s.shape[0])).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
              options={"SymmetricMode": True})  # fmt: skip
    return np.abs(lu.U.diagonal())[lu.perm_c], lu


def check_mobility(topology: Topology, tree: Tree, closure: Constraints, layout: Layout, tableau: Tableau) -> None:
    """Refuse a pose in which fewer constraints are independent than in neighbouring poses."""
    groups = [group for group in closure.groups if group.redundant]
    if not groups or len(tree.names) <= len(layout.multiplier):
        return
    small = _small_motion(tree, layout, tableau, min(group.length for group in groups))
    described = Twists(tree.names, tree.linear, tree.angular, tree.point, np.zeros((0, 0), np.int8), tree.turns)
    moved, cuts = rows_nearby(topology, described, closure.cuts, tree.position, small)
    moved_tree = replace(tree, linear=moved.linear, angular=moved.angular, point=moved.point)
    entries = closure.entries(tree), replace(closure, cuts=cuts).entries(moved_tree)
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


def _small_motion(tree: Tree, layout: Layout, tableau: Tableau, length: float) -> Array:
    """A small motion (bodies, 6) that every loop allows, with every joint on an equal spring."""
    right = np.zeros(layout.size)
    # an arbitrary direction, which no symmetry of the mechanism favours
    right[layout.coordinate] = np.cos(1.0 + np.arange(len(tree.names))) / tableau.row_scale[layout.coordinate]
    motion = tableau.with_equal_springs(layout).solve(right)
    q = motion[layout.coordinate]
    motion *= NEIGHBOUR_STEP / float(np.max(np.abs(q) / np.where(tree.turns, 1.0, length), initial=1e-300))
    result = np.zeros((len(tree.parent), 6))
    result[tree.moves] = motion[layout.displacement[tree.moves]]
    return result
