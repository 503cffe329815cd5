"""Modal disparity: how modes of a system hand their energy to the modes of the same system under constraints."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import eigh

from mbsvib.common.arrays import Array
from mbsvib.common.expected import a_system
from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError

# Motions of the held system that the free one follows no better than this are none of it.
ADMISSIBLE = 1e-8


def modal_disparity(free_system: Equations, held_system: Equations) -> Array:
    """Return the share of each mode's kinetic energy that each mode of the held system takes over.

    Where constraints catch a system that moves in one of its modes phi_i, its velocity is projected on the motions that
    they leave, in the sense of the mass matrix; mode psi_j of the held system then has the share

    D_ij = (psi_j^T M phi_i)^2 / ((phi_i^T M phi_i) (psi_j^T M psi_j))

    of the energy before. What the shares of a row lack of 1 is lost in the catch; where both systems have the same
    modes D is the identity, and there is no disparity. Both are taken without damping, modes in order of frequency.

    Parameters
    ----------
    free_system : System
        The system without the constraints.
    held_system : System
        The same bodies with more joints or couplers.

    Returns
    -------
    array, shape (modes of free, modes of held)
        Shares of kinetic energy.

    Raises
    ------
    ResponseError
        If the bodies are not the same, the held system has motions that the free one has not, or a system has
        coordinates without mass.

    Source: Diaz & Mukherjee (2006), Modal disparity enhancement through optimal insertion of nonstructural masses,
    Structural and Multidisciplinary Optimization 31.
    """
    free, held = (_symmetric(a_system(system, "modal_disparity", field)) for system, field in (
        (free_system, "free_system"), (held_system, "held_system")))  # fmt: skip
    bodies = list(free.displacements(np.zeros(free.dof)))
    missing = [name for name in held.displacements(np.zeros(held.dof)) if name not in bodies]
    if missing:
        raise ResponseError(f"modal_disparity: body '{missing[0]}' of '{held.name}' is none of '{free.name}'; give two "
                            f"systems of the same bodies, one of which has more joints.")  # fmt: skip
    motions = [_motions(system, bodies) for system in (free, held)]
    # coordinates of the free system that move the bodies as those of the held system do
    transform = np.linalg.lstsq(motions[0], motions[1], rcond=None)[0]
    residual = np.abs(motions[0] @ transform - motions[1]).max(initial=0.0)
    if residual > ADMISSIBLE * np.abs(motions[1]).max(initial=1.0):
        raise ResponseError(f"modal_disparity: '{held.name}' moves in ways that '{free.name}' does not; give the "
                            f"system without the constraints first.")  # fmt: skip
    shapes = [_modes(free), transform @ _modes(held)]
    mass = np.asarray(free.M)
    norms = [np.einsum("ki,kl,li->i", shape, mass, shape) for shape in shapes]
    return np.asarray((shapes[0].T @ mass @ shapes[1]) ** 2 / np.outer(*norms))


def _motions(system: Any, bodies: list[str]) -> Array:
    """Displacements (6 bodies, m) of bodies per unit coordinate."""
    columns = [system.displacements(unit) for unit in np.eye(system.dof)]
    return np.array([np.concatenate([column[name] for name in bodies]) for column in columns]).T


def _symmetric(system: Any) -> Any:
    """Refuse equations whose modes are not orthogonal."""
    if system.circulatory is not None:
        raise ResponseError(f"modal_disparity: '{system.name}' has follower loads, torques or cross-coupled "
                            f"bushings, whose K is not symmetric, so that its modes share no energy; leave these "
                            f"out.")  # fmt: skip
    return system


def _modes(system: Any) -> Array:
    try:
        return np.asarray(eigh(system.K, system.M)[1])
    except np.linalg.LinAlgError as error:
        raise ResponseError(f"modal_disparity: '{system.name}' has coordinates without mass, whose modes hold no "
                            f"kinetic energy; give their bodies a mass.") from error  # fmt: skip
