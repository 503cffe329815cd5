"""The rungs of the ladder: shapes of undamped modes by three solvers, each from what the one below it left."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas, lapack

from mbsvib.kinematics.loops import pivoted_qr

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.modes.undamped import _Scene


def by_products(scene: _Scene) -> tuple[Array, Array]:
    """Return shapes and squared frequencies from M and K."""
    square, vectors, failed = lapack.dsygvd(scene.stiffness.T, scene.mass.T)
    if failed:
        raise np.linalg.LinAlgError("the eigenvalues of M and K did not converge")
    return vectors, square


def by_factors(scene: _Scene, _shapes: Array) -> Array:
    """Return shapes from the singular vectors of diag(sqrt k) D R^-1."""
    root = triangle(scene.w)
    half = blas.dtrsm(1.0, root, scene.e.T, trans_a=1)
    vectors = np.linalg.svd(half, full_matrices=half.shape[1] < len(half))[0]
    result: Array = blas.dtrsm(1.0, root, vectors[:, ::-1])
    return result


def by_jacobi(scene: _Scene, shapes: Array) -> Array:
    """Return shapes from one-sided Jacobi on the factors in the basis ``shapes``, rigid-body modes left aside.

    A change of basis is exact whatever the basis, so the frequencies are those of the pair (E, H) = (e, w) shapes. Both
    are brought to triangles by QR with rows sorted by size and columns pivoted, which keeps the digits of small rows.

    Source: Drmac & Veselic, SIAM J. Matrix Anal. Appl. 29 (2008); Cox & Higham, BIT 38 (1998).
    """
    rigid = 0 if scene.null is None else scene.null.shape[1]
    basis = shapes[:, rigid:]
    upper, order = sorted_qr(scene.e @ basis)
    root, place = sorted_qr(scene.w @ basis)
    back = np.argsort(order)[place]
    quotient = blas.dtrsm(1.0, root, upper[:, back].T, trans_a=1).T
    _, _, vectors, _, _, failed = lapack.dgejsv(quotient, joba=0, jobu=3, jobv=0)
    if failed:
        return shapes
    result = np.empty_like(shapes)
    result[:, :rigid] = shapes[:, :rigid]
    turned = blas.dtrsm(1.0, root, vectors[:, ::-1])
    result[:, rigid:] = basis[:, place] @ turned
    return result


def sorted_qr(a: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return R and the order of the columns from a QR of an array, its rows sorted by size and its columns pivoted."""
    qr, order, _ = pivoted_qr(a[np.argsort(-np.abs(a).max(axis=1), kind="stable")])
    return np.triu(qr[: a.shape[1]]), order


def triangle(factor: Array) -> Array:
    """Return R upper triangular with R^T R = factor^T factor, from a QR of the factor."""
    m = factor.shape[1]
    return np.triu(lapack.dgeqrf(factor)[0][:m])
