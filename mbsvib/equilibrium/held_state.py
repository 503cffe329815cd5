"""States of equilibrium but for the force that holds one joint coordinate, and Newton's method to reach them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.equations.statics import shares
from mbsvib.equilibrium.balance import Balance, balance
from mbsvib.equilibrium.motion import PosedModel
from mbsvib.equilibrium.path import BALANCED, NEWTON_STEPS, after_step
from mbsvib.errors import EquilibriumError
from mbsvib.linalg.rank import EPS, ZERO_STIFFNESS

# The longest correction [rad, mechanism sizes].
FARTHEST = 0.2


@dataclass(frozen=True)
class State:
    """A pose in equilibrium but for the force along the ``led`` coordinate, which is number ``i`` of ``forces``."""

    at: PosedModel
    forces: Balance
    led: str
    value: float

    @cached_property
    def i(self) -> int:
        """Number of the led coordinate among the minimal ones."""
        return self.forces.names.index(self.led)

    @property
    def force(self) -> float:
        """The generalized force that holds the coordinate [N, N m]."""
        return -float(self.forces.residual[self.i])

    @cached_property
    def _tangent(self) -> Array:
        """The scaled tangent of the forces."""
        return self.forces.scaled_tangent

    @cached_property
    def free(self) -> Array:
        """Numbers of the other coordinates."""
        return np.delete(np.arange(len(self.forces.names)), self.i)

    @property
    def share(self) -> float:
        """The residual along the other coordinates, as a share of the forces."""
        return float(shares(self.forces.residual[self.free], self.forces.size[self.free]).max(initial=0.0))

    @cached_property
    def direction(self) -> Array:
        """The direction (m,) of the curve, scaled, of unit length; its sign is open."""
        _, sizes, rows = np.linalg.svd(self._tangent[self.free])
        null = rows[int(np.sum(sizes > ZERO_STIFFNESS * sizes.max(initial=0.0))) :]
        along = null.T @ null[:, self.i]  # of several motions without stiffness the one that moves the coordinate
        size = float(np.linalg.norm(along))
        return np.asarray(along / size if len(null) > 1 and size > ZERO_STIFFNESS else null[-1])

    @cached_property
    def stiffness(self) -> Array:
        """Eigenvalues of the stiffness under a constant force, ascending by their real parts."""
        return np.sort(np.linalg.eigvals(self._tangent).real)

    @cached_property
    def stiffness_held(self) -> Array:
        """Eigenvalues of the stiffness while the coordinate is held, ascending by their real parts."""
        matrix = self._tangent[np.ix_(self.free, self.free)]
        return np.sort(np.linalg.eigvals(matrix).real)

    @property
    def softest(self) -> Array:
        """Motion of the other coordinates (m,) with the least stiffness, scaled to length 1, its largest positive."""
        result = np.zeros(len(self.forces.names))
        result[self.free] = np.linalg.svd(self._tangent[np.ix_(self.free, self.free)])[2][-1]
        motion = self.forces.all_joints(self.forces.scale * result)
        return np.asarray(result * np.sign(motion[np.abs(motion).argmax()]))

    def rise(self, along: Array) -> float:
        """Change of the holding force along a direction."""
        return float(self._tangent[self.i] @ along)

    def correction(self, exact: bool) -> Array:
        """Newton step (m,) of the least norm; with ``exact`` the led coordinate stays."""
        columns = self.free if exact else np.arange(len(self.forces.names))
        matrix, right = self._tangent[np.ix_(self.free, columns)], (self.forces.scale * self.forces.residual)[self.free]
        result = np.zeros(len(self.forces.names))
        result[columns] = np.linalg.lstsq(matrix, right, rcond=ZERO_STIFFNESS)[0]
        return result


def stepped(state: State, step: Array) -> State | None:
    """Return the state after a scaled step (m,) with loops closed, forces not balanced; None where loops cannot be, or
    forces are not defined there or on the way.
    """
    by = state.forces.scale * step
    reached = after_step(state.at, state.forces.all_joints(by), state.forces, state.led)
    return None if reached is None else State(*reached, state.led, state.value + float(by[state.i]))


def corrected(state: State | None, exact: bool = False) -> tuple[State, int] | None:
    """Return the state on the curve next to another one and the number of Newton steps; None if they do not contract.

    With ``exact`` the led coordinate keeps its value.
    """
    for count in range(NEWTON_STEPS):
        if state is None:
            return None
        if state.share <= EPS:
            return state, count
        step = state.correction(exact)
        if np.linalg.norm(step) > FARTHEST:
            return None
        following = stepped(state, step)
        if state.share <= BALANCED and (following is None or not following.share < 0.5 * state.share):
            return state, count
        state = following
    return None


def started(at: PosedModel, coordinate: str) -> State:
    """Return the equilibrium next to a pose while a coordinate is held where it is."""
    state = State(at, balance(at, [coordinate]), coordinate, 0.0)
    corrected_state = corrected(state, exact=True)
    if corrected_state is None:
        raise EquilibriumError(
            f"path: model '{at.reference.name}' is not in balance in the given pose while '{coordinate}' is held, and "
            f"Newton's method finds no equilibrium next to it. Start from model.equilibrium(), or from a pose nearer "
            f"to one.", coordinate=coordinate,
        )  # fmt: skip
    return corrected_state[0]
