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
from mbsvib.linalg.gram_schmidt import extended
from mbsvib.modes.undamped import undamped
from mbsvib.sparse.from_matrices import matrices_of, motions_of, projected, quadratic_of
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
        raise ResponseError(f"reduced: '{system.name}' has no inputs and outputs, about which method = 'krylov' is. "
                            f"Take method = 'modal'.")  # fmt: skip
    free = _free(system, form)
    speed = quadratic_of(system).speed
    scale = max(2.0 * np.pi * max(frequencies), speed)
    metric = given.M + given.K / scale**2
    z = extended(free[:, :0], free, REPEATED, order, metric)
    series = [_Moments(given, 2j * np.pi * f, ends, speed) for f in frequencies if f or not free.shape[1]]
    if not series:
        raise ResponseError(f"reduced: near = {shown(near)} with method = 'krylov': '{system.name}' moves freely, and "
                            f"has no static response; expected frequencies above 0.")  # fmt: skip
    idle = 0  # undamped, every other coefficient about 0 is nothing; after more, these are all that inputs reach
    while z.shape[1] < order and idle < IDLE:
        before = z.shape[1]
        for one in series:
            block = one.next()
            z = extended(z, np.concatenate((block.real, block.imag), axis=1), REPEATED, order, metric)
        idle = idle + 1 if z.shape[1] == before else 0
    mass = z.T @ (given.M @ z)
    size, turn = np.linalg.eigh(0.5 * (mass + mass.T))
    if size[0] <= REPEATED * size[-1]:
        raise ResponseError(f"reduced: method = 'krylov': inputs or outputs of '{system.name}' are at coordinates "
                            f"without mass, whose motions alone have none; take method = 'static-corrected'.")
    root = turn / np.sqrt(size)
    return projected(system, _rotated(z @ root, given.K, free), free.shape[1], form)


def _rotated(z: Array, stiffness: Any, free: Array) -> Array:
    """The same span by its own modes of unit mass, the free motions first."""
    inner = z.T @ (stiffness @ z)
    turned = z @ np.linalg.eigh(0.5 * (inner + inner.T))[1]
    turned[:, : free.shape[1]] = free
    return np.asarray(turned)


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
                                f"'{given.name}'. Take a frequency beside it or 'modal'.") from None  # fmt: skip
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
        self.pairs = extended(self.pairs, block, REPEATED)
        return self.pairs[:n, self.last :]
