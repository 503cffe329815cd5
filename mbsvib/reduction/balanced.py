"""Balanced truncation: hardly controllable or hardly observable states are left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import schur, solve_sylvester

from mbsvib.linalg.balancing import exponents, scaled_by
from mbsvib.linalg.rank import DECAYS
from mbsvib.reduction.gramians import gramian_factors

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


@dataclass(frozen=True, slots=True)
class Balanced:
    """x = ``right`` z and z = ``left`` x: the first ``lasting`` states z do not decay, the others are balanced with the
    Hankel singular values ``hankel``, in descending order.
    """

    left: Array
    right: Array
    lasting: int
    hankel: Array

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
    power = exponents(a, b, c)
    scaled, b, c = scaled_by(power, a, b, c)
    lasting, decaying, lasting_rows, decaying_rows = _split(scaled)
    n = decaying.shape[1]
    left = right = np.zeros((len(a), 0))
    hankel = np.zeros(0)
    if n:
        l_p, l_q = gramian_factors(decaying_rows @ scaled @ decaying, decaying_rows @ b, c @ decaying)
        u, hankel, vt = np.linalg.svd(l_q.T @ l_p)
        rank = int(np.count_nonzero(hankel > 0.0))
        root = np.sqrt(hankel[:rank])
        right = decaying @ (l_p @ vt[:rank].T / root)
        left = ((u[:, :rank] / root).T @ l_q.T @ decaying_rows).T
        hankel = hankel[:rank]
    return Balanced(np.ldexp(np.hstack((lasting_rows.T, left)).T, -power[None, :]),
                    np.ldexp(np.hstack((lasting, right)), power[:, None]), lasting.shape[1], hankel)  # fmt: skip


def _split(a: Array) -> tuple[Array, Array, Array, Array]:
    """Bases of the states that do not decay and of those that do, (n, k) and (n, n - k), and rows of the inverse."""
    form, basis, count = schur(a, sort=lambda re, im: re >= -DECAYS * np.hypot(re, im))
    first, second = basis[:, :count], basis[:, count:]
    if not count or count == len(a):
        return first, second, first.T, second.T
    x = solve_sylvester(form[:count, :count], -form[count:, count:], -form[:count, count:])
    return first, second + first @ x, first.T - x @ second.T, second.T
