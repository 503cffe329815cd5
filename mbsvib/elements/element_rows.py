"""Rows of elements between two bodies: relative displacements with a stiffness, a damping and an inertance.

K = D^T diag(k) D, C = D^T diag(c) D and, of inerters, M = D^T diag(b) D share the rows D. A direction without
stiffness or without damping has a zero there; one without both is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.rows import Rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Index


@dataclass(frozen=True, slots=True)
class ElementRows:
    """Elastic, damping and inertial rows: ``rows``, ``stiffness`` and ``damping`` (..., n), the number of the ``owner``
    (n,) among the model's connections, and the direction ``unit`` (..., n, 6) in the owner's axes. ``inertance`` (n,)
    is None where no inerter is among them.
    """

    rows: Rows
    stiffness: Array
    damping: Array
    owner: Index
    unit: Array
    inertance: Array | None = None

    @staticmethod
    def along_lines(ends: Array, start: Array, line: Array, stiffness: Array, damping: Array,
                    inertance: Array | None = None) -> ElementRows:  # fmt: skip
        """Return rows of changes of length.

        Parameters
        ----------
        ends : array, shape (3, n)
            Numbers of the first body, of the second body and of the owner.
        start, line : array, shape (3, n)
            A point of each line [m], and its unit vector, world axes.
        stiffness, damping, inertance : array, shape (n,)
            Their coefficients.

        Returns
        -------
        ElementRows
            One row a line.
        """
        first, second, owner = ends.astype(np.intp)
        unit = np.zeros((len(owner), 6))
        unit[:, 2] = 1.0
        return ElementRows(Rows(first, second, start, line, np.zeros(line.shape)), stiffness, damping, owner, unit,
                           inertance)  # fmt: skip

    @staticmethod
    def join(parts: Sequence[ElementRows]) -> ElementRows:
        """Return the rows of several families as one."""
        if len(parts) == 1:
            return parts[0]
        inertance = None
        if any(part.inertance is not None for part in parts):
            inertance = np.concatenate([np.zeros(len(part.owner)) if part.inertance is None else part.inertance
                                        for part in parts])  # fmt: skip
        stiffness, damping, owner, unit = (np.concatenate([getattr(part, key) for part in parts])
                                           for key in ("stiffness", "damping", "owner", "unit"))  # fmt: skip
        return ElementRows(Rows.join([part.rows for part in parts]), stiffness, damping, owner, unit, inertance)

    def only(self, kept: Index) -> ElementRows:
        """Return the rows of some numbers, in ascending order."""
        if len(kept) == len(self.owner):
            return self
        rows = self.rows
        return ElementRows(
            Rows(rows.first.take(kept), rows.second.take(kept), rows.point.take(kept, axis=-1),
                 rows.force.take(kept, axis=-1), rows.moment.take(kept, axis=-1)),
            self.stiffness.take(kept, axis=-1), self.damping.take(kept, axis=-1), self.owner.take(kept),
            self.unit.take(kept, axis=-2), None if self.inertance is None else self.inertance.take(kept),
        )  # fmt: skip

    @property
    def weights(self) -> tuple[tuple[int, Array], ...]:
        """Stiffness, damping and inertance, by the derivative of the displacement that each of them multiplies."""
        return tuple([(order, value) for order, value in enumerate((self.stiffness, self.damping, self.inertance))
                      if value is not None])  # fmt: skip
