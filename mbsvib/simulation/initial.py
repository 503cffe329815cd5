"""Where a run starts: displacements and rates of some coordinates, to which the others follow through the loops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Index
from mbsvib.errors import ModelError, SingularPoseError
from mbsvib.finite_motion.loops import DrivenLoops
from mbsvib.kinematics.pose import size_of
from mbsvib.linalg.dead_points import is_unknown
from mbsvib.linalg.qr import minimum_norm_solution, pivoted_qr
from mbsvib.linalg.rank import DETERMINED
from mbsvib.simulation.session import Session
from mbsvib.simulation.states import State

# How far loops may stay open, in units of 1 rad and the size of the mechanism.
OPEN = 1e-11
# Displacements and rates of all joints of a loop, as another run has them, agree to this share.
AGREES = 1e-6


def initial_state(run: Session, displaced: Any, time: float) -> State:
    """Return the state in which a run starts.

    ``displaced``: displacement [m, rad] of coordinates from the pose as described, or displacement and rate.
    Coordinates that are not named are 0, or as near to it as loops allow. ``time``: when [s].
    """
    q, qd = np.zeros(len(run.names)), np.zeros(len(run.names))
    displaced = {} if displaced is None else displaced
    check.mapping("simulate", "initial", displaced, "a mapping of joint coordinates to a displacement, or to "
                  "(displacement, rate): {'hinge.rz': (0.1, 2.0)}", empty=True)  # fmt: skip
    fixed, cut, following = [], run.statement.motion.cut, {}
    for name, value in displaced.items():
        check.known(name, (*run.names, *cut),
                    f"simulate: '{name}' is not a coordinate of model '{run.model.name}'", "initial")  # fmt: skip
        pair = (value, 0.0) if np.ndim(value) == 0 else value
        both = check.numbers(pair, (2,), "simulate", f"initial['{name}']", "a displacement, or (displacement, rate)")
        if name in cut:
            following[name] = both
            continue
        k = run.names.index(name)
        if k in run.equations.first and both[1]:
            raise ModelError(f"simulate: initial['{name}'] = {value}; expected a displacement alone: without "
                             f"inertia its rate follows from the forces.", element=name, field="initial")  # fmt: skip
        q[k], qd[k] = both
        fixed.append(k)
    bases = run.statement.motion.no_turns
    given = np.array(fixed, dtype=np.intp)
    moved, held = _moved(run, q, given, bases)
    rates = _rates(run, moved, qd, given, held, bases)
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


def _moved(run: Session, target: Array, given: Index, bases: Array) -> tuple[Array, Index]:
    """Coordinates with some at their values and loops closed, followed from the pose as described, and which of the
    given ones were held: of more than the loops leave free, the others follow, and must agree.
    """
    if not len(run.loops.row_scale):
        return target, given
    reached, scale = run.loops.projected(np.zeros(len(target)), bases)[0], run.loops.coordinate_scale
    fixed = _independent(run, reached, given, bases)
    loops = DrivenLoops(run.names, fixed, run.loops, OPEN, bases)
    (reached, matrix), done = loops.followed((reached, loops.jacobian(reached)), target[fixed])
    if is_unknown(loops.smallest(matrix), OPEN):
        where = _named(run, reached, given)
        raise SingularPoseError(
            f"simulate: the run would start {f'with {where} ' if where else ''}at a dead centre or another singular "
            f"pose: '{loops.loose(matrix)}' could move by itself there, so that no rate follows. Start further from "
            f"it, or displace '{loops.loose(matrix)}' instead."
        )  # fmt: skip
    if done < 1.0 or np.abs((reached - target)[given] / scale[given]).max(initial=0.0) > AGREES:
        raise _open(run, target, given, reached)
    return reached, fixed


def _named(run: Session, q: Array, given: Index) -> str:
    return ", ".join(f"{run.names[k]} = {q[k]:.6g}" for k in given)


def _open(run: Session, q: Array, given: Index, reached: Array) -> ModelError:
    return ModelError(f"simulate: the loops cannot be closed with {_named(run, q, given)}, on the way only up to "
                      f"{_named(run, reached, given)}; give fewer coordinates, or others.",
                      field="initial")  # fmt: skip


def _independent(run: Session, q: Array, given: Index, bases: Array) -> Index:
    """Of more coordinates than the loops leave free, those that vary most independently of each other."""
    free = np.linalg.svd(run.loops.scaled(q, bases)[1])[2][run.loops.rank_at(q, bases) :]
    factor, order, _ = pivoted_qr(free[:, given])
    if len(given) <= len(free):
        return given
    size = np.abs(np.diag(factor))
    return np.sort(given[order[: len(free)][size > DETERMINED * size.max(initial=0.0)]])


def _rates(run: Session, q: Array, qd: Array, given: Index, fixed: Index, bases: Array) -> Array:
    """Rates with those of ``fixed``, the others the least that keep loops closed; those ``given`` must agree."""
    if not len(run.loops.row_scale):
        return qd
    _, jacobian = run.loops.scaled(q, bases)
    scale = run.loops.coordinate_scale
    others = np.setdiff1d(np.arange(len(q)), fixed)
    result = qd / scale
    right = -jacobian[:, fixed] @ result[fixed]
    result[others] = minimum_norm_solution(jacobian[:, others], right)
    fastest = float(np.abs(result).max())
    off = np.abs(result - qd / scale)[given].max(initial=0.0)
    if np.abs(jacobian @ result).max() > 1e-8 * fastest or off > AGREES * fastest:
        names = ", ".join(run.names[k] for k in given)
        raise ModelError(f"simulate: the loops do not allow these rates of {names}; give fewer of them.",
                         field="initial")  # fmt: skip
    return np.asarray(result * scale)
