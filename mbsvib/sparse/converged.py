"""The modes of a large system in a subspace that grows until the residual of the full system is small.

(lambda^2 M + lambda (C + G) + K + N) x = 0, and y^T from the left, are solved in one subspace for both: the projected
small dense system (by the dense path) gives eigenvalues and vectors. If the residual of a vector in the full system is
too large, P(lambda)^-1 P'(lambda) x, a step of inverse iteration, is added to the subspace.

Source: Voss, BIT 44 (2004), an Arnoldi method for nonlinear eigenvalue problems; Schreiber, thesis, TU Berlin (2008),
two-sided methods.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.modes import modes as dense_modes
from mbsvib.modes.general import General
from mbsvib.sparse.first_order import independent, split_massless
from mbsvib.sparse.reduction import RTOL, reduced, rounding

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.equations.equations import Equations
    from mbsvib.modes import Modes
    from mbsvib.sparse.equations import SparseEquations
    from mbsvib.sparse.quadratic import Quadratic

# Largest relative residual of right vectors, and largest relative error of eigenvalues, which is bounded by the product
# of the residuals from both sides.
CONVERGED, ACCURATE = 1e-9, 1e-13
ROUNDS = 12
# If less than this share of a direction remains after orthogonalization, it is left out: it has lost its digits.
NEW, STILL_NEW = 1e-10, 0.1
# Residuals are measured with P(s) at a real s, this factor above |lambda|: it is no eigenvalue of a stable system.
ABOVE = 1.3


@dataclass(frozen=True, slots=True)
class Eigenvectors:
    """Eigenvalues ``values`` (h,) that are not 0, those of conjugate pairs with positive imaginary part, with ``right``
    and ``left`` vectors in the small system (n, h), and their ``number`` (h,) among the eigenvalues of its modes.
    """

    values: Complex
    right: Complex
    left: Complex
    number: Index


def eigenvectors(result: Modes, numbers: Index) -> Eigenvectors:
    """Return the eigenvalues and vectors of some modes of a small system.

    Parameters
    ----------
    result : Modes
        Its modes.
    numbers : array
        Numbers of modes.

    Returns
    -------
    Eigenvectors
        Without eigenvalues 0.
    """
    modal, starts = result.damped, result.starts
    if isinstance(modal, General):
        spectrum = modal.spectrum
        used = np.flatnonzero(np.isin(modal.mode, numbers))
        at = starts[modal.mode[used]]
        second = result.eigenvalues[at] != spectrum.values[used]
        number = at + (second & (starts[modal.mode[used] + 1] - at > 1))
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


def joined(quadratic: Quadratic, basis: Array, more: Array, speed: float) -> Array:
    """Return a basis extended by some motions, orthonormal in kinetic energy, basis^T M basis = 1.

    Parameters
    ----------
    quadratic : Quadratic
        P(s).
    basis : array, shape (size, n)
        Orthonormal motions.
    more : array, shape (size, k)
        More of them.
    speed : float
        A frequency [rad/s] at which new directions are projected on motions that the joints allow. Small remainders
        violate the constraints by rounding.

    Returns
    -------
    array, shape (size, n + new)
        The motions.
    """
    if not more.shape[1]:
        return basis
    w = quadratic.w
    old = w @ basis
    length = np.linalg.norm(w @ more, axis=0)
    more = more[:, length > 0.0] / length[length > 0.0]
    factor = quadratic.system.tableau.factor(s=ABOVE * speed)
    for new in (NEW, STILL_NEW):
        for _ in range(2):
            rows = w @ more
            share = old.T @ rows
            more, rows = more - basis @ share, rows - old @ share
        _, singular, right = np.linalg.svd(rows, full_matrices=False)
        significant = singular > new
        more = more @ (right[significant].T / singular[significant])
        if new == NEW:
            more = quadratic.solve(factor, quadratic.force(ABOVE * speed, more))
    return np.concatenate((basis, more), axis=1)


@dataclass(frozen=True, slots=True)
class Solution:
    """The ``small`` system of motions with ``mass`` (size, n), of which the first ``rigid`` deform no spring, and
    ``light`` ones without mass; its ``modes``, the numbers ``selected`` of the wanted ones, and a ``bound`` of the
    relative error of each eigenvalue by the truncation of the basis.
    """

    mass: Array
    light: Array
    rigid: int
    small: Equations
    modes: Modes
    selected: Index
    bound: Array
    vectors: Eigenvectors
    left_over: Array

    @property
    def basis(self) -> Array:
        """All motions, those without mass last."""
        return np.concatenate((self.mass, self.light), axis=1)


@dataclass(frozen=True)
class Galerkin:
    """Modes of a large system from a subspace: ``choose`` returns the numbers of the wanted modes among all modes of
    the small system, of the class ``form``, and ``apart`` is the distance of eigenvalues from those not in the
    subspace.
    """

    quadratic: Quadratic
    choose: Callable[[Modes], Index]
    apart: Callable[[Complex], Array]
    form: type[Equations]

    def solution(self, mass: Array, light: Array, rigid: int) -> Solution:
        """Return the modes of a given subspace."""
        basis = np.concatenate((mass, light), axis=1)
        small = reduced(self.quadratic.system, basis, rigid, self.form, light.shape[1])
        result: Modes = dense_modes(small, RTOL)
        selected = self.choose(result)
        vectors = eigenvectors(result, selected)
        sizes = left_over(self.quadratic, basis, vectors)
        apart = np.maximum(self.apart(vectors.values) / np.abs(vectors.values), CONVERGED)
        lacks = np.minimum(sizes.max(axis=0), sizes[0] * sizes[1] / apart)
        bound = error_bound(self.quadratic.system, small, result, vectors, lacks)
        return Solution(mass, light, rigid, small, result, selected, bound, vectors, sizes)

    def converged(self, mass: Array, light: Array, rigid: int) -> Solution:
        """Return the modes of a subspace that grows until the selected ones satisfy the full system's equations."""
        for _ in range(ROUNDS):
            result = self.solution(mass, light, rigid)
            more = self._steps(result)
            if not more:
                break
            mass, light = self.joined(mass, light, np.concatenate(more, axis=1), result.vectors)
            if mass.shape[1] + light.shape[1] == len(result.small.M):
                break
        return result

    def joined(
        self, mass: Array, light: Array, more: NDArray[Any], vectors: Eigenvectors
    ) -> tuple[Array, Array]:
        """Return motions with mass, and those without mass, extended by more of them."""
        new, massless = split_massless(self.quadratic.system, parts(more))
        speed = float(np.abs(vectors.values).max(initial=1.0))
        return (joined(self.quadratic, mass, new, speed),
                independent(self.quadratic.system, np.concatenate((light, massless), axis=1)))  # fmt: skip

    def _steps(self, solution: Solution) -> list[NDArray[Any]]:
        """Steps of inverse iteration for the vectors that do not satisfy the full system's equations."""
        vectors, inaccurate = solution.vectors, solution.bound[solution.vectors.number] > ACCURATE
        late = (inaccurate | (solution.left_over[0] > CONVERGED), inaccurate)
        return [_step(self.quadratic, s, z, transposed)
                for transposed, side in ((False, vectors.right), (True, vectors.left))[: 2 - self.quadratic.symmetric]
                for s, z, wanted in zip(vectors.values, (solution.basis @ side).T, late[int(transposed)], strict=True)
                if wanted]  # fmt: skip

    def narrowed(self, solution: Solution) -> Solution:
        """Return the selected modes in the subspace of their right and left vectors and of free motions. The larger
        subspace is returned if other modes of the smaller one would be as near, or unstable.
        """
        vectors, modal, rigid = solution.vectors, solution.modes.damped, solution.rigid
        sides: list[NDArray[Any]] = [vectors.right, vectors.left][: 2 - self.quadratic.symmetric]
        if isinstance(modal, General) and (solution.modes.eigenvalues == 0.0).any():
            sides += [modal.state.show @ modal.state.right, modal.state.force.T @ modal.state.left]
        own = solution.basis @ parts(np.concatenate(sides, axis=1))
        result = self.solution(*self.joined(solution.mass[:, :rigid], solution.light[:, :0], own, vectors), rigid)
        others = np.setdiff1d(np.arange(len(result.modes)), result.selected)
        if len(self._steps(result)) or result.modes.growing[others].any():
            return solution
        return result


def _step(quadratic: Quadratic, s: complex, z: Complex, transposed: bool) -> NDArray[Any]:
    """P(s)^-1 P'(s) z, or the same of the transposed: one step of inverse iteration at an eigenvalue's estimate."""
    shift: Any = s if s.imag else s.real
    for aside in (0.0, 1e-9, 1e-7):
        try:
            factor = quadratic.system.tableau.factor(s=shift * (1.0 + aside))
        except np.linalg.LinAlgError:
            continue
        motion = quadratic.solve(factor, quadratic.slope(s, z[:, None], transposed), transposed)
        if np.isfinite(motion).all():
            break
    return motion


def left_over(quadratic: Quadratic, basis: Array, vectors: Eigenvectors) -> Array:
    """Return the residual of the full system's equations as a motion, relative to the vectors, in energy.

    |P(s)^-1 P(lambda) x| / |x| with s = |lambda| to a power of two, and the same from the left

    Parameters
    ----------
    quadratic : Quadratic
        P(s).
    basis : array, shape (size, n)
        The subspace.
    vectors : Eigenvectors
        Eigenvalues with both vectors in it.

    Returns
    -------
    array, shape (2, h)
        For right and left vectors.
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
    system: SparseEquations, small: Equations, result: Modes, vectors: Eigenvectors, lacks: Array
) -> Array:
    """Return bounds of the relative errors of eigenvalues: truncation of the subspace and rounding of displacements.

    |x| |y| / |lambda y^T P'(lambda) x| times both, in energy at the speed |lambda|

    Parameters
    ----------
    system : SparseEquations
        The full system.
    small : Equations
        That of the subspace.
    result : Modes
        Its modes.
    vectors : Eigenvectors
        Those that are bounded.
    lacks : array, shape (h,)
        Products of their residuals from both sides.

    Returns
    -------
    array
        One for each eigenvalue of the modes, 0 for others.
    """
    values, x, y = vectors.values, vectors.right, vectors.left
    speed = np.abs(values)
    slope = np.abs(np.einsum("ij,ij->j", y, 2.0 * values * (small.M @ x) + small.C @ x))
    weights = np.abs(small.row_stiffness)[:, None] + speed * np.abs(small.row_damping)[:, None]
    energy = [np.sqrt(speed**2 * (np.abs(small.inertia_factor @ v) ** 2).sum(axis=0)
                      + (weights * np.abs(small.elastic_rows @ v) ** 2).sum(axis=0)) for v in (x, y)]  # fmt: skip
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.nan_to_num(energy[0] * energy[1] / (slope * speed), nan=np.inf)
    bound = np.zeros(len(result.eigenvalues))
    bound[vectors.number] = condition * (lacks + rounding(system))
    twin = vectors.number[vectors.number + 1 < len(bound)]
    twin = twin[result.eigenvalues[twin + 1] == result.eigenvalues[twin].conj()]
    bound[twin + 1] = bound[twin]
    return bound
