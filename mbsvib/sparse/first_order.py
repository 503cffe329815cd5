"""Bases of motions in which those without mass that dampers resist stand apart: small systems tell them by structure.

A motion z is z_m + N a, with N the damped motions without mass and z_m one in which their own coordinates rest. Both
parts join the basis, so that M is regular in the first columns and exactly zero in the last ones, however little mass
z moves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.qr import pivoted_qr

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.sparse.equations import SparseEquations

# Motions that are new by less than this share of their length are left out: what is left of them has lost digits.
NEW = 1e-10
# What is left of a motion without those that move no mass is rounding below this share of it.
NOTHING = 1e-12


def told_apart(system: SparseEquations, basis: Array, rigid: int) -> tuple[Array, int]:
    """Return a basis that spans what another one does, and how many motions without mass are its last ones.

    Parameters
    ----------
    system : SparseEquations
        The whole system.
    basis : array, shape (size, n)
        Motions.
    rigid : int
        Number of the first ones, which are kept as they are.

    Returns
    -------
    array, shape (size, k)
        The first motions, others M-orthonormal with these, and some without mass; k is at most 2 n.
    int
        Number of the last.
    """
    if system.separation is None or not system.massless:
        return basis, 0
    n, own = system.separation.damped, system.separation.own
    share = basis[own] / np.asarray(n[own, np.arange(len(own))]).reshape(-1, 1)
    left = (basis - n @ share)[:, rigid:]
    rows = system.elastic_rows
    size = np.sqrt(np.abs(system.stiffness) + np.abs(system.damping))[:, None]
    energy, before = (
        np.linalg.norm(size * (rows @ part), axis=0) + np.linalg.norm(system.inertia_factor @ part, axis=0)
        for part in (left, basis[:, rigid:])
    )
    mass = orthonormal(system.inertia_factor, basis[:, :rigid], left[:, energy > NOTHING * before])
    acts = np.flatnonzero(system.damping)
    weight = np.sqrt(np.abs(system.damping[acts]))[:, None]
    light = _independent(share, weight * (rows[acts] @ (n @ share)))
    return np.concatenate((mass, n @ light), axis=1), light.shape[1]


def orthonormal(factor: Any, first: Array, more: Array) -> Array:
    """Return motions with others M-orthonormal beside them, M = W^T W for a factor W."""
    old = np.linalg.qr(factor @ first)[0]
    upper = old.T @ (factor @ first)
    length = np.linalg.norm(factor @ more, axis=0)
    more = more[:, length > 0.0] / length[length > 0.0]
    for _ in range(2):
        rows = factor @ more
        share = old.T @ rows
        more, rows = more - first @ np.linalg.solve(upper, share), rows - old @ share
        _, singular, right = np.linalg.svd(rows, full_matrices=False)
        kept = singular > NEW
        more = more @ (right[kept].T / singular[kept])
    return np.concatenate((first, more), axis=1)


def _independent(share: Array, rows: Array) -> Array:
    """Independent combinations of columns, of unit damping; ``rows`` are their rates in dampers."""
    length = np.linalg.norm(rows, axis=0)
    used = length > NOTHING * length.max(initial=0.0)
    if not used.any():
        return np.zeros((len(share), 0))
    _, singular, right = np.linalg.svd(rows[:, used] / length[used], full_matrices=False)
    kept = singular > NEW
    return np.asarray((share[:, used] / length[used]) @ (right[kept].T / singular[kept]))


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
