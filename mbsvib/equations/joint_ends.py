"""Ends of joints: their bodies and points, and the components of their wrenches that are zero."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.products import product_with_zeros

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Joint
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.mechanism.topology import Topology


def joint_ends(topology: Topology, position: Array) -> tuple[Index, Index, Array, Array, Index]:
    """Return the bodies and points of joints.

    ``position`` (3, bodies + 1): centres of mass [m], the origin for ground. Returns ``first, second`` (joints,):
    numbers of their bodies; ``start, point`` (3, joints): points of the first and of the second body [m], which differ
    for rods; ``carrier`` (joints,): numbers of the bodies with which these points move.
    """
    number, joints = topology.body_numbers, topology.joints
    first, second, carrier = (np.array(bodies, dtype=np.intp) for bodies in (
        [number[joint.first] for joint in joints], [number[joint.second] for joint in joints],
        [carrier_of(joint, number) for joint in joints]))  # fmt: skip
    point = np.array([point_of(joint, number, position) for joint in joints]).reshape(-1, 3).T
    start = point.copy()
    for k, joint in enumerate(joints):
        if joint.is_rod:
            start[:, k] = joint.position
    return first, second, start, point, carrier


def carrier_of(joint: Joint, number: Mapping[str, int]) -> int:
    """Return the body with which a joint's point moves: its second body, or its first where the second is ground and
    the point is a centre of mass.
    """
    return number[joint.first if joint.point is None and joint.second == "ground" else joint.second]


def point_of(joint: Joint, number: Mapping[str, int], position: Array) -> Array | tuple[float, float, float]:
    """Return a joint's point; by default the centre of mass of its second body (of its first, where that is ground)."""
    if joint.point is not None:
        return joint.point
    bodies = (number[joint.second], number[joint.first])
    return position[:, bodies[1] if bodies[0] == position.shape[1] - 1 else bodies[0]]


def carries_nothing(joint: Joint, direction: Array, model: Mechanism, loaded: bool) -> bool:
    """Return whether a component of the wrench in a joint is zero in every motion, along its free directions.

    ``direction`` (6,): of the component, world axes. Under load, the free rotations must be about axes that the first
    body carries, or about all; couplers act along free directions.
    """
    if (loaded and len(joint.rotation_axes) == 2) or any(
            name.rpartition(".")[0] == joint.name for part in model.couplers.values() for name, _ in part.terms):
        return False
    return not product_with_zeros(np.array([row for _, row in joint.locked]).reshape(-1, 6), direction).any()
