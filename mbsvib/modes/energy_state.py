"""First-order equations in energy coordinates for matrices without symmetry, and their eigenvalues 0.

With the undamped modes Phi of M and the symmetric part of K as basis, states are (Omega eta, eta') and, where M is
singular, the massless motions zeta, chosen so that damping does not couple them to the other motions. In

    x' = A x + F f,   q = S x,      (lambda^2 M + lambda C + K)^-1 = S (lambda - A)^-1 F

A has the norm of the largest frequency and not of its square. Motions without stiffness have eigenvalues 0, in chains
of two if neither dampers nor spin resist them. They are determined by rank decisions and split off exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.equations.equations import Equations
from mbsvib.equations.unresisted_motion import (
    completed_basis,
    coordinate_sizes,
    free_motions,
    independent_coordinates,
    null_pair,
    orthonormal,
    rounding_scale,
)
from mbsvib.linalg.products import gram_matrix, product_with_zeros, weighted_gram
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.linalg.rank import EPS, ZERO_SUM
from mbsvib.modes.undamped import WELL_CLOSED, Undamped, undamped
from mbsvib.modes.zero_subspaces import UNMOVED, damping_terms, long_chains, row_terms, unbraked, zero_subspaces


@dataclass(frozen=True, slots=True)
class EnergyState:
    """x' = ``a`` x + ``force`` f and q = ``show`` x for n states, physical f and q (m,); x = ``position`` q + ``rate``
    q' (n, m) each.

    ``scale`` (p,) is d in x = (d eta, eta', zeta); ``conservative``: the energy is constant, so that eigenvalues are
    imaginary. The k eigenvalues 0 have the invariant subspaces ``right`` and ``left`` (n, k), left^T right = 1, on
    which A is ``nilpotent`` (k, k); the ``null_count`` first columns are the motions without stiffness. ``uncertainty``
    is the relative error of the coordinates from nearly singular loops. In the ``basis`` (m, m) the inertia is 1, or 0
    for massless motions, which come last; ``square`` (p,) is Omega^2, ``damping`` (m, m) is C, and ``coupling`` (m, m)
    is K without Omega^2.
    """

    a: Array
    show: Array
    force: Array
    position: Array
    rate: Array
    scale: Array
    conservative: bool
    right: Array
    left: Array
    nilpotent: Array
    null_count: int
    free: int
    uncertainty: float
    basis: Array
    square: Array
    damping: Array
    coupling: Array

    @property
    def massless(self) -> int:
        """Number of massless motions."""
        return len(self.basis) - len(self.scale)

    @property
    def motion(self) -> Array:
        """Motions in the basis (m, n): q = basis @ motion @ x."""
        return _motion(self.scale, len(self.basis))

    @property
    def long(self) -> bool:
        """Whether a chain of the eigenvalue 0 is longer than two, as that of a rocket whose thrust turns along."""
        return bool((self.nilpotent @ self.nilpotent).any())


def energy_state(system: Equations, rtol: float) -> EnergyState:
    """Return a system's first-order equations in energy coordinates.

    ``rtol`` is the required relative accuracy of the undamped modes that are the basis.
    """
    m, n1 = system.dof, system.massless
    p = m - n1
    basis, undamped_modes, free = _basis(system, rtol)
    square, back = undamped_modes.square, _back(system, basis)
    stiffness, damping = _in_basis(system, basis, undamped_modes, free)
    scale = np.sqrt(np.abs(square))
    speeds = (scale[scale > 0.0].min(initial=np.inf), np.abs(damping[:p, :p]).max(initial=0.0))
    scale[scale == 0.0] = next((speed for speed in speeds if 0.0 < speed < np.inf), 1.0)
    coupling = stiffness.copy()
    coupling[np.arange(p), np.arange(p)] -= square
    a, force = _first_order(stiffness, damping, scale, n1)
    position, rate = np.zeros((2 * p + n1, m)), np.zeros((2 * p + n1, m))
    position[:p], position[2 * p :], rate[p : 2 * p] = scale[:, None] * back[:p], back[p:], back[:p]
    null = _null_spaces(system, basis, back, stiffness, undamped_modes)
    zeros = zero_subspaces(stiffness, damping, null, _chains(system, basis, damping, null, free), scale)
    if zeros is None:  # longer chains, or dampers that the free motions move by their own rounding
        chains = _chains(system, basis, damping, null, free, unmoved=1.0)
        zeros = zero_subspaces(stiffness, damping, null, chains, scale) or long_chains(a)
    right, left, nilpotent, count = zeros
    no_damping = not system.row_damping.any() and system.circulatory is None
    conservative = bool(no_damping and not n1 and (square >= 0.0).all())
    reduction = min((group.retained for group in system.provenance.reduction.groups), default=1.0)
    uncertainty = 0.0 if reduction >= WELL_CLOSED else EPS / reduction
    return EnergyState(a, basis @ _motion(scale, m), force @ basis.T, position, rate, scale, conservative, right, left,
                       nilpotent, null[0].shape[1], count, uncertainty, basis, square, damping, coupling)  # fmt: skip


def _motion(scale: Array, m: int) -> Array:
    p = len(scale)
    result = np.zeros((m, m + p))
    result[np.arange(p), np.arange(p)] = 1.0 / scale
    result[p:, 2 * p :] = np.eye(m - p)
    return result


def _resists(system: Equations) -> bool:
    """Whether K and C (without spin) are sums of squares, so that the rows determine which motions they resist."""
    positive = (system.row_stiffness >= 0.0).all() and (system.row_damping >= 0.0).all()
    return system.circulatory is None and bool(positive)


def _stiff_rows(system: Equations) -> Array:
    """Relative displacements at springs."""
    rows: Array = system.elastic_rows[system.row_stiffness != 0.0]
    return rows


def _basis(system: Equations, rtol: float) -> tuple[Array, Undamped, int]:
    """Columns Phi (M-orthonormal, stiffness diagonal), then massless ones; the undamped modes, rigid-body modes first;
    and the number of these that no damper resists, which come before the others.
    """
    turn, loose, null = np.eye(system.dof), np.zeros((system.dof, 0)), None
    if system.massless:
        turn, loose, null = _separated(system)
    rows, w = product_with_zeros(system.elastic_rows, turn), system.inertia_factor @ turn
    part: Any = SimpleNamespace(
        dof=turn.shape[1], row_stiffness=system.row_stiffness, elastic_rows=rows, inertia_factor=w, circulatory=None,
        M=gram_matrix(w), K=weighted_gram(rows, system.row_stiffness), provenance=system.provenance,
    )  # fmt: skip
    undamped_modes = undamped(part, rtol, null=null)
    basis = turn @ undamped_modes.shapes
    free = unbraked(system, basis[:, : undamped_modes.rigid])
    basis[:, : undamped_modes.rigid] = completed_basis(system.inertia_factor, free, basis[:, : undamped_modes.rigid])
    return np.concatenate((basis, loose), axis=1), undamped_modes, free.shape[1]


def _separated(system: Equations) -> tuple[Array, Array, Array]:
    """Motions that damping does not couple to massless ones (m, p), massless ones of unit damping (m, n1), and the
    rigid-body modes in coordinates of the former (p, r).
    """
    loose = system.null_inertia
    assert loose is not None
    independent, others = independent_coordinates(loose)
    damping_rows = loose.T @ system.C
    size = np.sqrt(np.abs(damping_rows @ loose).max(axis=1))
    scaled = damping_rows / size[:, None]
    tied = np.linalg.solve(damping_rows @ loose / size[:, None] / size, scaled[:, others]) / size[:, None]
    turn = -loose @ tied
    turn[others, np.arange(len(others))] += 1.0
    rigid = free_motions(_stiff_rows(system), damping_rows)
    null = orthonormal(system.inertia_factor @ turn, rigid[others] - loose[others] @ rigid[independent])
    even = 0.5 * (damping_rows @ loose + (damping_rows @ loose).T)
    try:  # of unit damping, if dampers and not spin resist them
        loose = np.linalg.solve(np.linalg.cholesky(even), loose.T).T
    except np.linalg.LinAlgError:
        loose = loose / size
    return turn, loose, null


def _back(system: Equations, basis: Array) -> Array:
    """Inverse of the basis: M-orthonormal motions, and massless ones that damping does not couple to them."""
    p = system.dof - system.massless
    damping_rows = basis[:, p:].T @ system.C
    return np.concatenate((basis[:, :p].T @ system.M, np.linalg.solve(damping_rows @ basis[:, p:], damping_rows)))


def _in_basis(system: Equations, basis: Array, undamped_modes: Undamped, free: int) -> tuple[Array, Array]:
    """Stiffness and damping in the basis, exactly 0 for motions that they do not resist."""
    p = len(undamped_modes.square)
    rows = product_with_zeros(system.elastic_rows, basis)
    stiffness = weighted_gram(rows, system.row_stiffness)
    stiffness[np.abs(stiffness) <= ZERO_SUM * row_terms(system, system.row_stiffness, basis, basis)] = 0.0
    stiffness[:p, :p] = np.diag(undamped_modes.square)
    if system.circulatory is not None:
        stiffness += product_with_zeros(product_with_zeros(basis.T, system.circulatory), basis)
    braked = rows * (np.arange(len(basis)) >= free)
    damping = weighted_gram(braked, system.row_damping)
    if system.gyroscopic is not None:
        damping += product_with_zeros(product_with_zeros(basis.T, system.gyroscopic), basis)
    damping[p:, :p] = 0.0  # by the choice of the basis
    if system.gyroscopic is None:
        damping[:p, p:] = 0.0
    return stiffness, damping


def _first_order(stiffness: Array, damping: Array, scale: Array, n1: int) -> tuple[Array, Array]:
    """A (n, n) and F (n, m) in the basis; massless motions are the last ``n1``, and C21 is 0."""
    m = len(stiffness)
    p = m - n1
    a, force = np.zeros((2 * p + n1, 2 * p + n1)), np.zeros((2 * p + n1, m))
    at = np.arange(p)
    force[p + at, at] = 1.0
    if n1:
        force[2 * p :, p:] = np.linalg.inv(damping[p:, p:])
        force[p : 2 * p, p:] = -damping[:p, p:] @ force[2 * p :, p:]
    coupling = force @ stiffness
    a[:, :p], a[:, 2 * p :] = -coupling[:, :p] / scale, -coupling[:, p:]
    a[p : 2 * p, p : 2 * p] = -damping[:p, :p]
    a[at, :p] = 0.0
    a[at, p + at] = scale
    return a, force


def _stiffness_terms(system: Equations, basis: Array, modes: Undamped, unmoved: float) -> Array:
    """Sums of the magnitudes of all terms of K in the basis, see ``row_terms``. The undamped modes were found from the
    factors, so that rounding of their stiffness is that of their own springs and not of the stiffest ones.
    """
    p = len(modes.square)
    result = row_terms(system, system.row_stiffness, basis, basis, unmoved)
    result[:p, :p] = np.diag(np.abs(system.row_stiffness) @ product_with_zeros(system.elastic_rows, basis[:, :p]) ** 2)
    if system.circulatory is not None:
        most = rounding_scale(basis, coordinate_sizes(system))
        result += most.T @ np.abs(system.circulatory) @ most
    return result


def _null_spaces(
    system: Equations, basis: Array, back: Array, stiffness: Array, modes: Undamped
) -> tuple[Array, Array]:
    """Right and left null space of K in the basis, (m, r) each."""
    m, rigid = system.dof, modes.rigid
    null = np.eye(m)[:, :rigid]
    if system.circulatory is None and not system.massless:
        return null, null
    if not _resists(system):
        coarse, fine = (null_pair(stiffness, _stiffness_terms(system, basis, modes, share)) for share in (1.0, UNMOVED))
        return coarse if coarse[0].shape == fine[0].shape else fine  # of as many motions, those with less noise
    # motions that damping couples to massless ones are not among the undamped modes
    motions = product_with_zeros(back, free_motions(_stiff_rows(system)))
    tied = pivoted_qr(motions[rigid:])[1][: motions.shape[1] - rigid]
    null = np.concatenate((null, np.zeros((m, len(tied)))), axis=1)
    null[rigid:, rigid:] = np.linalg.qr(motions[rigid:, tied])[0]
    return null, null


def _chains(
    system: Equations, basis: Array, damping: Array, null: tuple[Array, Array], free: int, unmoved: float = UNMOVED
) -> tuple[Array, Array]:
    """Combinations (r, n) of both null spaces of K that damping does not couple: they start chains."""
    z, y = null
    if _resists(system) and system.gyroscopic is None:
        return np.eye(z.shape[1])[:, :free], np.eye(y.shape[1])[:, :free]
    return null_pair(y.T @ damping @ z, damping_terms(system, basis @ y, basis @ z, unmoved))
