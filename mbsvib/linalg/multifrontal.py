"""Factors of a sparse symmetric matrix by dense fronts, with its inertia.

Front by front, A = [F11 F12; F21 F22] over the unknowns that are eliminated in it and those that they reach:
S = F22 - F21 F11^-1 F12 goes to the parent. F11 is factored by Cholesky, or by LU with pivoting inside it. By
Haynsworth, In(A) is the sum of In(F11) over all fronts.

Source: Duff & Reid, ACM Trans. Math. Softw. 9 (1983) 302; Liu, SIAM Review 34 (1992) 82.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.dissection import dissected

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index

# Largest memory of factors [bytes].
LARGEST = 4e9


@dataclass(frozen=True, slots=True)
class Fronts:
    """The order ``permutation`` (n,) of unknowns, and of every front the first and last + 1 of those eliminated in it,
    the others that it reaches, in this order, and its children.
    """

    permutation: Index
    start: Index
    reached: list[Index]
    children: list[list[int]]

    @property
    def entries(self) -> int:
        """Numbers in all factors."""
        own = np.diff(self.start)
        return int(sum(p * (p + len(b)) for p, b in zip(own.tolist(), self.reached, strict=True)))


def fronts(pattern: Any) -> Fronts:
    """Return the fronts of a symmetric sparse ``pattern`` (n, n) by nested dissection."""
    parts = dissected(pattern)
    permutation = np.concatenate([own for own, _ in parts])
    start = np.concatenate(([0], np.cumsum([len(own) for own, _ in parts])))
    matrix = pattern[permutation][:, permutation].tocsc()
    children: list[list[int]] = [[] for _ in parts]
    for i, (_, parent) in enumerate(parts):
        if parent >= 0:
            children[parent].append(i)
    reached: list[Index] = []
    for i in range(len(parts)):
        own = matrix.indices[matrix.indptr[start[i]] : matrix.indptr[start[i + 1]]]
        union = np.unique(np.concatenate([own, *[reached[j] for j in children[i]]]))
        reached.append(union[union >= start[i + 1]])
    return Fronts(permutation, start, reached, children)


@dataclass(frozen=True, slots=True)
class SymmetricFactor:
    """Factors of a symmetric ``matrix`` (n, n), scaled by ``scale`` (n,) on both sides, front by front."""

    matrix: Any
    fronts: Fronts
    scale: Array
    factors: list[tuple[Any, NDArray[Any]]]
    count: int

    def negative(self, layout: object = None) -> int:
        """Return the number of negative eigenvalues, by Sylvester's law of inertia; of a real matrix."""
        del layout
        return self.count

    def solve_closely(self, right: NDArray[Any], fine: float) -> tuple[NDArray[Any], float]:
        """Return the solution for right sides (n, columns), refined, and the last step of refinement as a share of it.

        A second step is done if the first exceeds the share ``fine``.
        """
        x, change = self._solve(right), np.inf
        for _ in range(2):
            step = self._solve(right - self.matrix @ x)
            x = x + step
            size = np.abs(x).max(axis=0, initial=0.0)
            used = size > 0.0
            change = float((np.abs(step).max(axis=0, initial=0.0)[used] / size[used]).max(initial=0.0))
            if change <= fine or not np.isfinite(change):
                break
        return x, change if np.isfinite(x).all() else np.inf

    def solve(self, right: NDArray[Any], refinements: int = 1, transposed: bool = False) -> NDArray[Any]:
        """Return the solution for right sides (n,) or (n, columns)."""
        del transposed
        b = right.reshape(len(right), -1)
        x = self._solve(b)
        for _ in range(refinements):
            x = x + self._solve(b - self.matrix @ x)
        return x.reshape(right.shape)

    def _solve(self, b: NDArray[Any]) -> NDArray[Any]:
        from scipy.linalg import blas, lapack

        f = self.fronts
        dtype = np.result_type(b.dtype, self.matrix.dtype)
        if np.issubdtype(dtype, np.complexfloating) and not np.iscomplexobj(self.matrix.data):
            return self._solve(np.ascontiguousarray(b.real)) + 1j * self._solve(np.ascontiguousarray(b.imag))
        x = (b * self.scale[:, None])[f.permutation].astype(dtype)
        getrs = lapack.zgetrs if np.issubdtype(dtype, np.complexfloating) else lapack.dgetrs
        for i, (factor, across) in enumerate(self.factors):
            own = slice(f.start[i], f.start[i + 1])
            if not isinstance(factor, tuple):
                x[own] = blas.dtrsm(1.0, factor, x[own], lower=1)
            if len(f.reached[i]):
                x[f.reached[i]] -= across.T @ x[own]
        for i in range(len(self.factors) - 1, -1, -1):
            factor, across = self.factors[i]
            own = slice(f.start[i], f.start[i + 1])
            if isinstance(factor, tuple):
                x[own] = getrs(*factor, x[own])[0] - across @ x[f.reached[i]]
            else:
                x[own] = blas.dtrsm(1.0, factor, x[own] - across @ x[f.reached[i]], lower=1, trans_a=1)
        result = np.empty_like(x)
        result[f.permutation] = x
        return result * self.scale[:, None]


def factored(matrix: Any, structure: Fronts) -> SymmetricFactor:
    """Factor a symmetric ``matrix`` (n, n), sparse by columns, real or complex; LinAlgError if a front is singular."""
    size = np.abs(matrix.diagonal())
    scale = 2.0 ** -np.round(0.5 * np.log2(np.where(size > 0.0, size, 1.0)))
    order = structure.permutation
    a = matrix[order][:, order].tocsc()
    a.data = a.data * scale[order][a.indices] * np.repeat(scale[order], np.diff(a.indptr))
    position = np.empty(len(order), dtype=np.intp)
    waiting: dict[int, NDArray[Any]] = {}
    factors, negative = [], 0
    for i, reached in enumerate(structure.reached):
        first, last = int(structure.start[i]), int(structure.start[i + 1])
        own, n = last - first, last - first + len(reached)
        position[first:last], position[reached] = np.arange(own), np.arange(own, n)
        front = np.zeros((n, n), dtype=a.dtype, order="F")
        entries = slice(a.indptr[first], a.indptr[last])
        row, column = a.indices[entries], np.repeat(np.arange(own), np.diff(a.indptr[first : last + 1]))
        below = row >= first
        front[position[row[below]], column[below]] = a.data[entries][below]
        for child in structure.children[i]:
            _add(front.T, position[structure.reached[child]], waiting.pop(child).T)
        factor, across, rest, count = _eliminated(front, own)
        factors.append((factor, across))
        negative += count
        waiting[i] = rest
    return SymmetricFactor(matrix, structure, scale, factors, negative)


def _add(upper: NDArray[Any], at: Index, part: NDArray[Any]) -> None:
    """Add the upper triangle of a matrix in the rows and columns ``at``, ascending, by runs of consecutive rows."""
    starts = np.flatnonzero(np.diff(at, prepend=-2) != 1).tolist()
    for first, last in zip(starts, [*starts[1:], len(at)], strict=True):
        row = int(at[first])
        upper[row : row + last - first, at[first:]] += part[first:last, first:]


def _eliminated(front: NDArray[Any], own: int) -> tuple[Any, NDArray[Any], NDArray[Any], int]:
    """Factors of F11, F11^-1 F12 (L^-1 F12 by Cholesky), S, and the negative eigenvalues of F11; lower triangles."""
    from scipy.linalg import blas, lapack

    real = not np.iscomplexobj(front)
    corner, below = front[:own, :own], front[own:, :own]
    rest = front[own:, own:]
    if real:
        factor, failed = lapack.dpotrf(corner, lower=1)
        if not failed:
            across = blas.dtrsm(1.0, factor, below.T, lower=1)
            if len(rest):
                rest = blas.dsyrk(-1.0, across, 1.0, rest, trans=1, lower=1)
            return factor, across, rest, 0
    lower = np.tril(corner)
    full = np.asfortranarray(lower + np.tril(corner, -1).T)
    count = _negative(full) if real else 0
    lu, pivot, failed = (lapack.dgetrf if real else lapack.zgetrf)(full)
    if failed:
        raise np.linalg.LinAlgError("a front is singular")
    across = (lapack.dgetrs if real else lapack.zgetrs)(lu, pivot, below.T)[0]
    return (lu, pivot), across, rest - below @ across, count


def _negative(matrix: Array) -> int:
    """Number of negative eigenvalues, from L D L^T with blocks of one and two rows; these have one each."""
    from scipy.linalg import lapack

    d, pivot, _ = lapack.dsytrf(matrix, lower=1)
    single = pivot > 0
    return int(np.count_nonzero(d.diagonal()[single] < 0.0)) + int(np.count_nonzero(~single)) // 2
