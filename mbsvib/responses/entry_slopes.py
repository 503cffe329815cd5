"""How poles and gains of x' = A x + B u, y = C x + D u change with the entries of [A B; C D].

d lambda = l^H dA r / l^H r of a simple pole with eigenvectors l, r;  d sigma = Re(u^H dG v) of a simple singular value
with u, v, and dG = [C R 1] d[A B; C D] [R B; 1], R = (i w - A)^-1.

Source: Magnus & Neudecker, Matrix Differential Calculus (1999), chapter 8.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array, Complex

    Matrices = tuple[Array, Array, Array, Array]


def pole_slope(a: Array, number: Callable[[Complex], int]) -> tuple[complex, Complex]:
    """Return a pole, the one whose ``number`` among all (n,) a function tells, and its derivatives to A (n, n)."""
    from scipy.linalg import eig

    values, left, right = eig(a, left=True)
    k = int(number(values))
    y, x = left[:, k].conj(), right[:, k]
    return complex(values[k]), np.asarray(np.outer(y, x) / (y @ x or np.finfo(float).eps))


def gain_slope(space: Matrices, w: float, weight: Array | Complex | None = None) -> tuple[float, Array]:
    """Return the largest singular value of W G(i w), and its derivatives to the entries of [A B; C D].

    ``w``: angular frequency, inf for D. ``weight`` W (rows, outputs) or (1, 1), the same for all; default: 1.
    """
    a, b, c, d = space
    n, one = len(a), np.eye(len(c))
    w_out = one if weight is None else np.asarray(weight) * one if np.size(weight) == 1 else np.asarray(weight)
    x = np.zeros((n, b.shape[1]), dtype=complex)
    inside = 1j * w * np.eye(n) - a if np.isfinite(w) else np.eye(n)
    if np.isfinite(w):
        x = np.linalg.solve(inside, b.astype(complex))
    u, s, vh = np.linalg.svd(w_out @ (c @ x + d))
    row = u[:, 0].conj() @ w_out
    left = np.linalg.solve(inside.T, c.T @ row) if np.isfinite(w) else np.zeros(n)
    right = np.concatenate((x @ vh[0].conj(), vh[0].conj()))
    return float(s[0]), np.outer(np.concatenate((left, row)), right).real
