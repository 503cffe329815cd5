"""Where a run starts: displacements and rates of some coordinates, to which the others follow through the loops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.common import arguments as check
from mbsvib.errors import ModelError, nearest
from mbsvib.kinematics.characteristic_length import size_of
from mbsvib.linalg.minimum_norm import minimum_norm_solution
from mbsvib.simulation.states import State

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.simulation.session import Session

# The longest step [rad, mechanism sizes] along which loops are followed, and how far they may stay open.
LONGEST, OPEN = 0.05, 1e-11
# Displacements and rates of all joints of a loop, as another run has them, agree to this share.
AGREES = 1e-6


def initial_state(run: Session, displaced: Any, time: float) -> State:
    """Return the state in which a run starts.

    ``displaced``: displacement [m, rad] of coordinates from the pose as described, or displacement and rate.
    Coordinates that are not named are 0, or as near to it as loops allow. ``time``: when [s].
    """
    q, qd = np.zeros(len(run.names)), np.zeros(len(run.names))
    displaced = {} if displaced is None else displaced
    if not isinstance(displaced, Mapping):
        raise check.refuse("simulate", "initial", displaced, "a mapping of joint coordinates to a displacement, or to "
                           "(displacement, rate): {'hinge.rz': (0.1, 2.0)}")  # fmt: skip
    fixed, cut, following = [], run.statement.motion.cut, {}
    for name, value in displaced.items():
        if name not in run.names and name not in cut:
            raise ModelError(f"simulate: '{name}' is no coordinate of the spanning tree of model '{run.model.name}'."
                             f"{nearest(str(name), run.names)} It has {', '.join(run.names[:12])}.",
                             element=str(name), field="initial")  # fmt: skip
        pair = (value, 0.0) if np.ndim(value) == 0 else value
        both = check.numbers(pair, (2,), "simulate", f"initial['{name}']", "a displacement, or (displacement, rate)")
        if name in cut:
            following[name] = both
            continue
        k = run.names.index(name)
        q[k], qd[k] = both
        fixed.append(k)
    bases = run.statement.motion.no_turns
    moved = _moved(run, q, np.array(fixed, dtype=np.intp), bases)
    rates = _rates(run, moved, qd, fixed, bases)
    _check_following(run, following, (moved, rates, bases))
    return State(time, moved, rates, np.zeros(run.equations.yields), np.zeros(3))


def _check_following(
    run: Session, given: Mapping[str, tuple[float, ...]], state: tuple[Array, Array, Array]
) -> None:  # fmt: skip
    """Refuse coordinates of joints at which loops are cut that do not follow from those of the tree."""
    motion, names = run.statement.motion, list(given)
    if not names:
        return
    values = ca.vertcat(*(motion.cut[name] for name in names))
    function = ca.Function("cut", [motion.q, motion.qd, motion.bases], [values, motion.rate(values)])
    where, rates = (np.asarray(part)[:, 0] for part in function(*state))
    size = size_of(run.model)
    fastest = float(np.abs(state[1] / run.loops.coordinate_scale).max())
    for name, value, rate in zip(names, where.tolist(), rates.tolist(), strict=True):
        turns, (asked, asked_rate) = name.rpartition(".")[2][0] == "r", given[name]
        off, unit = asked - value, 1.0 if turns else size
        off -= 2.0 * np.pi * round(off / (2.0 * np.pi)) if turns else 0.0
        if abs(off) > AGREES * unit or abs(asked_rate - rate) > AGREES * unit * fastest:
            raise ModelError(f"simulate: where the other joints of its loop are displaced so, {name} is {value:.6g}, "
                             f"its rate {rate:.6g}, not {asked:.6g} and {asked_rate:.6g}; leave out one of them.",
                             element=name, field="initial")  # fmt: skip


def _moved(run: Session, target: Array, fixed: Array, bases: Array) -> Array:
    """Coordinates with some at their values and loops closed, followed from the pose as described."""
    reached = run.loops.projected(np.zeros(len(target)), bases)[0]
    others = np.setdiff1d(np.arange(len(target)), fixed)
    change = target[fixed] - reached[fixed]
    longest = float(np.abs(change / run.loops.coordinate_scale[fixed]).max(initial=0.0))
    steps = int(np.ceil(longest / LONGEST)) if len(run.loops.row_scale) else 1
    start = reached[fixed]
    for i in range(1, steps + 1):
        trial = reached.copy()
        trial[fixed] = start + change * i / steps
        projected, opening = run.loops.projected(trial, bases, others)
        if opening > OPEN or np.abs((projected - trial) / run.loops.coordinate_scale).max(initial=0.0) > 1.0:
            names = ", ".join(f"{run.names[k]} = {trial[k]:.6g}" for k in fixed)
            raise ModelError(f"simulate: the loops cannot be closed with {names}; give fewer coordinates, or others.",
                             field="initial")  # fmt: skip
        reached = projected
    return reached


def _rates(run: Session, q: Array, qd: Array, fixed: list[int], bases: Array) -> Array:
    """Rates with some at their values; the others are the least that keep the loops closed."""
    if not len(run.loops.row_scale):
        return qd
    _, jacobian = run.loops.scaled(q, bases)
    scale = run.loops.coordinate_scale
    others = np.setdiff1d(np.arange(len(q)), fixed)
    result = qd / scale
    right = -jacobian[:, fixed] @ result[fixed]
    result[others] = minimum_norm_solution(jacobian[:, others], right)
    if np.abs(jacobian @ result).max() > 1e-8 * float(np.abs(result).max()):
        names = ", ".join(run.names[k] for k in fixed)
        raise ModelError(f"simulate: the loops do not allow these rates of {names}; give fewer of them.",
                         field="initial")  # fmt: skip
    return np.asarray(result * scale)
