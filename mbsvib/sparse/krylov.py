"""Reduction of sparse matrices by moments: responses that are exact at some frequencies, with their derivatives.

With P(s) = s^2 M + s C + K the motions x_0 = P(s0)^-1 [B, H^T], x_j = -P(s0)^-1 (P'(s0) x_j-1 + M x_j-2) about
s0 = 2 pi i f are Taylor's coefficients of the motion under forces at the inputs and at the outputs. Matrices that are
projected on their real and imaginary parts have the same response at s0, and the same first 2 q - 1 derivatives with q
coefficients; f = 0 is the static correction. One basis for both sides keeps M, C and K symmetric and as definite as
they were, so that the reduced system is stable, and passive between collocated ports.

Source: Bai & Su, SIAM J. Sci. Comput. 26 (2005) 1692 (second-order Krylov subspaces); Beattie & Gugercin, Systems &
Control Letters 58 (2009) 225.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.common.arguments import shown
from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError
from mbsvib.modes.undamped import undamped
from mbsvib.sparse.from_matrices import matrices_of, motions_of, projected
from mbsvib.sparse.modes import modes
from mbsvib.sparse.reduction import RTOL

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.sparse.equations import SparseEquations

E = TypeVar("E", bound=Equations)

# What is left of a motion beside those before it, in parts of it, below which it is one of them.
REPEATED = 1e-9
# Modes that are asked for to find the free motions: six of a body, and one more.
FREE = 7
IDLE = 3


def krylov(system: SparseEquations, order: int, near: float | Sequence[float], form: type[E]) -> E:
    """Return the system of ``order`` motions that match moments about frequencies ``near`` [Hz], all in turn."""
    given, frequencies = matrices_of(system), _frequencies(near)
    ends = np.concatenate((system.input_rows.toarray(), *(rows.toarray() for rows in system.output_rows))).T
    ends = ends[:, ends.any(axis=0)]
    if not ends.shape[1]:
        raise ResponseError(f"reduced: '{system.name}' has no inputs and outputs, about which method = 'krylov' is.")
    free = _free(system, form)
    speed = _speed(given)
    scale = max(2.0 * np.pi * max(frequencies), speed)
    metric = given.M + given.K / scale**2
    basis = _Basis(metric, np.zeros((system.layout.size, 0))).with_motions(free, order)
    series = [_Moments(given, 2j * np.pi * f, ends, speed) for f in frequencies if f or not free.shape[1]]
    if not series:
        raise ResponseError(f"reduced: near = {shown(near)} with method = 'krylov': '{system.name}' moves freely, and "
                            f"has no static response; expected frequencies above 0.")  # fmt: skip
    idle = 0  # undamped, every other coefficient about 0 is nothing; after more, these are all that inputs reach
    while basis.motions.shape[1] < order and idle < IDLE:
        before = basis.motions.shape[1]
        for one in series:
            block = one.next()
            basis = basis.with_motions(np.concatenate((block.real, block.imag), axis=1), order)
        idle = idle + 1 if basis.motions.shape[1] == before else 0
    z = basis.motions
    mass = z.T @ (given.M @ z)
    size, turn = np.linalg.eigh(0.5 * (mass + mass.T))
    if size[0] <= REPEATED * size[-1]:
        raise ResponseError(f"reduced: method = 'krylov': inputs or outputs of '{system.name}' are at coordinates "
                            f"without mass, whose motions alone have none; take method='static-corrected'.")
    root = turn / np.sqrt(size)
    return projected(system, _rotated(z @ root, given.K, free), free.shape[1], form)


def _rotated(z: Array, stiffness: Any, free: Array) -> Array:
    """The same span by its own modes of unit mass, the free motions first."""
    inner = z.T @ (stiffness @ z)
    turned = z @ np.linalg.eigh(0.5 * (inner + inner.T))[1]
    turned[:, : free.shape[1]] = free
    return np.asarray(turned)


def _speed(given: Any) -> float:
    """A typical frequency [rad/s] of matrices, by their diagonals."""
    k, m = given.K.diagonal(), given.M.diagonal()
    return float(np.sqrt(np.median(np.abs(k[m > 0.0]) / m[m > 0.0]))) or 1.0


def _frequencies(near: Any) -> list[float]:
    values = np.atleast_1d(np.asarray(near, dtype=float)) if np.ndim(near) < 2 else np.zeros(0)
    if not len(values) or not np.isfinite(values).all() or (values < 0.0).any():
        raise ResponseError(f"reduced: near = {shown(near)} with method = 'krylov'; expected one or several "
                            f"frequencies [Hz], 0 or more.")  # fmt: skip
    return list(dict.fromkeys(values.tolist()))


def _free(system: SparseEquations, form: type[Equations]) -> Array:
    """Free motions (size, r) of unit mass."""
    found: Any = modes(system, min(FREE, system.dof), 0.0, form)
    basis = undamped(found.reduced, RTOL)
    return np.asarray((motions_of(found.reduced) @ basis.shapes)[:, : basis.rigid])


class _Basis:
    """Motions (size, n) that are orthonormal in a metric."""

    def __init__(self, metric: Any, motions: Array) -> None:
        self.metric, self.motions = metric, motions

    def with_motions(self, block: Array, most: int) -> _Basis:
        """Return the basis with what is new in a block, up to so many motions."""
        z = self.motions
        for column in block.T:
            if z.shape[1] == most or not (size := self._size(column)):
                continue
            rest = column / size
            for _ in range(2):
                rest = rest - z @ (z.T @ (self.metric @ rest))
            if (left := self._size(rest)) > REPEATED:
                z = np.column_stack((z, rest / left))
        return _Basis(self.metric, z)

    def _size(self, column: Array) -> float:
        return float(np.sqrt(max(0.0, column @ (self.metric @ column))))


class _Moments:
    """Pairs (x_j, x_j-1 / speed) of Taylor's coefficients of the motion about s, orthonormal one against the other.

    Such pairs span what those of the coefficients themselves span, which would all turn to the nearest mode.
    """

    def __init__(self, given: Any, s: complex, ends: Array, speed: float) -> None:
        self.given, self.s, self.ends, self.speed = given, s, ends, speed
        try:
            self.factor = given.factor(s=s) if s else given.factor()
        except np.linalg.LinAlgError:
            raise ResponseError(f"reduced: method = 'krylov' about {abs(s) / 2 / np.pi:g} Hz, an undamped pole of "
                                f"'{given.name}'; expected a frequency beside it.") from None  # fmt: skip
        self.pairs = np.zeros((2 * len(ends), 0), dtype=complex if s else float)
        self.last = 0

    def next(self) -> Complex:
        """Return motions (size, k) that the next coefficients add."""
        n, given = len(self.ends), self.given
        if not self.pairs.shape[1]:
            x = self.factor.solve(self.ends.astype(self.pairs.dtype))
            block = np.concatenate((x, 0.0 * x))
        else:
            x, before = self.pairs[:n, self.last :], self.pairs[n:, self.last :] * self.speed
            right = given.C @ x + 2.0 * self.s * (given.M @ x) + given.M @ before
            block = np.concatenate((-self.factor.solve(right), x / self.speed))
        self.last = self.pairs.shape[1]
        for column in block.T:
            size = np.linalg.norm(column)
            rest = column / (size or 1.0)
            for _ in range(2):
                rest = rest - self.pairs @ (self.pairs.conj().T @ rest)
            if (left := np.linalg.norm(rest)) > REPEATED:
                self.pairs = np.column_stack((self.pairs, rest / left))
        return self.pairs[:n, self.last :]
