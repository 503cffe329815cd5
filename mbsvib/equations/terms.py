"""Matrices of equations of motion in minimal coordinates, and the factors that they are made of."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.fast_init import fast_init
from mbsvib.linalg.products import concatenated, weighted_gram

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index


@fast_init
@dataclass(frozen=True, repr=False, eq=False)
class Matrices:
    """Matrices and factors of M q'' + C q' + K q = B u, y = Cq q + Cv q' + Ca q'' + D u, described in ``Equations``.

    In many variants arrays may have an axis of variants in front.
    """

    _engine = "body_motion elastic_rows inertia_factor null_inertia row_damping row_owner row_stiffness"

    M: Array
    """Mass matrix (m, m), symmetric [kg, kg m, kg m^2]."""
    C: Array
    """Damping matrix (m, m) [N s/m, N s, N m s]; not the output matrix, which is ``state_space().C``."""
    K: Array
    """Stiffness matrix (m, m) with the geometric stiffness of loads [N/m, N, N m]."""
    B: Array
    """Generalized forces by a unit of each input (m, inputs)."""
    Cq: Array
    """Outputs by the coordinates (outputs, m)."""
    Cv: Array
    """Outputs by the rates of the coordinates (outputs, m)."""
    Ca: Array
    """Outputs by the accelerations of the coordinates (outputs, m)."""
    D: Array
    """Outputs by the inputs directly (outputs, inputs)."""
    inertia_factor: Array
    """W (6 bodies, m) of M = W^T W."""
    elastic_rows: Array
    """D (rows, m): relative displacements in springs and dampers by the coordinates, K = D^T diag(k) D."""
    row_stiffness: Array
    """Stiffness k of each elastic row (rows,) [N/m, N m/rad]."""
    row_damping: Array
    """Damping c of each elastic row (rows,) [N s/m, N m s/rad]."""
    row_owner: Index
    """Number of the spring-damper of each elastic row (rows,)."""
    body_motion: Array
    """Displacements of the bodies by the coordinates (bodies, 6, m), world axes."""
    gyroscopic: Array | None = None
    """Antisymmetric part of C from spinning bodies and cross-coupling (m, m), None without."""
    circulatory: Array | None = None
    """Antisymmetric part of K from follower loads, rotating dampers and cross-coupling (m, m), None without."""
    massless: int = 0
    """Number of motions that move dampers but no mass: one state each in place of two."""
    null_inertia: Array | None = None
    """These motions (m, massless), None without."""

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
# Number of axes of each term of a single system; in many variants there may be one more in front.
AXES = dict.fromkeys(_NAMES, 2) | {"row_stiffness": 1, "row_damping": 1, "row_owner": 1, "body_motion": 3}
# Arrays that equations without spin, follower loads, cross-coupling and massless motions lack.
OPTIONAL = ("gyroscopic", "circulatory", "null_inertia")


@fast_init
@dataclass(frozen=True, repr=False, eq=False)
class Terms(Matrices):
    """Matrices and factors during the assembly."""

    def named(self) -> dict[str, Any]:
        """Return all terms by their names."""
        return dict(vars(self))

    def of_variants(self, which: Any) -> Terms:
        """Return the terms of one variant, or of some; arrays that are constant stay as they are.

        ``which``: an index or a mask along the axis of variants.
        """
        return Terms(**{key: array[which] if isinstance(array, np.ndarray) and array.ndim > AXES[key] else array
                        for key, array in self.named().items()})  # fmt: skip

    def with_rows(self, rows: Array, stiffness: Array, owner: Index, matrix: Array | None = None) -> Terms:
        """Return the terms with more rows of stiffness without damping, K + D^T diag(k) D.

        ``rows`` (..., rows, m): rows in minimal coordinates. ``stiffness`` (..., rows): signed values. ``owner``
        (rows,): numbers of their owners. ``matrix`` (..., m, m): their product, if known with fewer rounding errors.
        """
        added = weighted_gram(rows, stiffness) if matrix is None else matrix
        return replace(
            self, K=self.K + 0.5 * (added + added.swapaxes(-1, -2)),
            elastic_rows=concatenated((self.elastic_rows, rows), -2),
            row_stiffness=concatenated((self.row_stiffness, stiffness), -1),
            row_damping=concatenated((self.row_damping, np.zeros(stiffness.shape[-1])), -1),
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
