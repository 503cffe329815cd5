"""Newton's method for the pose of equilibrium, along the path that the mechanism itself would take.

Load steps, for a mechanism that its springs hold: the loads are applied in steps, and a step is accepted only if
Newton's method contracts and the tangent K + K_g stays positive definite. Where the mechanism becomes stiffer, as a
beam that is stretched, Newton's steps are shortened. Otherwise the branch ends there, and the mechanism would snap
through. Descent, for other mechanisms: steps |K + K_g|^-1 r of limited length, which become Newton steps near the
equilibrium.

Source: Crisfield, Non-linear Finite Element Analysis of Solids and Structures (1991), chapter 9, for steps along a
load; Dauphin et al., Advances in Neural Information Processing Systems 27 (2014), for steps with |K + K_g|.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import TypeVar

import numpy as np

from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.equilibrium.balance import Balance, balance
from mbsvib.equilibrium.motion import PosedModel, close, leaps, same_branch
from mbsvib.errors import ModelError, NoWordsError, SingularPoseError
from mbsvib.linalg.rank import EPS, ZERO_STIFFNESS
from mbsvib.mechanism.mechanism import Mechanism

M = TypeVar("M", bound=Mechanism)

# A pose is one of equilibrium if the residual is below this share of the forces.
BALANCED = 1e-10
# Longest step of the descent [rad, mechanism sizes], and how often a step is halved.
LONGEST, HALVINGS = 0.3, 30
STEPS = 200
# A step goes too far if the forces at its end do this share of the work back that they do at its start.
OVERSHOOT = 0.5
# Newton steps must become shorter by this factor from one to the next; at most so many are taken.
CONTRACTION, NEWTON_STEPS = 0.5, 12
# Shares of the load that are closer than this are not divided any more: the branch ends between them.
SMALLEST_SHARE = 1e-3
# Loops are closed when they are open by less than this share of the mechanism's size, or by rounding.
CLOSED = 1e-11
# Motions without stiffness get no step if no more than this share of the forces acts along them; otherwise their
# stiffness is assumed to be this share of the largest one.
NEGLIGIBLE_SHARE, SOFTEST = 1e-12, 1e-6


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The last pose of a search, as ``at``, the ``balance`` of forces there, and the steps that led to it.

    ``residuals`` are the shares of the forces left over after each step under the full load, ``steps`` counts all
    steps, ``shares`` are the shares of the load at which an equilibrium was computed; ``stopped`` is the reason why no
    equilibrium was reached, and empty if one was.
    """

    at: PosedModel
    balance: Balance
    residuals: tuple[float, ...]
    steps: int
    shares: tuple[float, ...]
    stopped: str = ""


def with_share(model: M, share: float) -> M:
    """Return a model with a share of gravity, loads and centrifugal forces; preloads of springs stay."""
    if share == 1.0:
        return model
    loads = {} if not share else {
        name: replace(load, force=_shared(load.force, share), torque=_shared(load.torque, share))
        for name, load in model.loads.items()
    }  # fmt: skip
    bodies = model.bodies if not model.hubs else dict(model.bodies) | {
        name: replace(hub, speed=sqrt(share) * hub.speed) for name, hub in model.hubs.items()}  # fmt: skip
    gravity = None if model.gravity is None else _shared(model.gravity, share)
    return model.with_parts(bodies=bodies, gravity=gravity, loads=loads)


def _shared(vector: Vector, share: float) -> Vector:
    x, y, z = vector
    return share * x, share * y, share * z


def after_step(
    at: PosedModel, step: Array, forces: Balance, led: str | None = None
) -> tuple[PosedModel, Balance] | None:
    """Return the pose after a motion (n,) of all joints with loops closed, and the forces there; None if loops cannot
    be closed before a dead point of the coordinates of ``forces``, or the forces are not defined there or on the way.

    ``led``: a coordinate of ``forces`` that keeps its value, as all minimal ones then do, while loops are closed.
    """
    try:
        after, opening = close(at.moved(step), None if led is None else forces.depends)
        if opening > max(CLOSED, after.rounding) or leaps(at, after, step):
            return None
        there = None if led is None else [led]
        return (after, balance(after, there)) if at.cuts is None or same_branch(at, after, forces.depends) else None
    except NoWordsError:
        raise
    except (ModelError, SingularPoseError):
        return None


def stiffness(forces: Balance) -> tuple[Array, Array]:
    """Return eigenvalues and vectors of the symmetric part of the tangent, coordinates being scaled alike."""
    matrix = forces.scaled_tangent
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return values, vectors


def is_stable(values: Array) -> bool:
    """Tell whether all eigenvalues are positive by more than rounding."""
    return bool(len(values) == 0 or values[0] > ZERO_STIFFNESS * np.abs(values).max())


def newton_step(forces: Balance) -> Array:
    """Return the step of all joints: of Newton's method where the tangent is positive definite, of descent elsewhere.

    It has no part along motions without stiffness and without force.
    """
    scale, residual = forces.scale, forces.scale * forces.residual
    values, vectors = stiffness(forces)
    if is_stable(values):
        return forces.all_joints(scale * np.linalg.solve(forces.scaled_tangent, residual))
    size = np.abs(values)
    soft = size <= ZERO_STIFFNESS * size.max()
    along = vectors.T @ residual
    noise = float(np.linalg.norm(scale * forces.size))
    along[soft & (np.abs(along) <= NEGLIGIBLE_SHARE * noise)] = 0.0
    size = np.maximum(size, SOFTEST * (float(size.max()) or noise))
    return forces.all_joints(scale * (vectors @ (along / size)))


def refined(at: PosedModel, forces: Balance) -> tuple[PosedModel, Balance, list[float]]:
    """Take Newton steps near a stable pose while they reduce the residual."""
    residuals: list[float] = []
    for _ in range(NEWTON_STEPS):
        values, _ = stiffness(forces)
        if forces.share <= EPS or values[0] < -ZERO_STIFFNESS * np.abs(values).max():
            break
        following = after_step(at, newton_step(forces), forces)
        if following is None or not following[1].share < forces.share:
            break
        previous, (at, forces) = forces.share, following
        residuals.append(forces.share)
        if not forces.share < 0.5 * previous:
            break
    return at, forces, residuals


def follow(first: PosedModel, forces: Balance) -> SearchResult:
    """Return the pose that a mechanism held by springs takes as its loads are applied.

    It is the pose under the full load, or the last one on the branch. ``forces`` are those in the first pose under the
    full load.
    """
    done, share, steps, model = 0.0, 1.0, 0, first.reference
    current, shares = first, [0.0]
    residuals: list[float] = []
    while True:
        under = current.under(with_share(model, share))
        attempt, converged = _newton_steps(under, forces if under.reference is model and not done else balance(under))
        steps += len(attempt.residuals) - 1
        if converged:
            current, done, residuals = attempt.at, share, list(attempt.residuals)
            shares.append(done)
            if done == 1.0:
                break
            share = min(1.0, done + 2.0 * (done - shares[-2]))
            continue
        if share - done < SMALLEST_SHARE:
            last = balance(current.under(with_share(model, done)))
            stopped = f"under {done:.1%} of the load {attempt.stopped or _lost_stiffness(first, last)}"
            under_load = current.under(model)
            forces = balance(under_load)
            return SearchResult(under_load, forces, (*residuals, forces.share), steps, tuple(shares), stopped)
        share = done + 0.5 * (share - done)
    at, forces, added = refined(attempt.at, attempt.balance)
    return SearchResult(at, forces, (*residuals, *added), steps + len(added), tuple(shares))


def _newton_steps(at: PosedModel, forces: Balance) -> tuple[SearchResult, bool]:
    """Newton's method with full steps until it does not contract or the pose is not stable; whether it converged."""
    residuals = [forces.share]
    length, newton_steps, stopped = np.inf, 0, ""
    while is_stable(stiffness(forces)[0]) and forces.share > BALANCED:
        step = newton_step(forces)
        before, length = length, float(np.abs(step / at.scale).max(initial=0.0))
        if length > CONTRACTION * before or length > LONGEST or newton_steps > NEWTON_STEPS:
            following = _shortened(at, forces, step * min(1.0, LONGEST / length)) if len(residuals) < STEPS else None
            if following is None:
                break
            length, newton_steps = np.inf, 0
        else:
            following, newton_steps = after_step(at, step, forces), newton_steps + 1
            if following is None:
                stopped = ("its loops cannot be closed any further, or a spring would turn beyond its limit of 172 "
                           "degrees")  # fmt: skip
                break
        at, forces = following
        residuals.append(forces.share)
    reached = forces.share <= BALANCED and is_stable(stiffness(forces)[0])
    return SearchResult(at, forces, tuple(residuals), 0, (), stopped), reached


def _shortened(at: PosedModel, forces: Balance, step: Array) -> tuple[PosedModel, Balance] | None:
    """A step that is halved while it goes too far as the mechanism becomes stiffer along it; None if it does not.

    A mechanism that is softer along the step, or not stable on it, may snap through, which load steps decide.
    """
    following = after_step(at, step, forces)
    for halvings in range(HALVINGS):
        if following is None:
            return None
        suits = _work(following[1], step) > -OVERSHOOT * _work(forces, step)
        if suits and not halvings:
            return None
        half = after_step(at, 0.5 * step, forces)
        if suits:
            ends = () if half is None else (following[1], half[1])
            return following if ends and all(is_stable(stiffness(there)[0]) for there in ends) else None
        following, step = half, 0.5 * step
    return None


def _lost_stiffness(first: PosedModel, last: Balance) -> str:
    """The stiffness that a mechanism has left at the end of its branch, in words."""
    before, _ = stiffness(balance(first.under(with_share(first.reference, 0.0))))
    values, vectors = stiffness(last)
    name = last.names[int(np.argmax(np.abs(vectors[:, 0])))]
    ratio = float(values[0] / before[0])
    if ratio > 0.5:
        return f"Newton's method no longer contracts, while the stiffness along '{name}' is still {ratio:.0%}"
    return f"its stiffness is down to {ratio:.1%}, mostly along '{name}': it would snap through to a pose elsewhere"


def descend(first: PosedModel, forces: Balance) -> SearchResult:
    """Return the pose to which a mechanism descends; ``forces`` are those in the first one.

    It is the pose of equilibrium, or the last one that was reached.
    """
    at = first
    residuals = [forces.share]
    stopped = f"{STEPS} steps of descent do not reach one"
    for _ in range(STEPS):
        if forces.share <= BALANCED:
            stopped = ""
            break
        reached = _downhill(at, forces)
        if reached is None:
            stopped = "no step reduces the residual any further"
            break
        at, forces = reached
        residuals.append(forces.share)
        if np.abs(at.pose.centre - first.pose.centre).max() > 50.0 * first.size:
            stopped = "it moves away without limit"
            break
    else:
        stopped = "" if forces.share <= BALANCED else stopped
    if not stopped:
        at, forces, added = refined(at, forces)
        residuals += added
    return SearchResult(at, forces, tuple(residuals), len(residuals) - 1, (), stopped)


def _downhill(at: PosedModel, forces: Balance) -> tuple[PosedModel, Balance] | None:
    """One step of limited length, halved until the forces do work along it at its end or have become smaller."""
    step = newton_step(forces)
    if not step.any():
        return None
    step = step * min(1.0, LONGEST / float(np.abs(step / at.scale).max()))
    along = _work(forces, step)
    for _ in range(HALVINGS):
        following = after_step(at, step, forces)
        if following is not None:
            _, after = following
            if after.share < 0.5 * forces.share or _work(after, step) > -0.2 * along:
                return following
        step, along = 0.5 * step, 0.5 * along
    return None


def _work(forces: Balance, step: Array) -> float:
    """The work of the residual along the independent coordinates of a motion of all joints."""
    return float(forces.residual @ step[forces.reduction.independent])
