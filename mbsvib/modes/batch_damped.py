"""Modes of all variants at once: the formulas of ``mbsvib.modes.undamped`` and ``damped``, with an axis of variants.

The common case is solved here; variants that are not solved to the required accuracy are marked, and the caller solves
them separately. Undamped modes come from the first solver of single systems, refined on the factors: there are no
rigid-body mode and no negative stiffness, and one rotation orthonormalizes the shapes. Classical damping is detected
variant by variant. Where damping couples the modes, these are accurate without refinement; strong dampers may leave
errors that refinement would reduce.

In the basis of the undamped modes (lambda^2 + lambda Gamma + Omega^2) y = 0, and conjugates are solutions too. With
light damping every y is near a unit vector, which is the initial guess. Corrections through the resolvent, the sum of
y y^T / (slope (s - lambda)) over all eigenvalues, converge quadratically. If they do not converge quickly, or if modes
are overdamped, the eigenvalues of the state matrix in energy coordinates are the initial guess. The Rayleigh step with
the factors of M, C and K (``rayleigh``) follows, as in a single system.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Complex, Index
from mbsvib.equations.batch_equations import BatchEquations
from mbsvib.linalg.products import drift, real_product
from mbsvib.linalg.rank import EPS
from mbsvib.modes.classical import CLASSICAL, COMMUTES, NO_DAMPER, classical_errors, quadratic_roots, rounding_of_sums
from mbsvib.modes.damped import MARGIN, Damped
from mbsvib.modes.pairs import pair_numbers
from mbsvib.modes.rayleigh import both, forms_in, rayleigh
from mbsvib.modes.undamped import FORCES, SUSPECT, Undamped, cleaned, perturbed

# Maximum number of corrections from unit vectors; they take less time than an eigensolver.
STEPS = 5
# Larger corrections do not converge.
START = 2.0
# Vectors that differ by less from unit vectors are independent.
INDEPENDENT = 0.95
# The correction after one of this size is rounding.
CONVERGED = 1e-7


@dataclass(frozen=True, slots=True)
class Start:
    """Eigenvalues ``values`` (k, h) and vectors ``y`` (k, m, h) of the variants ``which`` (k,): first
    ``complex_count`` with positive imaginary parts, which also represent their conjugates, then real ones.
    """

    which: Index
    values: Complex
    y: Complex
    complex_count: int


def starts(gamma: Array, square: Array) -> list[Start]:
    """Return eigenvalues and vectors of (lambda^2 + lambda Gamma + Omega^2) y = 0.

    ``gamma`` (n, m, m): Gamma. ``square`` (n, m): Omega^2, all positive.
    """
    m = square.shape[1]
    values, y, converged = _from_unit_vectors(gamma, square)
    rest = np.flatnonzero(~converged)
    if not len(rest):
        return [Start(np.arange(len(gamma)), values, y, m)]
    eigenvalues, vectors, complex_count = _by_eigensolver(gamma[rest], square[rest])
    oscillates = complex_count == m
    values[rest[oscillates]], y[rest[oscillates]] = eigenvalues[oscillates, :m], vectors[oscillates, :, :m]
    converged[rest[oscillates]] = True
    which = np.flatnonzero(converged)
    result = [Start(which, subset(values, which), subset(y, which), m)] if len(which) else []
    for count in np.unique(complex_count[~oscillates]).tolist():
        group = complex_count == count
        size = 2 * m - count
        result.append(Start(rest[group], eigenvalues[group, :size], vectors[group][..., :size], count))
    return result


def _from_unit_vectors(gamma: Array, square: Array) -> tuple[Complex, Complex, Bools]:
    """Corrections of undamped modes; if they converge, the vectors are independent and no mode is missing."""
    n, m = square.shape
    at = np.arange(m)
    damping = gamma[:, at, at]
    under = (damping * damping < 4.0 * square).all(axis=1)
    values = np.ascontiguousarray(quadratic_roots(square.reshape(-1), damping.reshape(-1))[:, 0]).reshape(n, m)
    distance = values[:, None] * (values[:, None] + damping[:, :, None]) + square[:, :, None]
    distance[:, at, at] = 1.0
    y = np.divide(-values[:, None] * gamma, distance, out=np.full(gamma.shape, np.inf + 0j), where=distance != 0.0)
    y[:, at, at] = 1.0
    todo = np.flatnonzero(under & (_off_diagonal(y) < START))
    converged = np.zeros(n, dtype=bool)
    for _ in range(STEPS):
        if not len(todo):
            break
        g, w = subset(gamma, todo), subset(square, todo)
        values[todo], y[todo], step = _corrected(g, w, subset(values, todo), subset(y, todo))
        done = step < CONVERGED
        converged[todo[done]] = True
        todo = todo[~done & (step < START)]
    converged &= _off_diagonal(y) < INDEPENDENT
    return values, y, converged


def _off_diagonal(y: Complex) -> Array:
    """The largest sum of the absolute off-diagonal entries of a column."""
    size = np.abs(y).sum(axis=1) - np.abs(np.einsum("vii->vi", y))
    return np.asarray(size.max(axis=1, initial=0.0))


def _corrected(gamma: Array, square: Array, values: Complex, y: Complex) -> tuple[Complex, Complex, Array]:
    """Values and vectors after one correction, which squares their error, and the largest correction."""
    m, braked = y.shape[2], real_product(gamma, y)
    slope = np.einsum("vij,vij->vj", y, 2.0 * values[:, None] * y + braked)
    residual = values[:, None] * (values[:, None] * y + braked) + square[:, :, None] * y
    every = both(y, m)
    distance = both(slope, m)[:, :, None] * (values[:, None] - both(values, m)[:, :, None])
    np.einsum("vii->vi", distance[:, :m])[...] = slope
    together = distance == 0.0  # repeated eigenvalues: these corrections cannot separate their vectors
    distance[together] = 1.0
    mixing = every.swapaxes(1, 2) @ residual / distance
    own = np.einsum("vii->vi", mixing[:, :m])
    improved = values - own
    own[...] = 0.0
    result = y - every @ mixing
    result /= np.einsum("vii->vi", result)[:, None].copy()
    return improved, result, np.where(together.any(axis=(1, 2)), np.inf, np.abs(mixing).max(axis=(1, 2)))


def _by_eigensolver(gamma: Array, square: Array) -> tuple[Complex, Complex, Index]:
    """Eigenvalues of the state matrix [0 Omega; -Omega -Gamma], whose velocity parts are the vectors: those with
    positive imaginary part, whose number comes with them, then real ones, then the others.
    """
    n, m = square.shape
    omega, at = np.sqrt(square), np.arange(m)
    a = np.zeros((n, 2 * m, 2 * m))
    a[:, at, m + at] = omega
    a[:, m + at, at] = -omega
    a[:, m:, m:] = -gamma
    values, right = np.linalg.eig(a)
    values, right = values.astype(complex), right[:, m:].astype(complex)
    order = np.argsort(-np.sign(values.imag), axis=1, kind="stable")
    return (np.take_along_axis(values, order, 1), np.take_along_axis(right, order[:, None], 2),
            np.count_nonzero(values.imag > 0.0, axis=1))  # fmt: skip


def subset(array: Any, which: Any) -> Any:
    """Return the variants ``which`` of an array; all of them without a copy."""
    return array if len(which) == len(array) else array[which]


@dataclass(frozen=True, slots=True)
class DampedBatch:
    """Damped modes: ``pairs`` and ``errors`` (n, m, 2), ``gamma`` (n, m, m), ``vectors`` (n, m, m, 2) and ``slopes``
    (n, m, 2) as of a single system, in the basis ``shapes`` (n, m, m) with ``square`` (n, m).

    ``classical`` (n,) is the reason why damping is classical; vectors and slopes are not used there. ``accurate`` (n,)
    marks the variants that need not be solved separately.
    """

    pairs: Complex
    errors: Array
    shapes: Array
    square: Array
    gamma: Array
    classical: tuple[str, ...]
    vectors: Complex
    slopes: Complex
    accurate: Bools

    def single(self, i: int) -> Damped:
        """Return the modes of variant ``i`` in the form of a single system."""
        reason = self.classical[i]
        pairs, errors, shapes, square = self.pairs[i], self.errors[i], self.shapes[i], self.square[i]
        if reason:
            return Damped(pairs, errors, shapes, square, self.gamma[i].diagonal().copy(), reason, None, None)
        return Damped(pairs, errors, shapes, square, self.gamma[i], "", self.vectors[i], self.slopes[i])


def joined(parts: list[DampedBatch]) -> DampedBatch:
    """Return the modes of several pieces of a batch as one."""
    if len(parts) == 1:
        return parts[0]
    arrays: dict[str, Any] = {
        key: np.concatenate([getattr(part, key) for part in parts])
        for key in DampedBatch.__slots__ if key != "classical"
    }  # fmt: skip
    return DampedBatch(classical=tuple(reason for part in parts for reason in part.classical), **arrays)


def damped_batch(batch: BatchEquations, basis: UndampedBatch, rtol: float) -> DampedBatch:
    """Return the damped modes, (lambda^2 M_i + lambda C_i + K_i) phi = 0.

    Pairs of eigenvalues are in ascending order of their natural frequency.
    """
    n, m = basis.square.shape
    classical, gamma = _classical(batch, basis)
    pairs = np.empty((n, m, 2), dtype=complex)
    errors = np.empty((n, m, 2))
    vectors, slopes = np.zeros((n, m, m, 2), dtype=complex), np.zeros((n, m, 2), dtype=complex)
    accurate = basis.accurate.copy()
    simple = np.array([bool(reason) for reason in classical])
    classical_variants = np.flatnonzero(simple)
    diagonal = np.einsum("vii->vi", gamma)[classical_variants].reshape(-1)
    square = basis.square[classical_variants].reshape(-1)
    roots = quadratic_roots(square, diagonal)
    pairs[classical_variants] = roots.reshape(len(classical_variants), m, 2)
    flat_basis = Undamped(square, basis.shapes[:0], basis.errors[classical_variants].reshape(-1), 0, "", 0.0)
    commuting, sum_rounding = [i for i, reason in enumerate(classical) if reason == COMMUTES], np.zeros((n, m))
    sum_rounding[commuting] = rounding_of_sums(
        batch.elastic_rows[commuting], batch.row_damping[commuting], basis.shapes[commuting]
    )
    flat_errors = classical_errors(roots, flat_basis, diagonal, sum_rounding[classical_variants].reshape(-1))
    errors[classical_variants] = flat_errors.reshape(len(classical_variants), m, 2)
    together = np.flatnonzero(~simple & accurate)
    if len(together):
        for start in starts(subset(gamma, together), np.abs(subset(basis.square, together))):
            which = together[start.which]
            reducible, *eigensolution = _coupled(batch, basis, gamma, start, which)
            for array, value in zip((pairs, vectors, slopes, errors), eigensolution, strict=True):
                array[which] = value
            accurate[which] = reducible <= MARGIN * rtol  # as in a single system; the others are solved separately
    return DampedBatch(pairs, errors, basis.shapes, basis.square, gamma, classical, vectors, slopes, accurate)


def _classical(batch: BatchEquations, basis: UndampedBatch) -> tuple[tuple[str, ...], Array]:
    """Why damping is classical in each variant ("" where it is not), and Phi^T C Phi."""
    n, m = basis.square.shape
    c, k = batch.row_damping, batch.row_stiffness
    gamma = np.zeros((n, m, m))
    at = np.arange(m)
    moves = batch.elastic_rows.any(axis=2)
    damped = ((c != 0.0) & moves).any(axis=1)
    if not damped.any():
        return (NO_DAMPER,) * n, gamma
    connected = ((c != 0.0) | (k != 0.0)) & moves
    ratio = np.divide(c, k, out=np.full(k.shape, np.nan), where=k != 0.0)
    low, high = np.where(connected, ratio, np.inf).min(axis=1), np.where(connected, ratio, -np.inf).max(axis=1)
    with np.errstate(invalid="ignore"):
        proportional = damped & (high - low <= 4.0 * EPS * np.abs(low))
    rest = np.flatnonzero(damped & ~proportional)
    mean = 0.5 * (low + high)[proportional]
    gamma[np.flatnonzero(proportional)[:, None], at, at] = mean[:, None] * basis.square[proportional]
    half = (batch.elastic_rows[rest] @ basis.shapes[rest]) * np.sqrt(np.abs(c[rest]))[:, :, None]
    size = np.einsum("vij,vij->vj", half, half)
    damping_product = half.swapaxes(1, 2) @ (half * np.sign(c[rest])[:, :, None])
    gamma[rest] = 0.5 * (damping_product + damping_product.swapaxes(1, 2))
    uncoupled = np.abs(gamma[rest]) <= CLASSICAL * np.sqrt(size[:, :, None] * size[:, None])
    uncoupled[:, at, at] = True
    commutes = dict(zip(rest.tolist(), uncoupled.all(axis=(1, 2)).tolist(), strict=True))
    return tuple(
        NO_DAMPER if not damped[i] else "damping proportional to stiffness" if proportional[i] else
        COMMUTES if commutes[i] else "" for i in range(n)
    ), gamma  # fmt: skip


def _coupled(
    batch: BatchEquations, basis: UndampedBatch, gamma: Array, start: Start, which: Index
) -> tuple[Array, Any, Complex, Any, Array]:
    """The largest reducible error; pairs, vectors, slopes, errors of variants with equally many oscillating modes."""
    factors = [subset(array, which) for array in
               (batch.inertia_factor, batch.elastic_rows, batch.row_stiffness, batch.row_damping)]  # fmt: skip
    forms = forms_in(factors, subset(basis.shapes, which), subset(gamma, which))
    forms = forms.with_errors(subset(basis.square, which), subset(basis.errors, which))
    values, y, slope, bound, reducible = rayleigh(start.values, start.y, forms, start.complex_count)
    m, oscillating = y.shape[1], np.arange(start.complex_count).repeat(2).reshape(1, -1, 2)
    if start.complex_count == m:
        pair_indices = np.broadcast_to(oscillating, (len(values), m, 2))
    else:  # real ones in pairs by shape
        pair_indices = np.array([pair_numbers(*variant, 0, 0) for variant in zip(values, y, strict=True)])
    size = np.abs(values)
    natural = np.take_along_axis(size, pair_indices[..., 0], 1) * np.take_along_axis(size, pair_indices[..., 1], 1)
    pair_indices = np.take_along_axis(pair_indices, np.argsort(natural, axis=1, kind="stable")[..., None], 1)
    flat = pair_indices.reshape(len(values), -1)
    pairs, slopes = (np.take_along_axis(part, flat, 1).reshape(-1, m, 2) for part in (values, slope))
    vectors = np.take_along_axis(y, flat[:, None], 2).reshape(-1, m, m, 2)
    upper = pair_indices[..., 0] < start.complex_count
    for part, oscillates in ((pairs, upper), (slopes, upper), (vectors, upper[:, None])):
        np.conjugate(part[..., 1], out=part[..., 1], where=oscillates)
    errors = np.take_along_axis(bound, flat, 1).reshape(-1, m, 2)
    return reducible.max(axis=1, initial=0.0), pairs, vectors, slopes, errors


# If a mass matrix of unit diagonal has a smaller pivot, its inverse factor loses digits.
PIVOT = 1e-8
# The relative rounding error of |H| is half that of |H|^2.
ROUNDING = 0.5
# Share of the required accuracy that errors of undamped modes may use; the rest is left for damping.
SHARE = 0.5


@dataclass(frozen=True, slots=True)
class UndampedBatch:
    """Undamped modes: ``square`` (n, m), ``shapes`` (n, m, m) and ``errors`` (n, m) as of a single system;
    ``accurate`` (n,) marks the variants in which they have the required accuracy.
    """

    square: Array
    shapes: Array
    errors: Array
    accurate: Bools


def undamped_batch(batch: BatchEquations, rtol: float) -> UndampedBatch:
    """Return the undamped modes, K_i phi = omega^2 M_i phi.

    Variants that are not ``accurate`` have to be solved separately.
    """
    square, shapes, accurate = _by_products(batch)
    largest = np.abs(square).max(axis=1, initial=0.0)
    # variants with rigid-body modes or modes of negative stiffness are solved separately
    accurate &= (square > SUSPECT**2 * largest[:, None]).all(axis=1)
    square[~accurate] = 1.0
    growth = (np.sqrt(np.einsum("vii->vi", batch.M))[:, None] @ np.abs(shapes))[:, 0] ** 2
    errors = 4.0 * EPS * growth.max(axis=1, initial=0.0)[:, None] * square.max(axis=1, initial=0.0)[:, None] / square
    rounding = drift(batch.elastic_rows[0], batch.inertia_factor[0])
    errors += rounding
    cancels = (batch.row_stiffness < 0.0).any(axis=1)  # by stiffness of loads, so that K has larger terms
    inaccurate = np.flatnonzero(accurate & (cancels | (errors.max(axis=1, initial=0.0) > SHARE * rtol)))
    if len(inaccurate):
        refined = _refined(batch, inaccurate, shapes[inaccurate], rounding)
        square[inaccurate], shapes[inaccurate], errors[inaccurate], unresolved = refined
        accurate[inaccurate] = unresolved <= rtol
    return UndampedBatch(square, shapes, errors, accurate)


def _by_products(batch: BatchEquations) -> tuple[Array, Array, Bools]:
    """Squared frequencies, shapes, and where the mass matrix is far enough from singular for them."""
    diagonal = np.einsum("vii->vi", batch.M)
    scale = 1.0 / np.sqrt(diagonal)
    root = np.linalg.cholesky(batch.M * scale[:, :, None] * scale[:, None])
    accurate = np.einsum("vii->vi", root).min(axis=1, initial=1.0) ** 2 > PIVOT
    inverse = np.linalg.inv(root) * scale[:, None]
    square, vectors = np.linalg.eigh(inverse @ batch.K @ inverse.swapaxes(1, 2))
    return square, inverse.swapaxes(1, 2) @ vectors, accurate


def _refined(
    batch: BatchEquations, which: Index, shapes: Array, rounding: float
) -> tuple[Array, Array, Array, Array]:
    """Frequencies from the factors, orthonormalized shapes, errors, and the largest error that other solvers reduce.

    ``rounding``: that of sums over many rows, see ``drift``.
    """
    stiffness = batch.row_stiffness[which]
    rows = batch.elastic_rows[which] * np.sqrt(np.abs(stiffness))[:, :, None]
    h = batch.inertia_factor[which] @ shapes
    length = np.sqrt(np.einsum("vij,vij->vj", h, h))[:, None]
    h, phi = h / length, shapes / length
    e = rows @ phi
    inertia, elastic = h.swapaxes(1, 2) @ h, e.swapaxes(1, 2) @ (np.sign(stiffness)[:, :, None] * e)
    _, value, mixing, uncertainty = perturbed(inertia, elastic)
    cancel = np.abs(rows) @ np.abs(phi)
    noise = EPS * np.einsum("vij,vij->vj", np.abs(e), cancel) + EPS**2 * np.einsum("vij,vij->vj", cancel, cancel)
    uncertainty += noise
    cancels = np.asarray((stiffness < 0.0).any(axis=1))[:, None]
    uncertainty += FORCES * EPS * np.where(cancels, np.einsum("vij,vij->vj", e, e), 0.0)
    errors = 0.5 * uncertainty / np.abs(value)
    largest_error = errors.max(axis=1, initial=0.0)
    growth = (np.sqrt(np.einsum("vii->vi", batch.M[which]))[:, None] @ np.abs(phi))[:, 0]
    errors += EPS * (2.0 + ROUNDING * growth) + rounding
    phi = cleaned(phi, inertia, mixing)
    order = np.argsort(value, axis=1, kind="stable")
    if (order == np.arange(value.shape[1])).all():
        return value, phi, errors, largest_error
    return (np.take_along_axis(value, order, 1), np.take_along_axis(phi, order[:, None], 2),
            np.take_along_axis(errors, order, 1), largest_error)  # fmt: skip
