"""The loaded mechanism: statics, and the geometric stiffness in addition to the elastic one.

Applied forces and the geometry of all wrench pairs depend on parts and tree only, and are cached with them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.contribution import Contribution
from mbsvib.equations.coupler_curvature import curvature_stiffness
from mbsvib.equations.force_paths import ForcePaths, force_paths
from mbsvib.equations.geometric_stiffness import GeometricTerms, geometric_terms
from mbsvib.equations.reactions import reactions
from mbsvib.equations.statement import JointRows, antisymmetric, joint_rows, minimal_rows, signed_squares
from mbsvib.equations.statics import Statics, balance, check_balance
from mbsvib.equations.unsymmetric_stiffness import load_stiffness
from mbsvib.equations.wrench_pairs import WrenchPairs
from mbsvib.linalg.rank import POSITION_ROUNDING

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.second_order_rows import SecondOrderRows
    from mbsvib.equations.wrenches import AppliedWrenches, Mask


@dataclass(frozen=True, slots=True)
class AppliedForces:
    """Applied forces on the bodies, and the geometry of all wrench pairs, the applied ones and those of joints.

    ``wrench`` (6, bodies + 1) acts on the bodies; ``sizes`` (2, bodies + 1) are the sums of the lengths of its forces
    and moments; ``pairs`` (6, applied) are the wrenches on the second bodies; ``first`` and ``second`` (pairs,),
    ``start`` and ``end`` (3, pairs) those of all pairs. ``owners`` are the names of all pairs and of the bodies.
    ``geometric`` is the geometric stiffness, and ``geometric_rows`` its rows in joint coordinates. ``tree_wrenches``
    (6, joints, 1) are the wrenches in joints of the open tree, ``multiplier_wrenches`` (6 joints, locked rows) those
    in all joints per unit of each multiplier.
    """

    paths: ForcePaths
    wrench: Array
    sizes: Array
    pairs: Array
    first: Index
    second: Index
    start: Array
    end: Array
    owners: tuple[str, ...]
    geometric: GeometricTerms
    tree_wrenches: Array
    multiplier_wrenches: Array
    geometric_rows: JointRows

    @property
    def reach(self) -> float:
        """Largest coordinate of a point [m], to which the rounding of points is relative."""
        return max(float(np.abs(self.start).max(initial=0.0)), float(np.abs(self.paths.position).max(initial=0.0)))


def applied_forces(
    applied: AppliedWrenches, second_order: SecondOrderRows, scene: Scene, cache: dict[str, Any]
) -> AppliedForces:
    """Return the applied forces of a mechanism, the cached ones if its tree is the same."""
    cached: AppliedForces | None = cache.get("applied_forces")
    if cached is not None and cached.paths.topology is scene.topology:
        return cached
    topology = scene.topology
    position = np.concatenate((scene.position, np.zeros((1, 3)))).T
    paths = force_paths(topology, position)
    wrench, sizes = applied.on_bodies(position)
    first = np.concatenate((applied.pairs.first, paths.first))
    second = np.concatenate((applied.pairs.second, paths.second))
    start = np.concatenate((applied.pairs.start, paths.start), axis=1)
    end = np.concatenate((applied.pairs.end, paths.point), axis=1)
    geometric = geometric_terms(WrenchPairs(first, second, start, end, end, end), applied, second_order, position)
    cache["applied_forces"] = result = AppliedForces(
        paths, wrench, sizes, np.concatenate((applied.pairs.force, applied.pairs.torque)), first, second, start, end,
        (*applied.names, *(joint.name for joint in topology.joints), *topology.bodies),
        geometric, paths.of_tree(wrench[:, :, None]), paths.of_locked(scene.cuts),
        joint_rows(geometric.rows, scene.coordinates),
    )  # fmt: skip
    return result


def with_loads(draft: Draft) -> Draft:
    """Return equations of motion with the stiffness of loads, and the forces at the pose."""
    scene, reduction, terms = draft.scene, draft.reduction, draft.terms
    assert scene.loads is not None
    applied, second_order, cache = scene.loads
    forces = applied_forces(applied, second_order, scene, cache)
    motion = terms.body_motion
    residual, size = balance(forces.wrench[:, :-1], forces.sizes[:, :-1], motion, forces.reach)
    if draft.checked:
        check_balance(residual, size, terms.K, scene, reduction, draft.model.name)
    to_joints = reactions(forces.paths, scene.coordinates, scene.cuts, reduction, draft.phi, forces.multiplier_wrenches)
    joint_wrenches = to_joints.with_loops(forces.tree_wrenches)[:, :, 0]
    wrench = np.concatenate((forces.pairs, joint_wrenches), axis=1)
    pairs = WrenchPairs(forces.first, forces.second, forces.start, forces.end, wrench[:3], wrench[3:])
    names = [joint.name for joint in scene.topology.joints]
    statics = Statics(
        applied, joint_wrenches, pairs, forces.paths.position, second_order, residual, size, forces.owners,
        tuple([stress.undetermined(names, {}) for stress in to_joints.stress]),
    )
    parts = [forces.geometric.contribution(pairs.force, pairs.torque)]
    unsymmetric = load_stiffness(applied, forces.paths.position)
    if unsymmetric is not None:
        parts.append(unsymmetric)
    contribution = Contribution.join(parts)
    in_joint_coordinates = forces.geometric_rows if unsymmetric is None else None
    displacements = minimal_rows(contribution, scene.coordinates, reduction, motion, in_joint_coordinates)
    rows, stiffness, owner = signed_squares(contribution.stiffness, displacements)
    zero = _without_effect(rows, stiffness, forces, pairs, motion)
    if np.count_nonzero(zero):
        rows[:, zero] = 0.0
    used = (stiffness * rows.any(axis=1)).nonzero()[0]
    terms = terms.with_rows(rows.take(used, axis=0), stiffness.take(used), len(scene.owners) + owner.take(used))
    terms = terms.with_antisymmetric(None, antisymmetric(contribution.circulatory, displacements))
    if any(coupler.curvatures for coupler in scene.couplers):
        multipliers = to_joints.multipliers(forces.tree_wrenches)[:, 0]
        rows, stiffness, owner = curvature_stiffness(scene, draft.reduction, multipliers)
        terms = terms.with_rows(rows, stiffness, len(scene.owners) + len(applied.names) + owner)
    return replace(draft, terms=terms, statics=statics, undetermined=statics.undetermined, reactions=to_joints)


def _without_effect(rows: Array, stiffness: Array, forces: AppliedForces, pairs: WrenchPairs, motion: Array) -> Mask:
    """Mask (m,) of coordinates whose geometric stiffness is rounding of points, as about an axis through a weight.

    Such a stiffness must be zero: with a small one a freely turning wheel would oscillate or be unstable.
    """
    lengths = np.sqrt(np.square(motion[:, 3:]).sum(axis=1))
    force, bodies = np.sqrt(np.square(pairs.force).sum(axis=0)), len(motion) + 1
    total = forces.sizes[0] + np.bincount(pairs.first, force, bodies) + np.bincount(pairs.second, force, bodies)
    rounding = POSITION_ROUNDING * forces.reach * (lengths * total[:-1, None]).T.dot(lengths)
    result: Mask = (np.abs((rows * stiffness[:, None]).T.dot(rows)) <= rounding).all(axis=1)
    return result
