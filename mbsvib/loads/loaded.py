"""The loaded mechanism: statics, and the geometric stiffness that comes on top of the elastic one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.kinematics import relative_motion
from mbsvib.loads.geometric import body_rows, line_rows, turning_rows
from mbsvib.loads.pairs import Pairs
from mbsvib.loads.reactions import reactions
from mbsvib.loads.statics import Statics, balance, check_balance, rounding
from mbsvib.loads.unsymmetric import circulatory, follower_rows

if TYPE_CHECKING:
    from mbsvib.assembly import Scene
    from mbsvib.kinematics import Array, Index, Triplets
    from mbsvib.loads.wrenches import Applied
    from mbsvib.loops import Reduction


def load(
    scene: Scene, relative: Triplets, reduction: Reduction, found: dict[str, Any], name: str, checked: bool = True
) -> Statics:
    """Add to the matrices of a mechanism what its loads do, and return the forces at its pose.

    Parameters
    ----------
    scene : Scene
        The mechanism in numbers.
    relative : Triplets
        Its relative displacements.
    reduction : Reduction
        Its minimal coordinates.
    found : dict
        Its matrices and factors; K, ``circulatory``, the rows, their values and owners are replaced.
    name : str
        Name of the model.
    checked : bool
        Whether a pose that is not in balance is refused; if not, ``Statics.residual`` is what is left over.

    Returns
    -------
    Statics
        Forces applied and in joints.

    Raises
    ------
    EquilibriumError
        If the pose is not in balance.
    """
    assert scene.loads is not None
    applied, felt = scene.loads
    topology = scene.topology
    position = np.concatenate((scene.position, np.zeros((1, 3)))).T
    wrench, sizes = applied.pairs.on_bodies(position)
    wrench[:3] += applied.weight
    sizes[0] += np.sqrt(np.square(applied.weight).sum(axis=0))
    motion = found["body_motion"]
    residual, size = balance(wrench[:, :-1], sizes[:, :-1], motion)
    kept = reduction.independent.tolist()
    names = tuple([scene.coordinates.names[i] for i in kept])
    units = tuple(["rad" if turn else "m" for turn in scene.coordinates.turns[kept].tolist()])
    if checked:
        noise = rounding(found["K"], position, scene.coordinates.turns[kept])
        check_balance(residual, size, noise, names, units, topology, name)
    to_joints = reactions(topology, scene.coordinates, scene.cuts, reduction, scene.closure(relative), position)
    carried = to_joints(wrench[:, :, None])[:, :, 0]
    pairs = Pairs.join(applied.pairs, Pairs(to_joints.first, to_joints.second, to_joints.start, to_joints.point,
                                            carried[:3], carried[3:]))  # fmt: skip
    owners = (*applied.names, *(joint.name for joint in topology.joints), *topology.bodies)
    statics = Statics(
        applied, carried, pairs, position, felt, residual, size, owners,
        tuple([group.joints for group in reduction.groups if group.redundant]),
    )  # fmt: skip
    moved = reduction.apply_exactly(relative_motion(scene.coordinates, felt.rows).dense(0, len(felt.rows.first)))
    add_rows(found, *geometric_rows(statics, moved, motion, scene))
    found["circulatory"] = circulatory(applied, position, motion)
    if found["circulatory"] is not None:
        found["K"] = found["K"] + found["circulatory"]
    return statics


def geometric_rows(statics: Statics, moved: Array, motion: Array, scene: Scene) -> tuple[Array, Array, Index]:
    """Return all rows of geometric stiffness with their signed values and owners.

    Parameters
    ----------
    statics : Statics
        The forces.
    moved : array, shape (felt rows, m)
        What they feel, in minimal coordinates.
    motion : array, shape (bodies, 6, m)
        Motion of the bodies.
    scene : Scene
        The mechanism, to number the owners: its spring-dampers first, then ``statics.owners``.

    Returns
    -------
    rows : array, shape (rows, m)
        Rows in minimal coordinates.
    stiffness, owner : array, shape (rows,)
        Signed values, and whose they are.
    """
    applied, pairs = statics.applied, statics.pairs
    turned = np.concatenate((motion[:, 3:], np.zeros((1, 3, motion.shape[-1]))))
    springs = len(scene.owners)
    turning, k_turning, of_turning = turning_rows(statics.felt, pairs.force, pairs.torque, moved, turned)
    across, k_across = line_rows(statics.felt, pairs.force, moved, turned)
    body, direction, k_body = body_rows(fixed(applied, pairs), statics.position)
    follower, k_follower, of_follower = follower_rows(applied, motion)
    rows = np.concatenate((turning, across, np.einsum("nc,ncm->nm", direction, motion[body, 3:]), follower))
    stiffness = np.concatenate((k_turning, k_across, k_body, k_follower))
    owner = springs + np.concatenate((of_turning, statics.felt.line_owner, len(pairs.first) + body, of_follower))
    used = np.flatnonzero(rows.any(axis=1) & (stiffness != 0.0))
    return rows[used], stiffness[used], owner[used]


def add_rows(found: dict[str, Any], rows: Array, stiffness: Array, owner: Index) -> None:
    """Put rows of stiffness without damping behind those that a mechanism has, and add them to K.

    Parameters
    ----------
    found : dict
        Matrices and factors of the mechanism, changed in place.
    rows : array, shape (rows, m)
        Rows in minimal coordinates.
    stiffness, owner : array, shape (rows,)
        Signed values, and whose they are.
    """
    from mbsvib.assembly import product

    for key, value in (("elastic_rows", rows), ("stiffness", stiffness), ("damping", np.zeros(len(rows))),
                       ("row_owner", owner)):  # fmt: skip
        found[key] = np.concatenate((found[key], value))
    found["K"] = product(found["elastic_rows"], found["stiffness"])


def fixed(applied: Applied, pairs: Pairs) -> Pairs:
    """Return the pairs with the forces of follower loads, which have a form of their own, set to zero.

    Parameters
    ----------
    applied : Applied
        What loads the mechanism.
    pairs : Pairs
        All forces between bodies.

    Returns
    -------
    Pairs
        As many.
    """
    if not applied.follower.any():
        return pairs
    force = pairs.force.copy()
    force[:, : applied.loads][:, applied.follower] = 0.0
    return replace(pairs, force=force)
