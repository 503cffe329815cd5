"""Damped modes of many bodies: the test whether damping couples the undamped modes, and the coupled modes.

(lambda^2 M + lambda C + K) phi = 0 is solved in a subspace that starts with the undamped modes: the projected small
dense system (by the dense path, left vectors included) gives eigenvalues and shapes. The residuals of the full system,
multiplied by the existing factors, extend the subspace until they are small.

Source: Voss, BIT 44 (2004), an Arnoldi method for nonlinear eigenvalue problems.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.modes import modes as dense_modes
from mbsvib.sparse.galerkin import CONVERGED, ROUNDS, eigenvectors, of_all_eigenvalues, parts, truncation
from mbsvib.sparse.reduction import RTOL, reduced

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.equations import Equations
    from mbsvib.modes import Modes
    from mbsvib.sparse.operator import Operator
    from mbsvib.sparse.subspace import Subspace

# The subspace is restarted from the current modes when it has grown to this many vectors per mode.
GROWTH = 8
# A direction is left out if less than this fraction of it remains after orthogonalization.
NEW = 1e-4


def decoupled(space: Subspace, result: Modes, z: Array) -> bool:
    """Return whether the undamped modes ``z`` (size, n) are also modes of the damped system.

    ``result``: modes of the projected small system, of which each eigenvalue and shape is put into the full equations.
    """
    quadratic = space.operator.quadratic
    if quadratic.proportional:
        return True
    if not result.classical or quadratic.is_damped(z[:, : result.rigid]):
        return False
    # C phi must equal Gamma_ii M phi; a solve gives both the same units
    damping = quadratic.damping(z)
    gamma = np.einsum("ij,ij->j", z, damping)
    residual = _motion(space.operator, result.eigenvalues[0::2] * (damping - gamma * quadratic.inertia(z)))
    return bool((quadratic.size(residual) <= CONVERGED).all())


def coupled(
    space: Subspace, k: int, near: float, form: type[Equations]
) -> tuple[Equations, Modes, Array, Index]:
    """Return the damped modes whose natural frequencies are nearest to a frequency, of rigid-body modes the slowest.

    ``space``: the undamped subspace. ``near`` [Hz], 0 for the lowest. Returns the small system of the class ``form``,
    its modes, a bound of the relative error of each eigenvalue (2n,), and which modes to take.
    """
    t, rigid = space.operator, space.rigid
    complete = not np.isfinite(space.reach)
    basis = space.z
    limit = rigid + GROWTH * (k + 4)
    for _ in range(ROUNDS):
        small = reduced(t.system, basis, rigid, form)
        result: Modes = dense_modes(small, RTOL)
        speed = np.abs(result.eigenvalues).reshape(-1, 2).max(axis=1)  # orders rigid-body modes
        selected = np.sort(np.lexsort((speed, np.abs(result.natural - 2.0 * np.pi * near)))[:k])
        if complete:
            return small, result, np.repeat(space.noise, 2) * (result.eigenvalues != 0.0), selected
        vectors = eigenvectors(result, selected)
        z = basis @ vectors.right
        residual = t.quadratic.force(vectors.values, z) / t.quadratic.size(z)
        correction = _motion(t, residual)
        size = t.quadratic.size(correction)
        unconverged = size > CONVERGED
        if not unconverged.any():
            break
        if basis.shape[1] > limit:
            basis = _extended(t, basis[:, :rigid], parts(z))
        basis = _extended(t, basis, parts(correction[:, unconverged]))
    # relative distance of the selected modes from those that are not in the subspace
    distance = np.abs(np.abs(vectors.values) ** 2 - t.sigma)
    errors = truncation(size, size, space.reach / np.maximum(distance, 1e-300) - 1.0)
    return small, result, of_all_eigenvalues(result, vectors, errors), selected


def _motion(t: Operator, force: NDArray[np.inexact]) -> NDArray[np.inexact]:
    """The motion under generalised forces, without rigid-body modes."""
    return t.flexible(t.factor.solve(t.right(force)))


def _extended(t: Operator, basis: Array, added: Array) -> Array:
    """The basis extended by some motions, M-orthonormal.

    Corrections are mostly in the basis already. Their remainders are scaled to unit length before their Gram matrix is
    diagonalized, which would otherwise leave them out.
    """
    momentum = t.quadratic.inertia(basis)
    for _ in range(2):
        length = t.quadratic.size(added)
        added = added - basis @ (momentum.T @ added)
        remaining = t.quadratic.size(added)
        used = remaining > NEW * length
        added = added[:, used] / remaining[used]
        square, vectors = np.linalg.eigh(added.T @ t.quadratic.inertia(added))
        significant = square > NEW**2 * square.max(initial=0.0)
        added = added @ (vectors[:, significant] / np.sqrt(square[significant]))
    return np.concatenate((basis, added), axis=1)
