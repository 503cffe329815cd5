"""Damped modes of all variants at once: the formulas of ``mbsvib.modes.damped`` over arrays with an axis of variants.

Classical damping is detected variant by variant. Where damping couples the modes, the common case is solved here: modes
that are accurate without refinement. Variants in which strong dampers leave reducible errors are marked, and the caller
solves them separately.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.rank import EPS
from mbsvib.modes.batch_coupled import Start, starts, subset
from mbsvib.modes.classical import CLASSICAL, COMMUTES, NO_DAMPER, classical_errors, quadratic_roots, rounding_of_sums
from mbsvib.modes.damped import MARGIN, Damped
from mbsvib.modes.pairs import pair_numbers
from mbsvib.modes.rayleigh import forms_in, rayleigh
from mbsvib.modes.undamped import Undamped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Complex, Index
    from mbsvib.equations.batch_equations import BatchEquations
    from mbsvib.modes.batch_undamped import UndampedBatch

    Mask = NDArray[np.bool_]


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
    accurate: Mask

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
