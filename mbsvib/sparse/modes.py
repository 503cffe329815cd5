"""Some modes of many bodies: shift-invert Lanczos, frequencies from the factors, and modes that damping couples.

The subspace comes from Lanczos on T = W (K - sigma M)^-1 W^T and one more solve. The frequencies come from the
projected small dense system, M = |W x|^2 and K = |sqrt(k) D q|^2, by the same solvers as for small mechanisms. Springs
act on relative coordinates q, which the solve gives with full accuracy; so frequencies many orders below those of a
single body on its spring lose no digits.

With damping (lambda^2 M + lambda C + K) phi = 0 is solved in a subspace that starts with the undamped modes: the
projected small dense system (by the dense path, left vectors included) gives eigenvalues and shapes. The residuals of
the full system, multiplied by the existing factors, extend the subspace until they are small.

Source: Voss, BIT 44 (2004), an Arnoldi method for nonlinear eigenvalue problems.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import AnyArray, Array, Index
from mbsvib.common.expected import near_frequency
from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError, UnstableWarning, counted
from mbsvib.modes import Modes
from mbsvib.modes import modes as dense_modes
from mbsvib.modes.undamped import undamped
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.from_matrices import motions_of
from mbsvib.sparse.galerkin import CONVERGED, ROUNDS, eigenvectors, of_all_eigenvalues, parts, truncation
from mbsvib.sparse.matrix_subspace import matrix_subspace
from mbsvib.sparse.operator import Operator, count_below
from mbsvib.sparse.reduction import RTOL, reduced, rounding
from mbsvib.sparse.spectrum import general_modes
from mbsvib.sparse.subspace import Subspace
from mbsvib.sparse.subspace import subspace as mechanism_subspace

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


# If the errors of eigenvalues are larger, the damped modes are not computed from the undamped ones.
UNCERTAIN = 1e-6
# Modes are counted up to this many times the last natural frequency.
BEYOND = 1.0 + 1e-6
# The last mode of a subspace is within its reach up to this relative difference.
REACHED = 1e-6


@dataclass(frozen=True, repr=False, eq=False)
class SomeModes(Modes):
    """Some modes of a large system, in ascending natural frequency: ``Modes`` with the projected system.

    ``shapes`` are in the coordinates of ``reduced`` (mode1, mode2, ...), ``body_shapes`` those of the bodies.
    ``missed`` is the number of modes below the highest one that are not among these, by a count of eigenvalues (0; None
    if they cannot be counted: rows were exchanged, or the matrices are not symmetric).
    """

    reduced: Equations = field(repr=False, kw_only=True)
    dof: int = field(kw_only=True)
    """Number of degrees of freedom of the whole system, m."""
    missed: int | None = field(kw_only=True)
    moving: tuple[tuple[str, ...], ...] = field(default=(), kw_only=True)
    """The coordinate with the largest momentum, for each mode of matrices."""

    @property
    def coordinate_shapes(self) -> AnyArray:
        """The shapes in the coordinates of the large system, (coordinates, n)."""
        return np.asarray(motions_of(self.reduced) @ self.shapes)

    def strongest(self) -> tuple[tuple[str, ...], ...]:
        """Return for each mode the body with most kinetic energy and its direction, or the coordinate."""
        return self.moving or super().strongest()

    def _shown(self) -> str:
        return f"{len(self)} of {self.dof} DOF"


M = TypeVar("M", bound=SomeModes)


def modes(
    system: SparseEquations, k: int, near: float = 0.0, dense: type[Equations] = Equations,
    form: type[M] = SomeModes,  # type: ignore[assignment]
) -> M:  # fmt: skip
    """Return the k lowest modes, or the k nearest to a frequency ``near`` [Hz], in ascending natural frequency.

    ``dense``, ``form``: the classes of the small dense equations and of the modes.
    """
    _check(system, k)
    near, missed = near_frequency(near), None
    if system.circulatory is not None or system.gyroscopic is not None or system.massless:
        small, result, truncation, selected = general_modes(system, k, near, dense)
        errors = result.errors + truncation
    else:
        small, result, errors, selected, missed, growing = _symmetric(system, k, near, dense)
        left = growing - int(np.count_nonzero(result.growing[selected]))
        if left > 0:
            number = f"{counted(growing, 'mode')}, of which {left} {'is' if left == 1 else 'are'}"
            warnings.warn(f"modes: the stiffness of '{system.name}' is negative for {number} not among the {k} asked "
                          f"for: they grow. Check the matrices, or give dense ones for all modes.",
                          UnstableWarning, stacklevel=3)  # fmt: skip
    errors = np.minimum(errors, 1.0)
    pairs = np.concatenate([np.arange(*result.starts[i : i + 2]) for i in selected])
    return form(
        result.name, result.coordinates, result.bodies, result.eigenvalues[pairs], errors[pairs],
        result.shapes[:, selected], result.classical, int(np.count_nonzero(selected < result.rigid)),
        result.body_motion, result.inertia_factor, result.damped,
        None if result.first_order is None else result.first_order[selected], reduced=small, dof=system.dof,
        missed=missed, moving=_moving(system, small, result.shapes[:, selected]),
    )  # fmt: skip


def _moving(system: SparseEquations, small: Equations, shapes: AnyArray) -> tuple[tuple[str, ...], ...]:
    """The coordinate with the largest momentum in each mode of matrices."""
    if system.matrices is None:
        return ()
    amount = np.abs(motions_of(small) @ shapes) ** 2 * system.matrices.M.diagonal()[:, None]
    return tuple([(system.joint_coordinates[i],) for i in amount.argmax(axis=0).tolist()])


def _symmetric(
    system: SparseEquations, k: int, near: float, dense: type[Equations]
) -> tuple[Equations, Modes, Array, Index, int | None, int]:
    """The small system, its modes with errors, the numbers of the wanted ones, how many were missed, and how many of
    all modes of matrices grow.
    """
    subspace = mechanism_subspace if system.matrices is None else matrix_subspace
    space = subspace(system, k, near)
    basis, bound, rigid = _nearest(system, space, k)
    requested = k
    while basis is None:
        requested += max(4, k // 2)
        space = subspace(system, min(requested, system.dof), near)
        basis, bound, rigid = _nearest(system, space, k)
    small = reduced(system, basis, rigid, dense)
    result: Modes = dense_modes(small, RTOL)
    if decoupled(space, result, basis):
        errors = result.errors + np.repeat(bound, 2) * (result.eigenvalues != 0.0)
        return small, result, errors, np.arange(k), space.missed, space.growing
    small, result, truncation, selected = coupled(space, k, near, dense)
    missed = space.missed
    certain = result.rigid == space.rigid and float(truncation.max(initial=0.0)) < UNCERTAIN
    unknown = _unknown_overdamped(system, small, result, selected) if certain else 1
    if unknown and system.matrices is not None:
        raise ResponseError(
            f"modes: dampers of '{system.name}' are so strong that other modes than these may be among the lowest {k}; "
            f"ask for more modes, or give dense matrices."
        )
    if unknown:  # strong dampers make slow modes of fast undamped ones
        small, result, truncation, selected = general_modes(system, k, near, dense)
    if unknown is None or unknown:
        missed = None
    errors = result.errors + truncation + rounding(system) * (result.eigenvalues != 0.0)
    return small, result, errors, selected, missed, space.growing


def _unknown_overdamped(system: SparseEquations, small: Equations, result: Modes, selected: Index) -> int | None:
    """Number of pairs of real eigenvalues with one on each side of -s that the small system does not contain.

    s is beyond all selected modes. Each pair (a, b) of a mode with one eigenvalue on each side of -s gives one negative
    eigenvalue of P(-s), which is symmetric; their number is that of the negative pivots. Without dampers they are those
    of modes that grow faster than s. None if it cannot be counted.
    """
    size = np.abs(result.pairs[selected])
    s = BEYOND * float(np.sqrt(size.prod(axis=1)).max(initial=0.0) or size.max(initial=0.0))
    if not s:
        return 0
    try:
        negative = system.tableau.factor(s=-s, pivot=0.0).negative(system.layout)
        growing = count_below(system, -s * s) if negative else 0
    except np.linalg.LinAlgError:
        return None
    if negative is None or growing is None:
        return None
    real = result.pairs[(result.pairs.imag == 0.0).all(axis=1)].real
    known = int(np.count_nonzero((real + s).prod(axis=1) < 0.0))
    if growing:
        growing -= int(np.count_nonzero(undamped(small, RTOL).square < -s * s))
    return abs(negative - known - growing)


def _check(system: SparseEquations, k: int) -> None:
    if not system.dof:
        raise ResponseError(f"modes: '{system.name}' is fully locked: it has no modes. Its responses are constant: ask "
                            f"{system.dense_form} for them, or frequency_response.")  # fmt: skip
    if isinstance(k, bool) or not hasattr(k, "__index__") or not 1 <= k <= system.dof:
        raise ResponseError(
            f"modes: count = {k!r}; expected a whole number from 1 to {system.dof}, the degrees of freedom of "
            f"'{system.name}'."
        )


def _nearest(system: SparseEquations, space: Subspace, k: int) -> tuple[Array | None, Array, int]:
    """The k modes of the subspace nearest to the shift, M-orthonormal, error bounds of their frequencies, and how many
    of them are rigid-body modes.

    None if the subspace is too small to decide which are nearest.
    """
    sigma = space.operator.sigma
    small = reduced(system, space.z, space.rigid)
    try:
        ritz = undamped(small, RTOL)
    except np.linalg.LinAlgError:
        raise ResponseError(
            f"modes: the search for the lowest modes of '{system.name}' found linearly dependent motions, and motions "
            f"with very small stiffness; use linearize(method='dense')."
        ) from None  # fmt: skip
    if sigma > 0.0:
        centre = space.centre
        distance = np.abs(np.sqrt(np.abs(ritz.square)) - centre)
        last = float(np.sort(distance)[k - 1])
        needed = max((centre + last) ** 2 - sigma, sigma - max(0.0, centre - last) ** 2)
        if needed <= space.reach and space.operator.diverging() > int(np.count_nonzero(ritz.square < 0.0)):
            needed = sigma + (centre + last) ** 2
        if needed > space.reach:
            return None, np.zeros(0), 0  # a mode outside the subspace may be nearer
    else:
        distance = np.abs(ritz.square)
        distance[: space.rigid] = -1.0
        # diverging modes are nearer to a shift below zero than others of the same magnitude
        if sigma < 0.0 and float(np.sort(distance)[k - 1]) - sigma > space.reach * (1.0 + REACHED):
            return None, np.zeros(0), 0
    selected = np.sort(np.argsort(distance, kind="stable")[:k])
    y = ritz.shapes[:, selected]
    basis = space.z @ y
    residual = np.sqrt(np.abs(y.T) ** 2 @ space.residual**2)
    noise = np.abs(y.T) ** 2 @ space.noise
    square = np.abs(ritz.square[selected])
    from_shift = np.abs(ritz.square[selected] - sigma)
    to_others = np.maximum(space.reach - from_shift, 0.0)
    flexible = square > 0.0
    first = residual * from_shift / np.where(flexible, square, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        second = np.where(to_others > 0.0, first * residual * from_shift / to_others, np.inf)
    bound = np.where(flexible, 0.5 * (np.minimum(first, second) + noise) + rounding(system), 0.0)
    return basis, bound, int(np.count_nonzero(selected < space.rigid))
