"""Reactions in joints over a cycle: what joints carry by constraint, along virtual displacements.

Forces along the free directions of a joint are those of drives and couplers, and are taken out. Where constraints are
redundant, the wrenches are those of least norm of ``equations.self_stress``, in each pose: the sum of |force|^2 +
|moment / L|^2 over joints, with what couplers transmit in them.

Exact derivatives of the reactions of a cycle.

With what drives supply, J^T lambda + e tau = M q'' - f along the coordinates, the wrenches w - E lambda of the joints,
and z the coordinates, their rates and accelerations,

h = J^T lambda + e tau - (M q'' - f) = 0,

d lambda / dp = -J^T^+ (h_p + h_z dz/dp + e d tau / dp),

and so the wrenches, which are linear in lambda. What redundant constraints leave open has no derivative.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array, Bools
from mbsvib.cycles.elastic import parameter_derivatives, with_parameters
from mbsvib.cycles.expressions import Statement
from mbsvib.cycles.prescribed import turns
from mbsvib.cycles.result import CycleData
from mbsvib.elements import Joint
from mbsvib.errors import MbsvibError
from mbsvib.finite_motion.evaluation import matrices
from mbsvib.finite_motion.frames import Expression, axial
from mbsvib.finite_motion.joints import place_of
from mbsvib.finite_motion.reactions import multipliers, opened
from mbsvib.kinematics.pose import length_of
from mbsvib.linalg.groups import connected_parts
from mbsvib.linalg.rank import DETERMINED, REDUNDANT_LOOPS
from mbsvib.mechanism.mechanism import Mechanism

# What the equations leave over, as a share of the forces in them: rounding, and how far loops are open.
BALANCED = 1e-7


@dataclass(frozen=True)
class Reactions:
    """``wrenches`` (samples, 6) by joint, and the directions by joint that are ``undetermined``."""

    wrenches: Mapping[str, Array]
    undetermined: Mapping[str, tuple[str, ...]]


def reactions(cycle: CycleData) -> Reactions:
    """Return the wrenches that joints carry over a cycle.

    Returns what the first body does to the second, at the joint's point, world axes.
    """
    plant, motion = cycle.machine, cycle.machine.solved
    model, expressions = plant.model, plant.statement
    function = expressions.compiled("reactions", lambda: list(map(ca.densify, (
        *wrench_terms(model, expressions), _points(model, expressions)))))  # fmt: skip
    required, jacobian, wrenches, effects, points = matrices(
        function, motion.q, motion.qd, motion.qdd, plant.values(expressions), plant.about)  # fmt: skip
    scale, row_units = expressions.motion.motion.scales(plant.size)
    places, largest = points[:, :, 0].reshape(len(points), -1, 3), np.abs(effects).max(axis=0) / row_units
    units, couplers = _units(model, places, largest, plant.size)
    fixed = np.pad(wrenches[:, :, 0], ((0, 0), (0, couplers.shape[1]))) / units
    loads = np.concatenate((-effects, couplers), axis=1) / row_units / units[:, :, None]
    torques = np.zeros(required.shape[:2])
    torques[:, motion.driven] = np.column_stack([cycle.torques[name] for name in cycle.drives])
    matrix, right = jacobian / row_units[:, None] * scale, (required[:, :, 0] - torques) * scale
    acting, idle = multipliers(matrix, right)
    residual = float(np.abs((matrix.transpose(0, 2, 1) @ acting[:, :, None])[:, :, 0] - right).max(initial=0.0))
    forces = max(float(np.abs(part).max(initial=0.0))
                 for part in (matrix * acting[:, :, None], torques * scale, plant.size * fixed))  # fmt: skip
    if residual > BALANCED * forces:
        raise MbsvibError(f"cycle: the reactions balance the bodies of model '{model.name}' only to "
                          f"{residual / forces:.1e} of the forces in them; the cycle is too near a singular "
                          f"pose.")  # fmt: skip
    total = fixed + (loads @ acting[:, :, None])[:, :, 0]
    idle_loads = loads @ idle
    open_shares = idle_loads @ np.linalg.pinv(idle_loads, rcond=REDUNDANT_LOOPS)
    total = (total - (open_shares @ total[:, :, None])[:, :, 0]) * units
    indeterminacy = np.sqrt(np.abs(np.diagonal(open_shares, axis1=1, axis2=2))).max(axis=0)
    found: dict[str, Array] = {}
    undetermined: dict[str, tuple[str, ...]] = {}
    for k, name in enumerate(model.joints):
        own = slice(6 * k, 6 * k + 6)
        found[name] = total[:, own].copy()
        found[name].flags.writeable = False
        loose = tuple([d for d, size in zip(DIRECTIONS, indeterminacy[own], strict=True) if size > DETERMINED])
        undetermined |= {name: loose} if loose else {}
    return Reactions(found, undetermined)


def _points(model: Mechanism, expressions: Statement) -> Expression:
    """The points (3 joints,) of all joints [m], world axes."""
    motion = expressions.motion.motion
    return ca.vertcat(*(motion.frames[joint.first].point(
        place_of(joint, motion.numbers, model.bodies, motion.relative(joint.first, joint.second)))
        for joint in model.joints.values()))  # fmt: skip


def _units(model: Mechanism, points: Array, effects: Array, size: float) -> tuple[Array, Array]:
    """Units (samples, 6 joints + couplers) of wrenches, 1 and the length L of moments, and what couplers transmit in
    joints per multiplier (samples, couplers, rows), moments over L.

    L is that of ``points`` (samples, joints, 3) of loops that have joints or couplers in common. ``effects``
    (6 joints, rows): the largest wrenches that multipliers make per row of the ``size`` [m] of the mechanism; those of
    rounding, in joints that carry both ends of a loop, make no loop.
    """
    names, rows = list(model.joints), effects.shape[1]
    in_unit = effects.reshape(len(names), 6, rows) * np.repeat((size, 1.0), 3)[:, None]
    in_loop: Bools = in_unit.max(axis=1) > DETERMINED
    terms = [(rows - len(model.couplers) + k, names.index(name.rpartition(".")[0]), turns(name), value)
             for k, part in enumerate(model.couplers.values()) for name, value in part.terms]  # fmt: skip
    for row, joint, _, _ in terms:
        in_loop[joint, row] = True
    joint_of, row_of = np.nonzero(in_loop)
    part, _ = connected_parts(joint_of, row_of, (len(names), rows))
    length = np.ones(points.shape[:2])
    for number in np.unique(part).tolist():
        length[:, part == number] = length_of(points[:, part == number])[:, None]
    couplers = np.zeros((len(points), len(model.couplers), rows))
    for row, joint, rotates, value in terms:
        couplers[:, row - rows, row] += (value / (length[:, joint] if rotates else 1.0)) ** 2
    units = np.repeat(np.stack((np.ones_like(length), length), axis=2), 3, axis=2).reshape(len(points), -1)
    return np.concatenate((units, np.ones(couplers.shape[:2])), axis=1), np.sqrt(couplers)


def wrench_terms(model: Mechanism, expressions: Statement) -> tuple[Expression, Expression, Expression, Expression]:
    """Return what the equations lack without closures (n,), the closures' derivative (rows, n), and the wrenches
    w (6 joints,) of all joints in world axes and E (6 joints, rows): w - E lambda with multipliers lambda.
    """
    motion, n = expressions.motion.motion, len(expressions.motion.motion.names)
    unbalanced, jacobian = opened(model, expressions.motion, tuple(model.joints), expressions.qdd,
                                  ca.SX.zeros(0))  # fmt: skip
    driven = {name.rpartition(".")[0] for name in motion.names}
    turned = ca.diagcat(*(_constraints(joint, expressions, joint.name in driven) for joint in model.joints.values()))
    return unbalanced[:n], jacobian[:, :n], turned @ unbalanced[n:], turned @ jacobian[:, n:].T


def _constraints(joint: Joint, expressions: Statement, has_coordinates: bool) -> Expression:
    """The matrix (6, 6) that makes the wrench of a joint by constraint, world axes, of what it carries in its axes.

    With the twists T (6, f) of its coordinates, which forces W (6, f) drive one by one, it is what 1 - W T^T leaves.
    Such a force is along or about directions in which coordinates of the same kind move, and does no work on these.
    """
    motion = expressions.motion.motion
    first, relative = motion.frames[joint.first], motion.relative(joint.first, joint.second)
    place = place_of(joint, motion.numbers, expressions.model.bodies, relative)
    if joint.is_rod:
        rod = first.vector(place - ca.SX(np.array(joint.position)))
        along = ca.horzcat(ca.SX.zeros(3, 2), rod / ca.norm_2(rod))
        return ca.diagcat(along, ca.SX.zeros(3, 3))
    axes = first.rotation @ ca.SX(np.array(joint.axes))
    to_world = ca.diagcat(axes, axes)
    if not has_coordinates or not joint.freedom:
        return to_world
    spin = ca.reshape(motion.rate(ca.vec(relative.rotation)), 3, 3) @ relative.rotation.T
    speed = spin @ (place - relative.shift) + motion.rate(relative.shift)
    rates = ca.vertcat(first.vector(speed), first.vector(axial(spin)))
    names = [direction for direction, _ in joint.freedom]
    columns = [motion.names.index(f"{joint.name}.{direction}") for direction in names]
    twists, forces = ca.densify(ca.jacobian(rates, expressions.qd)[:, columns]), ca.SX.zeros(6, len(names))
    for rows, rotates in ((slice(0, 3), False), (slice(3, 6), True)):
        some = [k for k, direction in enumerate(names) if turns(direction) is rotates]
        if some:
            own = twists[rows, some]
            forces[rows, some] = own @ ca.inv(own.T @ own)
    return (ca.SX.eye(6) - forces @ twists.T) @ to_world


def reaction_sensitivities(cycle: CycleData, names: tuple[str, ...]) -> dict[str, Array]:
    """Return the derivatives of the reactions of all joints.

    Returns (parameters, samples, 6): by joint; not a number for directions that redundant constraints leave open.
    """
    plant = with_parameters(cycle.machine, names)
    motion, model, expressions = plant.solved, plant.model, plant.statement
    required, jacobian, fixed, effects = wrench_terms(model, expressions)
    loads = ca.SX.sym("lambda", jacobian.shape[0])
    residual, wrenches = jacobian.T @ loads - required, fixed - effects @ loads
    state = ca.vertcat(expressions.q, expressions.qd, expressions.qdd)
    symbols = [expressions.q, expressions.qd, expressions.qdd, expressions.p, expressions.about]
    p = plant.values(expressions)
    at = (motion.q, motion.qd, motion.qdd, p, plant.about)

    def evaluated(
        *outputs: Expression, extra: tuple[Expression, ...] = (), values: tuple[Array, ...] = ()
    ) -> list[Array]:
        function = ca.Function("f", [*symbols, *extra], [ca.densify(item) for item in outputs])
        return matrices(function, *at, *values)

    matrix, lacking = evaluated(jacobian, required)
    scale, row_units = expressions.motion.motion.scales(plant.size)
    lacking[:, motion.driven, 0] -= np.column_stack([cycle.torques[name] for name in cycle.drives])
    inverse = np.linalg.pinv((matrix / row_units[:, None] * scale).transpose(0, 2, 1), rcond=REDUNDANT_LOOPS)
    inverse = inverse / row_units[:, None] * scale
    acting = (inverse @ lacking)[:, :, 0]
    parts = [ca.jacobian(item, to) for item in (residual, wrenches) for to in (state, expressions.p)]
    h_z, h_p, w_z, w_p, w_l = evaluated(*parts, -effects, extra=(loads,), values=(acting,))
    derivatives = parameter_derivatives(plant)
    d_state = derivatives.state
    supplied = np.zeros(h_p.shape)
    supplied[:, motion.driven] = derivatives.results[:, : len(cycle.drives)]
    change = -inverse @ (h_p + h_z @ d_state + supplied)
    total = (w_p + w_z @ d_state + w_l @ change)[:, :, [expressions.names.index(name) for name in names]]
    result, undetermined = {}, reactions(cycle).undetermined
    for k, name in enumerate(model.joints):
        slopes = total[:, 6 * k : 6 * k + 6].transpose(2, 0, 1).copy()
        slopes[:, :, [DIRECTIONS.index(item) for item in undetermined.get(name, ())]] = np.nan
        slopes.flags.writeable = False
        result[name] = slopes
    return result
