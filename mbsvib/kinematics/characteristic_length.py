"""The characteristic length of a mechanism, by which moments are divided to add them to forces."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.rank import SAME_POINT

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.mechanism.mechanism import Mechanism


def length_of(points: Array, *centres: Array) -> Any:
    """Return the root mean square distance (...) of points (..., n, 3) [m] from their mean [m].

    L^2 = 1/n sum of |p_i - 1/n sum of p_j|^2

    It is the same in all frames and for all orders of the points; 1 where there is no point, or all coincide within
    rounding. ``centres`` (..., n, 3): centres of mass of the bodies that have these points [m].
    """
    if not points.shape[-2]:
        return 1.0
    offsets = points - points.mean(axis=-2, keepdims=True)
    length = np.sqrt((offsets * offsets).sum(axis=(-2, -1)) / points.shape[-2])
    far = reduce(np.maximum, [np.abs(points - centre).max(axis=(-2, -1)) for centre in (np.zeros(3), *centres)])
    return np.where(np.abs(length) > SAME_POINT * far, length, 1.0)[()]


def size_of(model: Mechanism) -> float:
    """Return the size [m] of a mechanism in its reference pose, 1 m if all of its points coincide.

    It is the root mean square distance from their mean of the centres of mass, the points of joints and bushings, and
    the ends of springs.
    """
    points = [body.position for body in model.bodies.values()]
    points += [joint.point for joint in model.joints.values() if joint.point is not None]
    for spring in model.springs.values():
        points += spring.points
    return float(length_of(np.array(points).reshape(-1, 3)))
