"""Nodes of elastic blocks as frames: where their coordinates put them, and these coordinates where frames are known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.finite_motion.frames import Frame
from mbsvib.finite_motion.rotations import Expression, exponential, logarithm
from mbsvib.linalg.rotations import exponential as rotation_matrix

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.finite_motion.elastic_block import ElasticBlock


def node_displacement(block: ElasticBlock, station: int, both: Expression) -> Frame:
    """Return the displacement of an interface node against the root, in the axes of the root as described.

    It is that since the pose as described. ``station``: number of the node among the elastic ones. ``both``
    (modes + interface,): coordinates (z, b) of the block.
    """
    rho, rows = block.state[6 * station + 3 : 6 * station + 6], block.span[6 * station : 6 * station + 6]
    b = ca.sparsify(ca.DM(rows)) @ both
    rotation = exponential(ca.SX(rho) + b[3:])
    if rho.any():
        rotation = rotation @ ca.DM(_inverse(rho))
    point = ca.SX(point_as_described(block, station))
    return Frame(rotation, point + b[:3] - rotation @ point)


def coordinates_of(block: ElasticBlock, station: int, relative: Frame) -> Expression:
    """Return the coordinates b (6,) of an interface node whose displacement against the root follows from others."""
    rho = block.state[6 * station + 3 : 6 * station + 6]
    point = ca.SX(point_as_described(block, station))
    rotation = relative.rotation @ ca.DM(_inverse(rho)).T if rho.any() else relative.rotation
    return ca.vertcat(relative.point(point) - point, logarithm(rotation) - ca.SX(rho))


def point_as_described(block: ElasticBlock, station: int) -> Array:
    """Return where a node is in the pose as described [m]."""
    return np.asarray(block.points[block.elastic[station]] + block.state[6 * station : 6 * station + 3])


def node_row(block: ElasticBlock, body: str, point: Sequence[float], wrench: Sequence[float]) -> Array:
    """Return the row (6 e + internal,) that makes of x the small displacement of a point along a direction; 0 for the
    root.

    ``body``: name of the node, or of the root, that carries the point. ``point`` (3,): the point as described [m].
    ``wrench`` (6,): the direction, translation and rotation, in the axes of the root as described.
    """
    row = np.zeros(len(block.state))
    if body in block.nodes:
        k = block.nodes.index(body)
        force = np.array(wrench[:3])
        row[6 * k : 6 * k + 3] = force
        row[6 * k + 3 : 6 * k + 6] = wrench[3:] + np.cross(np.array(point) - point_as_described(block, k), force)
    return row


def _inverse(rho: Array) -> Array:
    """The rotation matrix of -rho."""
    return rotation_matrix(-rho)
