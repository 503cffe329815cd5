"""Accelerations that forces cause at once, M^-1 F, and the feedthrough of systems and loops, D + Ca M^-1 B."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.linalg.groups import part_numbers
from mbsvib.linalg.qr import gram_solution
from mbsvib.linalg.rank import EPS, ZERO_MARKOV

if TYPE_CHECKING:
    from mbsvib.equations.equations import Equations

# An entry of D below this share of what M^-1 makes of rounding of its terms is 0.
ROUNDING = 32 * EPS


def accelerations(system: Equations, forces: Array) -> Array:
    """Return M^-1 F (m, n) of regular M; coordinates whose accelerations M does not tie to the forces have exactly 0.
    """
    result = gram_solution(system.inertia_factor, forces)
    part = part_numbers(system.M != 0.0)
    if part.any():
        acted_on = np.zeros((part.max() + 1, forces.shape[1]), dtype=bool)
        np.logical_or.at(acted_on, part, forces != 0.0)
        result[~acted_on[part]] = 0.0
    return result


def feedthrough(system: Equations) -> Array:
    """Return D + Ca M^-1 B (outputs, inputs) of regular M, 0 where it is rounding."""
    if not system.Ca.any():
        return np.array(system.D)
    result = system.D + system.Ca @ accelerations(system, system.B)
    result[np.abs(result) <= ROUNDING * _terms(system)] = 0.0
    return np.asarray(result)


def _terms(system: Equations) -> Array:
    """Sizes (outputs, inputs) of the terms of D + Ca M^-1 B, each entry of Ca, M and B as large as rounding takes it.
    """
    scale = np.sqrt(system.M.diagonal())
    inverse = np.abs(accelerations(system, np.diag(scale))) * scale[:, None]
    seen, moved = entry_sizes(system.Ca, 1.0 / scale), entry_sizes(system.B.T, 1.0 / scale).T
    return np.asarray(np.abs(system.D) + seen @ (inverse @ ((system.M != 0.0) @ (inverse @ moved))))


def entry_sizes(rows: Array, scale: Array) -> Array:
    """Return sizes (rows, m) against which entries of rows times ``scale`` (m,) are rounding: the largest of the row.

    6e-17 beside 1 may be a zero whose rotation was rounded; what is exactly 0 is.
    """
    scaled = np.abs(rows) * scale
    return np.asarray((rows != 0.0) * scaled.max(axis=1, keepdims=True, initial=0.0))


def without_rounding(value: Array, terms: Array) -> Array:
    """Return a sum, with zeros where it is rounding of its terms; ``terms`` is the sum of their magnitudes."""
    return np.where(np.abs(value) > ZERO_MARKOV * terms, value, 0.0)


def direct(linear: Any) -> Array:
    """Return the feedthrough H0 (outputs, inputs) of a system, a state space or a loop, D of its first-order equations.
    """
    if linear.kind == "system":
        return _of_system(linear)
    if linear.kind != "closed loop":
        return np.asarray(linear.D)
    plant, gain, (y, u), (o, i) = direct(linear.open_loop), linear.law.D, linear.ports, linear.selected_ports
    back = np.linalg.inv(np.eye(len(u)) - gain @ plant[np.ix_(y, u)]) @ gain
    value = plant + plant[:, u] @ back @ plant[y]
    value = without_rounding(value, np.abs(plant) + np.abs(plant[:, u]) @ np.abs(back) @ np.abs(plant[y]))
    return value[np.ix_(o, i)]


def _of_system(system: Any) -> Array:
    if not system.massless:
        return feedthrough(system)
    space, m = system.state_space(), system.dof
    rate = space.transform[m:]
    scale = np.sqrt(np.einsum("ik,ij,jk->k", rate, system.M, rate))  # states of one kinetic energy
    inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
    terms = np.abs(system.D) + np.abs(system.Ca) @ (np.abs(rate) @ np.abs(space.B))
    terms += entry_sizes(system.Ca @ rate, inverse) @ entry_sizes(space.B.T, scale).T
    if space.through is not None:
        terms += np.abs(system.Cv) @ np.abs(space.through[m:])
    return without_rounding(space.D, terms)
