"""Damped modes of all variants at once: the formulas of ``mbsvib.modes.damped`` over arrays with an axis of variants.

Classical damping is told variant by variant. Where damping couples the modes the common case is solved here, all
modes oscillating and accurate as they come; variants in which some creep, or strong dampers leave errors that can be
mended, are told apart, so that they can be solved one by one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.modes.damped import (
    CLASSICAL,
    COMMUTES,
    CORRECTION,
    EPS,
    MARGIN,
    NO_DAMPER,
    Damped,
    _classical_errors,
    _rounding,
    quadratic_roots,
)
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

    ``classical`` (n,) says why damping is; vectors and slopes are not used there. ``settled`` (n,) tells the variants
    that need not be solved by themselves.
    """

    pairs: Complex
    errors: Array
    shapes: Array
    square: Array
    gamma: Array
    classical: tuple[str, ...]
    vectors: Complex
    slopes: Complex
    settled: Mask

    def single(self, i: int) -> Damped:
        """Return the modes of variant ``i`` as a single system has them."""
        reason = self.classical[i]
        gamma = self.gamma[i].diagonal().copy() if reason else self.gamma[i]
        return Damped(self.pairs[i], self.errors[i], self.shapes[i], self.square[i], gamma, reason,
                      None if reason else self.vectors[i], None if reason else self.slopes[i])  # fmt: skip


def joined(pieces: list[DampedBatch]) -> DampedBatch:
    """Return the modes of several pieces of a batch as one."""
    if len(pieces) == 1:
        return pieces[0]
    whole: dict[str, Any] = {
        key: np.concatenate([getattr(piece, key) for piece in pieces])
        for key in DampedBatch.__slots__ if key != "classical"
    }  # fmt: skip
    return DampedBatch(classical=tuple(reason for piece in pieces for reason in piece.classical), **whole)


def damped_batch(batch: BatchEquations, basis: UndampedBatch, rtol: float) -> DampedBatch:
    """Return the damped modes, (lambda^2 M_i + lambda C_i + K_i) phi = 0.

    Parameters
    ----------
    batch : BatchEquations
        The variants.
    basis : UndampedBatch
        Their undamped modes.
    rtol : float
        Relative accuracy asked of every eigenvalue.

    Returns
    -------
    DampedBatch
        Pairs of eigenvalues, in ascending order of their natural frequency.
    """
    n, m = basis.square.shape
    classical, gamma = _classical(batch, basis)
    pairs = np.empty((n, m, 2), dtype=complex)
    errors = np.empty((n, m, 2))
    vectors, slopes = np.zeros((n, m, m, 2), dtype=complex), np.zeros((n, m, 2), dtype=complex)
    settled = basis.settled.copy()
    simple = np.array([bool(reason) for reason in classical])
    alone = np.flatnonzero(simple)
    diagonal = np.einsum("vii->vi", gamma)[alone].reshape(-1)
    square = basis.square[alone].reshape(-1)
    roots = quadratic_roots(square, diagonal)
    pairs[alone] = roots.reshape(len(alone), m, 2)
    each = Undamped(square, basis.shapes[:0], basis.errors[alone].reshape(-1), 0, "", 0.0)  # one mode knows no other
    own, summed = [i for i, reason in enumerate(classical) if reason == COMMUTES], np.zeros((n, m))
    summed[own] = _rounding(batch.elastic_rows[own], batch.damping[own], basis.shapes[own])
    errors[alone] = _classical_errors(roots, each, diagonal, summed[alone].reshape(-1)).reshape(len(alone), m, 2)
    together = np.flatnonzero(~simple & settled)
    if len(together):
        mendable, *found = _coupled(batch, basis, gamma[together], together)
        for array, value in zip((pairs, vectors, slopes, errors), found, strict=True):
            array[together] = value
        settled[together] = mendable <= MARGIN * rtol  # as a single system: what is in doubt is solved by itself
    return DampedBatch(pairs, errors, basis.shapes, basis.square, gamma, classical, vectors, slopes, settled)


def _classical(batch: BatchEquations, basis: UndampedBatch) -> tuple[tuple[str, ...], Array]:
    """Why damping is classical in each variant ("" where it is not), and Phi^T C Phi."""
    n, m = basis.square.shape
    c, k = batch.damping, batch.stiffness
    gamma = np.zeros((n, m, m))
    at = np.arange(m)
    moves = batch.elastic_rows.any(axis=2)
    damped = ((c != 0.0) & moves).any(axis=1)
    if not damped.any():
        return (NO_DAMPER,) * n, gamma
    acts = ((c != 0.0) | (k != 0.0)) & moves
    ratio = np.divide(c, k, out=np.full(k.shape, np.nan), where=k != 0.0)
    low, high = np.where(acts, ratio, np.inf).min(axis=1), np.where(acts, ratio, -np.inf).max(axis=1)
    with np.errstate(invalid="ignore"):
        proportional = damped & (high - low <= 4.0 * EPS * np.abs(low))
    rest = np.flatnonzero(damped & ~proportional)
    mean = 0.5 * (low + high)[proportional]
    gamma[np.flatnonzero(proportional)[:, None], at, at] = mean[:, None] * basis.square[proportional]
    half = (batch.elastic_rows[rest] @ basis.shapes[rest]) * np.sqrt(np.abs(c[rest]))[:, :, None]
    size = np.einsum("vij,vij->vj", half, half)
    whole = half.swapaxes(1, 2) @ (half * np.sign(c[rest])[:, :, None])
    gamma[rest] = 0.5 * (whole + whole.swapaxes(1, 2))
    apart = np.abs(gamma[rest]) <= CLASSICAL * np.sqrt(size[:, :, None] * size[:, None])
    apart[:, at, at] = True
    commutes = dict(zip(rest.tolist(), apart.all(axis=(1, 2)).tolist(), strict=True))
    return tuple(
        NO_DAMPER if not damped[i] else "damping proportional to stiffness" if proportional[i] else
        COMMUTES if commutes[i] else "" for i in range(n)
    ), gamma  # fmt: skip


def _coupled(
    batch: BatchEquations, basis: UndampedBatch, gamma: Array, which: Index
) -> tuple[Array, Complex, Complex, Complex, Array]:
    """The largest error that can be mended, infinite where not all modes oscillate; pairs, vectors, slopes, errors."""
    n, m = gamma.shape[:2]
    omega = np.sqrt(np.abs(basis.square[which]))
    at = np.arange(m)
    a = np.zeros((n, 2 * m, 2 * m))
    a[:, at, m + at] = omega
    a[:, m + at, at] = -omega
    a[:, m:, m:] = -gamma
    values, right = np.linalg.eig(a)
    values, y = values.astype(complex), right[:, m:].astype(complex)
    y /= np.linalg.norm(y, axis=1)[:, None]
    oscillates = (np.count_nonzero(values.imag > 0.0, axis=1) == m) & (np.count_nonzero(values.imag, axis=1) == 2 * m)
    values, y, slope, bound, mendable = _rayleigh(batch, basis, gamma, which, values, y)
    # LAPACK puts the conjugate right behind
    rank = np.where(values.imag > 0.0, np.abs(values), np.inf)
    first = np.argsort(rank, axis=1, kind="stable")[:, :m]
    second = np.minimum(first + 1, 2 * m - 1)
    chosen = np.stack((first, second), axis=2).reshape(n, -1)
    pairs = np.take_along_axis(values, chosen, 1).reshape(n, m, 2)
    vectors = np.take_along_axis(y, chosen[:, None], 2).reshape(n, m, m, 2)
    slopes = np.take_along_axis(slope, chosen, 1).reshape(n, m, 2)
    errors = np.take_along_axis(bound, chosen, 1).reshape(n, m, 2)
    return np.where(oscillates, mendable, np.inf), pairs, vectors, slopes, errors


def _rayleigh(
    batch: BatchEquations, basis: UndampedBatch, gamma: Array, which: Index, values: Complex, y: Complex
) -> tuple[Complex, Complex, Complex, Array, Array]:
    """Improve eigenvalues by their two-sided Rayleigh quadratics and vectors by what the others see of the residual."""
    shapes, square = basis.shapes[which], basis.square[which]
    h, e = batch.inertia_factor[which] @ shapes, batch.elastic_rows[which] @ shapes
    stiff = e.swapaxes(1, 2) @ (e * batch.stiffness[which][:, :, None])
    cancel = np.abs(batch.elastic_rows[which]) @ np.abs(shapes)
    spread = cancel.swapaxes(1, 2) @ (np.abs(e) * np.abs(batch.damping[which])[:, :, None])
    inertia, damping, elastic = (h.swapaxes(1, 2) @ h) @ y, gamma @ y, stiff @ y
    a, b, c = (np.einsum("vij,vij->vj", y, part) for part in (inertia, damping, elastic))
    improved = values
    for _ in range(2):  # the second step squares what the first leaves
        slope = 2.0 * improved * a + b
        step = np.divide(improved * (improved * a + b) + c, slope, out=np.zeros_like(slope), where=slope != 0.0)
        small = np.abs(step) <= CORRECTION * np.abs(improved)
        improved = np.where(small, improved - step, improved)
    size, speed = np.abs(y), np.abs(improved)
    wide = improved[:, None]
    share = y.swapaxes(1, 2) @ (wide * (wide * inertia + damping) + elastic)
    seen = np.abs(share)
    exact_slope = 2.0 * improved * a + b
    slope = np.abs(exact_slope)
    distance = exact_slope[:, :, None] * (wide - improved[:, :, None])
    apart = np.abs(distance)
    at = np.arange(apart.shape[1])
    apart[:, at, at] = np.inf
    doubt = np.divide(seen, apart, out=np.ones_like(seen), where=apart > seen)
    doubt = np.einsum("vij,vij->vj", seen, doubt)
    doubt += 4.0 * EPS * speed * np.einsum("vij,vij->vj", size, spread @ size)
    mendable = np.divide(doubt, slope * speed, out=np.ones_like(slope), where=slope * speed > 0.0)
    mendable[~small] = 1.0
    trust = 2.0 * (basis.errors[which][:, :, None] + EPS)
    doubt += np.einsum("vij,vij->vj", size, (speed[:, None] ** 2 + np.abs(square)[:, :, None]) * trust * size)
    bound = np.divide(doubt, slope * speed, out=np.ones_like(slope), where=slope * speed > 0.0)
    near = (CORRECTION * apart <= seen) | (distance == 0.0)
    y = y - y @ np.divide(share, distance, out=np.zeros_like(share), where=~near)
    y /= np.linalg.norm(y, axis=1)[:, None]
    slopes = np.einsum("vij,vij->vj", y, 2.0 * wide * y + gamma @ y)
    relative = np.divide(np.abs(step), speed, out=np.ones_like(speed), where=speed > 0.0)
    bound = np.minimum(np.where(small, bound, np.maximum(bound, relative)), 1.0)
    return improved, y, slopes, bound, mendable.max(axis=1, initial=0.0)
