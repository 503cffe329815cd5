"""Bases of motions in which those without mass that dampers resist stand apart: small systems tell them by structure.

A motion z is z_m + N a, with N the damped motions without mass and z_m one in which their own coordinates rest. Both
parts join the basis, so that M is regular in the first columns and exactly zero in the last ones, however little mass
z moves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.qr import pivoted_qr

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.sparse.equations import SparseEquations

# Motions that are new by less than this share of their length are left out: what is left of them has lost digits.
NEW = 1e-10
# What is left of a motion without those that move no mass is rounding below this share of it.
NOTHING = 1e-12


def told_apart(system: SparseEquations, motions: Array) -> tuple[Array, Array]:
    """Return what motions are where the own coordinates of massless motions rest, and their massless parts.

    Parameters
    ----------
    system : SparseEquations
        The whole system.
    motions : array, shape (size, n)
        Motions.

    Returns
    -------
    array, shape (size, k)
        Motions that move mass; those of which no more than rounding is left are none of them.
    array, shape (size, r)
        Independent motions that move none, of unit damping.
    """
    if system.separation is None or not system.massless:
        return motions, np.zeros((len(motions), 0))
    n, own = system.separation.damped, system.separation.own
    light = n @ (motions[own] / np.asarray(n[own, np.arange(len(own))]).reshape(-1, 1))
    left = motions - light
    size = np.sqrt(np.abs(system.stiffness) + np.abs(system.damping))[:, None]
    rest, whole = (np.linalg.norm(size * (system.elastic_rows @ part), axis=0)
                   + np.linalg.norm(system.inertia_factor @ part, axis=0) for part in (left, motions))  # fmt: skip
    return left[:, rest > NOTHING * whole], independent(system, light)


def independent(system: SparseEquations, light: Array) -> Array:
    """Return independent motions (size, r), of unit damping, that span some (size, n) that move no mass."""
    acts = np.flatnonzero(system.damping)
    rates = np.sqrt(np.abs(system.damping[acts]))[:, None] * (system.elastic_rows[acts] @ light)
    length = np.linalg.norm(rates, axis=0)
    used = length > NOTHING * length.max(initial=0.0)
    if not used.any():
        return light[:, used]
    _, singular, right = np.linalg.svd(rates[:, used] / length[used], full_matrices=False)
    kept = singular > NEW
    return np.asarray((light[:, used] / length[used]) @ (right[kept].T / singular[kept]))


def heaviest(system: SparseEquations, mass: Array) -> Array:
    """Return as many of all motions (size, n), in which own coordinates of massless motions rest, as move mass."""
    rows = system.inertia_factor @ mass
    rows = rows / np.maximum(np.linalg.norm(rows, axis=0), np.finfo(float).tiny)
    return np.asarray(mass[:, np.sort(pivoted_qr(rows)[1][: system.dof - system.massless])])


def following(system: SparseEquations, basis: Array) -> Array:
    """Return motions in which those that springs alone hold, of no mass, follow the others from statics.

    z - N (N^T K N)^-1 N^T K z, and no more of them than there are degrees of freedom

    Parameters
    ----------
    system : SparseEquations
        The whole system.
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
    own, other = (force @ (rows @ n)).tocsc(), force @ (rows @ basis)
    if system.circulatory is not None:
        own, other = (own + n.T @ system.circulatory @ n).tocsc(), other + n.T @ (system.circulatory @ basis)
    result = basis - n @ splu(own).solve(other)
    unit = 1.0 / np.maximum(np.abs(basis).max(axis=0), 1e-300)
    order = pivoted_qr(result[system.layout.coordinate] * unit)[1]
    return np.asarray(result[:, np.sort(order[: system.dof])])
