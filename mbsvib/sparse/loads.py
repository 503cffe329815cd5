"""Loads on many bodies: joint forces from the leaves to the root, and geometric stiffness as sparse signed rows.

A joint of the tree transmits the sum of all forces on the bodies behind it; one pass from the leaves to the root
computes it. In loops this includes the forces of the cut joints: with Phi their independent rows per joint coordinate,
Phi^T lambda = -B'^T W by sparse least squares, and the residual is the unbalanced force of the pose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.core.pairs import CutJoints, of_measured, opening_hessians
from mbsvib.core.shift_forms import by_form, shift_hessian, stacked, twists_of
from mbsvib.elements.coupler import refuse_curved
from mbsvib.elements.rows import Rows
from mbsvib.equations.force_paths import joint_ends
from mbsvib.equations.load_stiffness import applied_pairs
from mbsvib.equations.statics import LEAST_LEVER, unbalanced
from mbsvib.equations.wrench_pairs import WrenchPairs
from mbsvib.equations.wrenches import applied_wrenches
from mbsvib.kinematics.mobility import crossed_product
from mbsvib.linalg.rank import BALANCE
from mbsvib.mechanism.topology import FLOATS
from mbsvib.sparse.geometric_stiffness import Products, of_bodies, of_joints, of_pairs

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.core.geometric_stiffness import Pairs
    from mbsvib.elements import Joint
    from mbsvib.elements.element_rows import ElementRows
    from mbsvib.equations.wrenches import AppliedWrenches
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.mechanism.topology import Topology
    from mbsvib.sparse.constraints import Constraints
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.self_stress import Region
    from mbsvib.sparse.tree import Tree


@dataclass(frozen=True, slots=True)
class Geometric:
    """Signed ``rows`` (n, unknowns) of geometric stiffness with their values ``stiffness`` (n,), and the forces.

    ``owner`` (n,) are numbers of ``names``. ``joints`` (6, joints) are the wrenches in the joints, on their second
    bodies ``parts``. ``pairs`` are all forces, those of ``applied`` and then those in joints, ``carrier`` (pairs,) the
    bodies with which their points move; ``hessian`` (applied, 6, 6) are the second derivatives of the applied ones.
    """

    rows: csr_matrix
    stiffness: Array
    owner: Index
    names: tuple[str, ...]
    joints: Array
    pairs: WrenchPairs
    carrier: Index
    hessian: Array
    parts: tuple[Joint, ...]
    applied: AppliedWrenches
    circulatory: csr_matrix | None = None

    def of_joints(self, joints: Index, wrench: Array) -> Geometric:
        """Return it with wrenches (6, j) in some joints as the only forces."""
        force, torque = np.zeros((2, *self.pairs.force.shape))
        count = len(self.applied.names)
        force[:, count + joints], torque[:, count + joints] = wrench[:3], wrench[3:]
        return replace(self, pairs=replace(self.pairs, force=force, torque=torque), hessian=0.0 * self.hessian)


def geometric(
    model: Mechanism, topology: Topology, tree: Tree, layout: Layout, closure: Constraints, number: Mapping[str, int],
    springs: ElementRows, regions: Iterable[Region] = (),
) -> Geometric:  # fmt: skip
    """Return the geometric stiffness of a loaded mechanism; refused if the pose is not in balance.

    ``springs``: rounding of the pose causes forces in them. ``regions``: loops in which redundant constraints share
    forces of least norm; elsewhere redundant constraints have none.
    """
    position = np.concatenate((tree.position, np.zeros((1, 3)))).T
    refuse_curved(model.couplers.values(), "and sparse equations have no stiffness of its curvature under loads. Take "
                  "dense ones: linearize(method='dense').")
    applied = applied_wrenches(model, number)
    wrench, sizes = applied.on_bodies(position)
    reach = max([float(np.abs(position).max()), *(abs(x) for joint in topology.joints for x in joint.position or ())])
    subtree, size = _subtree_wrenches(tree, wrench, sizes + _rounding(springs, reach, position))
    multipliers = _multipliers(tree, closure, subtree, size, (model.name, topology), reach)
    cut = _in_cut_joints(closure, multipliers)
    if cut is not None:
        subtree = _subtree_wrenches(tree, wrench + cut.on_bodies(position)[0], sizes)[0]
    joints = topology.joints
    first, second, start, point, carrier = joint_ends(topology, position)
    joint_wrenches = _joint_wrenches(topology, closure, subtree, cut, position, point)
    balanced = WrenchPairs(first, second, start, point, joint_wrenches[:3], joint_wrenches[3:])
    # stiffness does not depend on the forces that redundant constraints share in one way or another
    parts = _pairs(model, topology, tree, closure, applied, multipliers)
    rows, stiffness, owner, circulatory = _stiffness(topology, tree, layout, parts, balanced, len(applied.names))
    joint_wrenches = joint_wrenches.copy()
    for region in regions:
        joint_wrenches[:, region.joints] = region.minimum_norm(joint_wrenches[:, region.joints])
    in_joints = WrenchPairs(first, second, start, point, joint_wrenches[:3], joint_wrenches[3:])
    names = (*applied.names, *(joint.name for joint in joints), *topology.bodies)
    carrier = np.concatenate((applied.pairs.second, carrier))
    return Geometric(rows, stiffness, owner, names, joint_wrenches, WrenchPairs.join(applied.pairs, in_joints), carrier,
                     _hessian(parts[0][0]) if applied.names else np.zeros((0, 6, 6)), joints, applied,
                     circulatory)  # fmt: skip


def _hessian(pairs: Pairs) -> Array:
    """Second derivatives (p, 6, 6) of pairs, with the antisymmetric part of those without potential."""
    result = shift_hessian(pairs)
    if pairs.torsion is not None:
        result[: len(pairs.torsion)] += 0.5 * (pairs.torsion - pairs.torsion.swapaxes(-1, -2))
    return result


def _stiffness(
    topology: Topology, tree: Tree, layout: Layout, parts: list[tuple[Pairs, Index, Array | None]],
    in_joints: WrenchPairs, of_joints_from: int,
) -> tuple[csr_matrix, Array, Index, csr_matrix | None]:  # fmt: skip
    """Signed rows with their stiffness and owners, and the antisymmetric matrix of the forces at the pose."""
    products, circulatory = [], None
    branches = [branch for branch in topology.branches if branch.joint != FLOATS]
    number = np.array([branch.joint for branch in branches], dtype=np.intp)
    first, second = in_joints.first[number], in_joints.second[number]
    force, moment = in_joints.force[:, number], in_joints.torque[:, number]
    forces = [(second, in_joints.end[:, number], force), (first, in_joints.end[:, number], -force)]
    joints = [(topology.joints[branch.joint], int(a), int(tree.first[branch.body]))
              for branch, a in zip(branches, first, strict=True)]  # fmt: skip
    for pairs, owner, twists in parts:
        part, antisymmetric = of_pairs(tree, layout, pairs, owner, twists)
        products.append(part)
        circulatory = antisymmetric if circulatory is None else circulatory
        forces += [(pairs.second, pairs.point, -pairs.wrench[3:]), (pairs.first, pairs.point, pairs.wrench[3:])]
    products.append(of_joints(tree, layout, joints, np.concatenate((force, moment)), of_joints_from + number))
    products.append(of_bodies(tree, layout, forces, of_joints_from + len(topology.joints)))
    return *Products.join(products).squares(), circulatory


def _pairs(
    model: Mechanism, topology: Topology, tree: Tree, closure: Constraints, applied: AppliedWrenches, multipliers: Array
) -> list[tuple[Pairs, Index, Array | None]]:
    """The pairs of loads, preloads and cut joints with their owners, and the twists (p, 6, 6) that these allow."""
    rows, count, of_joints_from = closure.rows, len(closure.rows.first), len(applied.names)
    # weights act at the centres of mass, where they have no stiffness
    result: list[tuple[Pairs, Index, Array | None]] = []
    if applied.names:
        pairs = applied_pairs(replace(applied, weight=np.zeros_like(applied.weight)), tree.position)
        result.append((pairs, np.arange(of_joints_from), None))
    if count:
        numbers, start = np.unique(closure.loop[:count], return_index=True)
        number = np.array(topology.cut, dtype=np.intp)[numbers]
        joints = [topology.joints[k] for k in number.tolist()]
        hessian = np.zeros((count, 6, 6))
        for alike, which in by_form(joints):
            own = start[which][:, None] + np.arange(len(alike[0].locked))
            hessian[own] = stacked(alike, lambda joint, axes, length: opening_hessians(
                [joint], {joint.name: axes}, {joint.name: length}))  # fmt: skip
        cut = CutJoints(rows.first[start], rows.second[start], rows.point[:, start],
                        np.concatenate((rows.moment, rows.force)), closure.loop[:count], start, hessian)  # fmt: skip
        result.append((cut.pairs(-multipliers[:count]), of_joints_from + number, twists_of(joints)))
    if closure.couplers is not None and len(closure.couplers.joint):
        measured, number = closure.couplers.terms.measured, closure.couplers.joint
        coupler, coefficient = closure.couplers.measured
        known = set(tree.names)
        names = [name.rpartition(".")[2] for part in model.couplers.values() for name, _ in part.terms
                 if name not in known]  # fmt: skip
        joints = [topology.joints[k] for k in number.tolist()]
        pairs = of_measured((measured.first, measured.second), (measured.point, measured.force, measured.moment),
                            list(zip(joints, names, strict=True)), -coefficient * multipliers[count + coupler], {}, {})
        result.append((pairs, of_joints_from + number, twists_of(joints)))  # fmt: skip
    return result


def _joint_wrenches(
    topology: Topology, closure: Constraints, subtree: Array, cut: WrenchPairs | None, position: Array, point: Array
) -> Array:
    """Wrenches (6, joints) at the joints' points, from those of ``subtree`` (6, bodies) and those in the cut joints."""
    result = np.zeros((6, len(topology.joints)))
    outer = [(branch.joint, branch.body, branch.sign) for branch in topology.branches if branch.joint != FLOATS]
    joint, body, sign = np.array(outer, dtype=np.intp).reshape(-1, 3).T
    result[:, joint] = -sign * subtree[:, body]
    result[3:, joint] += crossed_product(position[:, body] - point[:, joint], result[:3, joint])
    if cut is not None:
        joint = np.array(topology.cut, dtype=np.intp)[closure.loop[: len(closure.rows.first)]]
        if closure.couplers is not None:
            joint = np.concatenate((joint, closure.couplers.joint))
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
    rows = closure.rows
    if not len(closure.names):
        return None
    if closure.couplers is not None:  # in joints of the tree they are part of the forces of these
        coupler, coefficient = closure.couplers.measured
        of_couplers = coefficient * multipliers[len(rows.first) + coupler]
        multipliers = np.concatenate((multipliers[: len(rows.first)], of_couplers))
        rows = Rows.join([rows, closure.couplers.terms.measured])
    force, moment = rows.force * multipliers, rows.moment * multipliers
    return WrenchPairs(rows.first, rows.second, rows.point, rows.point, force, moment)


def _least_squares(entries: tuple[Index, Index, Array], m: int, n: int, right: Array) -> tuple[Array, Array, Array]:
    """The solution of an overdetermined sparse system of full rank, the residual, and the magnitude (n,) to which
    rounding of the solution is relative: that of the largest unknown, with columns scaled to unit length.
    """
    from scipy.sparse import bmat, csc_matrix, eye
    from scipy.sparse.linalg import splu

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
