"""Undamped modes of all variants at once: the first solver of ``mbsvib.modes.undamped``, refined on the factors.

The formulas are those of single systems, over arrays with an axis of variants, for the common case: no rigid-body
mode, no mode of negative stiffness, shapes that one rotation orthonormalizes. Variants that are not solved to the
required accuracy are marked, and the caller solves them separately.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.products import drift
from mbsvib.linalg.rank import EPS
from mbsvib.modes.undamped import FORCES, SUSPECT, cleaned, perturbed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.batch_equations import BatchEquations

    Mask = NDArray[np.bool_]

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
    accurate: Mask


def undamped_batch(batch: BatchEquations, rtol: float) -> UndampedBatch:
    """Return the undamped modes, K_i phi = omega^2 M_i phi.

    Variants that are not ``accurate`` have to be solved separately.
    """
    square, shapes, accurate = _by_products(batch)
    largest = np.abs(square).max(axis=1, initial=0.0)
    # variants with rigid-body modes or modes of negative stiffness are solved separately
    accurate &= (square > SUSPECT**2 * largest[:, None]).all(axis=1)
    square[~accurate] = 1.0
    growth = _growth(batch, shapes) ** 2
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


def _by_products(batch: BatchEquations) -> tuple[Array, Array, Mask]:
    """Squared frequencies, shapes, and where the mass matrix is far enough from singular for them."""
    diagonal = np.einsum("vii->vi", batch.M)
    scale = 1.0 / np.sqrt(diagonal)
    root = np.linalg.cholesky(batch.M * scale[:, :, None] * scale[:, None])
    accurate = np.einsum("vii->vi", root).min(axis=1, initial=1.0) ** 2 > PIVOT
    inverse = np.linalg.inv(root) * scale[:, None]
    square, vectors = np.linalg.eigh(inverse @ batch.K @ inverse.swapaxes(1, 2))
    return square, inverse.swapaxes(1, 2) @ vectors, accurate


def _growth(batch: BatchEquations, shapes: Array) -> Array:
    return np.asarray((np.sqrt(np.einsum("vii->vi", batch.M))[:, None] @ np.abs(shapes))[:, 0])


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
