"""Undamped modes from the factors: natural frequencies are singular values, never roots of eigenvalues of a product.

With M = R^T R from a QR of the inertia factor and K = D^T diag(k) D, the frequencies are the singular values of
F = diag(sqrt k) D R^-1 and the shapes R^-1 times its right singular vectors. Forming F^T F instead would square the
span of the frequencies, and lose twice the digits of the low ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from mbsvib.loops import pivoted_qr

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.system import System

    Array = NDArray[np.float64]

EPS = float(np.finfo(float).eps)
# Below this share of the largest frequency a mode may be a rigid-body mode, and the rank of the rows decides.
SUSPECT = 1e-6
# Rows of unit length that depend on each other differ by rounding of the geometry, far below this.
RANK = 1e-11


@dataclass(frozen=True, slots=True)
class Undamped:
    """Undamped modes: ``square`` (m,) holds omega^2 [rad^2/s^2], ascending, exactly 0 for the ``rigid`` first ones and
    negative where stiffness is; ``shapes`` (m, m) with shapes^T M shapes = 1; ``errors`` (m,) of omega, relative.
    """

    square: Array
    shapes: Array
    errors: Array
    rigid: int

    @property
    def omega(self) -> Array:
        """Magnitude of the natural angular frequencies [rad/s], shape (m,)."""
        return np.sqrt(np.abs(self.square))


def undamped(system: System) -> Undamped:
    """Return the undamped modes, K phi = omega^2 M phi.

    Parameters
    ----------
    system : System
        The equations of motion.

    Returns
    -------
    Undamped
        Squares of the frequencies, mass-normalised shapes and error estimates.
    """
    m = system.dof
    if m == 0:
        return Undamped(np.zeros(0), np.zeros((0, 0)), np.zeros(0), 0)
    root = triangle(system.inertia_factor)
    used = system.stiffness != 0.0
    k = system.stiffness if used.all() else system.stiffness[used]
    rows = system.elastic_rows if used.all() else system.elastic_rows[used]
    half = lapack.dtrtrs(root, (rows * np.sqrt(np.abs(k))[:, None]).T, trans=1)[0] if len(k) else np.zeros((m, 0))
    if len(k) and float(k.min()) < 0.0:
        values, vectors = np.linalg.eigh((half * np.sign(k)) @ half.T)
        size = np.sqrt(np.abs(values))
    else:
        vectors, size = _left_singular(half)
        values = size * size
    largest = float(size.max())
    rigid = 0
    if largest == 0.0:
        rigid = m
    elif float(size.min()) < SUSPECT * largest:
        rigid = m - _rank(rows)
    zero = np.argsort(np.abs(values), kind="stable")[:rigid]
    values[zero] = 0.0
    order = np.argsort(values, kind="stable")
    if rigid:  # rigid-body modes come first, also where negative stiffness makes others diverge
        order = np.concatenate((zero, order[~np.isin(order, zero)]))
    shapes = lapack.dtrtrs(root, vectors[:, order])[0]
    largest_entry = shapes[np.argmax(np.abs(shapes), axis=0), np.arange(m)]
    shapes *= np.sign(largest_entry)
    values, size = values[order], size[order]
    return Undamped(values, shapes, _errors(values, size, largest, squared=values.min() < 0.0), rigid)


def triangle(factor: Array) -> Array:
    """Return R upper triangular with R^T R = factor^T factor, from a QR of the factor."""
    m = factor.shape[1]
    return np.triu(lapack.dgeqrf(factor)[0][:m])


def _left_singular(half: Array) -> tuple[Array, Array]:
    """Return all left singular vectors of (m, n) and m singular values, ascending."""
    m, n = half.shape
    if n == 0:
        return np.eye(m), np.zeros(m)
    u, s, _, info = lapack.dgesdd(half, full_matrices=n < m)
    if info:  # divide and conquer did not converge, which is rare: the older QR iteration does
        u, s, _, info = lapack.dgesvd(half, full_matrices=n < m)
    if info:
        raise np.linalg.LinAlgError("the singular values of the stiffness factor did not converge")
    size = np.zeros(m)
    size[: len(s)] = s
    return u[:, ::-1], size[::-1]


def _rank(rows: Array) -> int:
    """Rank of the elastic rows whatever their stiffness: rows and then columns are brought to unit length."""
    length = np.sqrt(np.einsum("ij,ij->i", rows, rows))
    unit = rows / length[:, None]
    size = np.sqrt(np.einsum("ij,ij->j", unit, unit))
    pivots = np.abs(pivoted_qr(unit / np.where(size > 0.0, size, 1.0))[0].diagonal())
    return int(np.count_nonzero(pivots > RANK * pivots[0])) if len(pivots) else 0


def _errors(values: Array, size: Array, largest: float, squared: bool) -> Array:
    """Backward stability of the decomposition: an absolute error of a few eps times the largest value."""
    ratio = np.divide(largest, size, out=np.zeros_like(size), where=values != 0.0)
    growth = 4.0 + float(np.sqrt(len(size)))
    result: Array = growth * EPS * (0.5 * ratio**2 if squared else ratio)
    return result
