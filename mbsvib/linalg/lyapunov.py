"""Lyapunov equations of one matrix with many right-hand sides."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array

REFINEMENTS = 2


@dataclass(frozen=True, eq=False)
class Lyapunov:
    """The equation A P + P A^T + W = 0 of a matrix ``a`` (n, n) whose eigenvalues have negative real parts.

    Source: Bartels & Stewart, Commun. ACM 15 (1972) 820: by the Schur form; its residual is solved for again.
    """

    a: Array

    @cached_property
    def _schur(self) -> tuple[Array, Array]:
        from scipy.linalg import schur

        triangle, vectors = schur(self.a, output="real")
        return triangle, vectors

    def controlled(self, w: Array) -> Array:
        """Return P with A P + P A^T + W = 0 for a symmetric W (n, n)."""
        return self._solved(w, self.a, transposed=False)

    def observed(self, w: Array) -> Array:
        """Return Q with A^T Q + Q A + W = 0 for a symmetric W (n, n)."""
        return self._solved(w, self.a.T, transposed=True)

    def _solved(self, w: Array, a: Array, transposed: bool) -> Array:
        if not len(w):
            return np.zeros((0, 0))
        result = self._once(w, transposed)
        for _ in range(REFINEMENTS):
            # one of the products is rounded as the other is: the residual is symmetric
            half = a @ result
            residual = half + half.T + w
            step = self._once(residual, transposed)
            if np.abs(step).max() > 0.5 * np.abs(result).max():
                break
            result = result + step
        return np.asarray(0.5 * (result + result.T))

    def _once(self, w: Array, transposed: bool) -> Array:
        from scipy.linalg import lapack

        triangle, z = self._schur
        inside, scale, _ = lapack.dtrsyl(triangle, triangle, -(z.T @ w @ z), trana="T" if transposed else "N",
                                         tranb="N" if transposed else "T")  # fmt: skip
        return np.asarray(z @ (inside / scale) @ z.T)
