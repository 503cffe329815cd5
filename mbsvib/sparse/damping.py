"""Damped modes of many bodies: are the undamped ones modes still, and if not, what is missing from them.

(lambda^2 M + lambda C + K) phi = 0 is solved in a subspace that starts with the undamped modes: the small dense system
that it makes (by the dense path, left vectors included) gives eigenvalues and shapes; what is left of the whole
system's equations, through the factors that are there already, joins the subspace, until nothing that counts is left.

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

# Shapes are modes if no more than this is left of their equations: eigenvalues are off by its square.
CONVERGED = 1e-9
# Where the subspace has not all that is wanted by then, eigenvalues are searched without the undamped modes.
ROUNDS = 12
# The subspace starts anew from the modes found when it has grown to this many vectors for each of them.
GROWTH = 8
# Directions that are new by less than this share of their length are left out: what is left of them has lost digits.
NEW = 1e-4


def decoupled(found: Subspace, result: Modes, z: Array) -> bool:
    """Tell whether undamped modes, as they are, are modes of the damped system too.

    Parameters
    ----------
    found : Subspace
        Where they come from.
    result : Modes
        Modes of the small system that they make.
    z : array, shape (size, n)
        Their displacements and coordinates.

    Returns
    -------
    bool
        Whether the whole system's equations hold for each eigenvalue and shape.
    """
    system, t = found.operator.system, found.operator
    if not system.damping.any():
        return True
    brakes = system.elastic_rows[system.damping != 0.0]
    rigid = z[:, : result.rigid]
    felt = np.abs(brakes @ rigid) > ZERO_SUM * (abs(brakes) @ np.abs(rigid))
    if not result.classical or felt.any():
        return False
    # what C does to a shape must be inertia of that same shape, Gamma_ii M phi, which a solve brings to common units
    damping, inertia = _forces(t, z)
    gamma = np.einsum("ij,ij->j", z, damping)
    left = _kinetic(t, result.eigenvalues[0::2] * (damping - gamma * inertia))[1]
    return bool((np.linalg.norm(left, axis=0) <= CONVERGED).all())


def coupled(
    found: Subspace, k: int, near: float, form: type[Equations]
) -> tuple[Equations, Modes, Array, Index]:
    """Return the damped modes whose natural frequencies are nearest to a frequency, of rigid-body modes the slowest.

    Parameters
    ----------
    found : Subspace
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
    t, rigid = found.operator, found.rigid
    whole = not np.isfinite(found.reach)
    basis = found.z
    limit = rigid + GROWTH * (k + 4)
    for _ in range(ROUNDS):
        small = reduced(t.system, basis, rigid, form)
        result: Modes = dense_modes(small, RTOL)
        speed = np.abs(result.eigenvalues).reshape(-1, 2).max(axis=1)  # tells rigid-body modes apart
        chosen = np.sort(np.lexsort((speed, np.abs(result.natural - 2.0 * np.pi * near)))[:k])
        if whole:
            return small, result, np.repeat(found.noise, 2) * (result.eigenvalues != 0.0), chosen
        eigenvalues, shapes, pair = _flexible(result, chosen)
        rest, left = _kinetic(t, _residual(t, eigenvalues, basis, shapes))
        size = np.linalg.norm(left, axis=0)
        late = size > CONVERGED
        if not late.any():
            break
        if basis.shape[1] > limit:
            basis = _joined(t, basis[:, :rigid], _parts(basis @ shapes))
        basis = _joined(t, basis, _parts(rest[:, late]))
    bound = np.zeros(len(result.eigenvalues))
    np.maximum.at(bound, pair, _bound(found, eigenvalues, size))
    return small, result, bound, chosen


def _flexible(result: Modes, chosen: Index) -> tuple[Complex, Complex, Index]:
    """Eigenvalues that are not zero, with shapes in the small system, and their numbers; one for a conjugate pair."""
    number = np.stack((2 * chosen, 2 * chosen + 1), axis=1).reshape(-1)
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
    """Generalised forces Q(lambda) phi that are left."""
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
    """Motion under generalised forces through the factors, and its rows of kinetic energy, rigid-body modes apart."""
    motion = t.factor.solve(t.right(force))
    rows = t.w @ motion
    if t.rigid.shape[1]:
        share = t.away[:, : t.rigid.shape[1]].T @ rows
        motion, rows = motion - t.rigid @ share, rows - t.away[:, : t.rigid.shape[1]] @ share
    return motion, rows


def _parts(z: NDArray[np.inexact]) -> Array:
    return np.concatenate((z.real, z.imag), axis=1)


def _joined(t: Operator, basis: Array, more: Array) -> Array:
    """The basis with what is new in some motions, M-orthonormal."""
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
        kept = singular > NEW * singular.max(initial=0.0)
        more = more @ (right[kept].T / singular[kept])
    return np.concatenate((basis, more), axis=1)


def _bound(found: Subspace, values: Complex, left: Array) -> Array:
    """Second-order error of eigenvalues, by the distance to the modes that are not in the subspace."""
    apart = np.abs(np.abs(values) ** 2 - found.operator.sigma)
    gap = np.maximum(found.reach / np.maximum(apart, 1e-300) - 1.0, CONVERGED)
    return np.minimum(left, left**2 / gap)
