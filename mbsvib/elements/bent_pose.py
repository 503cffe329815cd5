"""Nodes of elastic parts in another pose, relative to the body in whose frame the part is linear."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.linalg.rotations import exponential, logarithm

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Composed
    from mbsvib.elements.pose import Pose


def is_unmoved(part: Composed, pose: Pose) -> bool:
    """Return whether all bodies of an elastic part are in the reference pose."""
    carriers = [name for name in part.carriers if name in pose.number]
    return all(map(pose.is_unmoved, (part.root, *(body for body, _ in part.node_bodies), *carriers)))


def bent_nodes(part: Composed, before: Array, pose: Pose) -> tuple[Array, Array, bool]:
    """Return the nodes of an elastic part in another pose.

    ``before`` (n, 6): displacements of its nodes against its root in the reference pose [m, rad], world axes. Returns
    the points (n, 3) of the nodes [m], their displacements (n, 6) against the root, and whether these have changed by
    more than rounding.
    """
    points, root = np.array(part.points), pose.number[part.root]
    which, frame = np.array([pose.number[body] for body, _ in part.node_bodies]), np.full(len(points), root)
    moved_points, turn = pose.points(which, points), pose.rotations[root]
    change = moved_points - pose.points(frame, points)
    rotation = logarithm(turn.T @ pose.rotations[which] @ exponential(before[:, 3:]))
    after = np.concatenate((before[:, :3] @ turn.T + change, rotation @ turn.T), axis=1)
    extent = float(np.abs(np.concatenate((points, moved_points))).max())
    turned = np.abs(rotation - before[:, 3:]).max()
    return moved_points, after, bool(np.abs(change).max() > ZERO_SUM * extent or turned > ZERO_SUM)
