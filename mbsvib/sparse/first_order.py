"""Bases in which damped motions without mass are separate columns: the structure of small systems shows them.

A motion z is z_m + N a, with N the damped motions without mass and z_m a motion in which their own coordinates are 0.
Both parts are added to the basis, so that M is regular in the first columns and exactly zero in the last ones, even if
z moves little mass.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.qr import pivoted_qr

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.sparse.equations import SparseEquations

# If less than this share of a motion remains after orthogonalization, it is left out: it has lost its digits.
NEW = 1e-10
# Below this share of a motion, its part with mass is rounding.
NOTHING = 1e-12


def split_massless(system: SparseEquations, motions: Array) -> tuple[Array, Array]:
    """Split motions into parts in which the own coordinates of massless motions are 0, and massless parts.

    Parameters
    ----------
    system : SparseEquations
        The full system.
    motions : array, shape (size, n)
        Motions.

    Returns
    -------
    array, shape (size, k)
        Motions with mass; those that are only rounding are omitted.
    array, shape (size, r)
        Independent motions without mass, of unit damping.
    """
    if system.separation is None or not system.massless:
        return motions, np.zeros((len(motions), 0))
    n, own = system.separation.damped, system.separation.own
    light = n @ (motions[own] / np.asarray(n[own, np.arange(len(own))]).reshape(-1, 1))
    left = motions - light
    size = np.sqrt(np.abs(system.stiffness) + np.abs(system.damping))[:, None]
    rest, total = (np.linalg.norm(size * (system.elastic_rows @ part), axis=0)
                   + np.linalg.norm(system.inertia_factor @ part, axis=0) for part in (left, motions))  # fmt: skip
    return left[:, rest > NOTHING * total], independent(system, light)


def independent(system: SparseEquations, light: Array) -> Array:
    """Return independent motions (size, r), of unit damping, with the span of motions (size, n) without mass."""
    acts = np.flatnonzero(system.damping)
    rates = np.sqrt(np.abs(system.damping[acts]))[:, None] * (system.elastic_rows[acts] @ light)
    length = np.linalg.norm(rates, axis=0)
    used = length > NOTHING * length.max(initial=0.0)
    if not used.any():
        return light[:, used]
    _, singular, right = np.linalg.svd(rates[:, used] / length[used], full_matrices=False)
    significant = singular > NEW
    return np.asarray((light[:, used] / length[used]) @ (right[significant].T / singular[significant]))


def heaviest(system: SparseEquations, mass: Array) -> Array:
    """Return the independent motions with mass among all motions (size, n) without massless parts."""
    rows = system.inertia_factor @ mass
    rows = rows / np.maximum(np.linalg.norm(rows, axis=0), np.finfo(float).tiny)
    return np.asarray(mass[:, np.sort(pivoted_qr(rows)[1][: system.dof - system.massless])])


def following(system: SparseEquations, basis: Array) -> Array:
    """Return motions in which massless, undamped motions follow the others from statics.

    z - N (N^T K N)^-1 N^T K z, and no more of them than there are degrees of freedom

    Parameters
    ----------
    system : SparseEquations
        The full system.
    basis : array, shape (size, n)
        Motions that span all.

    Returns
    -------
    array, shape (size, dof)
        The motions.
    """
    if system.separation is None or not system.separation.static.shape[1]:
        return basis
    from scipy.sparse.linalg import splu

    n, rows = system.separation.static, system.elastic_rows
    force = n.T @ (rows.T.multiply(system.stiffness))
    own, coupling = (force @ (rows @ n)).tocsc(), force @ (rows @ basis)
    if system.circulatory is not None:
        own, coupling = (own + n.T @ system.circulatory @ n).tocsc(), coupling + n.T @ (system.circulatory @ basis)
    result = basis - n @ splu(own).solve(coupling)
    unit = 1.0 / np.maximum(np.abs(basis).max(axis=0), 1e-300)
    order = pivoted_qr(result[system.layout.coordinate] * unit)[1]
    return np.asarray(result[:, np.sort(order[: system.dof])])
