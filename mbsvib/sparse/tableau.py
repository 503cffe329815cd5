"""The tableau: all equations of motion in one sparse matrix, A(s) = A0 + K + s C + s^2 M, and its factors.

All s have one pattern. Lengths are scaled by the typical link length and forces by the typical stiffness, both by
powers of two, so that scaling causes no rounding and pivoting compares entries of the same units.

Source: Orlandea, Chace & Calahan, J. Eng. Ind. 99 (1977) 773, for sparse tableaus of mechanisms.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import AnyArray, Array, Bools, Index

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.tree import Tree

# The pivot stays on the diagonal, which gives the articulated-body recursion without fill, unless it is smaller than
# another entry by this factor: for joints without springs in loops, and frequencies inside the spectrum.
THRESHOLD = 1e-3
# A general ordering may eliminate multipliers before the unknowns that they constrain: this needs safe pivoting.
THRESHOLD_GENERAL = 0.1
# A stiffness below this share of the largest is the rounding of a spring's direction.
ROUNDED = float(np.finfo(float).eps)
# One step of refinement recovers the accuracy that threshold pivoting loses.
REFINEMENTS = 1
# If a step of refinement is larger than this share of the solution, the next residual has extended precision.
FINE = 1e-11
# If the step after that is still larger than this, the matrix is singular to rounding.
SINGULAR = 1e-3


@dataclass(frozen=True, slots=True)
class Tableau:
    """Entries (``indices``, ``indptr`` by columns) of the parts ``fixed``, ``stiffness``, ``damping``, ``mass`` on one
    pattern, scaled; ``row_scale`` and ``column_scale`` (size,) convert from scaled to SI units.
    ``diagonal`` (size,) is the entry of every coordinate's own stiffness.
    """

    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]
    fixed: Array
    stiffness: Array
    damping: Array
    mass: Array
    row_scale: Array
    column_scale: Array
    diagonal: Index
    ordering: str

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.row_scale)

    def factor(
        self, square: float = 0.0, s: complex = 0.0, lock: Index | None = None, pivot: float | None = None
    ) -> Factor:
        """Factor A0 + K + s C + (s^2 - square) M; a singular matrix is a LinAlgError.

        ``square``: shift of the undamped problem [rad^2/s^2]. ``s``: point at which damping is included [1/s].
        ``lock``: positions of coordinates that an additional spring locks. ``pivot``: threshold below which the pivot
        is not taken from the diagonal.
        """
        data: AnyArray = self.fixed + self.stiffness
        if s:
            data = data + (s * self.damping + (s * s) * self.mass)
        if square:
            data = data - square * self.mass
        if lock is not None and len(lock):
            data = data.copy()
            data[self.diagonal[lock]] += 1.0
        return self.factor_data(data, pivot)

    def with_equal_springs(self, layout: Layout) -> Factor:
        """Factor the equations of kinematics with an equal spring on every coordinate."""
        data = self.fixed.copy()
        data[self.diagonal[layout.coordinate]] += 1.0
        return self.factor_data(data)

    def factor_data(self, data: AnyArray, pivot: float | None = None) -> Factor:
        """Factor a matrix on the tableau's pattern, given by its scaled entries."""
        from scipy.sparse import csc_matrix
        from scipy.sparse.linalg import splu

        if pivot is None:
            pivot = THRESHOLD if self.ordering == "NATURAL" else THRESHOLD_GENERAL
        matrix = csc_matrix((data, self.indices, self.indptr), shape=(self.size, self.size))
        try:
            lu = splu(matrix, permc_spec=self.ordering, diag_pivot_thresh=pivot, options={"SymmetricMode": False})
        except RuntimeError as error:
            raise np.linalg.LinAlgError("the tableau is singular") from error
        return Factor(matrix, lu, self.row_scale, self.column_scale)


@dataclass(frozen=True, slots=True)
class Factor:
    """A factored matrix; right sides and solutions are in SI units."""

    matrix: Any
    lu: Any
    row_scale: Array
    column_scale: Array

    def solve(self, right: AnyArray, refinements: int = REFINEMENTS, transposed: bool = False) -> AnyArray:
        """Return the solution for one or more right sides (size,) or (size, n), also for the transposed matrix."""
        rows, columns = (self.column_scale, self.row_scale) if transposed else (self.row_scale, self.column_scale)
        scale = (slice(None), None) if right.ndim == 2 else slice(None)
        b = right * rows[scale]
        if np.iscomplexobj(b) and not np.iscomplexobj(self.matrix.data):
            real, imaginary = (self._solve(part, refinements, transposed) for part in (b.real, b.imag))
            x: AnyArray = real + 1j * imaginary
        else:
            x = self._solve(b.astype(self.matrix.dtype), refinements, transposed)
        return x * columns[scale]

    def _solve(self, b: AnyArray, refinements: int, transposed: bool) -> AnyArray:
        matrix, mode = (self.matrix.T, "T") if transposed else (self.matrix, "N")
        x: AnyArray = self.lu.solve(np.ascontiguousarray(b) if b.ndim == 1 else np.asfortranarray(b), mode)
        for _ in range(refinements):
            x = x + self.lu.solve(b - matrix @ x, mode)
        return x

    def solve_closely(self, right: Array, fine: float) -> tuple[AnyArray, float]:
        """Return the solution for right sides (size, n), and the last step of refinement as a share of it.

        Near a lightly damped resonance, and with nearly singular loops, residuals are not accurate enough for
        refinement. If the first step exceeds the share ``fine``, they are computed in extended precision. The share is
        infinite if there is no finite solution.
        """
        b = np.asfortranarray(right * self.row_scale[:, None], dtype=self.matrix.dtype)
        x: AnyArray = self.lu.solve(b)
        matrix, change = self.matrix, np.inf
        for last in (False, False, True):
            step = self.lu.solve(np.asfortranarray(b - matrix @ x, dtype=self.matrix.dtype))
            x = x + step
            size = np.abs(x).max(axis=0, initial=0.0)
            if not np.isfinite(size).all():
                return x, np.inf
            used = size > 0.0
            change = float((np.abs(step).max(axis=0, initial=0.0)[used] / size[used]).max(initial=0.0))
            if change <= fine or last:
                break
            if matrix is self.matrix:
                matrix = matrix.astype(np.clongdouble if np.iscomplexobj(matrix.data) else np.longdouble)
        return np.asarray(x * self.column_scale[:, None], dtype=self.matrix.dtype), change

    def negative(self, layout: Layout) -> int | None:
        """Return how many eigenvalues of the symmetric problem lie below the shift, by Sylvester's law of inertia.

        Negative pivots minus the multipliers; None if rows were exchanged, which is no congruence.
        """
        if not np.array_equal(self.lu.perm_r, self.lu.perm_c):
            return None
        pivot = self.lu.U.diagonal()[self.lu.perm_c]
        used = np.concatenate((layout.coordinate, layout.multiplier))
        return int(np.count_nonzero(pivot[used] < 0.0)) - len(layout.multiplier)


def build(
    tree: Tree, layout: Layout, fixed: csr_matrix, rows: csr_matrix, stiffness: Array, damping: Array,
    inertia: csr_matrix, loops: csr_matrix, translational: Bools, ordering: str = "NATURAL",
    circulatory: csr_matrix | None = None, gyroscopic: csr_matrix | None = None,
) -> Tableau:  # fmt: skip
    """Return the tableau of the equations of kinematics, ``fixed`` (size, size), and the forces of all parts.

    ``rows`` (elastic rows, size) with their coefficients; ``inertia`` (size, size): M over the displacements; ``loops``
    (multipliers, size): independent locked rows, of which the ``translational`` ones lock a translation; ``ordering``:
    SuperLU's of the columns; antisymmetric parts of K and C, (size, size) or None.
    """
    from scipy.sparse import coo_matrix, diags

    row_of, sign = layout.balance()

    def balanced(matrix: Any) -> tuple[Index, Index, Array]:
        entries = matrix.tocoo()
        return row_of[entries.row], entries.col, entries.data * sign[entries.row]

    size = layout.size
    closure = loops.tocoo()
    outer = layout.multiplier[closure.row]
    a = fixed.tocoo()
    forces = balanced(coo_matrix((closure.data, (closure.col, outer)), shape=(size, size)))
    q = layout.coordinate
    # explicit zeros on the diagonal, for springs that lock coordinates and for pivots of multipliers
    diagonal_of = np.concatenate((q, layout.multiplier))
    entries = [(a.row, a.col, a.data), (outer, closure.col, closure.data), forces,
               (diagonal_of, diagonal_of, np.zeros(len(diagonal_of)))]  # fmt: skip
    row, column, value = (np.concatenate([part[i] for part in entries]) for i in range(3))
    elastic, viscous = (rows.T @ diags(values) @ rows for values in (stiffness, damping))
    elastic = elastic if circulatory is None else elastic + circulatory
    viscous = viscous if gyroscopic is None else viscous + gyroscopic
    parts = [(row, column, value), balanced(elastic), balanced(viscous), balanced(inertia)]
    indices, indptr, data = _common_pattern(parts, size)
    row_scale, column_scale = _scales(tree, layout, translational, data[1], indices, indptr)
    owner = np.repeat(np.arange(size), np.diff(indptr))
    scale = row_scale[indices] * column_scale[owner]
    diagonal = np.zeros(size, dtype=np.intp)
    entry = np.flatnonzero(owner == indices)
    diagonal[owner[entry]] = entry
    constant, k, c, m = (part * scale for part in data)
    return Tableau(indices, indptr, constant, k, c, m, row_scale, column_scale, diagonal, ordering)


def _common_pattern(
    parts: list[tuple[Index, Index, Array]], size: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], list[Array]]:
    key = np.concatenate([column.astype(np.int64) * size + row for row, column, _ in parts])
    key, slot = np.unique(key, return_inverse=True)
    slot = slot.reshape(-1)
    data: list[Array] = []
    start = 0
    for row, _, value in parts:
        data.append(np.bincount(slot[start : start + len(row)], value, minlength=len(key)).astype(float))
        start += len(row)
    column, row = np.divmod(key, size)
    indptr = np.searchsorted(column, np.arange(size + 1)).astype(np.int32)
    return row.astype(np.int32), indptr, data


def _scales(
    tree: Tree, layout: Layout, translational: Bools, stiffness: Array, indices: NDArray[np.int32],
    indptr: NDArray[np.int32],
) -> tuple[Array, Array]:
    """Powers of two that scale lengths by the typical link and forces by the typical stiffness of a joint."""
    length = tree.length
    unit, row = np.ones(layout.size), np.ones(layout.size)
    x, h = layout.displacement, layout.force
    used = x >= 0
    translates = used & (np.arange(6) < 3)
    unit[x[translates]] = length
    unit[layout.coordinate[~tree.turns]] = length
    unit[layout.multiplier[translational]] = length
    column = np.repeat(np.arange(layout.size), np.diff(indptr))
    diagonal = (column == indices) & (stiffness != 0.0)
    moments = np.abs(stiffness[diagonal]) * unit[column[diagonal]] ** 2
    moments = moments[moments > ROUNDED * moments.max(initial=0.0)]
    moment = float(2.0 ** np.round(np.mean(np.log2(moments)))) if len(moments) else 1.0
    force = np.ones(layout.size)
    force[h[translates]] = length
    col = unit.copy()
    row[x[used]] = 1.0 / unit[x[used]]
    row[layout.multiplier] = 1.0 / unit[layout.multiplier]
    col[h[used]] = moment / force[h[used]]
    row[h[used]] = force[h[used]] / moment
    col[layout.multiplier] = moment / unit[layout.multiplier]
    row[layout.coordinate] = unit[layout.coordinate] / moment
    return row, col
