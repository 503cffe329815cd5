"""The characteristic length of a mechanism, by which moments are divided to add them to forces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rank import SAME_POINT

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


def length_of(points: Array, *centres: Array) -> float:
    """Return the root mean square distance of points (n, 3) [m] from their mean [m].

    L^2 = 1/n sum of |p_i - 1/n sum of p_j|^2

    It is the same in all frames and for all orders of the points; 1 where there is no point, or all coincide within
    rounding. ``centres`` (n, 3): centres of mass of the bodies that have these points [m].
    """
    if not len(points):
        return 1.0
    offsets = points - points.mean(axis=0)
    length = float(np.sqrt((offsets * offsets).sum() / len(points)))
    far = max([float(np.abs(points - centre).max()) for centre in (np.zeros(3), *centres)])
    return length if length > SAME_POINT * far else 1.0
