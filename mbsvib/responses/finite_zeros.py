"""Finite zeros of state-space matrices: orthogonal transformations deflate the infinite ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex

# Rows and feedthroughs of unit size are zero below this: rounding in the products of some hundred states is 1e-14.
RANK = 2e-13
# A feedthrough whose inverse is larger is not inverted; its zeros are those of a pencil.
REGULAR = 1e3


def finite_zeros(a: Array, b: Array, c: Array, d: Array) -> Complex:
    """Return the finite s at which [[A - s, B], [C, D]] loses rank; rows of C and D and columns of B are of the size of
    one.

    Source: Emami-Naeini & Van Dooren, Automatica 18 (1982).
    """
    a, b, c, d = _peeled(a, b, c, d)
    if not len(d):  # no output is left to tell one input from the other
        return np.linalg.eigvals(a).astype(complex) if len(a) else np.zeros(0, dtype=complex)
    # the same from the other side: columns of the feedthrough
    a, b, c, d = _peeled(a.T, c.T, b.T, d.T)
    n = len(a)
    if n == 0:
        return np.zeros(0, dtype=complex)
    if not len(d):
        return np.linalg.eigvals(a).astype(complex)
    if np.linalg.norm(np.linalg.inv(d), 2) * np.linalg.norm(b, 2) * np.linalg.norm(c, 2) <= REGULAR:
        return np.linalg.eigvals(a - b @ np.linalg.solve(d, c)).astype(complex)
    from scipy.linalg import eig

    turn = np.linalg.qr(np.concatenate((c, d), axis=1).T, mode="complete")[0][:, len(d) :]
    top = np.concatenate((a, b), axis=1) @ turn
    alpha, beta = eig(top, turn[:n], right=False, homogeneous_eigvals=True)
    finite = np.abs(beta) > EPS * np.abs(alpha)
    result: Complex = alpha[finite] / beta[finite]
    return result


def _peeled(a: Array, b: Array, c: Array, d: Array) -> tuple[Array, Array, Array, Array]:
    """Take off outputs without feedthrough and the states they show, until the feedthrough has full row rank."""
    while len(d):
        rank, turn = _rank(d, max(1.0, float(np.abs(d).max(initial=0.0))))
        c, d = turn.T @ c, turn.T @ d
        direct, hidden = (c[:rank], d[:rank]), c[rank:]
        if not len(hidden):
            break
        shown, turn = _rank(hidden.T, 1.0)
        left = turn[:, shown:]
        first = turn[:, :shown]
        a, b, c, d = (
            left.T @ a @ left, left.T @ b, np.concatenate((direct[0] @ left, first.T @ a @ left)),
            np.concatenate((direct[1], first.T @ b)),
        )  # fmt: skip
        if not shown:
            break
    return a, b, c, d


def _rank(matrix: Array, size: float) -> tuple[int, Array]:
    """Rank of a matrix against entries of ``size``, and an orthogonal matrix whose first columns span its range."""
    from scipy.linalg import qr

    if not matrix.size:
        return 0, np.eye(len(matrix))
    turn, upper, _ = qr(matrix, pivoting=True)
    return int(np.count_nonzero(np.abs(upper.diagonal()) > RANK * size)), turn
