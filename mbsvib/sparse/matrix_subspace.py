"""The subspace of the modes nearest to a shift, of sparse matrices: block Lanczos, with a count of eigenvalues.

(K - sigma M)^-1 M is applied to blocks of motions in units of the square root of the diagonal of M. The residual of a
Ritz vector is that of one more solve, (K - sigma M)^-1 (K - lambda M) x; x minus this is its next iterate. Modes are
counted by the inertia of K - s M at shifts s in the largest gap behind the last wanted mode, away from any mode.

Source: Parlett, The Symmetric Eigenvalue Problem (1998), chapters 3 and 13; Grimes, Lewis & Simon, SIAM J. Matrix
Anal. Appl. 15 (1994) 228.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh

from mbsvib.common.arrays import AnyArray, Array, Index
from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import EPS, RIGID_ENERGY
from mbsvib.sparse.arnoldi import arnoldi
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.from_matrices import matrices_of, quadratic_of
from mbsvib.sparse.operator import Operator, count_below
from mbsvib.sparse.subspace import OFFSETS, SEARCHES, SLOW, Subspace

# The shift for the lowest modes, as a share of the square of a typical frequency of single coordinates: below the
# flexible modes of most structures, and far enough from 0 that rigid-body modes do not drown the others in rounding.
BELOW = 1e-9
# Residual of Ritz values: the error of eigenvalues is its square. One more solve makes that of shapes smaller.
TOLERANCE = 1e-7
# Vectors of a block, at least and at most, and modes per vector between: repeated modes of up to this multiplicity are
# found by one search. The factor is read once for a block: larger blocks take less time for a vector, but more vectors.
BLOCK, MODES = (8, 16), 3
# Additional modes, among which the count finds a gap, and the least relative gap.
GUARDS, GAP = 4, 1e-6
# Coordinates up to which all modes are computed.
FEW = 100
# Dimension of the basis, at which it is first tested and at most: multiples of the number of modes, and more; and the
# share by which it grows between tests, which take far less than a block of solves.
FIRST, MOST, MORE, GROWTH = 2.5, 8, 200, 0.05
# Steps of the static iteration of free bodies.
STATIC = 40
# Largest dense matrix for all modes [coordinates]: 1 GB.
LARGEST = 11_000


def matrix_subspace(system: SparseEquations, k: int, near: float) -> Subspace:
    """Return vectors that span the k lowest modes, or the k nearest to a frequency ``near`` [Hz], and some more."""
    quadratic, dof = quadratic_of(system), system.dof
    centre, requested = 2.0 * np.pi * near, k + GUARDS
    below = -BELOW * quadratic.speed**2
    if centre <= SLOW * quadratic.speed:
        t, centre = _operator(system, below), 0.0
        growing = t.factor.negative(system.layout) or 0
    else:
        t, growing = _apart(system, centre**2), count_below(system, below) or 0  # which keeps no factors
        requested += k // 2
    missed: int | None = None
    for _ in range(SEARCHES):
        if dof <= max(FEW, 2 * requested):
            without_rigid, found = _all_modes(t)
            reach, missed = np.inf, 0
            break
        without_rigid, found = _modes(t, _basis(t, min(requested, dof - 1)))
        distance = np.abs(found.square - t.sigma)
        radius, inside = _gap(distance, k)
        missed = None if radius is None else _counted(t, radius) - inside
        reach = radius or float(distance.max())
        found = found.those(np.argsort(distance, kind="stable")[: max(inside, k)])
        if not missed and missed is not None:
            break
        requested += max(GUARDS, missed or 0)
    if growing and centre and np.isfinite(reach):
        found = _with_growing(t, found, k, centre, -below)
    return Subspace(without_rigid, found.z, found.rigid, found.residual, found.noise, reach, missed, centre, growing)


def _with_growing(t: Operator, found: _Found, k: int, centre: float, least: float) -> _Found:
    """Modes with those that grow and whose natural frequencies are as near to the centre as the k-th. They have squares
    below -``least``, and are sought around that of the centre.
    """
    distance = np.sort(np.abs(np.sqrt(np.abs(found.square)) - centre))[k - 1] * (1.0 + GAP)
    low, high = max(centre - distance, np.sqrt(least)) ** 2, (centre + distance) ** 2
    near = (count_below(t.system, -low) or 0) - (count_below(t.system, -high) or 0)
    known = found.square < -least
    if near <= np.count_nonzero(known):
        return found
    around = _apart(t.system, -(centre**2))
    try:
        more = _modes(around, _basis(around, near))[1]
    except ResponseError:  # they do not converge, and are counted
        return found
    more = _modes(around, more.z[:, (more.square < -low) & (more.square > -high)])[1]  # of a smaller residual
    return found.those(np.flatnonzero(~known)).joined(more)


def flexible_static(system: SparseEquations, rigid: Array, force: Array) -> Array | None:
    """Return the static motions (size, n) of flexible modes under forces; None if rigid-body modes are missing among
    ``rigid`` (size, r).

    With these, K is singular and x = (K - sigma M)^-1 (f - sigma M x) is iterated: the error shrinks by
    sigma / (omega^2 - sigma) of the flexible modes, a shift below them.
    """
    if not rigid.shape[1]:
        return np.asarray(system.tableau.factor().solve(force))
    t = replace(_operator(system, -BELOW * quadratic_of(system).speed ** 2), rigid=rigid)
    force = force - t.quadratic.inertia(rigid) @ (rigid.T @ force)
    x = np.zeros_like(force)
    for _ in range(STATIC):
        before, x = x, t.flexible(t.factor.solve(force - t.sigma * t.quadratic.inertia(x)))
        if (np.abs(x - before).max(axis=0) <= EPS * np.abs(x).max(axis=0)).all():
            return x
    return None


def _operator(system: SparseEquations, sigma: float) -> Operator:
    return Operator(quadratic_of(system), sigma, system.tableau.factor(square=sigma),
                    np.zeros((system.layout.size, 0)), np.zeros((0, 0)), None)  # fmt: skip


def _apart(system: SparseEquations, square: float) -> Operator:
    """The operator at the square of a frequency, or beside it if a mode is there."""
    for offset in OFFSETS:
        try:
            t = _operator(system, (1.0 + offset) * square)
        except np.linalg.LinAlgError:
            continue
        x = np.random.default_rng(1).standard_normal(system.layout.size)
        for _ in range(2):
            x = t.factor.solve(t.quadratic.inertia(x / np.sqrt(x @ t.quadratic.inertia(x))))
        if np.sqrt(x @ t.quadratic.inertia(x)) * abs(square) * GAP < 1.0:
            break
    return t


def _basis(t: Operator, requested: int) -> Array:
    """A basis of the modes nearest to the shift."""
    given, n = matrices_of(t.system), t.system.layout.size
    m = given.M.diagonal()
    unit = np.sqrt(np.where(m > 0.0, m, np.abs(given.K.diagonal()) / t.quadratic.speed**2))[:, None]

    def apply(y: AnyArray) -> AnyArray:
        return np.asarray(unit * t.factor.solve(given.M @ (y / unit), 0))

    block = int(np.clip(requested // MODES, *BLOCK))
    start = apply(np.random.default_rng(2).standard_normal((n, block)))
    last = min(MOST * requested + MORE, n)
    ritz = arnoldi(apply, start, lambda r: r.converged(TOLERANCE) >= requested, (int(FIRST * requested), last),
                   GROWTH)  # fmt: skip
    if ritz.converged(TOLERANCE) < min(requested, len(ritz.values)):
        raise ResponseError(f"modes: {requested} modes of '{t.system.name}' did not converge in {last} vectors; ask "
                            f"for fewer, or near another frequency.")  # fmt: skip
    return np.asarray(ritz.subspace(requested) / unit)


@dataclass(frozen=True, slots=True)
class _Found:
    """M-orthonormal shapes ``z`` (size, n), of which the first ``rigid`` deform nothing, the ``square`` of each
    frequency, the ``residual`` and the relative rounding of the strain energy, ``noise`` (n,).
    """

    z: Array
    rigid: int
    square: Array
    residual: Array
    noise: Array

    def those(self, which: Index) -> _Found:
        """Return some of them, in order."""
        which = np.sort(which)
        return _Found(self.z[:, which], int(np.count_nonzero(which < self.rigid)), self.square[which],
                      self.residual[which], self.noise[which])  # fmt: skip

    def joined(self, others: _Found) -> _Found:
        """Return these and other flexible ones."""
        z, square, residual, noise = (np.concatenate((getattr(self, key), getattr(others, key)), axis=-1)
                                      for key in ("z", "square", "residual", "noise"))  # fmt: skip
        return _Found(z, self.rigid, square, residual, noise)


def _modes(t: Operator, basis: Array) -> tuple[Operator, _Found]:
    """The modes of a basis, improved by one solve, and the operator without its rigid-body modes.

    Those are rigid-body modes whose strain energy is rounding of its terms.
    """
    given = matrices_of(t.system)
    square, y = eigh(basis.T @ (given.K @ basis), basis.T @ (given.M @ basis))
    x = basis @ y
    terms = np.einsum("ij,ij->j", np.abs(x), abs(given.K) @ np.abs(x))
    order = np.argsort(np.abs(square) > RIGID_ENERGY * terms, kind="stable")
    rigid = int(np.count_nonzero(np.abs(square) <= RIGID_ENERGY * terms))
    x, square, terms = x[:, order], square[order], terms[order]
    square[:rigid], terms[:rigid] = 0.0, 0.0
    t = replace(t, rigid=x[:, :rigid])
    step = np.zeros_like(x)
    force = given.K @ x[:, rigid:] - (given.M @ x[:, rigid:]) * square[rigid:]
    step[:, rigid:] = t.flexible(t.factor.solve(force, 0))
    z = x - step
    noise = np.divide(EPS * terms, np.abs(square), out=np.zeros_like(square), where=square != 0.0)
    return t, _Found(z / t.quadratic.size(z), rigid, square, t.quadratic.size(step), noise)


def _gap(distance: Array, k: int) -> tuple[float | None, int]:
    """A distance from the shift in the largest gap behind the k-th mode (None: no gap), and how many are nearer."""
    ordered = np.sort(distance)
    gaps = np.diff(ordered[k - 1 :]) / ordered[k:]
    best = int(np.argmax(gaps)) if len(gaps) else 0
    if not len(gaps) or gaps[best] < GAP:
        return None, len(distance)
    return float(0.5 * (ordered[k - 1 + best] + ordered[k + best])), k + best


def _counted(t: Operator, radius: float) -> int:
    """The number of modes within a distance from the shift."""
    above = count_below(t.system, t.sigma + radius) or 0
    if t.factor.negative(t.system.layout) == 0:  # none is below the shift
        return above
    return above - (count_below(t.system, t.sigma - radius) or 0)


def _all_modes(t: Operator) -> tuple[Operator, _Found]:
    """All modes, by a dense solver, and the operator without its rigid-body modes."""
    given, dof = matrices_of(t.system), t.system.dof
    if t.system.layout.size > LARGEST:
        raise ResponseError(f"modes: so many of the {dof} modes of '{t.system.name}' need its dense matrices; ask for "
                            f"fewer, at most {dof // 2 - 2 * GUARDS} of the lowest.")  # fmt: skip
    k, m, motions = given.K.toarray(), given.M.toarray(), given.motions()
    if motions is not None:
        k, m = motions.T @ k @ motions, motions.T @ m @ motions
    sigma = -BELOW * t.quadratic.speed**2
    while True:  # below all modes, also those that diverge
        try:
            z = eigh(m, k - sigma * m)[1][:, -dof:]
            break
        except np.linalg.LinAlgError:
            sigma *= 1e3
    t, found = _modes(t, z if motions is None else motions @ z)
    return t, replace(found, residual=np.zeros(dof))
