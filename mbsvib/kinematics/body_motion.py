"""Displacements of bodies per unit joint coordinate: the open-loop constraint matrix B'."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rotations import CYCLE

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.kinematics.relative_motion import Twists


def body_motion(coordinates: Twists, position: Array) -> Array:
    """Return the open-loop constraint matrix B' (..., bodies, 6, n): displacements of the bodies per unit joint
    coordinate.

    x_j = sum over the coordinates k on the path ground -> j of (v_k + w_k x (c_j - p_k), w_k) q_k

    ``position`` (..., bodies, 3): centres of mass [m], world axes. Displacements are translations of the centres of
    mass, then rotations, world axes.

    Source: Jiang, Chen & Luo (2011), open-loop constraint matrix B'.
    """
    if position.ndim + coordinates.linear.ndim + coordinates.angular.ndim + coordinates.point.ndim > 8:
        return _body_motion_of_variants(coordinates, position)
    sign = coordinates.path[:-1, None].astype(float)
    angular, point = coordinates.angular.take(CYCLE, axis=0), coordinates.point.take(CYCLE, axis=0)
    arm = position.take(CYCLE, axis=1)[..., None] - point
    translation = angular[1:4] * arm[:, 2:]
    translation -= angular[2:] * arm[:, 1:4]
    translation += coordinates.linear
    result = np.empty((len(translation), 6, sign.shape[2]))
    np.multiply(translation, sign, out=result[:, :3])
    np.multiply(angular[:3], sign, out=result[:, 3:])
    return result


def _body_motion_of_variants(coordinates: Twists, position: Array) -> Array:
    """Displacements of the bodies in all variants: only coordinates on the path from ground move a body."""
    body, column = coordinates.path[:-1].nonzero()
    sign = coordinates.path[body, column].astype(float)[:, None]
    centre = np.moveaxis(position, (-1, -2), (0, 1))
    linear, angular, point = (array[..., None] if array.ndim == 2 else array.swapaxes(1, 2) for array in (
        coordinates.linear, coordinates.angular, coordinates.point))  # fmt: skip
    turns = angular.take(column, axis=1) * sign
    arm = (centre if centre.ndim == 3 else centre[..., None]).take(body, axis=1) - point.take(column, axis=1)
    arm, wide = arm.take(CYCLE, axis=0), turns.take(CYCLE, axis=0)
    translation = wide[1:4] * arm[2:]
    translation -= wide[2:] * arm[1:4]
    translation = translation + linear.take(column, axis=1) * sign
    *_, variants = np.broadcast_shapes(translation.shape, turns.shape)
    bodies, n = len(coordinates.path) - 1, coordinates.path.shape[1]
    result = np.zeros((variants, bodies * 6 * n), np.result_type(translation, turns))
    at = (6 * body + np.arange(3)[:, None]) * n + column
    result[:, at.reshape(-1)] = translation.reshape(3 * len(body), translation.shape[2]).T
    result[:, at.reshape(-1) + 3 * n] = turns.reshape(3 * len(body), turns.shape[2]).T
    return result.reshape(variants, bodies, 6, n)
