"""Balanced truncation: hardly controllable or hardly observable states are left out.

Factors of the Gramians of stable state spaces.

A P + P A^T + B B^T = 0 and A^T Q + Q A + C^T C = 0 are solved for factors, P = L_p L_p^T and Q = L_q L_q^T, by Newton's
iteration for the sign of A: a product is never formed, so that small Hankel singular values keep their digits.

Source: Benner & Quintana-Orti, Solving stable generalized Lyapunov equations with the matrix sign function, Numerical
Algorithms 20 (1999), section 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from mbsvib.errors import ResponseError
from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.lasting import separated
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


@dataclass(frozen=True, slots=True)
class Balanced:
    """x = ``right`` z and z = ``left`` x: the first states z do not decay and have the matrix ``undamped``, the others
    are balanced with the Hankel singular values ``hankel``, in descending order. States that do not decay and that no
    response contains are left out.
    """

    left: Array
    right: Array
    undamped: Array
    hankel: Array

    @property
    def lasting(self) -> int:
        """Number of states that do not decay."""
        return len(self.undamped)

    def matrix(self, a: Array, order: int) -> Array:
        """Return the state matrix (order, order) of the first states, for that of all (n, n)."""
        result: Array = self.left[:order] @ a @ self.right[:, :order]
        result[: self.lasting] = result[:, : self.lasting] = 0.0
        result[: self.lasting, : self.lasting] = self.undamped
        return result

    def bound(self, order: int) -> float:
        """Return twice the sum of the Hankel singular values that ``order`` states leave out.

        max over omega of sigma(G(i w) - G_r(i w)) <= 2 (s_(r+1) + ... + s_n)

        Source: Antoulas, Approximation of Large-Scale Dynamical Systems (2005), theorem 7.9.
        """
        return 2.0 * float(self.hankel[order - self.lasting :].sum())

    def order(self, error: float) -> int:
        """Return the smallest order whose bound is no larger than ``error``."""
        tail = 2.0 * np.append(np.cumsum(self.hankel[::-1])[::-1], 0.0)
        return self.lasting + int(np.argmax(tail <= error))


def balanced(a: Array, b: Array, c: Array) -> Balanced:
    """Return the balancing transformation of a state space; poles that do not decay stay as they are.

    Source: Tombs & Postlethwaite, Truncated balanced realization of a stable non-minimal state-space system,
    International Journal of Control 46 (1987), the square-root method.
    """
    parts = separated(a, b, c)
    lasting = [group.part for group in parts.shown]
    left, right = (np.concatenate([np.zeros((len(a), 0)), *matrices], axis=1) for matrices in
                   ([part.left.T for part in lasting], [part.right for part in lasting]))  # fmt: skip
    hankel = np.zeros(0)
    if len(parts.decaying.a):
        power = exponents(parts.decaying.a, parts.decaying.b, parts.decaying.c)
        l_p, l_q = gramian_factors(*scaled_by(power, parts.decaying.a, parts.decaying.b, parts.decaying.c))
        u, hankel, vt = np.linalg.svd(l_q.T @ l_p)
        rank = int(np.count_nonzero(hankel > 0.0))
        hankel = hankel[:rank]
        root = np.sqrt(hankel)
        into, out = l_p @ vt[:rank].T / root, l_q @ u[:, :rank] / root
        left = np.hstack((left, parts.decaying.left.T @ np.ldexp(out, -power[:, None])))
        right = np.hstack((right, parts.decaying.right @ np.ldexp(into, power[:, None])))
    undamped = block_diag(np.zeros((0, 0)), *[part.a for part in lasting])
    return Balanced(left.T, right, undamped, hankel)
