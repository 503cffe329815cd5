"""Modal truncation: the modes that contribute most to the frequency response, with or without the static part of the
others.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.modes.undamped import undamped
from mbsvib.reduction.projection import projected

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations
    from mbsvib.modes.undamped import Undamped

# Accuracy of the frequencies: that of rounding, as reduced models are compared with the whole one.
RTOL = 1e-12


class ModalTruncation:
    """Undamped modes in the order of their contributions, of which the first ones make a reduced model.

    ``corrected``: whether the static response of the modes left out goes into D.
    """

    def __init__(self, system: Equations, corrected: bool) -> None:
        self.system, self.corrected = system, corrected
        self.modes: Undamped = undamped(system, RTOL)
        self.ranked = np.argsort(-peaks(system, self.modes, corrected), kind="stable")

    @property
    def least(self) -> int:
        """Number of free motions, which every reduced model has."""
        return self.modes.rigid

    @property
    def most(self) -> int:
        """Number of modes."""
        return self.system.dof

    def model(self, order: int) -> Equations:
        """Return the reduced model of some number of modes."""
        retained = np.sort(self.ranked[:order])
        names = [f"mode{k + 1}" for k in retained.tolist()]
        small = projected(self.system, self.modes.shapes[:, retained], names, ["modal"] * order)
        return replace(small, D=small.D + self.static(np.sort(self.ranked[order:]))) if self.corrected else small

    def static(self, truncated: Array) -> Array:
        """Return the static response of some modes, (outputs, inputs)."""
        shapes = self.modes.shapes[:, truncated]
        return np.asarray((self.system.Cq @ shapes / self.modes.square[truncated]) @ (shapes.T @ self.system.B))


def peaks(system: Equations, modes: Undamped, corrected: bool) -> Array:
    """Return how large the contribution of each mode to the frequency response becomes, (m,), in SI units.

    max over w of |c(i w) / (w0^2 + 2 i zeta w0 w - w^2)| |b|, about |c(i w0)| |b| / (2 zeta w0^2), infinite for free
    motions; damping that couples modes does not count, nor the static part if responses are ``corrected`` by it.
    """
    omega, shapes = modes.omega, modes.shapes
    damping = np.einsum("ik,ij,jk->k", shapes, system.C, shapes)
    observed = np.linalg.norm(
        system.Cq @ shapes + 1j * omega * (system.Cv @ shapes) - omega**2 * (system.Ca @ shapes), axis=0)  # fmt: skip
    static = np.linalg.norm(system.Cq @ shapes, axis=0)
    free = np.arange(len(omega)) < modes.rigid
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a mode without damping has no bound
        height = np.where(observed > 0.0, observed / (damping * omega), 0.0)
        height = height if corrected else np.maximum(height, static / omega**2)
    reached = np.linalg.norm(shapes.T @ system.B, axis=1)
    result = np.zeros(len(omega))
    np.multiply(height, reached, out=result, where=reached > 0.0)  # an undamped mode counts if an input reaches it
    result[free] = np.inf
    return result
