"""P(s) = s^2 M + s (C + G) + K + N over the unknowns: products from the factors, and solves from both sides.

P(s)^T has G and N with the opposite sign. Apart from these the tableau is symmetric, after the equations are permuted
to the unknowns that they balance, so that one factorisation serves both.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mbsvib.common.arrays import AnyArray, Array, Index
from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.modes.classical import proportional
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.tableau import Factor


@dataclass(frozen=True)
class Quadratic:
    """P(s) of a ``system``."""

    system: SparseEquations

    @cached_property
    def w(self) -> Any:
        """The nonzero rows of W."""
        w = self.system.inertia_factor
        return w[np.diff(w.indptr) > 0]

    @cached_property
    def wt(self) -> Any:
        """W^T by rows."""
        return self.w.T.tocsr()

    @property
    def symmetric(self) -> bool:
        """Whether left and right vectors are equal: neither spin nor circulatory forces."""
        return self.system.gyroscopic is None and self.system.circulatory is None

    @property
    def conservative(self) -> bool:
        """Whether energy is conserved, so that all eigenvalues are imaginary and left vectors conjugate."""
        system = self.system
        return not system.row_damping.any() and system.circulatory is None and bool((system.row_stiffness >= 0.0).all())

    @property
    def stable(self) -> bool:
        """Whether no eigenvalue can have a positive real part: forces are those of springs, dampers and spin."""
        system = self.system
        signs = (system.row_stiffness >= 0.0).all() and (system.row_damping >= 0.0).all()
        return bool(signs) and system.circulatory is None

    @cached_property
    def speed(self) -> float:
        """A typical frequency [rad/s] from the sums of all stiffness and all inertia; 1 without stiffness."""
        rows = np.asarray(self.system.elastic_rows.power(2).sum(axis=1))[:, 0]
        stiffness, inertia = float(np.abs(self.system.row_stiffness) @ rows), float(self.w.power(2).sum())
        return float(np.sqrt(stiffness / (inertia or 1.0))) or 1.0

    def force(self, values: Any, z: AnyArray, transposed: bool = False) -> AnyArray:
        """Return P(lambda) z, column by column (size, n), or P(lambda)^T z."""
        system, rows = self.system, self.system.elastic_rows
        weights = system.row_stiffness[:, None] + system.row_damping[:, None] * values
        result = rows.T @ (weights * (rows @ z)) + self.wt @ ((self.w @ z) * values**2)
        return np.asarray(result + self._antisymmetric(values, 1.0, z, transposed))

    def inertia(self, z: AnyArray) -> AnyArray:
        """Return M z."""
        return np.asarray(self.wt @ (self.w @ z))

    def damping(self, z: AnyArray) -> AnyArray:
        """Return the forces of dampers, C z."""
        rows = self.system.elastic_rows
        return np.asarray(rows.T @ (self.system.row_damping[:, None] * (rows @ z)))

    def size(self, z: AnyArray) -> Array:
        """Return sqrt(z^H M z) = |W z| of each column."""
        return np.asarray(np.linalg.norm(self.w @ z, axis=0))

    def is_damped(self, z: Array) -> bool:
        """Whether dampers resist some of the motions (size, n), beyond rounding."""
        rows = self.system.elastic_rows[self.system.row_damping != 0.0]
        return bool((np.abs(rows @ z) > ZERO_SUM * (abs(rows) @ np.abs(z))).any())

    @property
    def damped(self) -> bool:
        """Whether responses differ in phase: by dampers or spin."""
        return bool(self.system.row_damping.any()) or self.system.gyroscopic is not None

    @property
    def proportional(self) -> bool:
        """Whether C is a multiple of K, row by row."""
        return proportional(self.system.row_damping, self.system.row_stiffness)

    def slope(self, values: Any, z: AnyArray, transposed: bool = False) -> AnyArray:
        """Return P'(lambda) z = (2 lambda M + C + G) z, column by column (size, n), or P'(lambda)^T z."""
        result = self.damping(z) + self.inertia(z * (2.0 * values))
        return np.asarray(result + self._antisymmetric(1.0, 0.0, z, transposed))

    def _antisymmetric(self, spin: Any, circulation: float, z: AnyArray, transposed: bool) -> Any:
        sign, result = -1.0 if transposed else 1.0, 0.0
        if self.system.gyroscopic is not None:
            result = (self.system.gyroscopic @ z) * (sign * spin)
        if self.system.circulatory is not None and circulation:
            result = result + (self.system.circulatory @ z) * sign
        return result

    def energy(self, z: AnyArray, speed: float) -> AnyArray:
        """Return rows (n, columns) whose sum of squares is an energy: inertia at a speed [rad/s], springs, dampers."""
        weights = np.sqrt(np.abs(self.system.row_stiffness) + speed * np.abs(self.system.row_damping))[:, None]
        return np.concatenate((speed * (self.w @ z), weights * (self.system.elastic_rows @ z)))

    @cached_property
    def _balance(self) -> tuple[Index, Array]:
        return self.system.layout.balance()

    def right(self, force: AnyArray) -> AnyArray:
        """Return right sides of the tableau for generalised forces (size, n) or (size,) on the unknowns."""
        row, sign = self._balance
        used = np.flatnonzero(sign)
        result = np.zeros_like(force)
        result[row[used]] = force[used] * (sign[used] if force.ndim == 1 else sign[used, None])
        return result

    def solve(self, factor: Factor, force: AnyArray, transposed: bool = False) -> AnyArray:
        """Return motions (size, n) with P z = force, or P^T z = force, for the factored P."""
        if not transposed:
            return factor.solve(self.right(force))
        row, sign = self._balance
        used = np.flatnonzero(sign)
        result = np.zeros(force.shape, dtype=np.result_type(force, factor.matrix.dtype))
        result[used] = factor.solve(force, transposed=True)[row[used]] * sign[used, None]
        return result
