"""Shapes of undamped modes by three solvers, each more accurate and slower than the one before."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg import blas, lapack

from mbsvib.common.arrays import Array, Index
from mbsvib.equations.equations import Equations
from mbsvib.linalg.products import drift, nonzero_rows, single_entries
from mbsvib.linalg.qr import sorted_qr, triangle


class Factors:
    """Data of the solvers: ``mass`` and ``stiffness``, rows ``w`` and ``e`` = diag(sqrt |k|) D, ``sign`` of k.

    The rows are computed on first access; ``rows`` contains those of D with stiffness, ``w`` the nonzero rows of W.
    """

    def __init__(self, system: Equations) -> None:
        used = system.row_stiffness.nonzero()[0]
        every = len(used) == len(system.row_stiffness)
        self.k = system.row_stiffness if every else system.row_stiffness.take(used)
        self.rows = system.elastic_rows if every else system.elastic_rows.take(used, axis=0)
        self.mass = system.M
        self.stiffness = system.K if system.circulatory is None else system.K - system.circulatory
        self.sign = np.sign(self.k) if np.count_nonzero(self.k < 0.0) else None
        self.null: Array | None = None
        self._factor = system.inertia_factor

    @cached_property
    def w(self) -> Array:
        """Rows of W that move."""
        return nonzero_rows(self._factor)

    @cached_property
    def e(self) -> Array:
        """Rows diag(sqrt |k|) D."""
        result: Array = self.rows * np.sqrt(np.abs(self.k))[:, None]
        return result

    @cached_property
    def stiffness_diagonal(self) -> Array:
        """Sum of |k| D^2 over the rows, (m,)."""
        result: Array = self.stiffness.diagonal() if self.sign is None else np.einsum("ij,ij->j", self.e, self.e)
        return result

    @cached_property
    def drift(self) -> float:
        """Relative rounding of the sums over many rows of both factors."""
        return drift(self.rows, self._factor)

    @cached_property
    def single(self) -> Index | None:
        """The column of the only entry of each row of D, None where a row has more."""
        return single_entries(self.rows)

    def stretch(self, shapes: Array) -> Array:
        """Return e shapes, without a matrix product if every row of D has one entry."""
        if self.single is None:
            result: Array = self.e @ shapes
            return result
        return shapes[self.single] * self.e[np.arange(len(self.e)), self.single][:, None]


def by_products(scene: Factors) -> tuple[Array, Array]:
    """Return shapes and squared frequencies from M and K."""
    square, vectors, failed = lapack.dsygvd(scene.stiffness.T, scene.mass.T)
    if failed:
        raise np.linalg.LinAlgError("the eigenvalues of M and K did not converge")
    return vectors, square


def by_factors(scene: Factors, _shapes: Array) -> Array:
    """Return shapes from the singular vectors of diag(sqrt k) D R^-1."""
    root = triangle(scene.w)
    half = blas.dtrsm(1.0, root, scene.e.T, trans_a=1)
    vectors = np.linalg.svd(half, full_matrices=half.shape[1] < len(half))[0]
    result: Array = blas.dtrsm(1.0, root, vectors[:, ::-1])
    return result


def by_jacobi(scene: Factors, shapes: Array) -> Array:
    """Return shapes from one-sided Jacobi on the factors in the basis ``shapes``, without rigid-body modes.

    A change of basis is exact whatever the basis, so the frequencies are those of the pair (E, H) = (e, w) shapes. Both
    are brought to triangles by QR with rows sorted by size and columns pivoted, which keeps the digits of small rows.

    Source: Drmac & Veselic, SIAM J. Matrix Anal. Appl. 29 (2008); Cox & Higham, BIT 38 (1998).
    """
    rigid = 0 if scene.null is None else scene.null.shape[1]
    basis = shapes[:, rigid:]
    upper, order = sorted_qr(scene.e @ basis)
    root, pivots = sorted_qr(scene.w @ basis)
    back = np.argsort(order)[pivots]
    quotient = blas.dtrsm(1.0, root, upper[:, back].T, trans_a=1).T
    _, _, vectors, _, _, failed = lapack.dgejsv(quotient, joba=0, jobu=3, jobv=0)
    if failed:
        return shapes
    result = np.empty_like(shapes)
    result[:, :rigid] = shapes[:, :rigid]
    coefficients = blas.dtrsm(1.0, root, vectors[:, ::-1])
    result[:, rigid:] = basis[:, pivots] @ coefficients
    return result
