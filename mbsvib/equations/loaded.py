"""The loaded mechanism: statics, and the geometric stiffness in addition to the elastic one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.contribution import Contribution
from mbsvib.equations.applied_forces import applied_forces
from mbsvib.equations.reactions import reactions
from mbsvib.equations.statement import antisymmetric, minimal_rows, signed_squares
from mbsvib.equations.statics import Statics, balance, check_balance
from mbsvib.equations.unsymmetric_stiffness import load_stiffness
from mbsvib.equations.wrench_pairs import WrenchPairs
from mbsvib.linalg.rank import POSITION_ROUNDING

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.applied_forces import AppliedForces
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.wrenches import Mask


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
    return replace(draft, terms=terms, statics=statics, undetermined=statics.undetermined)


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
