"""Accelerations that forces cause at once, M^-1 F, and the feedthrough of systems and loops, D + Ca M^-1 B."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.linalg.groups import part_numbers
from mbsvib.linalg.qr import gram_solution
from mbsvib.linalg.rank import EPS, ZERO_MARKOV
from mbsvib.responses.first_order import FirstOrder, physical
from mbsvib.responses.general_terms import cleaned

if TYPE_CHECKING:
    from mbsvib.equations.equations import Equations

# An entry of D below this share of its terms is 0.
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
    moved = accelerations(system, system.B)
    result = system.D + system.Ca @ moved
    result[np.abs(result) <= ROUNDING * (np.abs(system.D) + _terms(system, moved))] = 0.0
    return np.asarray(result)


def _terms(system: Equations, moved: Array) -> Array:
    """Sizes (outputs, inputs) of the terms of Ca M^-1 B, each entry of Ca, M and B as large as rounding takes it.

    dCa (M^-1 B) + (Ca M^-1) dB + (Ca M^-1) dM (M^-1 B); ``moved`` is M^-1 B.
    """
    scale = np.sqrt(system.M.diagonal())
    seeing, moved = (np.abs(x) * scale[:, None] for x in (accelerations(system, system.Ca.T), moved))
    seen, pushed = entry_sizes(system.Ca, 1.0 / scale), entry_sizes(system.B.T, 1.0 / scale)
    return np.asarray(seen @ moved + seeing.T @ (pushed.T + (system.M != 0.0) @ moved))


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
        return of_first_order(linear)
    if linear.kind != "closed loop":
        return np.asarray(linear.D)
    plant, gain, (y, u), (o, i) = direct(linear.open_loop), linear.law.D, linear.ports, linear.selected_ports
    back = np.linalg.inv(np.eye(len(u)) - gain @ plant[np.ix_(y, u)]) @ gain
    value = plant + plant[:, u] @ back @ plant[y]
    value = without_rounding(value, np.abs(plant) + np.abs(plant[:, u]) @ np.abs(back) @ np.abs(plant[y]))
    return value[np.ix_(o, i)]


def of_first_order(system: Equations, states: FirstOrder | None = None) -> Array:
    """Return D of the first-order equations of a system, 0 where it is rounding.

    ``states``: its physical ones, where it has massless motions and these are known.
    """
    if not system.massless:
        return feedthrough(system)
    states = physical(system) if states is None else states
    rate, through = states.transform[system.dof :], states.through[system.dof :]
    seen, rates = states.accelerations(system)
    value = cleaned(seen, rates, states.b, direct=system.D + system.Cv @ through)
    scale = np.linalg.norm(cleaned(system.inertia_factor, rate), axis=0)  # states of one kinetic energy
    inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
    terms = np.abs(system.D) + np.abs(system.Ca) @ (np.abs(rate) @ np.abs(states.b))
    terms += entry_sizes(system.Ca @ rate, inverse) @ entry_sizes(states.b.T, scale).T
    return without_rounding(value, terms + np.abs(system.Cv) @ np.abs(through))
