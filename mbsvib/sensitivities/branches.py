"""Branches of eigenvalues that coincide, along which they part as a parameter changes.

Their derivatives are the eigenvalues of -(Y^T (2 lambda M + C) X)^-1 Y^T dT X in the common subspace.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex

# Where eigenvalues coincide, less than this share of the largest derivative to the same variable is rounding: it parts
# no branches.
ONE_BRANCH = 8.0 * EPS
# Cardano's formula is as accurate as the matrix where the root in it exceeds this share of its sum.
DISTINCT = 0.1
_THIRD_ROOTS = np.exp(2j * np.pi / 3.0 * np.arange(3))


def pair_branches(form: tuple[Complex, ...], pair: tuple[Complex, ...]) -> Complex:
    """Return derivatives of eigenvalues that coincide two by two.

    Parameters
    ----------
    form : tuple of four arrays, shape (variables, groups)
        Entries 11, 12, 21 and 22 of their forms.
    pair : tuple of four arrays, shape (groups,)
        The same entries of y^T (2 lambda M + C) x.

    Returns
    -------
    array, shape (variables, groups, 2)
        Derivatives of their branches, in ascending order.
    """
    (f, g, h, k), (a, b, c, d) = form, pair
    with np.errstate(all="ignore"):
        determinant = a * d - b * c
        a, b, c, d = a / determinant, b / determinant, c / determinant, d / determinant
        condition = np.abs((a, b, c, d)).max(axis=0) * np.abs(pair).max(axis=0)
        first, last = b * h - d * f, c * g - a * k
        mean, apart = 0.5 * (first + last), 0.5 * (first - last)
        root = np.sqrt(apart * apart + (b * k - d * g) * (c * f - a * h))
        turns = np.abs(mean.imag) + np.abs(root.imag) > np.abs(mean.real) + np.abs(root.real)
        root[np.where(turns, root.imag, root.real) < 0.0] *= -1.0
    result: Complex = np.empty((*mean.shape, 2), dtype=complex)
    np.subtract(mean, root, out=result[..., 0])
    np.add(mean, root, out=result[..., 1])
    result[:, ~(condition * EPS < 1.0)] = np.inf  # a defective pair parts with the square root
    return result


def branches(form: Complex, pair: Complex, largest: Array) -> Complex:
    """Return derivatives of eigenvalues of which k coincide.

    Parameters
    ----------
    form : array, shape (variables, groups, k, k)
        Their forms.
    pair : array, shape (groups, k, k)
        y^T (2 lambda M + C) x.
    largest : array, shape (variables,)
        The largest derivative of other eigenvalues.

    Returns
    -------
    array, shape (variables, groups, k)
        Derivatives of their branches, in ascending order.
    """
    inverse = np.linalg.pinv(np.where(np.isfinite(pair), pair, 0.0), rcond=EPS)
    with np.errstate(all="ignore"):
        condition = np.abs(inverse).max(axis=(1, 2)) * np.abs(pair).max(axis=(1, 2))
        matrix = -np.einsum("gij,vgjk->vgik", inverse, form).reshape(-1, *pair.shape[1:])
        values = _eigenvalues(matrix, (ONE_BRANCH * largest).repeat(len(pair))).reshape(form.shape[:3])
    turns = np.abs(values.imag).max(axis=2, keepdims=True) > np.abs(values.real).max(axis=2, keepdims=True)
    order = np.where(turns, values.imag, values.real).argsort(axis=2)
    result: Complex = np.take_along_axis(values, order, axis=2)
    result[:, ~(condition * EPS < 1.0)] = np.inf  # a defective group parts with a root
    return result


def _eigenvalues(matrices: Complex, rounding: Array) -> Complex:
    """Return eigenvalues (n, k) of matrices (n, k, k): diagonals where no entry exceeds the ``rounding`` (n,), not a
    number where these are not.

    The change of one part often has rank one: A^2 = A tr A, and the trace is the only eigenvalue that is not 0.
    """
    flat = matrices.reshape(len(matrices), -1)
    size = np.abs(flat).max(axis=1)
    result: Complex = np.einsum("nii->ni", matrices).copy()
    apart = np.flatnonzero(~(size <= rounding))
    matrices, flat, size = matrices[apart], flat[apart], size[apart]
    trace = result[apart].sum(axis=1)
    square = np.einsum("nij,njk->nik", matrices, matrices).reshape(flat.shape)
    rest = np.abs(square - flat * trace[:, None]).max(axis=1)
    one = (rest <= ONE_BRANCH * size * size) & (np.abs(trace) >= 0.5 * size)
    result[apart] = 0.0
    result[apart, 0] = trace
    result[apart[~np.isfinite(size)]] = np.nan
    others = np.flatnonzero(~one & np.isfinite(size))
    if matrices.shape[1] == 3:
        values, distinct = _cubic_roots(matrices[others])
        result[apart[others[distinct]]] = values[distinct]
        others = others[~distinct]
    result[apart[others]] = np.linalg.eigvals(matrices[others])
    return result


def _cubic_roots(matrices: Complex) -> tuple[Complex, NDArray[np.bool_]]:
    """Eigenvalues (n, 3) of 3x3 matrices by Cardano's formula, and whether they are as distinct as it needs.

    With A = B + 1 tr A / 3, p = tr B^2 / 6, q = det B / 2 they are tr A / 3 + u + p / u, u^3 = q + (q^2 - p^3)^1/2.
    """
    centre = np.einsum("nii->n", matrices) / 3.0
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(matrices, 0, 2)
    a, e, i = a - centre, e - centre, i - centre
    p = (a * a + e * e + i * i + 2.0 * (b * d + c * g + f * h)) / 6.0
    q = 0.5 * (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))
    cube = p * p * p
    root = np.sqrt(q * q - cube)
    root[(root * q.conj()).real < 0.0] *= -1.0
    u = ((q + root) ** (1.0 / 3.0))[:, None] * _THIRD_ROOTS
    distinct = np.abs(root) > DISTINCT * np.abs(q + root)
    with np.errstate(all="ignore"):
        return centre[:, None] + u + p[:, None] / u, distinct
