"""Poses that a mechanism reaches only if its beams and superelements bend: those of least elastic energy.

The requested coordinates have their values. All others, those within the parts included, minimise the elastic energy of
the parts with loops closed: Newton's method takes the residual along free coordinates to zero.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from mbsvib.equilibrium.articulation import articulated
from mbsvib.equilibrium.balance import Balance, balance
from mbsvib.equilibrium.motion import PosedModel, close, posed_model
from mbsvib.equilibrium.path import BALANCED, CLOSED, NEWTON_STEPS, newton_step
from mbsvib.equilibrium.vector_coordinates import held_vectors
from mbsvib.errors import ModelError, SingularPoseError
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.equilibrium.vector_coordinates import Held

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
    at = posed_model(mechanism, cut=cut)
    names = list(values)
    if not set(names) <= set(at.coordinates.names):
        return None
    scale = at.scale[[at.coordinates.names.index(name) for name in names]]
    target = np.array([values[name] for name in names])
    longest = float(np.abs(target / scale).max(initial=0.0))
    try:
        forces = balance(at, names)
    except (ModelError, SingularPoseError):
        return None
    done, step = 0.0, min(1.0, LONGEST / max(longest, LONGEST))
    held = held_vectors(mechanism, at.coordinates, _free(at.coordinates.names, names))
    whole = np.array([values.get(name, 0.0) for name in at.coordinates.names])
    for _ in range(STEPS + int(longest / LONGEST)):
        share = min(step, 1.0 - done)
        reached = _follow(at, forces, names, share * target, held.at((done + share) * whole))
        if reached is not None:
            (at, forces), done = reached, done + share
            if done >= 1.0:
                return at, forces
            step = min(2.0 * step, LONGEST / max(longest, LONGEST))
        elif share * longest < SHORTEST:
            break
        else:
            step = 0.5 * share
    return None


def _follow(
    at: PosedModel, forces: Balance, names: list[str], by: Array, held: Held
) -> tuple[PosedModel, Balance] | None:
    """One step of the requested coordinates, and Newton's method for the others."""
    motion = np.zeros(len(forces.names))
    motion[[forces.names.index(name) for name in names]] = by
    unbalanced = _along_free(forces, names)
    # along the tangent, the others follow such that their forces do not change
    against = np.where(_free(forces.names, names), forces.tangent @ motion, 0.0)
    follow = newton_step(replace(unbalanced, residual=unbalanced.residual - against))
    step = forces.all_joints(motion) + follow
    for _ in range(NEWTON_STEPS):
        if np.abs(step / at.scale).max(initial=0.0) > 5.0 * LONGEST:
            return None
        try:
            after_step, gap = close(at.moved(step), _free(at.coordinates.names, names), held)
            after = None if gap > max(CLOSED, after_step.rounding) else balance(after_step, names)
        except (ModelError, SingularPoseError):
            return None
        if after is None:
            return None
        at, unbalanced = after_step, _along_free(after, names)
        if unbalanced.share <= BALANCED:
            return at, after
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
