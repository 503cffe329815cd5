"""The modes of a large system in a subspace that grows until the residual of the full system is small.

(lambda^2 M + lambda (C + G) + K + N) x = 0, and y^T from the left, are solved in one subspace for both: the projected
small dense system (by the dense path) gives eigenvalues and vectors. If the residual of a vector in the full system is
too large, P(lambda)^-1 P'(lambda) x, a step of inverse iteration, is added to the subspace.

Damped massless motions are separate columns of the basis. A motion z is z_m + N a with the damped massless motions N,
whose amplitudes are zero in z_m. Both parts are added to the basis, so that M is regular in the first columns and
exactly zero in the last ones, even if z moves little mass.

Source: Voss, BIT 44 (2004), an Arnoldi method for nonlinear eigenvalue problems; Schreiber, thesis, TU Berlin (2008),
two-sided methods.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from mbsvib.common.arrays import AnyArray, Array, Complex, Index
from mbsvib.equations.equations import Equations
from mbsvib.linalg.qr import pivoted_qr
from mbsvib.modes import Modes
from mbsvib.modes import modes as dense_modes
from mbsvib.modes.general import General
from mbsvib.sparse.equations import SparseEquations
from mbsvib.sparse.quadratic import Quadratic
from mbsvib.sparse.reduction import RTOL, reduced, rounding

# A motion is left out if less than this fraction of it remains after orthogonalization.
NEW = 1e-10
# Smaller fractions of a motion are rounding errors.
NOTHING = 1e-12


def split_massless(system: SparseEquations, motions: Array) -> tuple[Array, Array]:
    """Split motions (size, n) into those without damped massless motions (size, k), and massless motions (size, r).

    Those with mass that are only rounding are left out; the massless ones are independent and of unit damping.
    """
    if system.separation is None or not system.massless:
        return motions, np.zeros((len(motions), 0))
    n, unknown = system.separation.damped, system.separation.amplitude_of
    massless = n @ (motions[unknown] / np.asarray(n[unknown, np.arange(len(unknown))]).reshape(-1, 1))
    with_mass = motions - massless
    size = np.sqrt(np.abs(system.row_stiffness) + np.abs(system.row_damping))[:, None]
    remaining, total = (np.linalg.norm(size * (system.elastic_rows @ part), axis=0)
                        + np.linalg.norm(system.inertia_factor @ part, axis=0) for part in (with_mass, motions))
    return with_mass[:, remaining > NOTHING * total], independent(system, massless)


def independent(system: SparseEquations, massless: Array) -> Array:
    """Return independent motions (size, r), of unit damping and forces of spins, that span massless ones (size, n)."""
    damped = np.flatnonzero(system.row_damping)
    rates = np.sqrt(np.abs(system.row_damping[damped]))[:, None] * (system.elastic_rows[damped] @ massless)
    if system.gyroscopic is not None:
        spins = np.asarray(abs(system.gyroscopic).sum(axis=1)).ravel()
        rates = np.concatenate((rates, np.sqrt(spins)[:, None] * massless))
    length = np.linalg.norm(rates, axis=0)
    used = length > NOTHING * length.max(initial=0.0)
    if not used.any():
        return massless[:, used]
    _, singular, right = np.linalg.svd(rates[:, used] / length[used], full_matrices=False)
    significant = singular > NEW
    return np.asarray((massless[:, used] / length[used]) @ (right[significant].T / singular[significant]))


def independent_with_mass(system: SparseEquations, mass: Array) -> Array:
    """Return the independent motions with mass among all motions (size, n) without massless parts."""
    rows = system.inertia_factor @ mass
    rows = rows / np.maximum(np.linalg.norm(rows, axis=0), np.finfo(float).tiny)
    return np.asarray(mass[:, np.sort(pivoted_qr(rows)[1][: system.dof - system.massless])])


def with_static_motions(system: SparseEquations, basis: Array) -> Array:
    """Return motions (size, dof) with the static massless motions that they cause, from those (size, n) that span all.

    z - N (N^T K N)^-1 N^T K z
    """
    if system.separation is None or not system.separation.static.shape[1]:
        return basis
    n, rows = system.separation.static, system.elastic_rows
    force = n.T @ (rows.T.multiply(system.row_stiffness))
    if system.circulatory is None:
        stiffness, coupling = force @ (rows @ n), force @ (rows @ basis)
    else:
        forces = n.T @ system.circulatory
        stiffness, coupling = force @ (rows @ n) + forces @ n, force @ (rows @ basis) + forces @ basis
    result = basis - n @ splu(stiffness.tocsc()).solve(coupling)
    unit = 1.0 / np.maximum(np.abs(basis).max(axis=0), 1e-300)
    order = pivoted_qr(result[system.layout.coordinate] * unit)[1]
    return np.asarray(result[:, np.sort(order[: system.dof])])


# Largest relative residual of right vectors, and largest relative error of eigenvalues, which is bounded by the product
# of the residuals of both vectors.
CONVERGED, ACCURATE = 1e-9, 1e-13
# Rounds in which the subspace grows.
ROUNDS = 12
# A direction is left out if less than this fraction remains after orthogonalization, and in the second pass.
NEW, STILL_NEW = 1e-10, 0.1
# Residuals are measured with P(s) at a real s, this factor above |lambda|: it is no eigenvalue of a stable system.
ABOVE = 1.3


@dataclass(frozen=True, slots=True)
class Eigenvectors:
    """Nonzero eigenvalues ``values`` (h,), of conjugate pairs those with positive imaginary part.

    ``right`` and ``left`` (n, h) are the vectors in the small system, ``number`` (h,) the numbers among the eigenvalues
    of its modes.
    """

    values: Complex
    right: Complex
    left: Complex
    number: Index


def eigenvectors(result: Modes, numbers: Index) -> Eigenvectors:
    """Return the nonzero eigenvalues and the vectors of the modes ``numbers`` of a small system."""
    modal, starts = result.damped, result.starts
    if isinstance(modal, General):
        spectrum = modal.spectrum
        used = np.flatnonzero(np.isin(modal.mode, numbers))
        first = starts[modal.mode[used]]
        is_second = result.eigenvalues[first] != spectrum.values[used]
        number = first + (is_second & (starts[modal.mode[used] + 1] - first > 1))
        return Eigenvectors(spectrum.values[used], spectrum.right[:, used], spectrum.left[:, used], number)
    number = np.stack((2 * numbers, 2 * numbers + 1), axis=1).reshape(-1)
    values = result.eigenvalues[number]
    used = (values != 0.0) & (values.imag >= 0.0)
    number, shapes = number[used], modal.shapes.astype(complex)
    x = shapes[:, number // 2] if modal.vectors is None else shapes @ modal.vectors[:, number // 2, number % 2]
    return Eigenvectors(result.eigenvalues[number], x, x, number)


def parts(z: NDArray[np.inexact]) -> Array:
    """Return the real vectors that span complex ones and their conjugates."""
    return np.concatenate((z.real, z.imag), axis=1) if np.iscomplexobj(z) else np.asarray(z, dtype=float)


def extended(quadratic: Quadratic, basis: Array, added: Array, speed: float) -> Array:
    """Return a basis (size, n) extended by motions ``added`` (size, k), orthonormal in kinetic energy, z^T M z = 1.

    ``speed``: a frequency [rad/s] at which new directions are projected on motions that the joints allow: small
    remainders after the orthogonalization violate the constraints by rounding.
    """
    if not added.shape[1]:
        return basis
    w = quadratic.w
    basis_rows = w @ basis
    length = np.linalg.norm(w @ added, axis=0)
    added = added[:, length > 0.0] / length[length > 0.0]
    factor = quadratic.system.tableau.factor(s=ABOVE * speed)
    for limit in (NEW, STILL_NEW):
        for _ in range(2):
            rows = w @ added
            amplitudes = basis_rows.T @ rows
            added, rows = added - basis @ amplitudes, rows - basis_rows @ amplitudes
        _, singular, right = np.linalg.svd(rows, full_matrices=False)
        significant = singular > limit
        added = added @ (right[significant].T / singular[significant])
        if limit == NEW:
            added = quadratic.solve(factor, quadratic.force(ABOVE * speed, added))
    return np.concatenate((basis, added), axis=1)


def truncation(right: Array, left: Array, distance: Array) -> Array:
    """Return bounds (h,) of the errors of eigenvalues by residuals (h,) of both vectors, to first and second order.

    ``distance`` (h,) is the relative distance to the eigenvalues that are not in the subspace.
    """
    return np.asarray(np.minimum(np.maximum(right, left), right * left / np.maximum(distance, CONVERGED)))


@dataclass(frozen=True, slots=True)
class Solution:
    """Modes in a subspace: the ``small`` system, its ``modes`` and the numbers ``selected`` of the wanted modes.

    The subspace has motions with ``mass`` (size, n), of which the first ``rigid`` deform no spring, and ``massless``
    ones. ``bound`` is that of the relative error of each eigenvalue by truncation, ``residuals`` (2, h) are those of
    the right and left ``vectors`` of the selected modes.
    """

    mass: Array
    massless: Array
    rigid: int
    small: Equations
    modes: Modes
    selected: Index
    bound: Array
    vectors: Eigenvectors
    residuals: Array

    @property
    def basis(self) -> Array:
        """All motions, massless ones last."""
        return np.concatenate((self.mass, self.massless), axis=1)


@dataclass(frozen=True)
class Galerkin:
    """Modes of a large system from a subspace, with a small system of the class ``form``.

    ``choose`` returns the numbers of the wanted modes among all modes of the small system, ``distance`` those of
    eigenvalues from the eigenvalues that are not in the subspace.
    """

    quadratic: Quadratic
    choose: Callable[[Modes], Index]
    distance: Callable[[Complex], Array]
    form: type[Equations]

    def solution(self, mass: Array, massless: Array, rigid: int) -> Solution:
        """Return the modes in a subspace."""
        basis = np.concatenate((mass, massless), axis=1)
        small = reduced(self.quadratic.system, basis, rigid, self.form, massless.shape[1])
        result: Modes = dense_modes(small, RTOL)
        selected = self.choose(result)
        vectors = eigenvectors(result, selected)
        sizes = residuals(self.quadratic, basis, vectors)
        errors = truncation(sizes[0], sizes[1], self.distance(vectors.values) / np.abs(vectors.values))
        bound = error_bound(self.quadratic.system, small, result, vectors, errors)
        return Solution(mass, massless, rigid, small, result, selected, bound, vectors, sizes)

    def converged(self, mass: Array, massless: Array, rigid: int) -> Solution:
        """Return the modes in a subspace that grows until the selected ones satisfy the full system's equations."""
        for _ in range(ROUNDS):
            result = self.solution(mass, massless, rigid)
            corrections = self._corrections(result)
            if not corrections:
                break
            mass, massless = self.extended(mass, massless, np.concatenate(corrections, axis=1), result.vectors)
            if mass.shape[1] + massless.shape[1] == len(result.small.M):
                break
        return result

    def extended(
        self, mass: Array, massless: Array, added: AnyArray, vectors: Eigenvectors
    ) -> tuple[Array, Array]:
        """Return motions with mass and massless motions, both extended by parts of further motions."""
        more_mass, more_massless = split_massless(self.quadratic.system, parts(added))
        speed = float(np.abs(vectors.values).max(initial=1.0))
        return (extended(self.quadratic, mass, more_mass, speed),
                independent(self.quadratic.system, np.concatenate((massless, more_massless), axis=1)))  # fmt: skip

    def _corrections(self, solution: Solution) -> list[AnyArray]:
        """Steps of inverse iteration for the vectors that do not satisfy the full system's equations."""
        vectors, inaccurate = solution.vectors, solution.bound[solution.vectors.number] > ACCURATE
        unconverged = (inaccurate | (solution.residuals[0] > CONVERGED), inaccurate)
        sides = ((False, vectors.right), (True, vectors.left))[: 2 - self.quadratic.symmetric]
        return [_inverse_iteration(self.quadratic, s, z, transposed) for transposed, side in sides
                for s, z, used in zip(vectors.values, (solution.basis @ side).T, unconverged[transposed], strict=True)
                if used]  # fmt: skip

    def narrowed(self, solution: Solution) -> Solution:
        """Return the selected modes in the subspace of their right and left vectors and of free motions.

        The larger subspace is returned if other modes of the smaller one are unstable, or it is not converged.
        """
        vectors, modal, rigid = solution.vectors, solution.modes.damped, solution.rigid
        sides: list[AnyArray] = [vectors.right, vectors.left][: 2 - self.quadratic.symmetric]
        if isinstance(modal, General) and (solution.modes.eigenvalues == 0.0).any():
            sides += [modal.state.show @ modal.state.right, modal.state.force.T @ modal.state.left]
        motions = solution.basis @ parts(np.concatenate(sides, axis=1))
        mass, massless = self.extended(solution.mass[:, :rigid], solution.massless[:, :0], motions, vectors)
        result = self.solution(mass, massless, rigid)
        others = np.setdiff1d(np.arange(len(result.modes)), result.selected)
        if len(self._corrections(result)) or result.modes.growing[others].any():
            return solution
        return result


def _inverse_iteration(quadratic: Quadratic, s: complex, z: Complex, transposed: bool) -> AnyArray:
    """One step of inverse iteration at an approximate eigenvalue, P(s)^-1 P'(s) z, or with the transposed P."""
    shift: Any = s if s.imag else s.real
    for offset in (0.0, 1e-9, 1e-7):
        try:
            factor = quadratic.system.tableau.factor(s=shift * (1.0 + offset))
        except np.linalg.LinAlgError:
            continue
        motion = quadratic.solve(factor, quadratic.slope(s, z[:, None], transposed), transposed)
        if np.isfinite(motion).all():
            break
    return motion


def residuals(quadratic: Quadratic, basis: Array, vectors: Eigenvectors) -> Array:
    """Return the residuals (2, h) of the full equations for right and left vectors in a basis (size, n), in energy.

    |P(s)^-1 P(lambda) x| / |x| with s = |lambda| to a power of two, and for left vectors with the transposed P
    """
    values = vectors.values
    octave = np.round(np.log2(ABOVE * np.abs(values)))
    result = np.zeros((2, len(values)))
    sides = (vectors.right,) if quadratic.symmetric else (vectors.right, vectors.left)
    for exponent in np.unique(octave):
        used, speed = np.flatnonzero(octave == exponent), float(2.0**exponent)
        factor = quadratic.system.tableau.factor(s=speed)
        for i, side in enumerate(sides):
            z = basis @ side[:, used]
            motion = quadratic.solve(factor, quadratic.force(values[used], z, bool(i)), bool(i))
            sizes = [np.linalg.norm(quadratic.energy(part, speed), axis=0) for part in (motion, z)]
            result[i, used] = sizes[0] / sizes[1]
    return result if len(sides) > 1 else result[[0, 0]]


def error_bound(
    system: SparseEquations, small: Equations, result: Modes, vectors: Eigenvectors, errors: Array
) -> Array:
    """Return bounds of the relative errors of all eigenvalues, by truncation of the subspace and by rounding.

    |x| |y| / |lambda y^T P'(lambda) x| times the sum of both, in energy at the speed |lambda|; 0 without a vector

    ``errors`` (h,): truncation errors of the eigenvalues of the ``vectors``.
    """
    values, x, y = vectors.values, vectors.right, vectors.left
    speed = np.abs(values)
    slope = np.abs(np.einsum("ij,ij->j", y, 2.0 * values * (small.M @ x) + small.C @ x))
    weights = np.abs(small.row_stiffness)[:, None] + speed * np.abs(small.row_damping)[:, None]
    energy = [np.sqrt(speed**2 * (np.abs(small.inertia_factor @ v) ** 2).sum(axis=0)
                      + (weights * np.abs(small.elastic_rows @ v) ** 2).sum(axis=0)) for v in (x, y)]  # fmt: skip
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.nan_to_num(energy[0] * energy[1] / (slope * speed), nan=np.inf)
    return of_all_eigenvalues(result, vectors, condition * (errors + rounding(system)))


def of_all_eigenvalues(result: Modes, vectors: Eigenvectors, errors: Array) -> Array:
    """Return errors (h,) of some eigenvalues as those of all eigenvalues, with conjugates, 0 for the others."""
    bound = np.zeros(len(result.eigenvalues))
    bound[vectors.number] = errors
    first = vectors.number[vectors.number + 1 < len(bound)]
    first = first[result.eigenvalues[first + 1] == result.eigenvalues[first].conj()]
    bound[first + 1] = bound[first]
    return bound
