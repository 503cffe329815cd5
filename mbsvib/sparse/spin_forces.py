"""Virtual work of rotors and rotating dampers in a motion that releases a joint.

The moment of a rotor with the angular momentum h on its body is h x theta', the wrench of a rotating damper on its
second body is C_d [W]x d. Their work in a motion is a row over the rates of the unknowns, and over the unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.spin_terms import momenta, rotating_dampers
from mbsvib.sparse.rows import relative_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body
    from mbsvib.equations.spin_terms import RotatingDamper
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.tree import Tree
    from mbsvib.sparse.virtual_motions import Motion


@dataclass(frozen=True, slots=True)
class SpinForces:
    """Angular momenta (body, h) of rotors, and rotating ``dampers`` with their six rows over the unknowns."""

    layout: Layout
    momenta: list[tuple[int, Array]]
    dampers: list[tuple[RotatingDamper, csr_matrix]]

    def of_rotors(self, rotations: Array) -> Array:
        """Return the work of rotors in rotations (bodies + 1, 3), as a row over the rates of the unknowns (size,)."""
        result = np.zeros(self.layout.size)
        for body, momentum in self.momenta:
            column = self.layout.displacement[body, 3:]
            used = column >= 0
            result[column[used]] += np.cross(rotations[body], momentum)[used]
        return result

    def of_dampers(self, motion: Motion) -> Array:
        """Return the work of rotating dampers in a motion, as a row over the unknowns (size,)."""
        result = np.zeros(self.layout.size)
        for damper, rows in self.dampers:
            along = motion.along(damper.rows)
            if motion.tree_motion is not None:
                along = along + rows @ motion.tree_motion
            result += rows.T @ (damper.matrix.T @ along)
        return result

    def in_element(self, name: str, wrench: Array) -> Array | None:
        """Return the force of a rotating damper along a wrench (6,) in its axes; None if the element does not rotate.
        """
        for damper, rows in self.dampers:
            if damper.name == name:
                return np.asarray(-(rows.T @ (damper.matrix.T @ (damper.axes @ wrench))))
        return None


def spin_forces(model: Mechanism, bodies: Sequence[Body], tree: Tree, layout: Layout) -> SpinForces | None:
    """Return the forces of a model's rotors, or None if it has none."""
    if not model.rotors:
        return None
    dampers = [(damper, relative_rows(tree, layout, damper.rows))
               for damper in rotating_dampers(model, bodies, tuple(model.springs.values()))]  # fmt: skip
    return SpinForces(layout, momenta(model, bodies), dampers)
