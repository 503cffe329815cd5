"""Follower loads and torques: what they add to K depends on the way of the motion, not on its end alone.

In coordinates (u, theta) of the exponential map a force f and a torque t about the centre of mass, that turn with the
body, have the tangent [[0, [f]x], [0, 1/2 [t]x]]; a torque that stays fixed in the world has -1/2 [t]x. The symmetric
part of f gives signed rows, 1/2 u . (f x theta); the antisymmetric rest is the circulatory matrix N.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.geometric_stiffness import products
from mbsvib.equations.second_order_rows import normals
from mbsvib.kinematics.loops import EPS
from mbsvib.kinematics.mobility import crossed_product

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.wrenches import Applied

# Entries of N below this share of the products that make them are rounding.
ZERO_ENTRY = 16.0 * EPS


def follower_rows(applied: Applied, motion: Array) -> tuple[Array, Array, Index]:
    """Return the symmetric part of follower forces as rows, signed stiffness and the loads that own them.

    Parameters
    ----------
    applied : Applied
        What loads the mechanism.
    motion : array, shape (bodies, 6, m)
        Motion of the bodies in minimal coordinates.

    Returns
    -------
    rows : array, shape (rows, m)
        Rows in minimal coordinates.
    stiffness : array, shape (rows,)
        Signed values.
    owner : array, shape (rows,)
        Numbers of the loads.
    """
    one, other, owner = [], [], []
    for k in np.flatnonzero(applied.follower).tolist():
        force, body = applied.pairs.force[:, k], motion[applied.pairs.second[k]]
        size = float(np.linalg.norm(force))
        if size == 0.0:
            continue
        a, b = normals(force / size)
        one += [b @ body[:3], -a @ body[:3]]
        other += [0.5 * size * (a @ body[3:]), 0.5 * size * (b @ body[3:])]
        owner += [k, k]
    shape = (len(owner), motion.shape[-1])
    rows, stiffness = products(np.array(one).reshape(shape), np.array(other).reshape(shape))
    return rows, stiffness, np.array(owner + owner, dtype=np.intp)


def circulatory(applied: Applied, position: Array, motion: Array) -> Array | None:
    """Return the antisymmetric part N of the stiffness that loads add, or None where there is none.

    Parameters
    ----------
    applied : Applied
        What loads the mechanism.
    position : array, shape (3, bodies + 1)
        Centres of mass [m].
    motion : array, shape (bodies, 6, m)
        Motion of the bodies in minimal coordinates.

    Returns
    -------
    array, shape (m, m), or None
        N = -N^T.
    """
    pairs, m = applied.pairs, motion.shape[-1]
    result, size = np.zeros((m, m)), np.zeros((m, m))
    for k in range(applied.loads):
        follows = bool(applied.follower[k])
        torque, body = pairs.torque[:, k], motion[pairs.second[k]]
        if not follows and not torque.any():
            continue
        u, theta = body[:3], body[3:]
        if follows:
            arm = pairs.end[:, k] - position[:, pairs.second[k]]
            torque = torque + crossed_product(arm, pairs.force[:, k])
            part = u.T @ _crossing(pairs.force[:, k], theta)
            result += 0.5 * (part - part.T)
            part = np.abs(u).T @ _sized(pairs.force[:, k], theta)
            size += part + part.T
        part = (0.25 if follows else -0.25) * theta.T @ _crossing(torque, theta)
        result += part - part.T
        size += np.abs(theta).T @ _sized(torque, theta)
    result[np.abs(result) <= ZERO_ENTRY * size] = 0.0
    return result if result.any() else None


def _crossing(vector: Array, columns: Array) -> Array:
    return crossed_product(np.repeat(vector[:, None], columns.shape[1], axis=1), columns)


def _sized(vector: Array, columns: Array) -> Array:
    """The same with all signs positive: how large the products are that make a cross product."""
    (x, y, z), (a, b, c) = np.abs(vector), np.abs(columns)
    return np.array((y * c + z * b, z * a + x * c, x * b + y * a))
