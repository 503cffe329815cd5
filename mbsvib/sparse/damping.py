"""Damped modes of many bodies: the test whether damping couples the undamped modes, and the coupled modes.

(lambda^2 M + lambda C + K) phi = 0 is solved in a subspace that starts with the undamped modes: the projected small
dense system (by the dense path, left vectors included) gives eigenvalues and shapes. The residuals of the full system,
multiplied by the existing factors, extend the subspace until they are small.

Source: Voss, BIT 44 (2004), an Arnoldi method for nonlinear eigenvalue problems.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rank import ZERO_SUM
from mbsvib.modes import modes as dense_modes
from mbsvib.modes.damped import Damped
from mbsvib.sparse.reduction import RTOL, reduced

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.equations.equations import Equations
    from mbsvib.modes import Modes
    from mbsvib.sparse.operator import Operator
    from mbsvib.sparse.subspace import Subspace

# Largest relative residual of shapes: the error of eigenvalues is its square.
CONVERGED = 1e-9
# If the subspace does not converge in so many rounds, eigenvalues are searched without the undamped modes.
ROUNDS = 12
# The subspace is restarted from the current modes when it has grown to this many vectors per mode.
GROWTH = 8
# If less than this share of a direction remains after orthogonalization, it is left out: it has lost its digits.
NEW = 1e-4


def decoupled(space: Subspace, result: Modes, z: Array) -> bool:
    """Tell whether the undamped modes are also modes of the damped system.

    Parameters
    ----------
    space : Subspace
        The subspace that contains them.
    result : Modes
        Modes of the projected small system.
    z : array, shape (size, n)
        Their displacements and coordinates.

    Returns
    -------
    bool
        Whether each eigenvalue and shape satisfies the full system's equations.
    """
    system, t = space.operator.system, space.operator
    if not system.damping.any():
        return True
    brakes = system.elastic_rows[system.damping != 0.0]
    rigid = z[:, : result.rigid]
    resisted = np.abs(brakes @ rigid) > ZERO_SUM * (abs(brakes) @ np.abs(rigid))
    if not result.classical or resisted.any():
        return False
    # C phi must equal Gamma_ii M phi; a solve brings both to the same units
    damping, inertia = _forces(t, z)
    gamma = np.einsum("ij,ij->j", z, damping)
    left = _kinetic(t, result.eigenvalues[0::2] * (damping - gamma * inertia))[1]
    return bool((np.linalg.norm(left, axis=0) <= CONVERGED).all())


def coupled(
    space: Subspace, k: int, near: float, form: type[Equations]
) -> tuple[Equations, Modes, Array, Index]:
    """Return the damped modes whose natural frequencies are nearest to a frequency, of rigid-body modes the slowest.

    Parameters
    ----------
    space : Subspace
        The undamped subspace.
    k : int
        Number of modes.
    near : float
        Frequency [Hz], 0 for the lowest.
    form : type
        The class of the small dense equations.

    Returns
    -------
    tuple
        The small system, its modes, a bound of the relative error of each eigenvalue (2n,), and which modes to take.
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
        eigenvalues, shapes, pair = _flexible(result, selected)
        rest, left = _kinetic(t, _residual(t, eigenvalues, basis, shapes))
        size = np.linalg.norm(left, axis=0)
        late = size > CONVERGED
        if not late.any():
            break
        if basis.shape[1] > limit:
            basis = _joined(t, basis[:, :rigid], _parts(basis @ shapes))
        basis = _joined(t, basis, _parts(rest[:, late]))
    bound = np.zeros(len(result.eigenvalues))
    np.maximum.at(bound, pair, _bound(space, eigenvalues, size))
    return small, result, bound, selected


def _flexible(result: Modes, selected: Index) -> tuple[Complex, Complex, Index]:
    """Eigenvalues that are not zero, with shapes in the small system, and their numbers; one for a conjugate pair."""
    number = np.stack((2 * selected, 2 * selected + 1), axis=1).reshape(-1)
    values = result.eigenvalues[number]
    used = (values != 0.0) & (values.imag >= 0.0)
    number = number[used]
    modal = result.damped
    assert isinstance(modal, Damped)  # symmetric matrices, as dampers and springs make them
    vectors, shapes = modal.vectors, modal.shapes.astype(complex)
    if vectors is None:
        return result.eigenvalues[number], shapes[:, number // 2], number
    return result.eigenvalues[number], shapes @ vectors[:, number // 2, number % 2], number


def _residual(t: Operator, values: Complex, basis: Array, shapes: Complex) -> Complex:
    """Residual forces Q(lambda) phi."""
    z = basis @ shapes
    damping, inertia = _forces(t, z)
    rows = t.system.elastic_rows
    stiffness = rows.T @ (t.system.stiffness[:, None] * (rows @ z))
    result: Complex = (stiffness + values * (damping + values * inertia)) / np.linalg.norm(t.w @ z, axis=0)
    return result


def _forces(t: Operator, z: NDArray[np.inexact]) -> tuple[NDArray[np.inexact], NDArray[np.inexact]]:
    rows = t.system.elastic_rows
    return rows.T @ (t.system.damping[:, None] * (rows @ z)), t.wt @ (t.w @ z)


def _kinetic(t: Operator, force: NDArray[np.inexact]) -> tuple[NDArray[np.inexact], NDArray[np.inexact]]:
    """Motion under generalised forces from the factors, without rigid-body modes, and its rows of kinetic energy."""
    motion = t.factor.solve(t.right(force))
    rows = t.w @ motion
    if t.rigid.shape[1]:
        share = t.away[:, : t.rigid.shape[1]].T @ rows
        motion, rows = motion - t.rigid @ share, rows - t.away[:, : t.rigid.shape[1]] @ share
    return motion, rows


def _parts(z: NDArray[np.inexact]) -> Array:
    return np.concatenate((z.real, z.imag), axis=1)


def _joined(t: Operator, basis: Array, more: Array) -> Array:
    """The basis extended by some motions, M-orthonormal."""
    old = t.w @ basis
    for _ in range(2):
        rows = t.w @ more
        length = np.linalg.norm(rows, axis=0)
        share = old.T @ rows
        rows -= old @ share
        new = np.linalg.norm(rows, axis=0)
        used = new > NEW * length
        more, rows = (more - basis @ share)[:, used] / new[used], rows[:, used] / new[used]
        _, singular, right = np.linalg.svd(rows, full_matrices=False)
        significant = singular > NEW * singular.max(initial=0.0)
        more = more @ (right[significant].T / singular[significant])
    return np.concatenate((basis, more), axis=1)


def _bound(space: Subspace, values: Complex, left: Array) -> Array:
    """Second-order error of eigenvalues, by the distance to the modes that are not in the subspace."""
    apart = np.abs(np.abs(values) ** 2 - space.operator.sigma)
    gap = np.maximum(space.reach / np.maximum(apart, 1e-300) - 1.0, CONVERGED)
    return np.minimum(left, left**2 / gap)
