"""Mobility: is the number of degrees of freedom the same in neighbouring poses?

Redundant constraints are accepted where they stay redundant, as in planar loops. Where they are redundant in this pose
only (a four-bar linkage in one line), the number of degrees of freedom jumps and linear equations do not describe the
motion.

Source: Connelly & Whiteley, SIAM J. Discrete Math. 9 (1996) 453, for constraints to second order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.common.tables import listed
from mbsvib.elements.pose import IDENTITY, Pose
from mbsvib.errors import SingularPoseError
from mbsvib.kinematics.couplers import locked
from mbsvib.kinematics.loops import Cuts, LoopGroup, Reduction
from mbsvib.kinematics.relative_motion import Twists, body_motion
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import NEIGHBOUR_PIVOT, NEIGHBOUR_STEP, PARALLEL_AXES, RANK_FACTOR
from mbsvib.linalg.rotations import skew
from mbsvib.mechanism.topology import Topology


def check_mobility(
    topology: Topology, coordinates: Twists, cuts: Cuts | None, reduction: Reduction, position: Array
) -> bool:
    """Refuse a pose in which fewer constraints are independent than in neighbouring poses.

    Only groups of loops with redundant rows are checked. ``position`` (bodies, 3): centres of mass [m], world axes.
    Returns whether loops are planar, which makes a check of neighbouring poses unnecessary.
    """
    groups = [group for group in reduction.groups if group.surplus]
    if cuts is None or reduction.matrix is None or not groups or not reduction.matrix.shape[1]:
        return False
    # without rods and two successive rotations, each row is fixed in one body
    fixed = not any(topology.joints[k].successive for k in topology.cut) and not any(
        joint.is_rod for joint in topology.joints)
    if fixed and _stays_planar(coordinates, cuts, groups):
        return True
    phi = phi_nearby(topology, coordinates, cuts, reduction, position)
    for group in groups:
        scale = np.where(coordinates.turns[group.columns], 1.0, group.length)
        row_scale = cuts.row_scale(group.length).take(group.rows)[:, None]
        limit = max(NEIGHBOUR_PIVOT, RANK_FACTOR * group.noise)
        rank = rank_nearby(phi[group.rows[:, None], group.columns] * row_scale * scale, limit)
        if rank > group.rank:
            raise jump(group.joints, len(group.rows), group.rank, rank)
    return False


def rank_nearby(a: Array, limit: float) -> int:
    """Return the number of pivots of scaled constraint rows above a limit, in units of the largest if that exceeds one.
    """
    pivots = np.abs(pivoted_qr(a)[0].diagonal())
    return int(np.count_nonzero(pivots > limit * max(1.0, float(pivots.max(initial=0.0)))))


def jump(joints: Sequence[str], rows: int, here: int, nearby: int) -> SingularPoseError:
    """Return the error of loops closed by ``joints``, of whose ``rows`` more are independent in neighbouring poses."""
    return SingularPoseError(
        f"loops closed by {listed(joints)}: singular pose. {here} of their {rows} constraint rows are independent "
        f"here, {nearby} in neighbouring poses, so the number of degrees of freedom jumps and linear equations do not "
        f"describe the motion. Move the pose off the singular one."
    )


def _stays_planar(coordinates: Twists, cuts: Cuts, groups: list[LoopGroup]) -> bool:
    """Tell whether these loops move in parallel planes with as many independent constraints as planar loops can have.

    Then the same holds in all neighbouring poses, as axes stay normal to the planes.
    """
    columns = groups[0].columns if len(groups) == 1 else np.concatenate([group.columns for group in groups])
    if cuts.couplings is not None or not len(columns):
        return False
    angular, linear = coordinates.angular.take(columns, axis=1), coordinates.linear.take(columns, axis=1)
    normal = angular[:, np.add.reduce(np.abs(angular)).argmax()]
    length = np.sqrt(normal.dot(normal))
    if not length:
        return False
    normal = normal / length
    if np.count_nonzero(np.abs(normal.dot(linear)) > PARALLEL_AXES):
        return False
    if np.count_nonzero(np.abs(angular - normal[:, None] * normal.dot(angular)) > PARALLEL_AXES):
        return False
    along = cuts.rows.force - normal[:, None] * normal.dot(cuts.rows.force)
    acts = np.maximum.reduce(np.abs(along)) > PARALLEL_AXES
    acts |= np.abs(normal.dot(cuts.rows.moment)) > PARALLEL_AXES
    return all(np.count_nonzero(acts.take(group.rows)) == group.rank for group in groups)


def phi_nearby(
    topology: Topology, coordinates: Twists, cuts: Cuts, reduction: Reduction, position: Array,
    axes: Mapping[str, Array] = MappingProxyType({}), lengths: Mapping[str, Array] = MappingProxyType({}),
) -> Array:  # fmt: skip
    """Return the constraints Phi (..., locked rows, n) of the loops in a neighbouring pose, which the mechanism reaches
    to first order.

    ``position`` (..., bodies, 3): centres of mass [m], world axes. ``axes`` (..., 3, 3) and ``lengths`` (...): of
    joints by name, where variants differ in them.
    """
    matrix = reduction.matrix
    assert matrix is not None
    # a direction without any symmetry of the mechanism
    direction = matrix @ np.cos(1.0 + np.arange(matrix.shape[-1]))
    length = min(group.length for group in reduction.groups if group.surplus)
    largest = (np.abs(direction) / np.where(coordinates.turns, 1.0, length)).max(axis=-1, keepdims=True, initial=1e-300)
    motion = body_motion(coordinates, position) @ (NEIGHBOUR_STEP / largest * direction)[..., None, :, None]
    return locked(*rows_nearby(topology, coordinates, cuts, position, motion[..., 0], axes, lengths))


def rows_nearby(
    topology: Topology, coordinates: Twists, cuts: Cuts, position: Array, motion: Array,
    axes: Mapping[str, Array] = MappingProxyType({}), lengths: Mapping[str, Array] = MappingProxyType({}),
) -> tuple[Twists, Cuts]:  # fmt: skip
    """Return the joint coordinates and the locked rows after small motions (..., bodies, 6) of the bodies.

    ``axes``, ``lengths``: as in ``phi_nearby``.
    """
    from mbsvib.kinematics.pose_kinematics import pose_kinematics

    origin, motion = (np.concatenate((array, np.zeros((*array.shape[:-2], 1, array.shape[-1]))), axis=-2)
                      for array in (position, motion))  # fmt: skip
    described = Pose(topology.body_numbers, origin, origin, np.broadcast_to(IDENTITY, (*origin.shape, 3)))
    kinematics = pose_kinematics(topology, described, coordinates, cuts, 1.0, axes, lengths)
    # to first order: far centres of mass would make more of the square of a rotation than a pivot may have
    moved, rows = kinematics.at(Pose(described.number, origin, origin + motion[..., :3],
                                     IDENTITY + skew(motion[..., 3:])))  # fmt: skip
    assert rows is not None
    return moved, rows
