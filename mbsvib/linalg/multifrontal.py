"""Factors of a sparse symmetric matrix by dense fronts, with its inertia.

Front by front, A = [F11 F12; F21 F22] over the unknowns that are eliminated in it and those that they reach:
S = F22 - F21 F11^-1 F12 goes to the parent. F11 is factored by Cholesky, or by LU with pivoting inside it. By
Haynsworth, In(A) is the sum of In(F11) over all fronts.

Source: Duff & Reid, ACM Trans. Math. Softw. 9 (1983) 302; Liu, SIAM Review 34 (1992) 82.

Nested dissection: an order of the unknowns of a sparse symmetric matrix in which elimination fills little.

Unknowns with the same neighbours (those of a node) stay together. Each part of the graph is split by the smallest of
some separators between levels of equal distance; it is eliminated after both halves.

Source: George, SIAM J. Numer. Anal. 10 (1973) 345; George & Liu, Computer Solution of Large Sparse Positive Definite
Systems (1981), chapter 8.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arrays import AnyArray, Array, Index
from mbsvib.linalg.groups import part_numbers

# Parts with fewer unknowns are not split: dense factors of this size cost less than more fronts.
LEAF = 240
# Shares of the nodes before a separator that are tried, and the least share of either half.
SPLITS, LEAST = (0.42, 0.5, 0.58), 0.2
# Nodes with more neighbours than this multiple of the root of their number are eliminated last: they join all others.
HUB = 10.0


def dissected(pattern: Any) -> list[tuple[Index, int]]:
    """Return the fronts of a symmetric sparse ``pattern`` (n, n), children before parents: unknowns, number of parent.

    The parent of the last ones is -1.
    """
    from scipy.sparse import csr_matrix

    n = pattern.shape[0]
    weight = np.random.default_rng(0).integers(0, 2**62, n)
    ones = csr_matrix((np.ones(len(pattern.indices), dtype=np.int64), pattern.indices, pattern.indptr), (n, n))
    _, label = np.unique(ones @ weight, return_inverse=True)
    size = np.bincount(label)
    join = csr_matrix((np.ones(n), (label, np.arange(n))), (len(size), n))
    graph = (join @ ones.astype(float) @ join.T).tocsr()
    graph.setdiag(0.0)
    graph.eliminate_zeros()
    hubs = np.diff(graph.indptr) > max(LEAF, HUB * np.sqrt(len(size)))
    parents: list[int] = []  # of fronts, parents first
    front = np.zeros(len(size), dtype=np.intp)

    def add(nodes: Index, parent: int) -> int:
        front[nodes] = len(parents)
        parents.append(parent)
        return len(parents) - 1

    pending = [(np.flatnonzero(~hubs), add(np.flatnonzero(hubs), -1) if hubs.any() else -1)]
    while pending:
        nodes, parent = pending.pop()
        split = None if size[nodes].sum() <= LEAF else _separator(graph[nodes][:, nodes], size[nodes])
        if split is None:
            add(nodes, parent)
            continue
        last = nodes[split == 2]
        above = add(last, parent) if len(last) else parent
        pending += [(nodes[split == side], above) for side in (0, 1)]
    end = len(parents) - 1
    number = end - front[label]
    # ascending numbers in a front: those of neighbours are mostly near, so that others reach runs of them
    members = np.split(np.argsort(number, kind="stable"), np.cumsum(np.bincount(number, minlength=end + 1))[:-1])
    return [(own, end - p if p >= 0 else -1) for own, p in zip(members, parents[::-1], strict=True)]


def _separator(graph: Any, size: Index) -> Index | None:
    """0 and 1 for the halves of a graph, 2 for the nodes between them; None if there is no small separator."""
    from scipy.sparse.csgraph import breadth_first_order

    part = part_numbers(graph)
    if part.max(initial=0) > 0:  # whole parts, about equal halves
        total = np.bincount(part, size)
        return np.asarray((np.cumsum(total) - 0.5 * total > 0.5 * size.sum()).astype(np.intp)[part])

    def distance(start: int) -> Array:
        order, before = breadth_first_order(graph, start)
        position = np.empty(len(order), dtype=np.intp)
        position[order] = np.arange(len(order))
        parent, ends = position[before[order[1:]]], [0, 1]  # ascending
        while ends[-1] < len(order):
            ends.append(1 + int(np.searchsorted(parent, ends[-1])))
        result = np.empty(len(order))
        result[order] = np.repeat(np.arange(len(ends) - 1.0), np.diff(ends))
        return result

    a = distance(int(distance(0).argmax()))
    b = distance(int(a.argmax()))
    c = distance(int(np.minimum(a, b).argmax()))
    d = distance(int(c.argmax()))
    best, result, whole = np.inf, None, float(size.sum())
    for level in (a - b, c - d, a + c - b - d, a + d - b - c, a, c):
        order = np.argsort(level, kind="stable")
        share = np.cumsum(size[order]) / whole
        for at in SPLITS:
            first = level <= level[order[np.searchsorted(share, at)]]
            if not LEAST < float(size[first].sum()) / whole < 1.0 - LEAST:
                continue
            for side in (first, ~first):
                between = side & (graph @ (~side).astype(float) > 0.0)
                halves = [float(size[half & ~between].sum()) / whole for half in (side, ~side)]
                cost = float(size[between].sum()) * (1.0 + (halves[0] - halves[1]) ** 2)
                if cost < best and min(halves) > 0.0:
                    best, result = cost, np.where(between, 2, np.where(side, 0, 1))
    return result


# Largest memory of factors [bytes].
LARGEST = 4e9
# Columns of a product of which the lower triangle is needed that are computed at a time.
COLUMNS = 256


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
    factors: list[tuple[Any, AnyArray]]
    count: int

    def negative(self, layout: object = None) -> int:
        """Return the number of negative eigenvalues, by Sylvester's law of inertia; of a real matrix."""
        del layout
        return self.count

    def solve_closely(self, right: AnyArray, fine: float) -> tuple[AnyArray, float]:
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

    def solve(self, right: AnyArray, refinements: int = 1, transposed: bool = False) -> AnyArray:
        """Return the solution for right sides (n,) or (n, columns)."""
        del transposed
        b = right.reshape(len(right), -1)
        x = self._solve(b)
        for _ in range(refinements):
            x = x + self._solve(b - self.matrix @ x)
        return x.reshape(right.shape)

    def _solve(self, b: AnyArray) -> AnyArray:
        from scipy.linalg import blas, lapack

        f = self.fronts
        dtype = np.result_type(b.dtype, self.matrix.dtype)
        if np.issubdtype(dtype, np.complexfloating) and not np.iscomplexobj(self.matrix.data):
            return self._solve(np.ascontiguousarray(b.real)) + 1j * self._solve(np.ascontiguousarray(b.imag))
        x = (b * self.scale[:, None])[f.permutation].astype(dtype)
        getrs = lapack.zgetrs if np.issubdtype(dtype, np.complexfloating) else lapack.dgetrs
        for i, (factor, below) in enumerate(self.factors):
            own = slice(f.start[i], f.start[i + 1])
            if not isinstance(factor, tuple):
                x[own] = blas.dtrsm(1.0, factor, x[own], lower=1)
            if len(f.reached[i]):
                x[f.reached[i]] -= below @ x[own]
        for i in range(len(self.factors) - 1, -1, -1):
            factor, below = self.factors[i]
            own = slice(f.start[i], f.start[i + 1])
            if isinstance(factor, tuple):
                x[own] = getrs(*factor, x[own])[0] - below.T @ x[f.reached[i]]
            else:
                x[own] = blas.dtrsm(1.0, factor, x[own] - below.T @ x[f.reached[i]], lower=1, trans_a=1)
        result = np.empty_like(x)
        result[f.permutation] = x
        return result * self.scale[:, None]


def factored(matrix: Any, structure: Fronts, keep: bool = True) -> SymmetricFactor:
    """Factor a symmetric ``matrix`` (n, n), sparse by columns, real or complex; LinAlgError if a front is singular.

    ``keep``: whether to keep the factors, or the inertia alone: new memory takes time to provide.
    """
    size = np.abs(matrix.diagonal())
    scale = 2.0 ** -np.round(0.5 * np.log2(np.where(size > 0.0, size, 1.0)))
    order = structure.permutation
    a = matrix[order][:, order].tocsc()
    a.data = a.data * scale[order][a.indices] * np.repeat(scale[order], np.diff(a.indptr))
    position = np.empty(len(order), dtype=np.intp)
    waiting: dict[int, AnyArray] = {}
    spare: list[AnyArray] = []
    factors, negative = [], 0
    for i, reached in enumerate(structure.reached):
        first, last = int(structure.start[i]), int(structure.start[i + 1])
        own, n = last - first, len(reached)
        position[first:last], position[reached] = np.arange(own), np.arange(n)
        corner, below = (np.zeros((m, own), dtype=a.dtype, order="F") for m in (own, n))
        waiting[i] = _zeros(n * n, spare, a.dtype)
        rest = _square(waiting[i], n)
        entries = slice(a.indptr[first], a.indptr[last])
        row, column = a.indices[entries], np.repeat(np.arange(own), np.diff(a.indptr[first : last + 1]))
        inside, beyond = (row >= first) & (row < last), row >= last
        corner[position[row[inside]], column[inside]] = a.data[entries][inside]
        below[position[row[beyond]], column[beyond]] = a.data[entries][beyond]
        for child in structure.children[i]:
            at, k = position[structure.reached[child]], int(np.searchsorted(structure.reached[child], last))
            memory = waiting.pop(child)
            part = _square(memory, len(at)).T
            _add(corner.T, at[:k], part[:k, :k])
            _add(rest.T, at[k:], part[k:, k:])
            for rows, row in _runs(at[:k]):
                below.T[row, at[k:]] += part[rows, k:]
            spare.append(memory)
        factor, below, count = _eliminated(corner, below, rest)
        if keep:
            factors.append((factor, below))
        negative += count
    return SymmetricFactor(matrix, structure, scale, factors, negative)


def _zeros(size: int, spare: list[AnyArray], dtype: Any) -> AnyArray:
    """Zeros, in the smallest of the spare arrays that has room for ``size`` numbers, which is taken out, or in new
    memory: the system takes longer to provide this than the numbers take to compute.
    """
    room = [(len(memory), i) for i, memory in enumerate(spare) if len(memory) >= size]
    if not room:
        return np.zeros(size, dtype=dtype)
    result = spare.pop(min(room)[1])
    result[:size] = 0.0
    return result


def _square(memory: AnyArray, n: int) -> AnyArray:
    """The first numbers as a matrix (n, n) by columns."""
    return memory[: n * n].reshape((n, n), order="F")


def _runs(at: Index) -> list[tuple[slice, slice]]:
    """Runs of consecutive numbers in ``at``, ascending: where they stand in it, and which they are."""
    first = np.flatnonzero(np.diff(at, prepend=-2) != 1).tolist()
    pairs = zip(first, [*first, len(at)][1:], strict=True)
    return [(slice(i, j), slice(int(at[i]), int(at[i]) + j - i)) for i, j in pairs]


def _add(upper: AnyArray, at: Index, part: AnyArray) -> None:
    """Add the upper triangle of a matrix in the rows and columns ``at``, ascending, by runs of consecutive rows."""
    for rows, row in _runs(at):
        upper[row, at[rows.start :]] += part[rows, rows.start :]


def _eliminated(corner: AnyArray, below: AnyArray, rest: AnyArray) -> tuple[Any, AnyArray, int]:
    """Factors of F11, F21 F11^-1 (F21 L^-T by Cholesky), and the negative eigenvalues of F11; S replaces F22.

    ``corner`` F11 and ``rest`` F22: lower triangles; ``below`` F21 may be overwritten.
    """
    from scipy.linalg import blas, lapack

    real = not np.iscomplexobj(corner)
    if real:
        factor, failed = lapack.dpotrf(corner, lower=1)
        if not failed:
            if len(rest):
                below = blas.dtrsm(1.0, factor, below, side=1, lower=1, trans_a=1, overwrite_b=1)
                blas.dsyrk(-1.0, below, 1.0, rest, lower=1, overwrite_c=1)
            return factor, below, 0
    full = np.asfortranarray(np.tril(corner) + np.tril(corner, -1).T)
    count = _negative(full) if real else 0
    lu, pivot, failed = (lapack.dgetrf if real else lapack.zgetrf)(full)
    if failed:
        raise np.linalg.LinAlgError("a front is singular")
    solved = (lapack.dgetrs if real else lapack.zgetrs)(lu, pivot, below.T)[0]
    for first in range(0, len(rest), COLUMNS):  # the lower triangle
        rest[first:, first : first + COLUMNS] -= below[first:] @ solved[:, first : first + COLUMNS]
    return (lu, pivot), np.asfortranarray(solved.T), count


def _negative(matrix: Array) -> int:
    """Number of negative eigenvalues, from L D L^T with blocks of one and two rows; these have one each."""
    from scipy.linalg import lapack

    d, pivot, _ = lapack.dsytrf(matrix, lower=1)
    single = pivot > 0
    return int(np.count_nonzero(d.diagonal()[single] < 0.0)) + int(np.count_nonzero(~single)) // 2
