"""Matrices of equations of motion in minimal coordinates, and the factors that they are made of."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.fast_init import fast_init

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index


@fast_init
@dataclass(frozen=True, repr=False, eq=False)
class Matrices:
    """Matrices and factors of M q'' + C q' + K q = B u, y = Cq q + Cv q' + Ca q'' + D u, described in ``Equations``.

    In many variants arrays may have an axis of variants in front.
    """

    M: Array
    C: Array
    K: Array
    B: Array
    Cq: Array
    Cv: Array
    Ca: Array
    D: Array
    inertia_factor: Array
    elastic_rows: Array
    row_stiffness: Array
    row_damping: Array
    row_owner: Index
    body_motion: Array
    gyroscopic: Array | None = None
    circulatory: Array | None = None
    massless: int = 0
    null_inertia: Array | None = None

    @property
    def mass(self) -> Array:
        """The mass matrix M (m, m) by its other name, in a batch (variants, m, m)."""
        return self.M

    @property
    def damping(self) -> Array:
        """The damping matrix C (m, m) by its other name, in a batch (variants, m, m); the output matrix of first-order
        equations is ``state_space().C``.
        """
        return self.C

    @property
    def stiffness(self) -> Array:
        """The stiffness matrix K (m, m) by its other name, in a batch (variants, m, m)."""
        return self.K


_NAMES = tuple([item.name for item in fields(Matrices)])
MATRICES = _NAMES[: _NAMES.index("inertia_factor")]
# Arrays that equations without spin, follower loads and massless motions lack.
OPTIONAL = ("gyroscopic", "circulatory", "null_inertia")


@fast_init
@dataclass(frozen=True, repr=False, eq=False)
class Terms(Matrices):
    """Matrices and factors during the assembly."""

    def named(self) -> dict[str, Any]:
        """Return all terms by their names."""
        return dict(vars(self))

    def with_rows(self, rows: Array, stiffness: Array, owner: Index) -> Terms:
        """Return the terms with more rows of stiffness without damping, K + D^T diag(k) D.

        Parameters
        ----------
        rows : array, shape (rows, m)
            Rows in minimal coordinates.
        stiffness, owner : array, shape (rows,)
            Signed values, and numbers of their owners.

        Returns
        -------
        Terms
            The sum.
        """
        added = rows.T.dot(stiffness[:, None] * rows)
        return replace(
            self, K=self.K + 0.5 * (added + added.T), elastic_rows=np.concatenate((self.elastic_rows, rows)),
            row_stiffness=np.concatenate((self.row_stiffness, stiffness)),
            row_damping=np.concatenate((self.row_damping, np.zeros(len(rows)))),
            row_owner=np.concatenate((self.row_owner, owner)),
        )  # fmt: skip

    def with_antisymmetric(self, gyroscopic: Array | None, circulatory: Array | None) -> Terms:
        """Return the terms with antisymmetric matrices (m, m) or None added to C and to K."""
        result = self
        if gyroscopic is not None:
            before = 0.0 if self.gyroscopic is None else self.gyroscopic
            result = replace(result, gyroscopic=before + gyroscopic, C=self.C + gyroscopic)
        if circulatory is not None:
            before = 0.0 if self.circulatory is None else self.circulatory
            result = replace(result, circulatory=before + circulatory, K=self.K + circulatory)
        return result
