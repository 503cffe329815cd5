"""Feedthrough of systems and loops, with zeros where it is rounding."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.rank import ZERO_MARKOV
from mbsvib.responses.feedthrough import entry_sizes, feedthrough

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


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
