"""Rigid-body motions that no damper resists, and invariant subspaces of the eigenvalue 0 in energy coordinates."""

from __future__ import annotations

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.equations.equations import Equations
from mbsvib.equations.unresisted_motion import coordinate_sizes, free_motions, matrix_scales, null_pair, rounding_scale
from mbsvib.linalg.products import product_with_zeros, weighted_gram
from mbsvib.linalg.rank import DEPENDENT_ROWS, LEAST_ROW, ZERO_SUM

# Generalised eigenvectors of 0 this nearly at right angles to all those from the left belong to a longer chain.
LONGER = 1e-9
# Share of the terms of a spring or damper between two motions that do not move it, whose rounding is squared: a rank
# decision takes 1e-14 of it as zero.
UNMOVED = ZERO_SUM**2 / (LEAST_ROW * DEPENDENT_ROWS)


def null_basis(rows: Array) -> Array:
    """Return an orthonormal basis of the null space of the rows."""
    _, values, turn = np.linalg.svd(rows)
    return turn[int(np.count_nonzero(values > DEPENDENT_ROWS * values[0])) :].T


def zero_subspaces(
    stiffness: Array, damping: Array, null: tuple[Array, Array], chains: tuple[Array, Array], scale: Array
) -> tuple[Array, Array, Array, int] | None:
    """Return the invariant subspaces of the eigenvalue 0 in the states, A restricted to them, and the number of chains
    of two; None if chains are longer.
    """
    (z, y), p = null, len(scale)
    n, r, count = len(stiffness) + p, z.shape[1], chains[0].shape[1]
    if r == 0:
        return np.zeros((n, 0)), np.zeros((n, 0)), np.zeros((0, 0)), 0
    x0, y0 = z @ chains[0], y @ chains[1]
    x1, y1 = (answer(k, c @ start, far, near) for k, c, start, far, near in (
        (stiffness, damping, x0, y, z), (stiffness.T, damping.T, y0, z, y)))  # fmt: skip
    right, left = np.zeros((n, r + count)), np.zeros((n, r + count))
    right[:p], right[2 * p :] = (scale[:, None] * np.hstack((z, x1))[:p]), np.hstack((z, x1))[p:]
    right[p : 2 * p, r:] = x0[:p]
    left_motions = np.hstack((y, y1))
    braked = damping.T @ left_motions
    braked[:p, r:] += y0[:p]
    left[:p], left[p : 2 * p], left[2 * p :] = braked[:p] / scale[:, None], left_motions[:p], braked[p:]
    size = np.linalg.norm(right, axis=0), np.linalg.norm(left, axis=0)
    angles = (left / size[1]).T @ (right / size[0])
    if np.linalg.svd(angles)[1][-1] < LONGER:
        return None
    left = np.linalg.solve(left.T @ right, left.T).T
    nilpotent = np.zeros((right.shape[1],) * 2)
    nilpotent[:r, r:] = chains[0]
    return right, left, nilpotent, count


def answer(stiffness: Array, forces: Array, far: Array, near: Array) -> Array:
    """Return x with K x = -push, orthogonal to the null space of K (``near``); ``far`` is the null space of K^T."""
    m, r = near.shape
    if not forces.any():
        return np.zeros_like(forces)
    size = matrix_scales(stiffness)
    bordered = np.zeros((m + r, m + r))
    bordered[:m, :m] = stiffness / size[:, None] / size
    bordered[:m, m:], bordered[m:, :m] = far, near.T
    right = np.concatenate((-forces / size[:, None], np.zeros((r, forces.shape[1]))))
    return np.asarray(np.linalg.solve(bordered, right)[:m] / size[:, None])


def long_chains(a: Array) -> tuple[Array, Array, Array, int]:
    """Return the same from A alone, by deflation of its null space until none remains."""
    left_null, right_null = _lost(a), _lost(a.T)
    left = np.asarray(np.linalg.solve(left_null.T @ right_null, left_null.T).T, dtype=float)
    nilpotent = np.asarray(left.T @ a @ right_null, dtype=float)
    nilpotent[np.abs(nilpotent) <= LONGER * np.abs(a).max()] = 0.0
    return right_null, left, nilpotent, right_null.shape[1] - len(null_basis(a))


def _lost(a: Array) -> Array:
    """Orthonormal complement of the range of all powers of A."""
    basis: Array = np.eye(len(a))
    while basis.shape[1]:
        inner = basis.T @ a @ basis
        u, values, _ = np.linalg.svd(inner)
        rank = int(np.count_nonzero(values > LONGER * np.abs(a).max()))
        if rank == len(inner):
            break
        basis = np.asarray(basis @ u[:, :rank], dtype=float)
    return np.linalg.qr(basis, mode="complete")[0][:, basis.shape[1] :]


def unbraked(system: Equations, rigid: Array) -> Array:
    """Return the rigid-body motions among (m, r) that no damper resists, (m, f); with negative dampers, those that
    deform neither a spring nor a damper.
    """
    if (system.row_stiffness >= 0.0).all() or (system.row_damping < 0.0).any():
        free = free_motions(system.elastic_rows[(system.row_stiffness != 0.0) | (system.row_damping != 0.0)])
        return free if free.shape[1] <= rigid.shape[1] else rigid[:, :0]
    # stiffness of loads has both signs: only its sum determines the motions, and the same holds for dampers in them
    relative_motion = product_with_zeros(system.elastic_rows, rigid)
    resistance = weighted_gram(relative_motion, system.row_damping)
    return rigid @ null_pair(resistance, damping_terms(system, rigid, rigid))[0]


def damping_terms(system: Equations, first: Array, second: Array, unmoved: float = UNMOVED) -> Array:
    """Return the sums of the magnitudes of all terms of Y^T C Z, see ``row_terms``."""
    result = row_terms(system, system.row_damping, first, second, unmoved)
    if system.gyroscopic is not None:
        spin, sizes = np.abs(system.gyroscopic), coordinate_sizes(system)
        (y, most_y), (z, most_z) = ((np.abs(part), rounding_scale(part, sizes)) for part in (first, second))
        result += y.T @ spin @ (z + most_z) + most_y.T @ spin @ (z + unmoved * most_z)
    return result


def row_terms(system: Equations, values: Array, first: Array, second: Array, unmoved: float = UNMOVED) -> Array:
    """Return the sums of the magnitudes of all terms of Y^T D^T diag(values) D Z for motions Y (m, k) and Z (m, n).

    Springs or dampers that one of them does not move count by a rounding, those that neither moves by its square, or by
    the share ``unmoved``: 1 where the motions themselves may be off.
    """
    sizes, size = coordinate_sizes(system), np.abs(values)[:, None]
    (moved, reach), (moved_by, reach_of) = (
        (np.abs(product_with_zeros(system.elastic_rows, part)),
         np.abs(system.elastic_rows) @ rounding_scale(part, sizes)) for part in (first, second))  # fmt: skip
    return np.asarray(moved.T @ (size * (moved_by + reach_of)) + reach.T @ (size * (moved_by + unmoved * reach_of)))
