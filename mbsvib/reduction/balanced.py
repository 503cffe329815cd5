"""Balanced truncation: hardly controllable or hardly observable states are left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.lasting import separated
from mbsvib.reduction.gramians import gramian_factors

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


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
