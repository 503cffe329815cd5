"""Accelerations that forces cause at once, M^-1 F, and the feedthrough D + Ca M^-1 B from inputs to outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.groups import part_numbers
from mbsvib.linalg.qr import gram_solution
from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations

# An entry of D below this share of what M^-1 makes of rounding of its terms is 0.
ROUNDING = 32 * EPS


def accelerations(system: Equations, forces: Array) -> Array:
    """Return M^-1 F (m, n) of regular M; coordinates whose accelerations M does not tie to the forces have exactly 0.
    """
    result = gram_solution(system.inertia_factor, forces)
    part = part_numbers(system.M != 0.0)
    if part.any():
        acted_on = np.zeros((part.max() + 1, forces.shape[1]), dtype=bool)
        np.logical_or.at(acted_on, part, forces != 0.0)
        result[~acted_on[part]] = 0.0
    return result


def feedthrough(system: Equations) -> Array:
    """Return D + Ca M^-1 B (outputs, inputs) of regular M, 0 where it is rounding."""
    if not system.Ca.any():
        return np.array(system.D)
    inverse = accelerations(system, np.eye(system.dof))
    moved = np.abs(inverse) @ np.abs(system.M) @ np.abs(inverse) @ np.abs(system.B)
    result = system.D + system.Ca @ accelerations(system, system.B)
    result[np.abs(result) <= ROUNDING * (np.abs(system.D) + np.abs(system.Ca) @ moved)] = 0.0
    return np.asarray(result)
