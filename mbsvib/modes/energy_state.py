"""First-order equations in energy coordinates for matrices without symmetry, and their eigenvalues 0.

With the undamped modes Phi of M and the symmetric part of K as basis, states are (Omega eta, eta') and, where M is
singular, the massless motions zeta, which are taken where dampers feel no other motion beside them. In

    x' = A x + F f,   q = S x,      (lambda^2 M + lambda C + K)^-1 = S (lambda - A)^-1 F

A has the norm of the largest frequency and not of its square. Motions that K does not feel are eigenvalues 0, in chains
of two where neither dampers nor spin feel them: they are found by rank and split off exactly, whatever rounding does.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.modes.undamped import undamped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.modes.undamped import Undamped
    from mbsvib.system import System

    Array = NDArray[np.float64]

# Directions in which nothing acts show up by rounding, far below this share of the largest.
RANK = 1e-11
# Generalised eigenvectors of 0 this nearly at right angles to all those from the left belong to a longer chain.
LONGER = 1e-9


@dataclass(frozen=True, slots=True)
class EnergyState:
    """x' = ``a`` x + ``force`` f and q = ``show`` x for n states, physical f and q (m,); x = ``position`` q + ``rate``
    q' (n, m) each.

    ``scale`` (p,) is d in x = (d eta, eta', zeta); ``conservative``: a sum of squares is kept, so that eigenvalues are
    imaginary. The k eigenvalues 0 have the invariant subspaces ``right`` and ``left`` (n, k), left^T right = 1, on
    which A is ``nilpotent`` (k, k); the ``still`` first columns are the motions that K does not feel. ``doubt`` is the
    relative error that the coordinates have from nearly singular loops. In the ``basis`` (m, m) the inertia is 1 or 0
    for massless motions, which come last; ``square`` (p,) is Omega^2 and ``damping`` and ``coupling`` (m, m) are C and
    what of K is not Omega^2.
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
    still: int
    free: int
    doubt: float
    basis: Array
    square: Array
    damping: Array
    coupling: Array

    @property
    def massless(self) -> int:
        """Number of massless motions."""
        return len(self.basis) - len(self.scale)

    @property
    def long(self) -> bool:
        """Whether a chain of the eigenvalue 0 is longer than two, as that of a rocket whose thrust turns along."""
        return bool((self.nilpotent @ self.nilpotent).any())


def energy_state(system: System, rtol: float) -> EnergyState:
    """Return a system's first-order equations in energy coordinates.

    Parameters
    ----------
    system : System
        The equations of motion.
    rtol : float
        Relative accuracy asked of the undamped modes that are the basis.

    Returns
    -------
    EnergyState
        Matrices, and what belongs to eigenvalues 0.
    """
    m, n1 = system.dof, system.massless
    p = m - n1
    basis, square, rigid, doubt = _basis(system, rtol)
    inertia = np.concatenate((np.ones(p), np.zeros(n1)))
    damping = basis.T @ system.C @ basis
    stiffness = np.zeros((m, m))
    stiffness[np.arange(p), np.arange(p)] = square
    if n1:
        loose = basis[:, p:]
        damping[p:, :p] = 0.0
        stiffness[p:] = loose.T @ system.K @ basis
        stiffness[:p, p:] = basis[:, :p].T @ system.K @ loose
    if system.circulatory is not None:
        stiffness[:p, :p] += basis[:, :p].T @ system.circulatory @ basis[:, :p]
    scale = np.sqrt(np.abs(square))
    sizes = (scale[scale > 0.0].min(initial=np.inf), np.abs(damping[:p, :p]).max(initial=0.0))
    scale[scale == 0.0] = next((size for size in sizes if 0.0 < size < np.inf), 1.0)
    coupling = stiffness.copy()
    coupling[np.arange(p), np.arange(p)] -= square
    a, force = _first_order(stiffness, damping, scale, n1)
    show = np.zeros((m, 2 * p + n1))
    show[np.arange(p), np.arange(p)] = 1.0 / scale
    show[p:, 2 * p :] = np.eye(n1)
    back = np.linalg.inv(basis) if n1 else basis.T @ system.M
    position, rate = np.zeros((2 * p + n1, m)), np.zeros((2 * p + n1, m))
    position[:p], position[2 * p :], rate[p : 2 * p] = scale[:, None] * back[:p], back[p:], back[:p]
    null, left_null = _null_spaces(system, basis, stiffness, rigid)
    zeros = _zeros(stiffness, damping, inertia, (null, left_null), scale) or _long_chains(a)
    right, left, nilpotent, free = zeros
    kept = bool(not system.damping.any() and system.circulatory is None and not n1 and (square >= 0.0).all())
    return EnergyState(a, basis @ show, force @ basis.T, position, rate, scale, kept, right, left, nilpotent,
                       null.shape[1], free, doubt, basis, square, damping, coupling)  # fmt: skip


def _basis(system: System, rtol: float) -> tuple[Array, Array, int, float]:
    """Columns Phi (M-orthonormal, stiffness diagonal), then massless ones; squares, number of rigid ones, doubt."""
    n1 = system.massless
    k = system.K if system.circulatory is None else system.K - system.circulatory
    kept = min((group.kept for group in system.provenance.reduction.groups), default=1.0)
    doubt = 0.0 if kept >= 0.1 else float(np.finfo(float).eps) / kept
    if not n1:
        found = _undamped(system, 0.5 * (k + k.T), np.eye(system.dof), rtol)
        return found.shapes, found.square, found.rigid, doubt
    assert system.null_inertia is not None
    loose = system.null_inertia
    felt = loose.T @ system.C
    own = felt @ loose
    try:  # of unit damping, where dampers and not spin hold them
        loose = np.linalg.solve(np.linalg.cholesky(0.5 * (own + own.T)), loose.T).T
    except np.linalg.LinAlgError:
        loose = loose / np.sqrt(np.abs(own).max(axis=0))
    felt = loose.T @ system.C
    turn = np.linalg.svd(felt / np.abs(felt).max(axis=1, keepdims=True))[2][n1:].T
    found = _undamped(system, turn.T @ (0.5 * (k + k.T)) @ turn, turn, rtol)
    return np.concatenate((turn @ found.shapes, loose), axis=1), found.square, found.rigid, doubt


def _undamped(system: System, stiffness: Array, turn: Array, rtol: float) -> Undamped:
    """Undamped modes in some of the motions only."""
    whole = turn.shape[1] == len(turn)
    rows, w = (part if whole else part @ turn for part in (system.elastic_rows, system.inertia_factor))
    part: Any = SimpleNamespace(
        dof=turn.shape[1], stiffness=system.stiffness, elastic_rows=rows, inertia_factor=w, circulatory=None,
        M=system.M if whole else turn.T @ system.M @ turn, K=stiffness, provenance=system.provenance,
    )  # fmt: skip
    return undamped(part, rtol)


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
    pull = force @ stiffness
    a[:, :p], a[:, 2 * p :] = -pull[:, :p] / scale, -pull[:, p:]
    a[p : 2 * p, p : 2 * p] = -damping[:p, :p]
    a[at, :p] = 0.0
    a[at, p + at] = scale
    return a, force


def _null_spaces(system: System, basis: Array, stiffness: Array, rigid: int) -> tuple[Array, Array]:
    """Motions that K does not feel, and forces that it does not answer, in the basis (m, r) each."""
    m = system.dof
    if system.circulatory is None and not system.massless:
        return np.eye(m)[:, :rigid], np.eye(m)[:, :rigid]
    if system.circulatory is None:
        rows = (system.elastic_rows[system.stiffness != 0.0]) @ basis
        size = np.sqrt(np.abs(stiffness).max(axis=1, initial=0.0))
        size[size == 0.0] = 1.0
        length = np.linalg.norm(rows / size, axis=1)
        null = _null(rows[length > 0.0] / length[length > 0.0, None] / size) / size[:, None]
        null = np.linalg.qr(null)[0]
        return null, null
    size = np.sqrt(np.maximum(np.abs(stiffness).max(axis=0), np.abs(stiffness).max(axis=1)))
    size[size == 0.0] = 1.0
    even = stiffness / size[:, None] / size
    return tuple(np.linalg.qr(_null(part) / size[:, None])[0] for part in (even, even.T))  # type: ignore[return-value]


def _null(rows: Array) -> Array:
    """Orthonormal motions that no row feels."""
    if not len(rows):
        return np.eye(rows.shape[1])
    _, values, turn = np.linalg.svd(rows)
    return turn[int(np.count_nonzero(values > RANK * values[0])) :].T


def _zeros(
    stiffness: Array, damping: Array, inertia: Array, null: tuple[Array, Array], scale: Array
) -> tuple[Array, Array, Array, int] | None:
    """Invariant subspaces of the eigenvalue 0 in the states, what A is on them, and the number of chains of two; None
    where chains are longer.
    """
    (z, y), p = null, len(scale)
    n, r = len(stiffness) + p, z.shape[1]
    if r == 0:
        return np.zeros((n, 0)), np.zeros((n, 0)), np.zeros((0, 0)), 0
    u, values, v = np.linalg.svd(y.T @ damping @ z)
    count = int(np.count_nonzero(values > RANK * np.abs(damping).max()))
    x0, y0 = z @ v[count:].T, y @ u[:, count:]
    x1, y1 = (_answer(k, c @ start, far, near) for k, c, start, far, near in (
        (stiffness, damping, x0, y, z), (stiffness.T, damping.T, y0, z, y)))  # fmt: skip
    right, left = np.zeros((n, r + r - count)), np.zeros((n, r + r - count))
    right[:p], right[2 * p :] = (scale[:, None] * np.hstack((z, x1))[:p]), np.hstack((z, x1))[p:]
    right[p : 2 * p, r:] = x0[:p]
    whole = np.hstack((y, y1))
    braked = damping.T @ whole
    braked[:, r:] += inertia[:, None] * y0
    left[:p], left[p : 2 * p], left[2 * p :] = braked[:p] / scale[:, None], whole[:p], braked[p:]
    size = np.linalg.norm(right, axis=0), np.linalg.norm(left, axis=0)
    angles = (left / size[1]).T @ (right / size[0])
    if np.linalg.svd(angles)[1][-1] < LONGER:
        return None
    left = np.linalg.solve(left.T @ right, left.T).T
    nilpotent = np.zeros((right.shape[1],) * 2)
    nilpotent[:r, r:] = z.T @ x0
    return right, left, nilpotent, r - count


def _answer(stiffness: Array, push: Array, far: Array, near: Array) -> Array:
    """x with K x = -push, at right angles to what K does not feel (``near``); ``far``: what it does not answer."""
    m, r = near.shape
    if not push.any():
        return np.zeros_like(push)
    size = np.sqrt(np.maximum(np.abs(stiffness).max(axis=0), np.abs(stiffness).max(axis=1)))
    size[size == 0.0] = 1.0
    whole = np.zeros((m + r, m + r))
    whole[:m, :m] = stiffness / size[:, None] / size
    whole[:m, m:], whole[m:, :m] = far, near.T
    right = np.concatenate((-push / size[:, None], np.zeros((r, push.shape[1]))))
    return np.asarray(np.linalg.solve(whole, right)[:m] / size[:, None])


def _long_chains(a: Array) -> tuple[Array, Array, Array, int]:
    """The same from A alone: what is left of it after its null space is taken off as often as there is one."""
    ahead, right = _lost(a), _lost(a.T)
    left = np.asarray(np.linalg.solve(ahead.T @ right, ahead.T).T, dtype=float)
    nilpotent = np.asarray(left.T @ a @ right, dtype=float)
    nilpotent[np.abs(nilpotent) <= LONGER * np.abs(a).max()] = 0.0
    return right, left, nilpotent, right.shape[1] - len(_null(a))


def _lost(a: Array) -> Array:
    """Orthonormal complement of the range of all powers of A."""
    kept: Array = np.eye(len(a))
    while kept.shape[1]:
        inner = kept.T @ a @ kept
        u, values, _ = np.linalg.svd(inner)
        rank = int(np.count_nonzero(values > LONGER * np.abs(a).max()))
        if rank == len(inner):
            break
        kept = np.asarray(kept @ u[:, :rank], dtype=float)
    return np.linalg.qr(kept, mode="complete")[0][:, kept.shape[1] :]
