"""The modes of a large system in a subspace that grows until what is left of the whole system's equations is small.

(lambda^2 M + lambda (C + G) + K + N) x = 0, and y^T from the left, are solved in one subspace for both: the small dense
system that it makes (by the dense path) gives eigenvalues and vectors; a vector for which the whole system's equations
do not hold brings P(lambda)^-1 P'(lambda) x, the step of inverse iteration, into the subspace.

Source: Voss, BIT 44 (2004), an Arnoldi method for nonlinear eigenvalue problems; Schreiber, thesis, TU Berlin (2008),
two-sided methods.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.modes import modes as dense_modes
from mbsvib.modes.general import General
from mbsvib.sparse.first_order import independent, told_apart
from mbsvib.sparse.reduction import reduced

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.equations.equations import Equations
    from mbsvib.modes import Modes
    from mbsvib.sparse.quadratic import Quadratic

RTOL = 1e-13
# Right vectors are those of the whole system if no more than this is left of their equations, and eigenvalues if their
# error, to which the product of what is left on both sides is a bound, is no more than the other.
CONVERGED, ACCURATE = 1e-9, 1e-13
ROUNDS = 12
# Directions that are new by less than this share of their length are left out: what is left of them has lost digits.
NEW, STILL_NEW = 1e-10, 0.1
# P(s) measures what is left at a real s this much above |lambda|, where it is no eigenvalue of a stable system.
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


def eigenvectors(result: Modes, chosen: Index) -> Eigenvectors:
    """Return the eigenvalues and vectors of some modes of a small system.

    Parameters
    ----------
    result : Modes
        Its modes.
    chosen : array
        Numbers of modes.

    Returns
    -------
    Eigenvectors
        Without eigenvalues 0.
    """
    modal, starts = result.damped, result.starts
    if isinstance(modal, General):
        spectrum = modal.spectrum
        used = np.flatnonzero(np.isin(modal.mode, chosen))
        at = starts[modal.mode[used]]
        second = result.eigenvalues[at] != spectrum.values[used]
        number = at + (second & (starts[modal.mode[used] + 1] - at > 1))
        return Eigenvectors(spectrum.values[used], spectrum.right[:, used], spectrum.left[:, used], number)
    number = np.stack((2 * chosen, 2 * chosen + 1), axis=1).reshape(-1)
    values = result.eigenvalues[number]
    used = (values != 0.0) & (values.imag >= 0.0)
    number, shapes = number[used], modal.shapes.astype(complex)
    x = shapes[:, number // 2] if modal.vectors is None else shapes @ modal.vectors[:, number // 2, number % 2]
    return Eigenvectors(result.eigenvalues[number], x, x, number)


def parts(z: NDArray[np.inexact]) -> Array:
    """Return the real vectors that span complex ones and their conjugates."""
    return np.concatenate((z.real, z.imag), axis=1) if np.iscomplexobj(z) else np.asarray(z, dtype=float)


def joined(quadratic: Quadratic, basis: Array, more: Array, speed: float) -> Array:
    """Return a basis with what is new in some motions, orthonormal in kinetic energy, basis^T M basis = 1.

    Parameters
    ----------
    quadratic : Quadratic
        P(s).
    basis : array, shape (size, n)
        Orthonormal motions.
    more : array, shape (size, k)
        More of them.
    speed : float
        A frequency [rad/s] at which what is new is made a motion again that joints allow, of which rounding leaves
        little where that is a small part.

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
        kept = singular > new
        more = more @ (right[kept].T / singular[kept])
        if new == NEW:
            more = quadratic.solve(factor, quadratic.force(ABOVE * speed, more))
    return np.concatenate((basis, more), axis=1)


def converged(
    quadratic: Quadratic, mass: Array, light: Array, rigid: int, choose: Callable[[Modes], Index],
    apart: Callable[[Complex], Array], form: type[Equations],
) -> tuple[Equations, Modes, Array, Index]:  # fmt: skip
    """Return the small system of a subspace that has grown until chosen modes are those of the whole system.

    Parameters
    ----------
    quadratic : Quadratic
        P(s) of the whole system.
    mass, light : array, shape (size, n)
        Motions to start with, and others that move no mass.
    rigid : int
        Number of the first ones that meet no spring.
    choose : callable
        Numbers of the modes that are wanted, out of all of the small system.
    apart : callable
        Distance of eigenvalues from others that are not in the subspace.
    form : type
        The class of the small equations.

    Returns
    -------
    tuple
        The small system, its modes, a bound of the relative error of each eigenvalue by what the subspace lacks, and
        which modes were chosen.
    """
    system = quadratic.system
    for _ in range(ROUNDS):
        basis = np.concatenate((mass, light), axis=1)
        small = reduced(system, basis, rigid, form, light.shape[1])
        result: Modes = dense_modes(small, RTOL)
        chosen = choose(result)
        vectors = eigenvectors(result, chosen)
        sizes = left_over(quadratic, basis, vectors)
        errors = _bound(small, vectors, sizes, apart(vectors.values))
        late = np.stack(((sizes[0] > CONVERGED) | (errors > ACCURATE), errors > ACCURATE))
        more = [_step(quadratic, s, z, transposed)
                for transposed, side in ((False, vectors.right), (True, vectors.left))[: 2 - quadratic.symmetric]
                for s, z, wanted in zip(vectors.values, (basis @ side).T, late[int(transposed)], strict=True)
                if wanted]  # fmt: skip
        if not more:
            break
        speed = float(np.abs(vectors.values).max())
        new, massless = told_apart(system, parts(np.concatenate(more, axis=1)))
        mass = joined(quadratic, mass, new, speed)
        light = independent(system, np.concatenate((light, massless), axis=1))
        if mass.shape[1] + light.shape[1] == basis.shape[1]:
            break
    bound = np.zeros(len(result.eigenvalues))
    bound[vectors.number] = errors
    twin = vectors.number[vectors.number + 1 < len(bound)]
    twin = twin[result.eigenvalues[twin + 1] == result.eigenvalues[twin].conj()]
    bound[twin + 1] = bound[twin]
    return small, result, bound, chosen


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
    """Return what is left of the whole system's equations, as motion, relative to the vectors, in energy.

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
    for each in np.unique(octave):
        used, speed = np.flatnonzero(octave == each), float(2.0**each)
        factor = quadratic.system.tableau.factor(s=speed)
        for i, side in enumerate(sides):
            z = basis @ side[:, used]
            motion = quadratic.solve(factor, quadratic.force(values[used], z, bool(i)), bool(i))
            sizes = [np.linalg.norm(quadratic.energy(part, speed), axis=0) for part in (motion, z)]
            result[i, used] = sizes[0] / sizes[1]
    return result if len(sides) > 1 else result[[0, 0]]


def _bound(small: Equations, vectors: Eigenvectors, sizes: Array, apart: Array) -> Array:
    """Relative errors: what is left on both sides, by the condition of the eigenvalue and the distance to others."""
    values, x, y = vectors.values, vectors.right, vectors.left
    speed = np.abs(values)
    slope = np.abs(np.einsum("ij,ij->j", y, 2.0 * values * (small.M @ x) + small.C @ x))
    weights = np.abs(small.stiffness)[:, None] + speed * np.abs(small.damping)[:, None]
    energy = [np.sqrt(speed**2 * (np.abs(small.inertia_factor @ v) ** 2).sum(axis=0)
                      + (weights * np.abs(small.elastic_rows @ v) ** 2).sum(axis=0)) for v in (x, y)]  # fmt: skip
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.nan_to_num(energy[0] * energy[1] / (slope * speed), nan=np.inf)
    first, second = sizes.max(axis=0), sizes[0] * sizes[1] / np.maximum(apart / speed, CONVERGED)
    return np.asarray(condition * np.minimum(first, second))
