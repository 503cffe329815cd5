"""Rigid-body motions that no damper resists."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.unresisted_motion import (
    coordinate_sizes,
    free_motions,
    null_pair,
    rounding_scale,
)
from mbsvib.linalg.products import product_with_zeros, weighted_gram

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations


def unbraked(system: Equations, rigid: Array) -> Array:
    """Return the rigid-body motions among (m, r) that no damper resists, (m, f); with negative dampers, those that
    deform neither a spring nor a damper.
    """
    if (system.row_stiffness >= 0.0).all() or (system.row_damping < 0.0).any():
        free = free_motions(system.elastic_rows[(system.row_stiffness != 0.0) | (system.row_damping != 0.0)])
        return free if free.shape[1] <= rigid.shape[1] else rigid[:, :0]
    # stiffness of loads has both signs: only its sum determines the motions, and the same holds for dampers in them
    relative_motion = product_with_zeros(system.elastic_rows, rigid)
    most = np.abs(system.elastic_rows) @ rounding_scale(rigid, coordinate_sizes(system))
    c = system.row_damping
    return rigid @ null_pair(weighted_gram(relative_motion, c), weighted_gram(most, c))[0]
