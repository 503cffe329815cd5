"""The length of a mechanism: what moments are divided by where they are added to forces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.kinematics import Array

# Points closer than this share of their distance from the origin are one point, told apart by rounding.
SAME_POINT = 16.0 * float(np.finfo(float).eps)


def length_of(points: Array) -> float:
    """Return the root mean square distance of points from their mean.

    L^2 = 1/n sum of |p_i - 1/n sum of p_j|^2

    It is the same in all frames and for all orders of the points.

    Parameters
    ----------
    points : array, shape (n, 3)
        Points [m].

    Returns
    -------
    float
        Length [m]; 1 where there is no point, or all are one but for rounding.
    """
    if not len(points):
        return 1.0
    apart = points - points.mean(axis=0)
    length = float(np.sqrt((apart * apart).sum() / len(points)))
    return length if length > SAME_POINT * float(np.abs(points).max()) else 1.0
