"""The loaded mechanism: statics, and the geometric stiffness that comes on top of the elastic one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.contribution import Contribution
from mbsvib.equations.applied_forces import acting
from mbsvib.equations.reactions import reactions
from mbsvib.equations.statement import antisymmetric, minimal_rows, signed_squares
from mbsvib.equations.statics import Statics, balance, check_balance
from mbsvib.equations.unsymmetric_stiffness import load_stiffness
from mbsvib.equations.wrench_pairs import Pairs
from mbsvib.linalg.rank import POSITION_ROUNDING

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.applied_forces import Acting
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.wrenches import Mask


def with_loads(draft: Draft) -> Draft:
    """Return equations of motion with what loads add to the stiffness, and the forces at the pose.

    Parameters
    ----------
    draft : Draft
        The equations without loads.

    Returns
    -------
    Draft
        Matrices and factors under load; ``statics`` are the forces applied and in joints.

    Raises
    ------
    EquilibriumError
        If the pose is not in balance and this is ``checked``.
    """
    scene, reduction, terms = draft.scene, draft.reduction, draft.terms
    assert scene.loads is not None
    applied, felt, memory = scene.loads
    known = acting(applied, felt, scene, memory)
    motion = terms.body_motion
    reach = max(float(np.abs(known.start).max(initial=0.0)), float(np.abs(known.ways.position).max(initial=0.0)))
    residual, size = balance(known.wrench[:, :-1], known.sizes[:, :-1], motion, reach)
    if draft.checked:
        check_balance(residual, size, terms.K, scene, reduction, draft.model.name)
    to_joints = reactions(known.ways, scene.coordinates, scene.cuts, reduction, draft.phi, known.loops)
    carried = to_joints.closed(known.tree)[:, :, 0]
    wrench = np.concatenate((known.pairs, carried), axis=1)
    pairs = Pairs(known.first, known.second, known.start, known.end, wrench[:3], wrench[3:])
    names = [joint.name for joint in scene.topology.joints]
    statics = Statics(
        applied, carried, pairs, known.ways.position, felt, residual, size, known.owners,
        tuple([stress.undetermined(names, {}) for stress in to_joints.stress]),
    )
    parts = [known.terms.contribution(pairs.force, pairs.torque)]
    unsymmetric = load_stiffness(applied, known.ways.position)
    if unsymmetric is not None:
        parts.append(unsymmetric)
    every = Contribution.join(parts)
    moved = minimal_rows(every, scene.coordinates, reduction, motion, known.rows if unsymmetric is None else None)
    rows, stiffness, owner = signed_squares(every.stiffness, moved)
    idle = _without_effect(rows, stiffness, known, pairs, motion)
    if np.count_nonzero(idle):
        rows[:, idle] = 0.0
    used = (stiffness * rows.any(axis=1)).nonzero()[0]
    terms = terms.with_rows(rows.take(used, axis=0), stiffness.take(used), len(scene.owners) + owner.take(used))
    terms = terms.with_antisymmetric(None, antisymmetric(every.circulatory, moved))
    return replace(draft, terms=terms, statics=statics, undetermined=statics.undetermined)


def _without_effect(rows: Array, stiffness: Array, known: Acting, pairs: Pairs, motion: Array) -> Mask:
    """Tell along which coordinates geometric stiffness is the rounding of points, as about an axis that a weight is on.

    What is no stiffness must not be a little of either sign: a wheel that turns freely would swing, or grow.
    """
    lengths = np.sqrt(np.square(motion[:, 3:]).sum(axis=1))
    force, bodies = np.sqrt(np.square(pairs.force).sum(axis=0)), len(motion) + 1
    each = known.sizes[0] + np.bincount(pairs.first, force, bodies) + np.bincount(pairs.second, force, bodies)
    reach = max(float(np.abs(known.start).max(initial=0.0)), float(np.abs(known.ways.position).max(initial=0.0)))
    rounding = POSITION_ROUNDING * reach * (lengths * each[:-1, None]).T.dot(lengths)
    result: Mask = (np.abs((rows * stiffness[:, None]).T.dot(rows)) <= rounding).all(axis=1)
    return result
