"""Loads on many bodies: joint forces from the leaves to the root, and geometric stiffness as sparse signed rows.

A joint of the tree transmits the sum of all forces on the bodies behind it; one pass from the leaves to the root
computes it. In loops this includes the forces of the cut joints: with Phi their independent rows per joint coordinate,
Phi^T lambda = -B'^T W by sparse least squares, and the residual is the unbalanced force of the pose.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import bmat, csc_matrix, eye
from scipy.sparse.linalg import splu

from mbsvib.common.arrays import Array, Index
from mbsvib.elements.coupler import refuse_curved
from mbsvib.elements.rows import ElementRows, Rows
from mbsvib.equations.statics import LEAST_LEVER, unbalanced
from mbsvib.equations.virtual_motions import joint_ends
from mbsvib.equations.wrenches import WrenchPairs, applied_wrenches
from mbsvib.linalg.rank import BALANCE
from mbsvib.linalg.rotations import crossed_product
from mbsvib.mechanism.topology import Topology
from mbsvib.sparse.constraints import Constraints
from mbsvib.sparse.draft import SparseDraft
from mbsvib.sparse.geometric_stiffness import Loading
from mbsvib.sparse.layout import VirtualUnknowns
from mbsvib.sparse.tree import Tree


def with_loads(draft: SparseDraft) -> SparseDraft:
    """Return a draft with the geometric stiffness of a loaded mechanism; refused if the pose is not in balance."""
    model, topology, tree, closure = draft.nodes, draft.topology, draft.structure, draft.closure
    position = np.concatenate((tree.position, np.zeros((1, 3)))).T
    refuse_curved(model.couplers.values(), "and sparse equations have no stiffness of its curvature under loads. Take "
                  "dense ones: linearize(method='dense').")
    applied = applied_wrenches(model, draft.number)
    wrench, sizes = applied.on_bodies(position)
    reach = max([float(np.abs(position).max()), *(abs(x) for joint in topology.joints for x in joint.position or ())])
    subtree, size = _subtree_wrenches(tree, wrench, sizes + _rounding(draft.springs, reach, position))
    multipliers = _multipliers(tree, closure, subtree, size, (model.name, topology), reach)
    cut = _in_cut_joints(closure, multipliers)
    if cut is not None:
        subtree = _subtree_wrenches(tree, wrench + cut.on_bodies(position)[0], sizes)[0]
    first, second, _, point, carrier = joint_ends(topology, position)
    joint_wrenches = _joint_wrenches(topology, closure, subtree, cut, position, point)
    names = (*applied.names, *(joint.name for joint in topology.joints), *topology.bodies)
    loading = Loading(topology, applied, joint_wrenches, point, names, first, second, carrier == first)
    # stiffness does not depend on the forces that redundant constraints share in one way or another
    none = np.full(len(topology.joints), -1)
    forms = loading.forms(VirtualUnknowns(tree, draft.layout, none, point))
    products, circulatory = loading.products(forms, joint_wrenches)
    rows, stiffness, owner = products.squares()
    least = joint_wrenches.copy()
    for region in dict.fromkeys(draft.regions.values()):
        least[:, region.joints] = region.minimum_norm(joint_wrenches[:, region.joints])
    draft = draft.with_rows(rows, stiffness, np.zeros(len(owner)), len(draft.names) + owner)
    return replace(draft, loading=replace(loading, joints=least)).with_antisymmetric(None, circulatory)


def _joint_wrenches(
    topology: Topology, closure: Constraints, subtree: Array, cut: WrenchPairs | None, position: Array, point: Array
) -> Array:
    """Wrenches (6, joints) at the joints' points, from those of ``subtree`` (6, bodies) and those in the cut joints."""
    result = np.zeros((6, len(topology.joints)))
    body, sign = topology.outer
    joint = np.flatnonzero(sign)
    body, sign = body[joint], sign[joint]
    result[:, joint] = -sign * subtree[:, body]
    result[3:, joint] += crossed_product(position[:, body] - point[:, joint], result[:3, joint])
    if cut is not None:
        joint, couplings = closure.joint, closure.cuts.couplings
        if couplings is not None:
            joint = np.concatenate((joint, couplings.owner))
        moment = cut.torque + crossed_product(cut.end - point[:, joint], cut.force)
        np.add.at(result.T, joint, np.concatenate((cut.force, moment)).T)
    return result


def _rounding(springs: ElementRows, reach: float, position: Array) -> Array:
    """Magnitudes (2, bodies + 1) of forces and moments; ``BALANCE`` times these are due to rounding of positions."""
    rows = springs.rows
    along, about = (np.linalg.norm(part, axis=0) for part in (rows.force, rows.moment))
    amount = LEAST_LEVER * np.abs(springs.stiffness) * (reach * along + about)
    pairs = WrenchPairs(rows.first, rows.second, rows.point, rows.point, amount * rows.force, amount * rows.moment)
    return pairs.on_bodies(position)[1]


def _subtree_wrenches(tree: Tree, wrench: Array, sizes: Array) -> tuple[Array, Array]:
    """Wrench on each body and all bodies behind it, about its centre of mass (6, bodies), and magnitudes of its terms.
    """
    fx, fy, fz, mx, my, mz = wrench[:, :-1].tolist()
    force, moment = sizes[:, :-1].tolist()
    parent = tree.parent.tolist()
    arm = tree.position - np.concatenate((tree.position, np.zeros((1, 3))))[tree.parent]
    length = np.sqrt(np.square(arm).sum(axis=1)).tolist()
    x, y, z = arm.T.tolist()
    n = len(parent)
    for b in tree.outward[::-1].tolist():
        p = parent[b]
        if p == n:
            continue
        fx[p] += fx[b]
        fy[p] += fy[b]
        fz[p] += fz[b]
        mx[p] += mx[b] + y[b] * fz[b] - z[b] * fy[b]
        my[p] += my[b] + z[b] * fx[b] - x[b] * fz[b]
        mz[p] += mz[b] + x[b] * fy[b] - y[b] * fx[b]
        force[p] += force[b]
        moment[p] += moment[b] + length[b] * force[b]
    return np.array((fx, fy, fz, mx, my, mz)), np.array((force, moment))


def _multipliers(
    tree: Tree, closure: Constraints, subtree: Array, size: Array, context: tuple[str, Topology], reach: float
) -> Array:
    """Multipliers of all locked rows and couplers that balance all other forces; an error if there are none."""
    motion, body = tree.motion.T, tree.coordinate_body
    unbalanced_force = np.einsum("ck,ck->k", motion, subtree[:, body])
    lengths = np.sqrt(np.square(motion.reshape(2, 3, -1)).sum(axis=1))
    limit = np.maximum(np.einsum("ck,ck->k", lengths, size[:, body]), LEAST_LEVER * reach * lengths[1] * size[0, body])
    count = int(closure.is_independent.sum())
    if not count:
        _check_residual(unbalanced_force, limit, tree, context)
        return np.zeros(len(closure.names))
    row, column, entry = closure.independent_entries(tree)
    value, residual, least = _least_squares((column, row, entry), len(unbalanced_force), count, -unbalanced_force)
    # constraints share what is unbalanced along one coordinate with all others that they tie to it
    shared = np.bincount(row, np.abs(entry) * limit[column], count) / np.bincount(row, entry * entry, count)
    np.maximum.at(limit, column, np.abs(entry) * shared[row])
    # forces from anywhere in a loop arrive at each of its joints, with the rounding of the largest ones
    force, moment = size.max(axis=1)
    from_multipliers = LEAST_LEVER * (lengths[0] * force + lengths[1] * (reach * force + moment))
    np.add.at(from_multipliers, column, np.abs(entry) * np.maximum(np.abs(value), LEAST_LEVER * least)[row])
    _check_residual(-residual, limit + from_multipliers, tree, context)
    multipliers = np.zeros(len(closure.names))
    multipliers[closure.is_independent] = value
    return multipliers


def _in_cut_joints(closure: Constraints, multipliers: Array) -> WrenchPairs | None:
    """Forces of multipliers in the cut joints, row by row; None without any."""
    rows, couplings = closure.rows, closure.cuts.couplings
    if not len(closure.names):
        return None
    if couplings is not None:  # in joints of the tree they are part of the forces of these
        coupler, coefficient = couplings.of_measured
        of_couplers = coefficient * multipliers[len(rows.first) + coupler]
        multipliers = np.concatenate((multipliers[: len(rows.first)], of_couplers))
        rows = Rows.join([rows, couplings.measured])
    force, moment = rows.force * multipliers, rows.moment * multipliers
    return WrenchPairs(rows.first, rows.second, rows.point, rows.point, force, moment)


def _least_squares(entries: tuple[Index, Index, Array], m: int, n: int, right: Array) -> tuple[Array, Array, Array]:
    """The solution of an overdetermined sparse system of full rank, the residual, and the magnitude (n,) to which
    rounding of the solution is relative: that of the largest unknown, with columns scaled to unit length.
    """
    a = csc_matrix((entries[2], entries[:2]), shape=(m, n))
    scale = 1.0 / np.sqrt(np.asarray(a.power(2).sum(axis=0))[0])
    a = a.multiply(scale).tocsc()
    matrix = bmat([[eye(m), a], [a.T, None]], format="csc")
    factor = splu(matrix)
    right_side = np.concatenate((right, np.zeros(n)))
    solution = factor.solve(right_side)
    solution += factor.solve(right_side - matrix @ solution)
    return solution[m:] * scale, right - a @ solution[m:], scale * np.abs(solution[m:]).max(initial=0.0)


def _check_residual(residual: Array, size: Array, tree: Tree, context: tuple[str, Topology]) -> None:
    """Refuse a pose in which the unbalanced force along a coordinate exceeds the share ``BALANCE``."""
    off = np.flatnonzero(np.abs(residual) > BALANCE * size)
    if not len(off):
        return
    relative = np.abs(residual[off]) / np.where(size[off] > 0.0, size[off], 1.0)
    worst = int(off[np.argmax(relative)])
    name, topology = context
    missing = -float(residual[worst])
    raise unbalanced(name, tree.names[worst], bool(tree.turns[worst]), missing, float(relative.max()), topology)
