"""Self-stress of many bodies: loops with redundant constraints, and their wrenches of least norm.

A unit displacement e of the gap in one joint has two parts: D^2 w, with self-equilibrated wrenches w in all joints, and
the gaps of a motion u of the bodies. The wrenches of least norm (``equations/self_stress.py``) do no work on the
former, so that the latter gives their component along e. With A the rows of locked directions and couplers over the
displacements of the bodies, and B the wrenches of these rows,

    [[B^T D^2 B, A], [A^T, 0]] [x; u] = [B^T e; 0],    w = B x.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import bmat, csr_matrix, diags, eye
from scipy.sparse.linalg import splu

from mbsvib.common.arrays import Array, Index
from mbsvib.common.tables import listed
from mbsvib.equations.self_stress import Undetermined, self_stress
from mbsvib.equations.virtual_motions import point_of
from mbsvib.errors import ModelError
from mbsvib.kinematics.couplers import measure
from mbsvib.kinematics.pose import length_of
from mbsvib.linalg.groups import connected_parts
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import COLUMN_REGULARISATION, DETERMINED
from mbsvib.linalg.rotations import rigid_transport
from mbsvib.mechanism.topology import FLOATS, Topology
from mbsvib.sparse.constraints import MOST_DENSE_ENTRIES, Constraints
from mbsvib.sparse.layout import paths
from mbsvib.sparse.tree import Tree

# Iterative refinement stops when a step changes the solution by less than this; it has so many steps at most.
CONVERGED, STEPS = 1e-13, 60

@dataclass(frozen=True, eq=False)
class Region:
    """Loops with redundant constraints that have joints or couplers in common.

    ``joints`` (j,) with ``point`` (3, j), of which ``force_joints`` can transmit a force; their ``length`` L [m].
    ``gap`` (6 j, 6 b) are the relative displacements in the joints per displacement of the outer bodies of those in the
    tree, ``rows`` (6 j, n) the wrenches of locked directions and couplers, of which ``rank`` are independent; in both,
    lengths are in units of L, and ``rows`` have unit length.
    """

    names: tuple[str, ...]
    joints: Index
    point: Array
    force_joints: Index
    length: float
    gap: csr_matrix
    rows: csr_matrix
    rank: int

    @cached_property
    def scale(self) -> Array:
        """D (6, 1): 1 for forces, 1 / L for moments."""
        return np.repeat((1.0, 1.0 / self.length), 3)[:, None]

    def stress(self, step: Array) -> Array:
        """Return the self-equilibrated wrenches w (6, j) of displacements in the joints (6, j) [m, rad], which do work
        on the part D^2 w of these only; the other part is that of a motion.
        """
        return self._solve((step / self.scale).T.reshape(-1)).reshape(-1, 6).T / self.scale

    def minimum_norm(self, wrench: Array) -> Array:
        """Return the wrenches (6, j) of least norm that are equivalent to given ones."""
        return np.asarray(wrench - self.stress(self.scale**2 * wrench))

    def determines(self, step: Array, wrench: Array) -> bool:
        """Return whether the constraints determine the force along a step, with its ``stress``."""
        return bool(np.linalg.norm(wrench * self.scale) <= DETERMINED * np.linalg.norm(step / self.scale))

    def undetermined(self, outputs: tuple[str, ...]) -> Undetermined:
        """Return the joints with self-stress, and the outputs that depend on it."""
        step = np.cos(np.arange(6.0 * len(self.joints))).reshape(-1, 6).T  # an arbitrary direction
        size = np.linalg.norm(self.stress(step * self.scale) * self.scale, axis=0)
        names = tuple(self.names[k] for k in self.joints[size > DETERMINED * size.max(initial=0.0)].tolist())
        return Undetermined(names, self.length, outputs)

    @cached_property
    def _solve(self) -> Callable[[Array], Array]:
        matrix = self.rows.T @ self.gap
        small = matrix.shape[0] * matrix.shape[1] <= MOST_DENSE_ENTRIES
        return _of_small(self, matrix.toarray()) if small else _of_large(self, matrix)


def _of_small(region: Region, matrix: Array) -> Callable[[Array], Array]:
    """By a pivoted QR of known rank, whose last columns are the combinations of rows without resultant on any body."""
    qr, _, tau = pivoted_qr(matrix)
    count = len(matrix)
    basis = np.zeros((count, count))
    basis[:, : len(tau)] = qr[:, : len(tau)]
    basis = lapack.dorgqr(basis, tau)[0][:, region.rank :]
    stress = self_stress(region.joints, region.length, _in_joints(region, region.rows @ basis))
    states = np.zeros((6 * len(region.joints), 0))
    if stress is not None:
        states = (stress.states * region.scale[..., None]).transpose(1, 0, 2).reshape(len(states), -1)

    return lambda step: states @ (states.T @ step)


def _in_joints(region: Region, flat: Array) -> Array:
    """Wrenches (6, j, n) from weighted ones (6 j, n)."""
    return np.asarray(flat.reshape(len(region.joints), 6, -1).transpose(1, 0, 2) / region.scale[..., None])


def _of_large(region: Region, matrix: csr_matrix) -> Callable[[Array], Array]:
    """By a regularised sparse system with iterative refinement."""
    n, m = matrix.shape
    equations = bmat([[region.rows.T @ region.rows, matrix], [matrix.T, None]], format="csc")
    shift = bmat([[COLUMN_REGULARISATION * eye(n), None], [None, -COLUMN_REGULARISATION * eye(m)]], format="csc")
    lu = splu(equations + shift)

    def solve(step: Array) -> Array:
        right = np.concatenate((region.rows.T @ step, np.zeros(m)))
        solution = np.zeros(n + m)
        size = CONVERGED * float(np.abs(right).max(initial=0.0))
        for _ in range(STEPS):
            change = lu.solve(right - equations @ solution)
            solution += change
            if max(np.abs(region.rows @ change[:n]).max(), np.abs(matrix @ change[n:]).max()) <= size:
                return np.asarray(region.rows @ solution[:n])
        names = listed([region.names[k] for k in region.joints.tolist()])
        raise ModelError(
            f"forces in the joints {names} are not determined to many digits: the constraints nearly depend on each "
            f"other. Leave these outputs out, or use method='dense'.",
            element=region.names[region.joints[0]], field="method",
        )  # fmt: skip

    return solve


def regions(
    topology: Topology, tree: Tree, closure: Constraints, number: Mapping[str, int], joints: Iterable[int]
) -> dict[int, Region]:
    """Return, by joint, the loops with redundant constraints that contain given joints; others have no entry."""
    if not any(group.surplus for group in closure.groups):
        return {}
    loop, joint = _joints_of_loops(topology, tree, closure, number)
    loop_part, joint_part = connected_parts(loop, joint, (int(loop.max()) + 1, len(topology.joints)))
    surplus = np.zeros(len(loop_part) + len(joint_part), dtype=np.intp)
    for group in closure.groups:
        surplus[loop_part[closure.loop[group.rows[0]]]] += group.surplus
    of_part: dict[int, Region] = {}
    result = {}
    for k in joints:
        part = int(joint_part[k])
        if surplus[part] and part not in of_part:
            within = np.flatnonzero(loop_part == part), np.flatnonzero(joint_part == part)
            of_part[part] = _region(topology, tree, closure, number, within, int(surplus[part]))
        if surplus[part]:
            result[k] = of_part[part]
    return result


def _joints_of_loops(
    topology: Topology, tree: Tree, closure: Constraints, number: Mapping[str, int]
) -> tuple[Index, Index]:
    """Pairs of a loop (first those of cut joints, then those of couplers) and a joint in it."""
    joint_to_parent = np.full(len(tree.parent) + 1, FLOATS)
    for branch in topology.branches:
        joint_to_parent[branch.body] = branch.joint
    cut, loop = [topology.joints[k] for k in topology.cut], np.arange(len(topology.cut))
    first = np.array([number[joint.first] for joint in cut], dtype=np.intp)
    second = np.array([number[joint.second] for joint in cut], dtype=np.intp)
    loops, joints = [loop], [np.array(topology.cut, dtype=np.intp)]
    terms = closure.cuts.couplings
    if terms is not None:
        inside, coupler = terms.column >= 0, len(topology.cut) + terms.row
        loops += [coupler[inside], coupler[~inside]]
        joints += [joint_to_parent[tree.coordinate_body[terms.column[inside]]], terms.owner]
        first, second = (np.concatenate((ends, more)) for ends, more in (
            (first, terms.measured.first), (second, terms.measured.second)))  # fmt: skip
        loop = np.concatenate((loop, coupler[~inside]))
    pair, body, _, _ = paths(tree, first, second, None)
    all_loops, all_joints = np.concatenate((*loops, loop[pair])), np.concatenate((*joints, joint_to_parent[body]))
    is_joint = all_joints != FLOATS
    return all_loops[is_joint], all_joints[is_joint]


def _region(
    topology: Topology, tree: Tree, closure: Constraints, number: Mapping[str, int], within: tuple[Index, Index],
    surplus: int,
) -> Region:  # fmt: skip
    """The region of some loops and joints, ``within``."""
    loops, joints = within
    parts = [topology.joints[k] for k in joints.tolist()]
    position = np.concatenate((tree.position, np.zeros((1, 3))))
    point = np.array([point_of(part, dict(number), position.T) for part in parts])
    index_of = {k: i for i, k in enumerate(joints.tolist())}
    bodies = np.array([branch.body for branch in topology.branches if branch.joint in index_of], dtype=np.intp)
    number_in_region = {body: i for i, body in enumerate(bodies.tolist())}
    owners = [-1] * len(position)
    for body in tree.outward.tolist():
        owners[body] = number_in_region.get(body, owners[tree.parent[body]])
    locked = [(i, six) for i, part in enumerate(parts) for _, six in part.locked]
    entries = [(i, row, six) for row, (i, six) in enumerate(locked)]
    entries += _of_couplers(topology, tree, closure, index_of, loops[loops >= len(topology.cut)], len(locked))
    ends = np.array([(number[part.first], number[part.second]) for part in parts]).T
    # joints without locked directions or couplers transmit no force
    force_joints, owner = np.unique([i for i, _, _ in entries]), np.array(owners)
    length = length_of(point[force_joints], *position[ends[:, force_joints]])
    rows = _rows(entries, len(parts), length)
    return Region(tuple([joint.name for joint in topology.joints]), joints, point.T, force_joints, length,
                  _gaps(point, owner[ends], position[bodies], length), rows, rows.shape[1] - surplus)  # fmt: skip


def _of_couplers(
    topology: Topology, tree: Tree, closure: Constraints, index_of: Mapping[int, int], loops: Index, first: int
) -> list[tuple[int, int, Any]]:
    """Wrenches of couplers on joints: the joint's number in its region, the row from ``first`` on, and the wrench."""
    terms = closure.cuts.couplings
    if terms is None:
        return []
    row = {int(loop) - len(topology.cut): first + k for k, loop in enumerate(loops)}
    known = {joint.name: (k, joint) for k, joint in enumerate(topology.joints)}
    cut = iter(zip(terms.owner.tolist(), *terms.measured.force, *terms.measured.moment, strict=True))
    result = []
    for coupler, value, column in zip(terms.row.tolist(), terms.value.tolist(), terms.column.tolist(), strict=True):
        if column >= 0:
            name, _, direction = tree.names[column].rpartition(".")
            k, joint = known[name]
            six = np.concatenate(measure(joint, direction))
        else:
            k, *components = next(cut)
            six = np.array(components)
        if coupler in row:
            result.append((index_of[k], row[coupler], value * six))
    return result


def _rows(entries: list[tuple[int, int, Any]], joints: int, length: float) -> csr_matrix:
    """Wrenches (6 joints, n), lengths in units of ``length``, columns scaled to unit length."""
    joint, row = np.array([entry[:2] for entry in entries], dtype=np.intp).T
    six = np.array([entry[2] for entry in entries]) * np.repeat((1.0, 1.0 / length), 3)
    entry, direction = np.nonzero(six)
    wrenches = csr_matrix((six[entry, direction], (6 * joint[entry] + direction, row[entry])),
                          shape=(6 * joints, int(row.max()) + 1))  # fmt: skip
    return (wrenches @ diags(1.0 / np.sqrt(np.asarray(wrenches.power(2).sum(axis=0))[0]))).tocsr()


def _gaps(point: Array, ends: Index, position: Array, length: float) -> csr_matrix:
    """Relative displacements in joints at points (j, 3) per displacement of bodies at positions (b, 3), (6 j, 6 b) in
    units of the length; ``ends`` (2, j) are the numbers of their first and second bodies, -1 for bodies at rest.
    """
    row, column, value = [], [], []
    for end, sign in zip(ends, (-1.0, 1.0), strict=True):
        moves = np.flatnonzero(end >= 0)
        block = rigid_transport((point[moves] - position[end[moves]]) / length)
        which, i, j = np.nonzero(block)
        row.append(6 * moves[which] + i)
        column.append(6 * end[moves[which]] + j)
        value.append(sign * block[which, i, j])
    shape = (6 * len(point), 6 * len(position))
    return csr_matrix((np.concatenate(value), (np.concatenate(row), np.concatenate(column))), shape=shape)
