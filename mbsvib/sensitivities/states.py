"""First-order equations in a basis that goes along with the parameters, and their derivatives.

The basis T = (R, N) has the motions R with R^T M R = 1, in the pose the undamped modes, and the motions N without mass
with N^T C N = 1 and N^T C R = 0, which have no velocities of their own:

eta'' = -K_RR eta - K_RN nu - gamma eta' + B_R u,  nu' = -K_NR eta - K_NN nu + B_N u

As parameters change, T stays of that kind by T' = T Theta, and a matrix X in it, T^T X T, changes by T^T X' T +
Theta^T X + X Theta. States are (s eta, eta', nu) with s = omega, so that A is as well scaled as the mechanism allows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, eigh, solve_triangular

from mbsvib.common.arrays import Array
from mbsvib.elements import Body, Maxwell
from mbsvib.equations.equations import Equations
from mbsvib.errors import ModelError
from mbsvib.linalg.rank import CANCELLED_RATE, ORTHOGONAL_STATES
from mbsvib.modes.damped import Damped
from mbsvib.responses.basis import Basis
from mbsvib.sensitivities.matrix_derivatives import MatrixDerivatives


@dataclass(frozen=True, slots=True)
class StateBasis:
    """Motions ``vectors`` T (m, m), the first ``massive`` of which have mass, with K and C in them."""

    vectors: Array
    massive: int
    stiffness: Array
    damping: Array


@dataclass(frozen=True, slots=True)
class States:
    """x' = A x + B u, y = C x + D u in a ``basis``, k motions of which have mass, with the ``scale`` (k,) of states.

    ``rates`` are the outputs and ``force`` the inputs in the basis; rows of A and B before the ``first`` never change.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    basis: StateBasis
    scale: Array
    rates: tuple[Array, ...]
    force: Array

    @property
    def first(self) -> int:
        """The first row that changes."""
        return self.basis.massive


def states(basis: Basis, inputs: list[int], outputs: list[int]) -> States:
    """Return the first-order equations of some inputs and outputs.

    Raises an error if the system has both spin and motions without mass.
    """
    system, states = basis.equations, state_basis(basis)
    k = states.massive
    omega = np.sqrt(np.abs(np.diagonal(states.stiffness)[:k]))
    scale = np.where(omega > 0.0, omega, omega[omega > 0.0].min(initial=np.inf) if omega.any() else 1.0)
    rows = _rows(states.stiffness, states.damping, scale)
    a = np.concatenate((np.zeros((k, rows.shape[1])), rows))
    a[np.arange(k), k + np.arange(k)] = scale
    force = states.vectors.T @ system.B[:, inputs]
    rates = tuple(slope[outputs] @ states.vectors for slope in (system.Cq, system.Cv, system.Ca))
    b = np.concatenate((np.zeros_like(force[:k]), force))
    moving = _moving(rates, k)
    c = _output_rates(rates, scale, k) + moving @ rows
    return States(a, b, c, _sum(system.D[np.ix_(outputs, inputs)], k, (moving, force)), states, scale, rates, force)


def has_states(system: Equations) -> bool:
    """Return whether a system has such states: not with both spin and motions without mass."""
    return system.null_inertia is None or system.gyroscopic is None


def state_basis(basis: Basis) -> StateBasis:
    """Return motions of unit mass, as far as they have any, with K and C in them as diagonal as can be.

    Raises an error if the system has both spin and motions without mass.
    """
    system, modal = basis.equations, basis.modal
    null = system.null_inertia
    if isinstance(modal, Damped):
        gamma = np.diag(modal.gamma) if modal.gamma.ndim == 1 else modal.gamma
        return StateBasis(modal.shapes, len(modal.square), np.diag(modal.square), gamma)
    if null is None:
        _, vectors = eigh(0.5 * (system.K + system.K.T), system.M)
        return StateBasis(vectors, len(vectors), vectors.T @ system.K @ vectors, vectors.T @ system.C @ vectors)
    if not has_states(system):
        raise _refusal(system)
    damping = null.T @ system.C @ null
    null = solve_triangular(cholesky(0.5 * (damping + damping.T), lower=True), null.T, lower=True).T
    unit = 1.0 / np.sqrt(np.diagonal(system.M) + (np.diagonal(system.M) == 0.0))
    values, rotation = eigh(unit[:, None] * system.M * unit)
    massive = len(unit) - null.shape[1]
    massive_vectors = unit[:, None] * rotation[:, len(unit) - massive :] / np.sqrt(values[len(unit) - massive :])
    massive_vectors = massive_vectors - null @ (null.T @ system.C @ massive_vectors)
    stiffness = massive_vectors.T @ system.K @ massive_vectors
    _, turn = eigh(0.5 * (stiffness + stiffness.T))
    vectors = np.concatenate((massive_vectors @ turn, null), axis=1)
    return StateBasis(vectors, massive, vectors.T @ system.K @ vectors, vectors.T @ system.C @ vectors)


def _refusal(system: Equations) -> ModelError:
    """The refusal of motions without mass beside spin, which names what makes them."""
    who = next((part.name for part in system.provenance.parts if isinstance(part, Maxwell) or
                (isinstance(part, Body) and part.mass == 0.0)), system.name)  # fmt: skip
    return ModelError(
        f"sensitivities: '{who}' makes motions without mass in a mechanism that spins or is cross-coupled, for which "
        f"there are those of eigenvalues, matrices and frequency responses only. Compare variants by "
        f"model.with_values.", element=who,
    )  # fmt: skip


def changed(base: States, change: MatrixDerivatives, inputs: list[int], outputs: list[int]) -> tuple[Array, ...]:
    """Return the derivatives of the first-order equations: of the rows of A that change (v, m, n), and of B in these
    (v, m, inputs), of C (v, outputs, n) and D (v, outputs, inputs).
    """
    basis, k = base.basis, base.basis.massive
    vectors, theta = basis.vectors, basis_rotation(basis, change)
    back = theta.swapaxes(1, 2)
    stiffness, damping = (vectors.T @ slope @ vectors + back @ matrix + matrix @ theta
                          for slope, matrix in ((change.K, basis.stiffness), (change.C, basis.damping)))  # fmt: skip
    rows = _rows(stiffness, damping, base.scale)
    force = vectors.T @ change.B[:, :, inputs] + back @ base.force
    rates = tuple(slope[:, outputs] @ vectors + matrix @ theta
                  for slope, matrix in zip((change.Cq, change.Cv, change.Ca), base.rates, strict=True))  # fmt: skip
    moving, moved = _moving(base.rates, k), _moving(rates, k)
    c = _output_rates(rates, base.scale, k) + moved @ base.A[k:] + moving @ rows
    d = _sum(change.D[:, outputs][:, :, inputs], k, (moved, base.force), (moving, force))
    return rows, force, c, d


def basis_rotation(basis: StateBasis, change: MatrixDerivatives) -> Array:
    """Return Theta (v, m, m), by which a basis goes along with parameters, T' = T Theta."""
    k, vectors = basis.massive, basis.vectors
    mass, damping = (vectors.T @ slope @ vectors for slope in (change.M, change.C))
    result = np.zeros_like(mass)
    result[:, :k, :k], result[:, :k, k:] = -0.5 * mass[:, :k, :k], -mass[:, :k, k:]
    result[:, k:, :k] = mass[:, k:, :k] @ basis.damping[:k, :k] - damping[:, k:, :k]
    result[:, k:, k:] = -0.5 * damping[:, k:, k:]
    return result


def _rows(stiffness: Array, damping: Array, scale: Array) -> Array:
    """Rows (..., m, m + k) of A for eta' and nu."""
    k = len(scale)
    among = -damping[..., :k].copy()
    among[..., k:, :] = 0.0
    return np.concatenate((-stiffness[..., :k] / scale, among, -stiffness[..., k:]), axis=-1)


def _output_rates(rates: tuple[Array, ...], scale: Array, k: int) -> Array:
    """What outputs see of the states themselves, (..., outputs, m + k)."""
    return np.concatenate((rates[0][..., :k] / scale, rates[1][..., :k], rates[0][..., k:]), axis=-1)


def _moving(rates: tuple[Array, ...], k: int) -> Array:
    """What outputs see of eta'' and nu', (..., outputs, m)."""
    return np.concatenate((rates[2][..., :k], rates[1][..., k:]), axis=-1)


def _sum(start: Array, k: int, *products: tuple[Array, Array]) -> Array:
    """Sum of a matrix and of products over k motions with mass and those without, 0 where they cancel but for rounding:
    accelerations see the base at once, and what the mechanism takes back.
    """
    total, size, bound = start, np.abs(start), 0.0
    for a, b in products:
        total, size = total + a @ b, size + np.abs(a) @ np.abs(b)
        for part in (slice(0, k), slice(k, None)):
            bound = bound + (np.linalg.norm(a[..., part], axis=-1)[..., :, None]
                             * np.linalg.norm(b[..., part, :], axis=-2)[..., None, :])  # fmt: skip
    return np.where((np.abs(total) <= CANCELLED_RATE * size) | (np.abs(total) <= ORTHOGONAL_STATES * bound), 0.0, total)
