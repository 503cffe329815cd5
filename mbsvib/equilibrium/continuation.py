"""Equilibria of a mechanism while one joint coordinate is led along values, through turning and branch points.

The forces along all other coordinates vanish, r(z) = 0: one equation less than coordinates, so that its solutions are
curves. A step goes along the null vector of the tangent of these equations and returns to the curve by Newton steps of
least norm, which neither an extreme of the coordinate nor one of the force that holds it disturbs.

Source: E. L. Allgower and K. Georg, Introduction to Numerical Continuation Methods (SIAM 2003), chapters 2, 3 and 8.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from mbsvib.common.arrays import Array
from mbsvib.equilibrium.held_state import State, corrected, stepped
from mbsvib.errors import EquilibriumError

# Length of a step [rad, mechanism sizes]: the first, the longest and the shortest that is tried.
FIRST, LONGEST, SHORTEST = 0.02, 0.1, 1e-7
# The direction turns by less than this cosine in a step, and steps that need so few corrections become longer.
STRAIGHT, FEW = 0.95, 3
STEPS = 5000
# A coordinate has the value asked for within this share of its scale.
SAME = 1e-12
# Special points are located to this share of a step.
LOCATED = 1e-10


@dataclass(frozen=True, slots=True)
class Passed:
    """A state on the way; ``kind`` is "turning" (of the coordinate), "limit" (of the force), "branch" or empty."""

    kind: str
    state: State


@dataclass(frozen=True, slots=True)
class Arc:
    """One step of the curve: from a state ``along`` a direction of some ``length``, and the state at its ``end``."""

    start: State
    along: Array
    length: float
    end: State
    onward: Array

    def at(self, share: float) -> tuple[State, Array]:
        """Return the state at a share of the step, and the direction there."""
        if share in (0.0, 1.0):
            return (self.start, self.along) if share == 0.0 else (self.end, self.onward)
        next_state = corrected(stepped(self.start, share * self.length * self.along))
        if next_state is None:
            raise _stuck(self.start, self.end.value, "Newton's method does not contract there")
        return next_state[0], continued(next_state[0], self.start, self.along)

    def located(
        self, quantity: Callable[[State, Array], float], between: tuple[float, float] = (0.0, 1.0)
    ) -> float | None:
        """Return the share of the step at which a quantity changes its sign, None if it does not."""
        first, last = (quantity(*self.at(share)) for share in between)
        if first * last > 0.0 or first == 0.0:
            return None
        return float(brentq(lambda share: quantity(*self.at(share)), *between, xtol=LOCATED))

    def special(self) -> Iterator[tuple[float, Passed]]:
        """Yield the special points of the step with their shares of it, at most one of each kind."""
        turning = self.located(lambda state, along: float(along[state.i]))
        if turning is not None:
            yield turning, Passed("turning", self.at(turning)[0])
        limit = self.located(lambda state, along: state.rise(along))
        if limit is not None:
            yield limit, Passed("limit", self.at(limit)[0])
        counts = [int(np.sum(state.stiffness_held < 0.0)) for state in (self.start, self.end)]
        # the stiffness that vanishes at a turning point is along the curve itself
        for k in range(min(counts) + (turning is not None), max(counts)):
            branch = self.located(lambda state, _, k=k: float(state.stiffness_held[k]))  # type: ignore[misc]
            if branch is not None:
                yield branch, Passed("branch", self.at(branch)[0])


def arc(start: State, along: Array, length: float) -> tuple[Arc, float]:
    """Return a step of the curve, shorter than asked for where it bends, and the length for the next one."""
    while True:
        reached = corrected(stepped(start, length * along))
        if reached is not None:
            end, count = reached
            onward = continued(end, start, along)
            if _cosine(start, along, end, onward) >= STRAIGHT:
                return Arc(start, along, length, end, onward), min(1.5 * length, LONGEST) if count <= FEW else length
        length *= 0.5
        if length < SHORTEST:
            raise _stuck(start, None, "no step can be taken there, as loops cannot be closed any further, a spring "
                         "would turn beyond its limit of 172 degrees, or the curve has a corner")  # fmt: skip


def crossing(at: State, sense: int) -> Arc:
    """Return the first step from a branch point onto the path that crosses there.

    ``sense``: 1 to go along the direction of ``softest``, -1 against it.
    """
    along = sense * at.softest
    next_state = corrected(stepped(at, FIRST * along))
    if next_state is not None and abs(_joints(next_state[0], next_state[0].direction) @ _joints(at, along)) > 0.5:
        return Arc(at, along, FIRST, next_state[0], continued(next_state[0], at, along))
    raise _stuck(at, None, "Newton's method does not find the path that crosses there")


def led_to(start: State, along: Array, value: float, switch: int = 0) -> tuple[State, Array, list[Passed], int]:
    """Follow the curve to the next state in which the coordinate has a value.

    ``along`` (m,): direction of the curve; it is reversed if it leads away from the value. ``value``: value of the
    coordinate [m, rad]. ``switch``: 1 or -1: at the next branch point go on along the path that crosses, in this sense;
    0: stay on the curve.
    """
    passed: list[Passed] = []
    if abs(value - start.value) <= SAME * start.forces.scale[start.i]:
        return start, along, passed, switch
    along, length = along * (1.0 if along[start.i] * (value - start.value) > 0.0 else -1.0), FIRST
    leaving: Arc | None = None
    for _ in range(STEPS):
        step, length = arc(start, along, length) if leaving is None else (leaving, FIRST)
        points = sorted(step.special(), key=lambda point: point[0]) if leaving is None else []
        branch = next((share for share, point in points if point.kind == "branch"), None) if switch else None
        points = [(share, point) for share, point in points if branch is None or share <= branch]
        ends = [0.0, *(share for share, point in points if point.kind == "turning"), 1.0 if branch is None else branch]
        for between in pairwise(ends):
            share = step.located(lambda state, _: state.value - value, between)
            if share is not None:
                reached = _exactly(step.at(share)[0], value)
                passed += [point for x, point in points if x < share]
                return reached, continued(reached, step.start, step.along), passed, switch
        passed += [point for _, point in points]
        start, along, leaving = step.end, step.onward, None
        if branch is not None:
            leaving, switch = crossing(step.at(branch)[0], switch), 0
        else:
            passed.append(Passed("", start))
    raise _stuck(start, value, f"{STEPS} steps do not reach it")


def _exactly(near: State, value: float) -> State:
    """The state in which the coordinate has exactly a value, from one nearby."""
    step = np.zeros(len(near.forces.names))
    step[near.i] = (value - near.value) / near.forces.scale[near.i]
    next_state = corrected(stepped(near, step), exact=True)
    if next_state is None:
        raise _stuck(near, value, "Newton's method does not reach it")
    return replace(next_state[0], value=value)


def _stuck(state: State, value: float | None, why: str) -> EquilibriumError:
    beyond = "no further" if value is None else f"not to {value:.6g}"
    return EquilibriumError(
        f"path: '{state.led}' can be led to {state.value:.6g} and {beyond}: {why}. Ask for values short of it, or "
        f"lead another coordinate.", coordinate=state.led,
    )  # fmt: skip


def _joints(state: State, step: Array) -> Array:
    """A scaled step as the motion of all joints, in comparable units."""
    return np.asarray(state.forces.all_joints(state.forces.scale * step) / state.at.scale)


def _cosine(first: State, along: Array, second: State, onward: Array) -> float:
    a, b = _joints(first, along), _joints(second, onward)
    return float(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)))


def continued(new: State, last: State, along: Array) -> Array:
    """Return the direction of the curve at a state that continues the one at another state."""
    return new.direction if _cosine(last, along, new, new.direction) >= 0.0 else -new.direction
