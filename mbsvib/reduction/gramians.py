"""Factors of the Gramians of stable state spaces.

A P + P A^T + B B^T = 0 and A^T Q + Q A + C^T C = 0 are solved for factors, P = L_p L_p^T and Q = L_q L_q^T, by Newton's
iteration for the sign of A: a product is never formed, so that small Hankel singular values keep their digits.

Source: Benner & Quintana-Orti, Solving stable generalized Lyapunov equations with the matrix sign function, Numerical
Algorithms 20 (1999), section 4.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import EPS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array

# Newton's iteration doubles its digits once it is this near to the limit; before that it is scaled.
NEAR = 0.1
# An eigenvalue as near to the imaginary axis as 1e-12 of its size takes some fifty steps.
STEPS = 100


def gramian_factors(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Return factors L_p (n, p) and L_q (n, q) of the Gramians of a stable state space, with as many columns as ranks.
    """
    n = len(a)
    sign, left, right = a, b, c.T
    for _ in range(STEPS):
        inverse = np.linalg.inv(sign)
        distance = float(np.linalg.norm(sign + np.eye(n)))
        scale = 1.0 if distance < NEAR else float(np.sqrt(np.linalg.norm(sign) / np.linalg.norm(inverse)))
        left = _compressed(np.hstack((left, scale * (inverse @ left))) / np.sqrt(2.0 * scale))
        right = _compressed(np.hstack((right, scale * (inverse.T @ right))) / np.sqrt(2.0 * scale))
        sign = 0.5 * (sign / scale + scale * inverse)
        if distance < np.sqrt(EPS):
            return left / np.sqrt(2.0), right / np.sqrt(2.0)
    raise ResponseError("reduced: the Gramians did not converge; a mode decays by less than 1e-12 of its frequency in "
                        "a radian. Give it damping, or take method='modal'.")  # fmt: skip


def _compressed(factor: Array) -> Array:
    """A factor with the same product, and no more columns than rows."""
    if factor.shape[1] <= len(factor):
        return factor
    return np.asarray(np.linalg.qr(factor.T, mode="r")).T
