"""Dampers so strong that rounding of their products would affect the motions that they nearly lock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations
    from mbsvib.modes.damped import Damped

# Dampers are strong where rounding in Gamma exceeds that: eps |L|^T |L| in parts of omega_i + omega_j.
STRONG = 200.0


def strong_dampers(system: Equations, modal: Damped) -> Array | None:
    """Return rows L (dampers, m) with Gamma = L^T L if rounding of Gamma is significant, else None."""
    used = system.row_damping != 0.0
    if modal.vectors is None or (system.row_damping < 0.0).any():
        return None
    root = np.sqrt(system.row_damping[used])[:, None]
    rows = system.elastic_rows[used]
    dampers = (rows @ modal.shapes) * root
    omega = np.sqrt(np.abs(modal.square))
    together = omega[:, None] + omega
    together[together == 0.0] = np.inf  # rigid-body modes do not share a damper: Gamma is diagonal there
    coupling = ((np.abs(rows) @ np.abs(modal.shapes)) * root).T @ np.abs(dampers)
    return dampers if (coupling > STRONG * together).any() else None
