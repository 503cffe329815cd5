"""Newton's method for the pose of equilibrium, along the way that the mechanism itself would go.

A mechanism whose springs hold it follows its loads: they are applied in steps, and each step is taken only if Newton's
method contracts and the tangent K + K_g stays positive. Where it does not, the branch ends and the mechanism would snap
through. A mechanism that hangs goes downhill: steps |K + K_g|^-1 r of limited length, which become Newton steps.

Source: Crisfield, Non-linear Finite Element Analysis of Solids and Structures (1991), chapter 9, for steps along a
load; Dauphin et al., Advances in Neural Information Processing Systems 27 (2014), for steps with |K + K_g|.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equilibrium.balance import Balance, balance
from mbsvib.equilibrium.load_steps import with_share
from mbsvib.equilibrium.motion import Stance, close, same_side
from mbsvib.errors import ModelError, NoWordsError, SingularPoseError
from mbsvib.linalg.rank import EPS, ZERO_STIFFNESS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array

# A pose counts as found when less than this share of the forces is left over, and no step makes it less.
FOUND = 1e-10
# Longest step downhill [rad, mechanism sizes], and how often one is cut in half.
LONGEST, HALVINGS = 0.3, 30
STEPS = 200
# Newton's method must make its own steps shorter by this factor, and takes at most so many.
CONTRACTION, NEWTON_STEPS = 0.5, 12
SMALLEST_SHARE = 1e-3
# Loops are closed when they are open by less than this share of the mechanism's size, or by rounding.
CLOSED = 1e-11
# Motions without stiffness are left alone if no more than this share of the forces acts along them; otherwise they are
# taken to be as soft as this share of the stiffest.
LEFT_ALONE, SOFTEST = 1e-12, 1e-6


@dataclass(frozen=True, slots=True)
class Found:
    """Where the search ended: the last stance with its forces, whether that is in balance, and the way there.

    ``residuals`` are the shares of the forces left over after each step under the whole load, ``steps`` counts all
    steps, ``shares`` are the shares of the load at which the mechanism was in balance on the way; ``stopped`` says in
    words why the search ended short of balance.
    """

    stance: Stance
    balance: Balance
    residuals: tuple[float, ...]
    steps: int
    shares: tuple[float, ...]
    stopped: str = ""


def step_from(at: Stance, step: Array, forces: Balance) -> Stance | None:
    """Return the stance after a motion of all joints with loops closed, or None where there is none, or none on the
    same side of a dead point of the coordinates that the forces in the first pose are stated in.
    """
    try:
        there, left = close(at.moved(step))
    except NoWordsError:
        raise
    except (ModelError, SingularPoseError):
        return None
    if left > max(CLOSED, there.rounding):
        return None
    depends = np.ones(len(step), dtype=bool)
    depends[forces.reduction.independent] = False
    return there if at.cuts is None or same_side(at, there, depends) else None


def forces_at(at: Stance) -> Balance | None:
    """Return the forces in a pose, or None where they are not defined."""
    try:
        return balance(at)
    except NoWordsError:
        raise
    except (ModelError, SingularPoseError):
        return None


def stiffness(forces: Balance) -> tuple[Array, Array]:
    """Return eigenvalues and vectors of the symmetric part of the tangent, coordinates being scaled alike."""
    matrix = forces.tangent * np.multiply.outer(forces.scale, forces.scale)
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return values, vectors


def is_stable(values: Array) -> bool:
    """Tell whether all eigenvalues are positive by more than rounding."""
    return bool(len(values) == 0 or values[0] > ZERO_STIFFNESS * np.abs(values).max())


def newton_step(forces: Balance) -> Array:
    """Return the motion of all joints that the tangent asks for: to balance where it is positive, downhill elsewhere.

    Motions without stiffness and without force are left alone.
    """
    scale, residual = forces.scale, forces.scale * forces.residual
    values, vectors = stiffness(forces)
    if is_stable(values):
        matrix = forces.tangent * np.multiply.outer(scale, scale)
        return forces.all_joints(scale * np.linalg.solve(matrix, residual))
    size = np.abs(values)
    soft = size <= ZERO_STIFFNESS * size.max()
    along = vectors.T @ residual
    noise = float(np.linalg.norm(scale * forces.size))
    along[soft & (np.abs(along) <= LEFT_ALONE * noise)] = 0.0
    size = np.maximum(size, SOFTEST * (float(size.max()) or noise))
    return forces.all_joints(scale * (vectors @ (along / size)))


def polished(at: Stance, forces: Balance) -> tuple[Stance, Balance, list[float]]:
    """Take Newton steps for as long as they leave less of the forces over; near a pose that is stable."""
    residuals: list[float] = []
    for _ in range(NEWTON_STEPS):
        values, _ = stiffness(forces)
        if forces.share <= EPS or values[0] < -ZERO_STIFFNESS * np.abs(values).max():
            break
        there = step_from(at, newton_step(forces), forces)
        after = None if there is None else forces_at(there)
        if there is None or after is None or not after.share < forces.share:
            break
        gained = after.share < 0.5 * forces.share
        at, forces = there, after
        residuals.append(forces.share)
        if not gained:
            break
    return at, forces, residuals


def follow(first: Stance) -> Found:
    """Return the pose that a mechanism held by springs takes as its loads are applied.

    Parameters
    ----------
    first : Stance
        The pose as described.

    Returns
    -------
    Found
        The pose under the whole load, or the last one on the branch.
    """
    done, share, steps, model = 0.0, 1.0, 0, first.described
    here, shares = first, [0.0]
    residuals: list[float] = []
    while True:
        tried, arrived = _contracting(here.under(with_share(model, share)))
        steps += len(tried.residuals) - 1
        if arrived:
            here, done, residuals = tried.stance, share, list(tried.residuals)
            shares.append(done)
            if done == 1.0:
                break
            share = min(1.0, done + 2.0 * (done - shares[-2]))
            continue
        if share - done < SMALLEST_SHARE:
            last = balance(here.under(with_share(model, done)))
            stopped = f"under {done:.1%} of the load {tried.stopped or _softened(first, last)}"
            whole = here.under(model)
            forces = balance(whole)
            return Found(whole, forces, (*residuals, forces.share), steps, tuple(shares), stopped)
        share = done + 0.5 * (share - done)
    at, forces, more = polished(here, balance(here))
    return Found(at, forces, (*residuals, *more), steps + len(more), tuple(shares))


def _contracting(at: Stance) -> tuple[Found, bool]:
    """Newton's method with whole steps, given up as soon as it does not contract on a stable branch; did it arrive?"""
    forces = balance(at)
    residuals = [forces.share]
    length = np.inf
    stopped = ""
    while is_stable(stiffness(forces)[0]) and forces.share > FOUND:
        step = newton_step(forces)
        before, length = length, float(np.abs(step / at.scale).max(initial=0.0))
        if length > CONTRACTION * before or length > LONGEST or len(residuals) > NEWTON_STEPS:
            break
        there = step_from(at, step, forces)
        after = None if there is None else forces_at(there)
        if there is None or after is None:
            stopped = "its loops cannot be closed any further"
            break
        at, forces = there, after
        residuals.append(forces.share)
    reached = forces.share <= FOUND and is_stable(stiffness(forces)[0])
    return Found(at, forces, tuple(residuals), 0, (), stopped), reached


def _softened(first: Stance, last: Balance) -> str:
    """Say how soft a mechanism has become at the end of its branch."""
    before, _ = stiffness(balance(first.under(with_share(first.described, 0.0))))
    values, vectors = stiffness(last)
    name = last.names[int(np.argmax(np.abs(vectors[:, 0])))]
    left = float(values[0] / before[0])
    if left > 0.5:
        return f"Newton's method no longer contracts, while the stiffness along '{name}' is still {left:.0%}"
    return f"its stiffness is down to {left:.1%}, mostly along '{name}': it would snap through to a pose elsewhere"


def descend(first: Stance) -> Found:
    """Return the pose to which a mechanism goes downhill.

    Parameters
    ----------
    first : Stance
        The pose as described.

    Returns
    -------
    Found
        The pose of equilibrium, or the last one that was reached.
    """
    at, forces = first, balance(first)
    residuals = [forces.share]
    stopped = f"{STEPS} steps downhill do not reach one"
    for _ in range(STEPS):
        if forces.share <= FOUND:
            stopped = ""
            break
        reached = _downhill(at, forces)
        if reached is None:
            stopped = "no motion leads any further"
            break
        at, forces = reached
        residuals.append(forces.share)
        if np.abs(at.pose.centre - first.pose.centre).max() > 50.0 * first.size:
            stopped = "it goes away without end"
            break
    else:
        stopped = "" if forces.share <= FOUND else stopped
    if not stopped:
        at, forces, more = polished(at, forces)
        residuals += more
    return Found(at, forces, tuple(residuals), len(residuals) - 1, (), stopped)


def _downhill(at: Stance, forces: Balance) -> tuple[Stance, Balance] | None:
    """One step of limited length, cut in half until the forces still point along it or have become less."""
    step = newton_step(forces)
    if not step.any():
        return None
    step = step * min(1.0, LONGEST / float(np.abs(step / at.scale).max()))
    along = _work(forces, step)
    for _ in range(HALVINGS):
        there = step_from(at, step, forces)
        after = None if there is None else forces_at(there)
        if there is not None and after is not None:
            less = after.share < 0.5 * forces.share
            if less or _work(after, step) > -0.2 * along:
                return there, after
        step, along = 0.5 * step, 0.5 * along
    return None


def _work(forces: Balance, step: Array) -> float:
    """The work of the forces left over along a motion of all joints, for the part of it that loops allow."""
    return float(forces.residual @ step[forces.reduction.independent])
