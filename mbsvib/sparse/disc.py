"""The eigenvalues of P(lambda) in a disc: shift-invert Arnoldi on motions and rates, z and (lambda - sigma) z.

P(lambda) z = 0 is theta (z, w) = (-P(sigma)^-1 (P'(sigma) z + M w), z) with theta = 1 / (lambda - sigma). The state
contains only the motions on which M, C and G act, in units of the square root of energy: W z, the rows of dampers and
spin, and W w. Motions without mass do not contribute to w; infinite eigenvalues have theta = 0. Repeated eigenvalues,
for example of equal parts, are found by further searches with the known ones deflated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_matrix, diags

from mbsvib.common.arrays import AnyArray, Array, Complex
from mbsvib.sparse.arnoldi import Ritz, arnoldi
from mbsvib.sparse.tableau import Factor

if TYPE_CHECKING:
    from mbsvib.sparse.quadratic import Quadratic

# Residual of the eigenvectors.
TOLERANCE = 1e-10
# Vectors of a block: the maximum multiplicity of eigenvalues that one search finds.
BLOCK = 4
# Maximum dimension of a search: the first number per eigenvalue, plus the second for bands of frequencies. Number of
# eigenvalues that may converge together; dimension, beyond the wanted ones, at which eigenvalues are first computed.
PER_EIGENVALUE, MORE, FEW, FIRST = 10, 300, 4, 20
# Eigenvalues are equally distant from the shift if their distances agree to this relative difference.
SAME_DISTANCE = 1e-6
# Ritz values may still grow by as much as this share of them.
UNSURE = 0.1
# Eigenvalues theta below the first fraction of the largest are 0; below the second they are rounding errors.
NOTHING, ROUNDED = 1e-13, 1e-10
# Rounds of searching for eigenvalues that were missed.
SEARCHES = 8


@dataclass(frozen=True)
class Shifted:
    """The operator at a shift ``sigma`` [1/s], with a ``speed`` [rad/s] that scales w to the size of z."""

    quadratic: Quadratic
    sigma: complex
    speed: float
    factor: Factor
    transposed: bool = False

    @cached_property
    def _dampers(self) -> tuple[Any, Any]:
        """Rows of dampers in the square root of energy, and the same with the dampers' signs, transposed."""
        system = self.quadratic.system
        used = np.flatnonzero(system.row_damping)
        c = system.row_damping[used]
        rows = diags(np.sqrt(np.abs(c))) @ system.elastic_rows[used]
        return (np.sqrt(self.speed) * rows).tocsr(), (rows.T @ diags(np.sign(c) / np.sqrt(self.speed))).tocsr()

    @cached_property
    def _spins(self) -> tuple[Any, Any]:
        """Coordinates on which G acts in the square root of energy, and G over these."""
        system = self.quadratic.system
        g = system.gyroscopic
        if g is None:
            return csr_matrix((0, system.layout.size)), csr_matrix((system.layout.size, 0))
        size = np.asarray(abs(g).sum(axis=0)).reshape(-1)
        at = np.flatnonzero(size)
        scale = np.sqrt(self.speed * size[at])
        rows = csr_matrix((scale, (np.arange(len(at)), at)), shape=(len(at), system.layout.size))
        return rows, ((-1.0 if self.transposed else 1.0) * g[:, at] @ diags(1.0 / scale)).tocsr()

    @cached_property
    def _ends(self) -> tuple[int, int, int]:
        mass, dampers = self.quadratic.w.shape[0], self._dampers[0].shape[0]
        return mass, mass + dampers, mass + dampers + self._spins[0].shape[0]

    @property
    def size(self) -> int:
        """Number of entries of a state."""
        return self._ends[2] + self._ends[0]

    def motions(self, state: AnyArray) -> AnyArray:
        """Return theta z (size, n) of states (n columns)."""
        mass, dampers, spins = self._ends
        q = self.quadratic
        force = q.wt @ ((2.0 * self.sigma / self.speed) * state[:mass] + state[spins:])
        force = force + self._dampers[1] @ state[mass:dampers] + self._spins[1] @ state[dampers:spins]
        return -q.solve(self.factor, np.asarray(force), self.transposed)

    def apply(self, state: AnyArray) -> AnyArray:
        """Return the operator times states."""
        z, before = self.motions(state), state[: self._ends[0]] / self.speed
        return np.concatenate((self.speed * (self.quadratic.w @ z), self._dampers[0] @ z, self._spins[0] @ z, before))

    def start(self, seed: int) -> AnyArray:
        """Return states at random, without motions of infinite eigenvalues."""
        state = np.random.default_rng(seed).standard_normal((self.size, min(BLOCK, self.size)))
        for _ in range(2):
            state = self.apply(state)
            state = state / np.maximum(np.linalg.norm(state, axis=0), np.finfo(float).tiny)
        return state

    def rough(self, steps: int) -> Ritz:
        """Return approximations of the eigenvalues nearest to the shift from a few steps."""
        return arnoldi(self.apply, self.start(0)[:, :1], lambda _: False, (steps, steps))


@dataclass(frozen=True, slots=True)
class Disc:
    """All eigenvalues ``values`` up to a distance of ``reach`` from the shift, with an orthonormal ``basis`` of their
    states; ``dimension`` is that of the largest search.
    """

    shifted: Shifted
    values: Complex
    basis: AnyArray
    reach: float
    dimension: int = 0

    def motions(self) -> AnyArray:
        """Return motions (size, n) that span the eigenvectors."""
        return self.shifted.motions(self.basis)

    def left(self) -> Disc:
        """Return the empty disc of the left eigenvectors."""
        return Disc(replace(self.shifted, transposed=True), self.values[:0], self.basis[:, :0], 0.0)

    def distance(self, values: Complex) -> Array:
        """Return lower bounds of the distances of eigenvalues from those that are not in the disc."""
        return np.asarray(np.maximum(self.reach - np.abs(values - self.shifted.sigma), 0.0))

    def grown(self, requested: int) -> Disc:
        """Return the disc with ``wanted`` eigenvalues or a few more, or fewer if they do not converge."""
        disc = self
        if requested > len(self.values):
            missing = requested - len(self.values)
            ritz = self._search(lambda ritz: ritz.converged(TOLERANCE) >= missing, missing + FIRST, missing)
            disc = self._with(ritz, ritz.converged(TOLERANCE))
        return disc.filled(disc.reach * (1.0 - SAME_DISTANCE), disc.dimension)

    def filled(self, reach: float, dimension: int = 2 * FIRST) -> Disc:
        """Return the disc with all eigenvalues up to a distance from the shift, or with a smaller reach if they do not
        converge. ``dimension`` is the minimum dimension of each search.
        """
        disc = self
        for _ in range(SEARCHES):
            if not np.isfinite(reach) or reach <= 0.0:
                break

            def inside(ritz: Ritz) -> int:
                size = np.abs(ritz.values) * (1.0 + np.minimum(ritz.residuals, UNSURE))
                return int(np.count_nonzero(size * reach >= 1.0))

            ritz = disc._search(lambda ritz: ritz.converged(TOLERANCE) >= inside(ritz), dimension, FEW)
            count, requested = ritz.converged(TOLERANCE), inside(ritz)
            disc = disc._with(ritz, min(count, requested))
            if count < requested:
                return replace(disc, reach=min(disc.reach, 1.0 / float(np.abs(ritz.values[: count + 1]).max())))
            if not requested:
                break
        return replace(disc, reach=max(disc.reach, reach))

    def _with(self, ritz: Ritz, count: int) -> Disc:
        """The disc with the first ``count`` eigenvalues of a search added."""
        sigma = self.shifted.sigma
        largest = float(np.abs(np.append(ritz.values, 1.0 / (self.values - sigma))).max())
        count = min(count, int(np.count_nonzero(np.abs(ritz.values) > ROUNDED * largest)))
        values = np.concatenate((self.values, sigma + 1.0 / ritz.values[:count]))
        basis = np.linalg.qr(np.concatenate((self.basis, ritz.subspace(count)), axis=1))[0]
        complete = float(np.abs(ritz.values).max(initial=0.0)) <= NOTHING * largest
        reach = np.inf if complete else float(np.abs(values - sigma).max(initial=0.0))
        return replace(self, values=values, basis=basis, reach=max(self.reach, reach),
                       dimension=max(self.dimension, len(ritz.values)))  # fmt: skip

    def _search(self, enough: Callable[[Ritz], bool], dimension: int, requested: int) -> Ritz:
        """Ritz values of the operator with the known eigenvectors deflated."""
        known, shifted = self.basis, self.shifted

        def without(state: AnyArray) -> AnyArray:
            return state - known @ (known.conj().T @ state) if known.shape[1] else state

        start = without(shifted.start(known.shape[1]))
        dimensions = dimension, PER_EIGENVALUE * requested + MORE
        return arnoldi(lambda state: without(shifted.apply(state)), start, enough, dimensions)


def disc(quadratic: Quadratic, sigma: complex, speed: float | None = None) -> Disc:
    """Return the empty disc around a shift ``sigma`` [1/s], not 0; ``grown`` adds eigenvalues.

    ``speed``: upper estimate of the magnitude of the wanted eigenvalues [1/s]; default: that of the shift.
    """
    factor = quadratic.system.tableau.factor(s=sigma)
    shifted = Shifted(quadratic, sigma, abs(sigma) if speed is None else speed, factor)
    return Disc(shifted, np.zeros(0, dtype=complex), np.zeros((shifted.size, 0), dtype=factor.matrix.dtype), 0.0)
