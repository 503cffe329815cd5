"""Forces in the elements of loaded beams that keep their shape: statics gives them, as those in joints.

Such elements do not deform as the pose moves, so that only motions q with R q = 0 are left, R being the deformations of
all elements along the coordinates. Where R has full rank, statics determines their forces: there are motions that open
the elements by any gaps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

from mbsvib.linalg.vectors import any_nonzero

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.linalg.vectors import Field

# Deformations, each scaled to its largest, that depend on each other but for this share are not independent.
DETERMINED = 1e-9


@dataclass(frozen=True, slots=True)
class ElementReactions:
    """Elements by their number among all springs (e,), with the coordinates that are ``dependent`` (6 e,) and those
    left (r,) where no element deforms; ``inverse`` (6 e, 6 e) leads from deformations to the dependent ones.
    """

    springs: Index
    dependent: Index
    independent: Index
    inverse: Array
    motions: Array

    def opened(self, gap: Field) -> Field:
        """Return the motion (m, ...) along dependent coordinates that opens elements by gaps (e, 6, ...)."""
        flat = gap.reshape(len(self.dependent), -1)
        result = np.zeros((len(self.motions), flat.shape[1]), dtype=flat.dtype)
        result[self.dependent] = self.inverse @ flat
        return result.reshape(len(result), *gap.shape[2:])


def element_reactions(springs: Index, deformations: Array) -> ElementReactions | None:
    """Return the elements whose forces statics gives, or None if it does not determine them.

    ``springs`` (e,): their numbers among all springs; ``deformations`` (6 e, m): R.
    """
    count, m = deformations.shape
    if count > m or not any_nonzero(deformations):
        return None
    scaled = deformations / np.abs(deformations).max(axis=0, initial=0.0, where=deformations != 0.0).clip(1e-300)
    scaled = scaled / np.abs(scaled).max(axis=1, keepdims=True).clip(1e-300)
    _, r, order = qr(scaled, mode="economic", pivoting=True)
    if abs(r[-1, count - 1]) <= DETERMINED * abs(r[0, 0]):
        return None
    dependent, independent = np.sort(order[:count]), np.sort(order[count:])
    inverse = np.linalg.inv(deformations[:, dependent])
    motions = np.zeros((m, len(independent)))
    motions[independent, np.arange(len(independent))] = 1.0
    motions[dependent] = -inverse @ deformations[:, independent]
    return ElementReactions(springs, dependent, independent, np.asarray(inverse, dtype=float), motions)
