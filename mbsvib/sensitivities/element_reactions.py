"""Forces in loaded beams and superelements that keep their shape: statics gives them, as those in joints.

Such elements do not deform as the pose moves, so that only motions q with R q = 0 are left, R being the deformations of
all elements and internal coordinates along the minimal ones. Where R has full rank, statics determines their forces:
there are motions that open the elements by any gaps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

from mbsvib.linalg.rank import DEPENDENT_DEFORMATION

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.linalg.vectors import Field

    Elements = tuple[tuple[str, ...], tuple[str, ...], int]



@dataclass(frozen=True, slots=True)
class ElementReactions:
    """Elements by their number among all springs (e,), with the coordinates that are ``dependent`` and those left (r,)
    where no element deforms; ``inverse`` leads from deformations, then internal coordinates, to the dependent ones,
    ``motions`` (m, r) from those left to all.
    """

    springs: Index
    dependent: Index
    independent: Index
    inverse: Array
    motions: Array

    def opened(self, gap: Field) -> Field:
        """Return the motion (m, ...) along dependent coordinates that opens elements by gaps (e, 6, ...)."""
        flat = gap.reshape(6 * len(gap), -1)
        result = np.zeros((len(self.motions), flat.shape[1]), dtype=flat.dtype)
        result[self.dependent] = self.inverse[:, : len(flat)] @ flat
        return result.reshape(len(result), *gap.shape[2:])


def element_reactions(
    elements: Sequence[Elements | None], number: Mapping[str, int], moves: Array, body_motion: Mapping[str, Array]
) -> ElementReactions | None:  # fmt: skip
    """Return the elements of beams and superelements whose forces statics gives, None if it does not determine them.

    ``elements`` are the names of those of each part, the bodies of its internal coordinates, and their number; None:
    statics does not determine their forces. ``number`` is that of each spring by its name, ``moves`` (s, 6, m) the
    relative motions of all springs and ``body_motion`` (6, m) those of bodies.
    """
    springs: list[int] = []
    internal: list[Array] = []
    for of_part in elements:
        if of_part is None or not all(name in number for name in of_part[0]):
            return None
        names, carriers, count = of_part
        if carriers:
            internal.append(np.concatenate([body_motion[name][:3] for name in carriers])[:count])
        springs += [number[name] for name in names]
    deformations = np.concatenate((moves[springs].reshape(6 * len(springs), moves.shape[2]), *internal))
    count, m = deformations.shape
    if count > m:
        return None
    scaled = deformations / _largest(deformations, 0)
    scaled = scaled / _largest(scaled, 1)
    _, r, order = qr(scaled, mode="economic", pivoting=True)
    if count and abs(r[-1, count - 1]) <= DEPENDENT_DEFORMATION * abs(r[0, 0]):
        return None
    dependent, independent = np.sort(order[:count]), np.sort(order[count:])
    inverse = np.asarray(np.linalg.inv(deformations[:, dependent]), dtype=float)
    motion = np.zeros((m, len(independent)))
    motion[independent, np.arange(len(independent))] = 1.0
    motion[dependent] = -inverse @ deformations[:, independent]
    return ElementReactions(np.array(springs, dtype=np.intp), dependent, independent, inverse, motion)


def _largest(array: Array, axis: int) -> Array:
    """The largest entry of each row or column, 1 where all are zero."""
    size = np.abs(array).max(axis=axis, initial=0.0, keepdims=True)
    return np.where(size > 0.0, size, 1.0)
