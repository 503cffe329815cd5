"""Bases in which damped massless motions are separate columns.

A motion z is z_m + N a with the damped massless motions N, whose amplitudes are zero in z_m. Both parts are added to
the basis, so that M is regular in the first columns and exactly zero in the last ones, even if z moves little mass.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.qr import pivoted_qr

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.sparse.equations import SparseEquations

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
    """Return independent motions (size, r), of unit damping, with the span of massless motions (size, n)."""
    damped = np.flatnonzero(system.row_damping)
    rates = np.sqrt(np.abs(system.row_damping[damped]))[:, None] * (system.elastic_rows[damped] @ massless)
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
    from scipy.sparse.linalg import splu

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
