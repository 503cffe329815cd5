"""Poses that a mechanism reaches only if its beams and superelements bend: those of least elastic energy.

The requested coordinates have their values. All others, those within the parts included, minimise the elastic energy of
the parts with loops closed: Newton's method takes the residual along free coordinates to zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.equilibrium.articulation import articulated
from mbsvib.equilibrium.balance import Balance, balance
from mbsvib.equilibrium.motion import PosedModel, posed_model
from mbsvib.equilibrium.path import BALANCED, CLOSED, NEWTON_STEPS, newton_step
from mbsvib.errors import ModelError, SingularPoseError
from mbsvib.kinematics.closing import Closing, Reached
from mbsvib.kinematics.loops import kept_rows
from mbsvib.mechanism.mechanism import Mechanism

M = TypeVar("M", bound=Mechanism)

# The longest step [rad, mechanism sizes] of the requested coordinates, and the shortest that is still tried.
LONGEST, SHORTEST = 0.1, 1e-5
# The number of steps that are tried, shorter ones included, beyond those of the longest length.
STEPS = 80


def elastic_mechanism(model: M) -> M:
    """Return a mechanism in which only beams and superelements resist motion; these carry no forces in its pose."""
    parts: dict[str, Any] = dict(model.composed)
    parts = {name: replace(part, displacements=None) for name, part in parts.items()}
    return articulated(model.with_parts(composed=parts, springs={}, loads={}, inputs={}, outputs={}, gravity=None))


def pose_of_least_energy(
    mechanism: Mechanism, values: Mapping[str, float], cut: Sequence[str]
) -> tuple[PosedModel, Balance] | None:
    """Return the pose of least elastic energy for values of some joint coordinates, or None if there is none.

    ``values``: how far coordinates of its tree move [m, rad]. ``cut``: joints at which loops are cut.
    """
    at, names = posed_model(mechanism, cut=cut), list(values)
    known = at.coordinates.names
    if not set(names) <= set(known):
        return None
    try:
        forces = balance(at, names)
    except (ModelError, SingularPoseError):
        return None
    blocks = tuple(kept_rows(at.cuts, forces.reduction))
    closing = Closing(at.kinematics, tuple(mechanism.couplers.values()), blocks)
    state = _Bent(at, forces, closing, closing.described)
    places = np.array([known.index(name) for name in names], dtype=np.intp)
    target = np.array([values[name] for name in names])
    longest = float(np.abs(target / at.scale[places]).max(initial=0.0))
    done, step = 0.0, min(1.0, LONGEST / max(longest, LONGEST))
    for _ in range(STEPS + int(longest / LONGEST)):
        share = min(step, 1.0 - done)
        after = _follow(state, places, (done + share) * target)
        if after is not None:
            state, done = after, done + share
            if done >= 1.0:
                return state.at, state.forces
            step = min(2.0 * step, LONGEST / max(longest, LONGEST))
        elif share * longest < SHORTEST:
            break
        else:
            step = 0.5 * share
    return None


@dataclass(frozen=True)
class _Bent:
    """A pose ``at``, its ``forces``, and the values of the coordinates there, ``reached`` by ``closing`` loops."""

    at: PosedModel
    forces: Balance
    closing: Closing
    reached: Reached

    def moved(self, step: Array, places: Index, target: Array) -> tuple[PosedModel, Reached]:
        """The pose after a step (n,) of all joints with coordinates at ``places`` at their values and loops closed."""
        q = self.reached.q + self.closing.changes(self.reached, step)
        q[:, places] = target
        reached = self.closing.near(q, self.reached)
        return replace(self.at, pose=reached.pose[0], travel=reached.travel[0]), reached


def _follow(state: _Bent, places: Index, target: Array) -> _Bent | None:
    """One step of the requested coordinates to their values, and Newton's method for the others."""
    forces, names = state.forces, [state.at.coordinates.names[k] for k in places.tolist()]
    motion = np.zeros(len(forces.names))
    motion[[forces.names.index(name) for name in names]] = target - state.reached.q[0, places]
    unbalanced = _along_free(forces, names)
    # along the tangent, the others follow such that their forces do not change
    against = np.where(_free(forces.names, names), forces.tangent @ motion, 0.0)
    follow = newton_step(replace(unbalanced, residual=unbalanced.residual - against))
    step = forces.all_joints(motion) + follow
    for _ in range(NEWTON_STEPS):
        if np.abs(step / state.at.scale).max(initial=0.0) > 5.0 * LONGEST:
            return None
        try:
            at, reached = state.moved(step, places, target)
            if reached.opening[0] > max(CLOSED, at.rounding):
                return None
            state = replace(state, at=at, reached=reached, forces=balance(at, names))
        except (ModelError, SingularPoseError):
            return None
        unbalanced = _along_free(state.forces, names)
        if unbalanced.share <= BALANCED:
            return state
        step = newton_step(unbalanced)
    return None


def _free(coordinates: Sequence[str], names: list[str]) -> Any:
    """Which coordinates are not among the named ones."""
    return np.array([name not in names for name in coordinates])


def _along_free(forces: Balance, names: list[str]) -> Balance:
    """The forces along the free coordinates; zero along the named ones, which therefore do not move."""
    free = _free(forces.names, names)
    return replace(forces, residual=np.where(free, forces.residual, 0.0),
                   tangent=np.where(np.logical_and.outer(free, free), forces.tangent, 0.0))  # fmt: skip
