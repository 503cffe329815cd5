"""Damped modes in energy coordinates.

In the undamped modes' coordinates the damping matrix is Gamma = Phi^T C Phi. Where it is diagonal (classical damping)
every mode is a quadratic of its own. Elsewhere the eigenvalues are those of A = [[0, Omega], [-Omega, -Gamma]], whose
norm is the largest frequency and not its square, each improved by Newton steps on its own two-sided Rayleigh
quadratic lambda^2 (y^T y) + lambda (y^T Gamma y) + y^T Omega^2 y = 0. Where strong dampers leave that in doubt, the
factors themselves improve right and left vectors (``general_refinement``), and if need be the dampers' forces are made
unknowns (``strong_damping``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.unresisted_motion import completed, product
from mbsvib.linalg.products import product as weighted
from mbsvib.modes.rigid_motions import unbraked
from mbsvib.modes.strong_damping import forces, improved

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.modes.undamped import Undamped


EPS = float(np.finfo(float).eps)
# Damping couples two modes if |Gamma_ij| exceeds this share of sqrt(Gamma_ii Gamma_jj); what is left out is that small.
CLASSICAL = 1e-13
NO_DAMPER = "no damper"
COMMUTES = "damping commutes with mass and stiffness"
# A Newton step larger than this share of the eigenvalue is no correction of rounding errors: a nearly defective pair.
CORRECTION = 1e-4
# Of the accuracy asked for, this share may be in doubt; errors of the undamped modes need some of it too.
MARGIN = 0.25


@dataclass(frozen=True, slots=True)
class _Forms:
    """Mass, damping and stiffness in the basis, from the factors: no more than rounding away from 1, Gamma, Omega^2,
    yet that rounding counts where an eigenvalue is asked for to the last digit. ``spread`` bounds Gamma's rounding.
    """

    mass: Array
    damping: Array
    stiffness: Array
    spread: Array


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


def damped(system: Equations, basis: Undamped, rtol: float) -> Damped:
    """Return the damped modes, (lambda^2 M + lambda C + K) phi = 0.

    Parameters
    ----------
    system : Equations
        The equations of motion.
    basis : Undamped
        Its undamped modes.
    rtol : float
        Relative accuracy asked of every eigenvalue.

    Returns
    -------
    Damped
        Pairs of eigenvalues, in ascending order of their natural frequency.
    """
    reason, gamma = classical_damping(system, basis)
    if reason:
        pairs = quadratic_roots(basis.square, gamma)
        summed = _rounding(system.elastic_rows, system.damping, basis.shapes) if reason == COMMUTES else 0.0
        errors = _classical_errors(pairs, basis, gamma, summed)
        return Damped(pairs, errors, basis.shapes, basis.square, gamma, reason, None, None)
    shapes, gamma, free = _split_rigid(system, basis, gamma)
    forms = _forms(system, shapes, gamma, basis.rigid)
    pairs, vectors, slopes, errors = _coupled(system, shapes, (basis, forms, free), rtol)
    return Damped(pairs, errors, shapes, basis.square, gamma, "", vectors, slopes)


def classical_damping(system: Equations, basis: Undamped) -> tuple[str, Array]:
    """Return why damping is classical ("" if it is not) and Gamma, as its diagonal (m,) or whole (m, m)."""
    c, k = system.damping, system.stiffness
    if not np.count_nonzero(c):
        return NO_DAMPER, np.zeros(system.dof)
    if proportional(system):
        return "damping proportional to stiffness", float(np.add.reduce(c / k) / len(c)) * basis.square
    used = c.nonzero()[0]
    c = c.take(used)
    half = system.elastic_rows.take(used, axis=0).dot(basis.shapes) * np.sqrt(np.abs(c))[:, None]
    gamma = half.T.dot(half * np.sign(c)[:, None] if np.count_nonzero(c < 0.0) else half)
    size = np.einsum("ij,ij->j", half, half)
    limit = CLASSICAL * np.sqrt(size[:, None] * size)
    np.fill_diagonal(limit, np.inf)
    if np.count_nonzero(np.abs(gamma) <= limit) == gamma.size:
        return COMMUTES, gamma.diagonal().copy()
    return "", gamma


def proportional(system: Equations) -> bool:
    """Return whether every damping is the same multiple of its stiffness, none included: known without the modes."""
    c, k = system.damping, system.stiffness
    if not np.count_nonzero(c):
        return True
    if np.count_nonzero(k) < len(k):
        return False
    ratio = c / k
    return bool(ratio[ratio.argmax()] - ratio[ratio.argmin()] <= 4.0 * EPS * abs(ratio[0]))


def quadratic_roots(square: Array, gamma: Array) -> Complex:
    """Return both roots of lambda^2 + gamma lambda + square = 0 for every mode, (m, 2), without cancellation."""
    half = 0.5 * gamma
    omega: Array = np.sqrt(np.abs(square))
    inside = np.where(square > 0.0, (half - omega) * (half + omega), half * half - square)
    root = np.sqrt(np.abs(inside))
    pairs: Complex = np.empty((len(square), 2), dtype=complex)
    if np.count_nonzero(inside < 0.0) == len(inside):
        pairs.real = 0.0 - half[:, None]
        pairs.imag[:, 0], pairs.imag[:, 1] = root, -root
        return pairs
    big = -(half + np.where(half >= 0.0, root, -root))
    small = np.divide(square, big, out=np.zeros_like(big), where=big != 0.0)
    oscillates = inside < 0.0
    pairs[:, 0] = np.where(oscillates, -half + 1j * root, small)
    pairs[:, 1] = np.where(oscillates, -half - 1j * root, big)
    return pairs


def _rounding(rows: Array, damping: Array, shapes: Array) -> Array:
    """Rounding of the diagonal of Phi^T D^T diag(c) D Phi, (..., m): dampers may push, and rows may cancel."""
    terms = np.abs(rows @ shapes) * (np.abs(rows) @ np.abs(shapes))
    return np.asarray(4.0 * EPS * np.einsum("...s,...sm->...m", np.abs(damping), terms))


def _classical_errors(pairs: Complex, basis: Undamped, gamma: Array, summed: Array | float) -> Array:
    """First-order errors of the roots: those of omega, of the same order of gamma, and of gamma's own sum."""
    first, second = pairs.T
    size = np.abs(pairs)
    gap, moves = np.abs(first - second)[:, None], size > 0.0
    moved = 2.0 * np.abs(basis.square) + np.abs(gamma) * np.maximum(size[:, 0], size[:, 1])
    # stiffness of both signs may cancel to an omega of exactly zero, whose relative error is not finite
    spread = np.multiply(basis.errors, moved, out=np.zeros(len(moved)), where=moved > 0.0)[:, None]
    spread = spread + np.reshape(summed, (-1, 1)) * size
    # at critical damping the root moves with the square root of a perturbation
    worst = np.sqrt(spread)
    np.minimum(np.divide(spread, gap, out=worst.copy(), where=gap > 0.0), worst, out=worst)
    relative: Array = np.divide(worst, size, out=np.zeros(size.shape), where=moves)
    relative += 2.0 * EPS * moves
    return relative


def _split_rigid(system: Equations, basis: Undamped, gamma: Array) -> tuple[Array, Array, int]:
    """Turn the rigid-body modes so that those which no damper touches come first; return their number too."""
    r, w = basis.rigid, system.inertia_factor
    if r == 0:
        return basis.shapes, gamma, 0
    shapes = basis.shapes.copy()
    free = unbraked(system, shapes[:, :r])
    shapes[:, :r], count = completed(w, free, shapes[:, :r]), free.shape[1]
    # each of the others by dampers of its own, the strongest last
    moved = product(system.elastic_rows, shapes[:, :r])
    _, turn = np.linalg.eigh(weighted(moved, system.damping)[count:, count:])
    shapes[:, count:r] = shapes[:, count:r] @ turn
    moved = product(system.elastic_rows, shapes)
    moved[:, :count] = 0.0
    return shapes, weighted(moved, system.damping), count


def _forms(system: Equations, shapes: Array, gamma: Array, rigid: int) -> _Forms:
    h = system.inertia_factor @ shapes
    e = system.elastic_rows @ shapes
    stiffness = e.T @ (e * system.stiffness[:, None])
    stiffness[:rigid] = stiffness[:, :rigid] = 0.0
    cancel = np.abs(system.elastic_rows) @ np.abs(shapes)
    return _Forms(h.T @ h, gamma, stiffness, cancel.T @ (np.abs(e) * np.abs(system.damping)[:, None]))


def _dampers(system: Equations, shapes: Array) -> Array | None:
    """Rows L with L^T L = Gamma; None where a damper pushes."""
    used = system.damping != 0.0
    if (system.damping < 0.0).any():
        return None
    rows: Array = (system.elastic_rows[used] @ shapes) * np.sqrt(system.damping[used])[:, None]
    return rows


def _coupled(
    system: Equations, shapes: Array, parts: tuple[Undamped, _Forms, int], rtol: float
) -> tuple[Complex, Complex, Complex, Array]:
    """Eigenvalues of the modes that damping couples: pairs (m, 2), vectors (m, m, 2), slopes (m, 2), errors (m, 2)."""
    basis, forms, free = parts
    m, r = len(basis.square), basis.rigid
    values, right = _energy_eigenvalues(basis, forms.damping, free)
    y = np.zeros((m, len(values)), dtype=complex)
    y[free:] = right * (1.0 / _lengths(right))
    values, y, slope, bound, doubt = _rayleigh(values, y, forms, basis)
    if float(doubt.max(initial=0.0)) > MARGIN * rtol:
        found = values, y, slope, bound
        values, y, slope, bound = _doubtful(system, shapes, parts, (found, doubt), MARGIN * rtol)
    first, second = _pair(values, y, free, r)
    pairs = np.zeros((m, 2), dtype=complex)
    vectors = np.zeros((m, m, 2), dtype=complex)
    slopes = np.zeros((m, 2), dtype=complex)
    errors = np.zeros((m, 2))
    vectors[np.arange(free), np.arange(free)] = 1.0
    for column, chosen in ((0, first), (1, second)):
        known = (chosen >= 0).nonzero()[0]
        place, which = free + known, chosen.take(known)
        pairs[place, column], slopes[place, column] = values.take(which), slope.take(which)
        errors[place, column], vectors[:, place, column] = bound.take(which), y.take(which, axis=1)
    # a rigid-body mode that dampers brake stays where it comes to rest: an eigenvalue 0 with a rigid shape
    resting = free + np.nonzero(first < 0)[0]
    at = free + np.arange(len(resting))
    vectors[at, resting, 0] = 1.0
    slopes[resting, 0] = forms.damping[at, at]
    order = np.sqrt(np.abs(pairs[:, 0] * pairs[:, 1])).argsort(kind="stable")
    return pairs[order], vectors[:, order], slopes[order], errors[order]


def _energy_eigenvalues(basis: Undamped, gamma: Array, free: int) -> tuple[Complex, Complex]:
    """Eigenvalues and velocity parts of the eigenvectors in energy coordinates (Omega eta, eta')."""
    omega = basis.omega[basis.rigid :]
    n, flexible = len(basis.square) - free, len(omega)
    a = np.zeros((flexible + n, flexible + n))
    at = np.arange(flexible)
    velocity = flexible + (basis.rigid - free) + at
    a[at, velocity] = omega
    a[velocity, at] = -np.sign(basis.square[basis.rigid :]) * omega
    a[flexible:, flexible:] = -gamma[free:, free:]
    values, vectors = np.linalg.eig(a)
    values[values == 0.0] = -EPS * np.abs(values).max(initial=0.0)  # none is: rounding left nothing of a slow motion
    return values.astype(complex), vectors[flexible:].astype(complex)


def _rayleigh(
    values: Complex, y: Complex, forms: _Forms, basis: Undamped
) -> tuple[Complex, Complex, Complex, Array, Array]:
    """Improve every eigenvalue by its two-sided Rayleigh quadratic and every vector by what the others see of its
    residual; return both with the slopes, a bound of the eigenvalues' relative errors, and what of it can be mended.
    """
    inertia, damping, elastic = _times(forms.mass, y), _times(forms.damping, y), _times(forms.stiffness, y)
    a, b, c = (np.einsum("ij,ij->j", y, part) for part in (inertia, damping, elastic))
    improved = values
    for _ in range(2):  # the second step squares what the first leaves
        slope = 2.0 * improved * a + b
        wrong, none = improved * (improved * a + b) + c, np.zeros(len(a), dtype=complex)
        step = np.divide(wrong, slope, out=none, where=slope != 0.0)
        small = np.abs(step) <= CORRECTION * np.abs(improved)
        improved = np.where(small, improved - step, improved)
    size, speed = np.abs(y), np.abs(improved)
    # what is left is of second order: the residual r through the resolvent, the sum of y y^T / (slope (l - l_k))
    residual = improved * (improved * inertia + damping) + elastic
    share = y.T @ residual
    seen = np.abs(share)
    exact_slope = 2.0 * improved * a + b
    slope = np.abs(exact_slope)
    distance = exact_slope[:, None] * (improved - improved[:, None])
    apart = np.abs(distance)
    np.fill_diagonal(apart, np.inf)
    doubt = np.divide(seen, apart, out=np.ones(seen.shape), where=apart > seen)
    doubt = np.einsum("ij,ij->j", seen, doubt)
    # rounding of the three quadratic forms; errors of the frequencies tell how far the factors can be trusted
    doubt += 4.0 * EPS * speed * np.einsum("ij,ij->j", size, forms.spread @ size)
    mendable = _relative(doubt, slope * speed, np.where(small, 0.0, 1.0))
    bound = _relative(doubt + _trust(improved, y, basis), slope * speed, np.where(small, 0.0, np.abs(step) / speed))
    near = (CORRECTION * apart <= seen) | (distance == 0.0)
    mixing = np.divide(share, distance, out=np.zeros(share.shape, dtype=complex), where=~near)
    y = y - y @ mixing
    if basis.rigid:
        brakes, r = forms.damping.diagonal()[: basis.rigid, None], slice(basis.rigid)
        y[r] -= np.divide(residual[r], brakes * improved, out=np.zeros_like(y[r]), where=brakes * speed > 0.0)
    y *= 1.0 / _lengths(y)
    exact_slope = np.einsum("ij,ij->j", y, 2.0 * improved * y + _times(forms.damping, y))
    return improved, y, exact_slope, bound, mendable


def _times(matrix: Array, y: Complex) -> Complex:
    """A real matrix times complex vectors, without a complex copy of the matrix."""
    result: Complex = matrix.dot(np.ascontiguousarray(y).view(float)).view(complex)
    return result


def _lengths(y: Complex) -> Array:
    """Lengths of complex columns."""
    return np.asarray(np.sqrt(np.add.reduce(np.square(np.abs(y)))))


def _trust(values: Complex, y: Complex, basis: Undamped) -> Array:
    """What errors of the undamped modes do to the quadratics."""
    size = np.abs(y)
    trust = 2.0 * (basis.errors[:, None] + EPS)
    energy = (np.abs(values) ** 2 + np.abs(basis.square[:, None])) * trust * size
    return np.asarray(np.einsum("ij,ij->j", size, energy))


def _relative(doubt: Array, slope: Array, least: Array) -> Array:
    bound = np.divide(doubt, slope, out=np.ones_like(slope), where=slope > 0.0)
    return np.minimum(np.maximum(bound, least), 1.0)


_Found = tuple["Complex", "Complex", "Complex", "Array"]


def _doubtful(
    system: Equations, shapes: Array, parts: tuple[Undamped, _Forms, int], found: tuple[_Found, Array], rtol: float
) -> _Found:
    """Eigenvalues in doubt from the factors themselves, or with the dampers' forces, whichever is better."""
    basis, _, free = parts
    best = min(found[0], _from_factors(system, shapes, len(found[0][0]), rtol) or found[0],
               key=lambda each: float(each[3].max()))  # fmt: skip
    dampers = _dampers(system, shapes)
    if dampers is None or float(best[3].max()) <= rtol:
        return best
    other = _with_forces(found[0], dampers, found[1], basis, free, rtol)
    return min(best, other, key=lambda each: float(each[3].max()))


def _from_factors(system: Equations, shapes: Array, count: int, rtol: float) -> _Found | None:
    """Values, vectors, slopes and bounds of all eigenvalues but 0; None if there are more or less than ``count``."""
    from mbsvib.modes.general import spectrum

    _, found = spectrum(system, rtol)
    turns, real = np.nonzero(found.turns)[0], np.nonzero(~found.turns)[0]
    order = np.concatenate((np.repeat(turns, 2), real))
    if len(order) != count or not np.isfinite(found.errors).all():
        return None
    inertia, felt = system.inertia_factor @ found.right, system.elastic_rows @ found.right
    slope = 2.0 * found.values * (inertia**2).sum(axis=0) + system.damping @ felt**2
    y = shapes.T @ (system.M @ found.right)
    size = np.linalg.norm(y, axis=0)
    values, y, slope, bound = found.values[order], (y / size)[:, order], (slope / size**2)[order], found.errors[order]
    second = slice(1, 2 * len(turns), 2)
    values[second], y[:, second], slope[second] = values[second].conj(), y[:, second].conj(), slope[second].conj()
    return values, y, slope, bound


def _with_forces(
    found: _Found, dampers: Array, doubt: Array, basis: Undamped, free: int, rtol: float
) -> _Found:
    """Values, vectors, slopes and bounds, with those in doubt from the dampers' forces where that is better."""
    values, y, slope, bound = found[0].copy(), found[1].copy(), found[2].copy(), found[3].copy()
    equations = forces(basis.square[free:], dampers[:, free:], basis.rigid - free)
    new, shapes, slopes, errors = improved(equations, values, doubt, rtol)
    motion = np.zeros_like(y)
    motion[free:] = shapes
    size = np.abs(slopes * new)
    errors += np.divide(_trust(new, motion, basis), size, out=np.zeros_like(size), where=size > 0.0)
    better = errors < bound
    values[better], y[:, better], slope[better], bound[better] = (
        new[better], motion[:, better], slopes[better], errors[better]
    )  # fmt: skip
    upper, real = np.nonzero(values.imag > 0.0)[0], np.nonzero(values.imag == 0.0)[0]
    distance = np.abs(values[:, None] - values)
    np.fill_diagonal(distance, np.inf)
    nearest = np.argmin(np.abs(values.conj()[upper, None] - values), axis=1) if len(upper) else upper
    whole = 2 * len(upper) + len(real) == len(values) and len(set(nearest.tolist())) == len(upper)
    if not whole or (distance <= 2.0 * bound * np.abs(values)).any():
        return found  # two have met, or a conjugate is missing
    pairs = np.repeat(upper, 2)
    order = np.concatenate((pairs, real))
    values, y, slope = values[order], y[:, order], slope[order]
    second = slice(1, len(pairs), 2)
    values[second], y[:, second], slope[second] = values[second].conj(), y[:, second].conj(), slope[second].conj()
    return values, y, slope, bound[order]


def _pair(values: Complex, y: Complex, free: int, rigid: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pair the eigenvalues: conjugates, a real one with 0 for each braked rigid mode, other real ones by shape."""
    speed = values.imag.tolist()
    turns = [i for i, imag in enumerate(speed) if imag != 0.0]  # conjugates are neighbours, also after a correction
    oscillating = [(i, j) if speed[i] > 0.0 else (j, i) for i, j in zip(turns[::2], turns[1::2], strict=True)]
    real = [i for i, imag in enumerate(speed) if imag == 0.0]
    share = _lengths(y[free:rigid, real])
    braked = [real[i] for i in np.argsort(-share, kind="stable")[: rigid - free].tolist()]
    left = sorted(set(real) - set(braked), key=lambda i: (abs(values[i]), i))
    pairs = [(-1, i) for i in braked] + oscillating
    while left:
        slow = left.pop(0)
        mac = np.abs(y[:, left].real.T @ y[:, slow].real)
        pairs.append((slow, left.pop(int(np.argmax(mac)))))
    return np.array([p for p, _ in pairs], dtype=np.intp), np.array([q for _, q in pairs], dtype=np.intp)
