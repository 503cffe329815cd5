"""Damped modes in energy coordinates.

In the undamped modes' coordinates the damping matrix is Gamma = Phi^T C Phi. Where it is diagonal (classical damping)
every mode has its own quadratic equation. Otherwise the eigenvalues are those of A = [[0, Omega], [-Omega, -Gamma]],
whose norm is the largest frequency and not its square, after one Rayleigh step (``rayleigh``). If strong dampers make
the result inaccurate, right and left vectors are refined on the factors (``general_refinement``), and if this is not
enough, the dampers' forces become unknowns (``strong_damping``).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh, lapack

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.fast_init import fast_init
from mbsvib.equations.equations import Equations
from mbsvib.equations.unresisted_motion import completed_basis
from mbsvib.linalg.products import product_with_zeros, weighted_gram
from mbsvib.linalg.rank import EPS
from mbsvib.modes.classical import (
    COMMUTES,
    IN_DOUBT,
    classical_damping,
    classical_errors,
    damper_rows,
    quadratic_roots,
    rounding_of_sums,
)
from mbsvib.modes.pairs import pair_numbers, with_neighbours
from mbsvib.modes.rayleigh import Forms, both, forms_in, rayleigh
from mbsvib.modes.strong_damping import DamperForces, improved
from mbsvib.modes.undamped import CLEAN, Undamped
from mbsvib.modes.zero_subspaces import unbraked

# Columns of work space with which LAPACK's eigenvalues go block by block.
WORK = 64
# Share of the required accuracy that the doubt may use; errors of the undamped modes need the rest.
MARGIN = 0.25


# Eigenvalues, vectors, slopes and bounds of their errors.
_Eigensolution = tuple["Complex", "Complex", "Complex", "Array"]


@fast_init
@dataclass(frozen=True, slots=True)
class Damped:
    """Damped modes in the basis ``shapes`` (m, m): ``pairs`` (m, 2) of eigenvalues, ``errors`` (m, 2) relative.

    ``gamma`` is Phi^T C Phi, (m,) where damping is ``classical`` and (m, m) elsewhere; ``square`` (m,) is omega^2 of
    the basis. ``vectors`` (m, m, 2) are the modes y in the basis and ``slopes`` (m, 2) their y^T (2 lambda + Gamma) y,
    which is 0 for a defective pair; both None where the modes are the basis itself.
    """

    pairs: Complex
    errors: Array
    shapes: Array
    square: Array
    gamma: Array
    classical: str
    vectors: Complex | None
    slopes: Complex | None


def damped(system: Equations, basis: Undamped, rtol: float, follows_stiffness: bool) -> Damped | None:
    """Return the damped modes, (lambda^2 M + lambda C + K) phi = 0; ``follows_stiffness`` is the result of
    ``proportional``.

    Pairs of eigenvalues are in ascending order of their natural frequency. The result is None if the undamped modes are
    too inaccurate to decide whether damping couples them, or to bound the errors: then more accurate ones are needed.
    """
    reason, gamma = classical_damping(system, basis, follows_stiffness)
    if reason == IN_DOUBT:
        return None
    if reason:
        rounding = None
        if reason == COMMUTES:
            forms = forms_in(_factors(system), basis.shapes, np.diag(gamma), basis.rigid)
            basis, gamma = _of_factors(basis, forms), gamma / forms.matrices[0].diagonal()
            rounding = rounding_of_sums(system.elastic_rows, system.row_damping, basis.shapes)
        pairs = quadratic_roots(basis.square, gamma)
        errors = classical_errors(pairs, basis, gamma, rounding)
        return Damped(pairs, errors, basis.shapes, basis.square, gamma, reason, None, None)
    shapes, gamma, free = _split_rigid(system, basis, gamma)
    forms = forms_in(_factors(system), shapes, gamma, basis.rigid)
    eigensolution = _coupled(system, shapes, (basis, forms, free), rtol)
    if eigensolution is None:
        return None
    pairs, vectors, slopes, errors = eigensolution
    return Damped(pairs, errors, shapes, basis.square, gamma, "", vectors, slopes)


def _split_rigid(system: Equations, basis: Undamped, gamma: Array) -> tuple[Array, Array, int]:
    """Rotate the rigid-body modes so that the undamped ones come first; return their number too."""
    r, w = basis.rigid, system.inertia_factor
    if r == 0:
        return basis.shapes, gamma, 0
    shapes = basis.shapes.copy()
    free = unbraked(system, shapes[:, :r])
    shapes[:, :r], count = completed_basis(w, free, shapes[:, :r]), free.shape[1]
    # diagonalize the damping of the others; the most strongly damped comes last
    relative_motion = product_with_zeros(system.elastic_rows, shapes[:, :r])
    _, turn = np.linalg.eigh(weighted_gram(relative_motion, system.row_damping)[count:, count:])
    shapes[:, count:r] = shapes[:, count:r] @ turn
    relative_motion = product_with_zeros(system.elastic_rows, shapes)
    relative_motion[:, :count] = 0.0
    return shapes, weighted_gram(relative_motion, system.row_damping), count


def _factors(system: Equations) -> tuple[Array, Array, Array, Array]:
    return system.inertia_factor, system.elastic_rows, system.row_stiffness, system.row_damping


def _of_factors(basis: Undamped, forms: Forms) -> Undamped:
    """Take frequencies and lengths of a ``mixed`` basis from the factors, whose rounding is added to the errors."""
    if not basis.mixed:
        return basis
    (mass, _, stiffness), (of_mass, _, of_stiffness) = (
        np.einsum("kii->ki", part) for part in (forms.matrices, forms.magnitudes))  # fmt: skip
    errors = basis.errors + 0.5 * EPS * (of_mass / mass + of_stiffness / stiffness)
    return replace(basis, square=stiffness / mass, shapes=basis.shapes / np.sqrt(mass), errors=errors)


def _coupled(
    system: Equations, shapes: Array, parts: tuple[Undamped, Forms, int], rtol: float
) -> _Eigensolution | None:
    """Eigenvalues of the modes that damping couples: pairs (m, 2), vectors (m, m, 2), slopes (m, 2), errors (m, 2);
    None if the basis is too inaccurate for them.

    Until they are paired, eigenvalues with Im > 0 come first, and also represent their conjugates.
    """
    basis, forms, free = parts
    r = basis.rigid
    values, y = _energy_eigenvalues(basis, forms.matrices[1], free)
    values, y, slope, bound, uncertainty = rayleigh(
        values, y, forms.with_errors(basis.square, basis.errors), _complex_count(values))
    uncertain = float(uncertainty.max(initial=0.0)) > MARGIN * rtol
    if basis.mixed > CLEAN and (uncertain or float(bound.max(initial=0.0)) > rtol):
        return None
    if uncertain:
        eigensolution = values, y, slope, bound
        values, y, slope, bound = _uncertain_refined(system, shapes, parts, (eigensolution, uncertainty), MARGIN * rtol)
    which = pair_numbers(values, y, free, r)
    pairs = np.where(which < 0, 0.0, values.take(which))
    order = np.abs(pairs[:, 0] * pairs[:, 1]).argsort(kind="stable")
    which, pairs = which.take(order, axis=0), pairs.take(order, axis=0)
    eigensolution = pairs, y.take(which, axis=1), slope.take(which), bound.take(which)
    turns = np.where(which[:, 0] == which[:, 1], -1.0, 1.0)
    for part in eigensolution[:3]:
        part.imag[..., 1] *= turns
    return _with_rigid(eigensolution, forms.matrices[1], free, r) if r else eigensolution


def _with_rigid(eigensolution: _Eigensolution, gamma: Array, free: int, rigid: int) -> _Eigensolution:
    """Put the undamped rigid-body modes in front, and the shapes of the damped ones at their eigenvalue 0."""
    pairs, vectors, slopes, errors = eigensolution
    at = np.arange(free, rigid)
    rest = at - free  # they come first
    vectors[:, rest, 0], errors[rest, 0] = 0.0, 0.0
    vectors[at, rest, 0] = 1.0
    slopes[rest, 0] = gamma[at, at]
    unit_vectors, zeros = np.zeros((len(vectors), free, 2)), np.zeros((free, 2))
    unit_vectors[np.arange(free), np.arange(free)] = 1.0
    vectors = np.concatenate((unit_vectors, vectors), axis=1)
    return np.concatenate((zeros, pairs)), vectors, np.concatenate((zeros, slopes)), np.concatenate((zeros, errors))


def _complex_count(values: Complex) -> int:
    """Return how many of the eigenvalues also represent their conjugates."""
    return int(np.count_nonzero(values.imag))


def _energy_eigenvalues(basis: Undamped, gamma: Array, free: int) -> tuple[Complex, Complex]:
    """Eigenvalues and velocity parts (m, n) of the eigenvectors in energy coordinates (Omega eta, eta')."""
    omega = basis.omega[basis.rigid :]
    m, flexible = len(basis.square), len(omega)
    size, rigid = flexible + m - free, basis.rigid
    a = np.zeros((size, size), order="F")
    a[flexible + rigid - free :, :flexible].flat[:: flexible + 1] = -np.copysign(omega, basis.square[rigid:])
    a[:flexible, flexible + rigid - free :].flat[:: flexible + 1] = omega
    a[flexible:, flexible:] = -gamma[free:, free:]
    real, imag, _, vectors, failed = lapack.dgeev(a, compute_vl=0, lwork=max(1, WORK * size), overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the eigenvalues of the damped modes did not converge")
    if (torn := rigid - free - int(np.count_nonzero(imag == 0.0))) > 0:
        _keep_real(real, imag, vectors[flexible:], (gamma[free:, free:], basis.square[free:]), torn // 2)
    upper, creeping = (imag > 0.0).nonzero()[0], (imag == 0.0).nonzero()[0]
    complex_count = len(upper)
    order = np.concatenate((upper, creeping))
    values, y = np.empty(len(order), dtype=complex), np.zeros((m, len(order)), dtype=complex)
    values.real, values.imag = real.take(order), imag.take(order)
    if np.count_nonzero(values) < len(values):  # no eigenvalue is exactly 0 here: that of a slow motion was rounded off
        values[values == 0.0] = -EPS * np.abs(values).max()
    parts = vectors[flexible:]
    y.real[free:], y.imag[free:, :complex_count] = parts.take(order, axis=1), parts.take(upper + 1, axis=1)
    return values, y


def _keep_real(real: Array, imag: Array, y: Array, forms: tuple[Array, Array], count: int) -> None:
    """Replace, in place, the ``count`` conjugate pairs nearest to the real axis by two real eigenvalues each.

    Each damped rigid-body mode has a real eigenvalue beyond those that oscillating modes may have, as y^T (2 lambda +
    Gamma) y < 0 there. Rounding tears two that coincide apart to a pair. ``real``, ``imag`` (n,), ``y`` (m, n): as of
    LAPACK, the real and the imaginary part of a vector side by side. ``forms``: Gamma (m, m) and Omega^2 (m,).
    """
    gamma, square = forms
    upper = (imag > 0.0).nonzero()[0]
    for i in upper[np.argsort(imag[upper] / np.abs(real[upper] + 1j * imag[upper]))[:count]].tolist():
        own, value = y[:, i : i + 2], real[i]
        braked = gamma @ own
        residual = own.T @ (value * (value * own + braked) + square[:, None] * own)
        moves, mixing = eigh(residual, -own.T @ (2.0 * value * own + braked))
        real[i : i + 2], imag[i : i + 2], own[:] = value + moves, 0.0, own @ mixing


def _uncertain_refined(
    system: Equations, shapes: Array, parts: tuple[Undamped, Forms, int], estimate: tuple[_Eigensolution, Array],
    rtol: float,
) -> _Eigensolution:  # fmt: skip
    """Inaccurate eigenvalues from the factors, or with the dampers' forces as unknowns, whichever is more accurate."""
    basis, forms, free = parts
    basis = _of_factors(basis, forms)
    count = len(estimate[0][0]) + _complex_count(estimate[0][0])
    best, uncertainty = estimate
    candidate = _from_factors(system, shapes, count, rtol)
    if candidate is not None and float(candidate[3].max()) < float(best[3].max()):
        best, uncertainty = candidate, candidate[3]
    dampers = damper_rows(system, shapes)
    if dampers is None or float(best[3].max()) <= rtol:
        return best
    with_forces = _with_forces(best, dampers, uncertainty, basis, free, rtol)
    return min(best, with_forces, key=lambda candidate: float(candidate[3].max()))


def _from_factors(system: Equations, shapes: Array, count: int, rtol: float) -> _Eigensolution | None:
    """Values, vectors, slopes and bounds of all eigenvalues but 0; None if they are not ``count``."""
    from mbsvib.modes.general import spectrum

    try:
        _, solution = spectrum(system, rtol)
    except np.linalg.LinAlgError:  # dampers hide which motions have the eigenvalue 0
        return None
    complex_count = int(np.count_nonzero(solution.turns))
    order = np.argsort(~solution.turns, kind="stable")
    if complex_count + len(order) != count or not np.isfinite(solution.errors).all():
        return None
    inertia, relative_motion = system.inertia_factor @ solution.right, system.elastic_rows @ solution.right
    slope = 2.0 * solution.values * (inertia**2).sum(axis=0) + system.row_damping @ relative_motion**2
    y = shapes.T @ (system.M @ solution.right)
    size = np.linalg.norm(y, axis=0)
    return solution.values[order], (y / size)[:, order], (slope / size**2)[order], solution.errors[order]


def _with_forces(
    eigensolution: _Eigensolution, dampers: tuple[Array, Array], uncertainty: Array, basis: Undamped, free: int,
    rtol: float,
) -> _Eigensolution:
    """Values, vectors, slopes and bounds; inaccurate ones with the dampers' forces as unknowns if that is better."""
    complex_count = _complex_count(eigensolution[0])
    values, y, slope = (both(part, complex_count) for part in eigensolution[:3])
    bound, uncertainty = (np.concatenate((part, part[:complex_count])) for part in (eigensolution[3], uncertainty))
    equations = DamperForces(basis.square[free:], dampers[0][:, free:], basis.rigid - free)
    new, shapes, slopes, errors, cluster = improved(equations, values, uncertainty, rtol)
    motion = np.zeros_like(y)
    motion[free:] = shapes
    size = np.abs(slopes * new)
    # the equations with forces take the basis as exact: products of different modes are rounding as well
    part = np.sqrt(2.0 * (basis.errors + EPS))[:, None] * np.abs(motion)
    trust = (np.abs(new) * part.sum(axis=0)) ** 2 + (basis.omega @ part) ** 2
    cancel = EPS * (dampers[1] @ np.abs(motion))  # rounding of the dampers' relative motions
    trust += 2.0 * np.abs(new) * (cancel * (np.abs(dampers[0] @ motion) + cancel)).sum(axis=0)
    errors += np.divide(trust, size, out=np.zeros_like(size), where=size > 0.0)
    largest = np.zeros((len(values), 2))
    np.maximum.at(largest, cluster, np.stack((errors, bound), axis=1))
    better = (largest[:, 0] < largest[:, 1])[cluster]  # values of a cluster have no order
    values[better], y[:, better], slope[better], bound[better] = (
        new[better], motion[:, better], slopes[better], errors[better]
    )  # fmt: skip
    upper, real = np.nonzero(values.imag > 0.0)[0], np.nonzero(values.imag == 0.0)[0]
    gap = np.abs(values[:, None] - values)
    np.fill_diagonal(gap, np.inf)
    distance = np.where(cluster[:, None] == cluster, np.inf, gap)
    nearest = np.argmin(np.abs(values.conj()[upper, None] - values), axis=1) if len(upper) else upper
    complete = 2 * len(upper) + len(real) == len(values) and len(set(nearest.tolist())) == len(upper)
    if not complete or (distance <= 2.0 * bound * np.abs(values)).any():
        return eigensolution  # two have met, or a conjugate is missing
    order = np.concatenate((upper, real))
    return values[order], y[:, order], slope[order], with_neighbours(np.abs(values), bound, gap)[order]
