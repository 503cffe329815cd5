"""Virtual work of rotors and cross-coupled elements in a motion that releases a joint.

The moment of a rotor with the angular momentum h on its body is h x theta', the wrench of a cross-coupled element on
its second body is -K_a d - C_a d'. Their work in a motion is a row over the unknowns, and one over their rates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.spin_terms import cross_couplings, momenta
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.sparse.rows import relative_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body
    from mbsvib.equations.spin_terms import CrossCoupling
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.tree import Tree
    from mbsvib.sparse.virtual_motions import Motion


@dataclass(frozen=True, slots=True)
class SpinForces:
    """Angular momenta (body, h) of rotors, and cross-coupled ``elements`` with their six rows over the unknowns."""

    layout: Layout
    momenta: list[tuple[int, Array]]
    elements: list[tuple[CrossCoupling, csr_matrix]]

    def of_rotors(self, rotations: Array) -> Array:
        """Return the work of rotors in rotations (bodies + 1, 3), as a row over the rates of the unknowns (size,)."""
        result = np.zeros(self.layout.size)
        for body, momentum in self.momenta:
            column = self.layout.displacement[body, 3:]
            used = column >= 0
            result[column[used]] += np.cross(rotations[body], momentum)[used]
        return result

    def of_elements(self, motion: Motion) -> Array:
        """Return the work of cross-coupled elements in a motion, as rows (2, size) over the unknowns and their rates.
        """
        result = np.zeros((2, self.layout.size))
        for part, rows in self.elements:
            along = motion.along(part.rows)
            if motion.tree_motion is not None:
                along = along + rows @ motion.tree_motion
            for order, matrix in enumerate((part.stiffness, part.damping)):
                result[order] -= rows.T @ (matrix.T @ along)
        return result

    def in_element(self, name: str, wrench: Array) -> Array | None:
        """Return the force of an element along a wrench (6,) in its axes, as rows (2, size) over the unknowns and their
        rates; None without cross-coupling.
        """
        for part, rows in self.elements:
            if part.name == name:
                return np.stack([rows.T @ (matrix.T @ (part.axes @ wrench))
                                 for matrix in (part.stiffness, part.damping)])  # fmt: skip
        return None


def spin_forces(model: Mechanism, bodies: Sequence[Body], tree: Tree, layout: Layout) -> SpinForces | None:
    """Return the forces of a model's rotors and cross-coupled elements, or None if it has none."""
    if not model.derived(has_antisymmetric_forces):
        return None
    elements = [(part, relative_rows(tree, layout, part.rows))
                for part in cross_couplings(model, bodies, tuple(model.springs.values()))]  # fmt: skip
    return SpinForces(layout, momenta(model, bodies), elements)
