"""Block Arnoldi: the largest eigenvalues of an operator, with an orthonormal basis of their invariant subspace.

Source: Saad, Numerical Methods for Large Eigenvalue Problems (2011), section 6.5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mbsvib.common.arrays import AnyArray, Array, Complex

# If less than this share of a vector remains after orthogonalization, the remainder is rounding.
NEW = 1e-12
# If more than this share remains in every direction, a second orthogonalization changes little more than rounding
# (Daniel, Gragg, Kaufman & Stewart, Math. Comp. 30 (1976) 772).
ORTHOGONAL = 0.1
# Ritz values are computed when the basis has grown by this share.
GROWTH = 0.3


@dataclass(frozen=True, slots=True)
class Ritz:
    """Ritz ``values`` (m,) by descending size with relative ``residuals`` (m,), and ``vectors`` (m, m) in a basis.

    The ``basis`` (n, m) is orthonormal.
    """

    values: Complex
    residuals: Array
    vectors: AnyArray
    basis: AnyArray

    def converged(self, tolerance: float) -> int:
        """Return how many of the first values have smaller residuals, conjugates together."""
        unconverged = np.flatnonzero(self.residuals > tolerance)
        count = int(unconverged[0]) if len(unconverged) else len(self.values)
        pair = 0 < count < len(self.values) and not np.iscomplexobj(self.basis)
        if pair and self.values[count - 1].imag and self.values[count] == self.values[count - 1].conj():
            count -= 1
        return count

    def subspace(self, count: int) -> AnyArray:
        """Return an orthonormal basis (n, count) of the first vectors' span."""
        y = self.vectors[:, :count]
        if not np.iscomplexobj(self.basis):
            u, size, _ = np.linalg.svd(np.concatenate((y.real, y.imag), axis=1), full_matrices=False)
            return np.asarray(self.basis @ u[:, : min(count, len(size))])
        return np.asarray(self.basis @ np.linalg.qr(y)[0])


def arnoldi(
    apply: Callable[[AnyArray], AnyArray], start: AnyArray, enough: Callable[[Ritz], bool],
    dimensions: tuple[int, int], growth: float = GROWTH,
) -> Ritz:  # fmt: skip
    """Return Ritz values and vectors of a linear operator, the largest first.

    ``apply``: the operator on columns (n, b). ``start`` (n, b): the first block. ``enough``: tells whether the Ritz
    values suffice, which ends the iteration. ``dimensions``: those of the basis at which they are first computed, and
    at most; there they may not suffice. ``growth``: the share by which the basis grows until they are computed again.
    """
    block = np.linalg.qr(start)[0]
    n, limit = len(block), min(dimensions[1], len(block))
    room = limit + block.shape[1]
    basis = np.zeros((n, room), dtype=block.dtype, order="F")
    inner = np.zeros((room, room), dtype=block.dtype)
    basis[:, : block.shape[1]] = block
    before, size, next_check = 0, block.shape[1], dimensions[0]
    while True:
        new = apply(basis[:, before:size])
        length = np.linalg.norm(new, axis=0)
        for _ in range(2):
            projection = basis[:, :size].conj().T @ new
            new = new - basis[:, :size] @ projection
            inner[:size, before:size] += projection
            block, upper, least = _independent(new, float(length.max(initial=0.0)))
            if least > ORTHOGONAL:
                break
        count = block.shape[1]
        full = size + count > limit
        if not count or full or size >= next_check:
            next_check = int(size * (1.0 + growth)) + 1
            result = _ritz(inner[:size, :size], upper, basis[:, :size])
            if not count or full or enough(result):
                return result
        inner[size : size + count, before:size] = upper
        basis[:, size : size + count] = block
        before, size = size, size + count


def _independent(new: AnyArray, length: float) -> tuple[AnyArray, AnyArray, float]:
    """Orthonormal columns of a block, without those that are rounding, the block in these, and the least share of
    ``length`` that remains in one of its directions.
    """
    from scipy.linalg import qr

    block, upper, order = qr(new, mode="economic", pivoting=True)
    pivots = np.abs(upper.diagonal())
    count = int(np.count_nonzero(pivots > NEW * length))
    result = np.empty((count, new.shape[1]), dtype=new.dtype)
    result[:, order] = upper[:count]
    return block[:, :count], result, float(pivots.min(initial=np.inf)) / length if length else 0.0


def _ritz(inner: AnyArray, below: AnyArray, basis: AnyArray) -> Ritz:
    values, vectors = np.linalg.eig(inner)
    order = np.argsort(-np.abs(values), kind="stable")
    values, vectors = values[order].astype(complex), vectors[:, order]
    norms = np.linalg.norm(below @ vectors[len(inner) - below.shape[1] :], axis=0)
    size = np.abs(values)
    residuals = np.divide(norms, size, out=np.full(len(size), np.inf), where=size > 0.0)
    return Ritz(values, residuals, vectors, basis)
