"""Mobility: is the number of degrees of freedom the same in the poses nearby?

Redundant constraints are legal where they stay redundant, as in planar loops. Where they are redundant in this pose
only (a four-bar stretched flat), the count of degrees of freedom jumps and no linear equations describe the motion.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import SingularPoseError
from mbsvib.kinematics import Rows, body_motion, relative_motion
from mbsvib.loops import pivoted_qr, scaled
from mbsvib.topology import FLOATS

if TYPE_CHECKING:
    from mbsvib.kinematics import Array, Index, Twists
    from mbsvib.loops import Cuts, LoopGroup, Reduction
    from mbsvib.topology import Topology

# The pose is moved by STEP (rad, or loop sizes) to first order; loops then close to STEP^2, and a constraint that has
# become independent shows as a pivot of the order of STEP. The limit lies between the two.
STEP = 1e-4
LIMIT = 1e-6


def check_mobility(
    topology: Topology, coordinates: Twists, cuts: Cuts | None, reduction: Reduction, position: Array
) -> None:
    """Refuse a pose in which fewer constraints are independent than in the poses nearby.

    Parameters
    ----------
    topology : Topology
        The spanning tree.
    coordinates : Twists
        The joint coordinates.
    cuts : Cuts or None
        Locked rows of the cut joints.
    reduction : Reduction
        The minimal coordinates; only groups of loops with redundant rows and a freedom left are looked at.
    position : array, shape (bodies, 3)
        Centres of mass [m], world axes.

    Raises
    ------
    SingularPoseError
        If the rank of the constraints is higher in the poses nearby.
    """
    groups = [group for group in reduction.groups if group.redundant]
    if cuts is None or reduction.matrix is None or not groups or not reduction.matrix.shape[1]:
        return
    # a direction that no symmetry of the mechanism can single out
    direction = reduction.matrix @ np.cos(1.0 + np.arange(reduction.matrix.shape[1]))
    moved_coordinates, moved_rows = _moved(topology, coordinates, cuts, position, direction, groups)
    phi = relative_motion(moved_coordinates, moved_rows).dense(0, len(cuts.names))
    for group in groups:
        scale = np.where(coordinates.turns[group.columns], 1.0, group.length)
        qr, _, _ = pivoted_qr(scaled(phi[group.rows[:, None], group.columns], cuts, group.rows, scale, group.length))
        pivots = np.abs(qr.diagonal())
        rank = int(np.count_nonzero(pivots > LIMIT * max(1.0, float(pivots.max(initial=0.0)))))
        if rank > group.rank:
            raise SingularPoseError(
                f"loops closed by {', '.join(group.joints)}: singular pose. {group.rank} of their {len(group.rows)} "
                f"constraint rows are independent here, {rank} in the poses nearby, so the number of degrees of "
                f"freedom jumps and linear equations do not describe the motion. Move the pose off the singular one."
            )


def _moved(
    topology: Topology, coordinates: Twists, cuts: Cuts, position: Array, direction: Array, groups: list[LoopGroup]
) -> tuple[Twists, Rows]:
    """Joint axes and locked rows after a small motion along the loops, to first order."""
    length = min(group.length for group in groups)
    step = STEP / float(np.max(np.abs(direction) / np.where(coordinates.turns, 1.0, length), initial=1e-300))
    displacement = np.zeros((len(position) + 1, 6))
    displacement[:-1] = body_motion(coordinates, position) @ (step * direction)
    centre = np.concatenate((position, np.zeros((1, 3))))

    def shift(body: Index, point: Array) -> Array:
        return point + displacement[body, :3].T + np.cross(displacement[body, 3:], point.T - centre[body]).T

    def turn(body: Index, vector: Array) -> Array:
        return vector + np.cross(displacement[body, 3:], vector.T).T

    carrier = _carriers(topology)
    twists = replace(coordinates, linear=turn(carrier, coordinates.linear), angular=turn(carrier, coordinates.angular),
                     point=shift(carrier, coordinates.point))  # fmt: skip
    rows = cuts.rows
    moment = turn(rows.first, rows.moment)
    for row, first_axis, second_axis in _crossed(topology, cuts):
        a = turn(rows.first[row : row + 1], np.array([first_axis]).T)
        b = turn(rows.second[row : row + 1], np.array([second_axis]).T)
        moment[:, row] = np.cross(a[:, 0], b[:, 0])
    return twists, replace(rows, point=shift(rows.first, rows.point), force=turn(rows.first, rows.force), moment=moment)


def _carriers(topology: Topology) -> Index:
    """The body in which each twist is fixed: a joint's first, but its second for the second of two rotations."""
    number = {name: i for i, name in enumerate(topology.bodies)}
    number["ground"] = len(topology.bodies)
    result: list[int] = []
    for branch in sorted((b for b in topology.branches if b.joint != FLOATS), key=lambda b: b.joint):
        joint = topology.joints[branch.joint]
        turning = [name for name, six in joint.freedom if any(six[3:])]
        for name, _ in joint.freedom:
            second = len(turning) == 2 and name == turning[1]
            result.append(number[joint.second if second else joint.first])
    return np.array(result + [number["ground"]] * (6 * len(topology.floating)), dtype=np.intp)


def _crossed(topology: Topology, cuts: Cuts) -> list[tuple[int, tuple[float, ...], tuple[float, ...]]]:
    """Locked rotations that are normal to an axis of each body: (row, axis in first, axis in second)."""
    result = []
    for count, k in enumerate(topology.cut):
        turning = [six[3:] for _, six in topology.joints[k].freedom if any(six[3:])]
        if len(turning) == 2:
            rows = np.nonzero(cuts.joint == count)[0]
            row = int(rows[cuts.rows.moment[:, rows].any(axis=0)][0])
            result.append((row, turning[0], turning[1]))
    return result
