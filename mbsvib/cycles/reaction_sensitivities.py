"""Exact derivatives of the reactions of a cycle.

With the equations of bodies on their own, the openings Phi(x, p) of all joints, their multipliers lambda, the torques
tau_j of drives and couplers along w_j, and x as a function of the tree coordinates z and of parameters p,

h = (dPhi/dx)^T lambda + sum of w_j tau_j - (M x'' - f) = 0,

d lambda / dp = -(dPhi/dx)^T^+ (h_p + h_z dz/dp + sum of w_j d tau_j / dp),

and so the wrenches, which are linear in lambda. What redundant constraints leave open has no derivative.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.cycles.free_bodies import free_bodies
from mbsvib.cycles.reactions import reactions
from mbsvib.cycles.total_derivatives import dependent_derivatives, total_derivatives
from mbsvib.finite_motion.evaluation import matrices
from mbsvib.linalg.rank import REDUNDANT_LOOPS

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.cycles.result import CycleData
    from mbsvib.finite_motion.rotations import Expression


def reaction_sensitivities(cycle: CycleData, names: tuple[str, ...]) -> dict[str, Array]:
    """Return the derivatives of the reactions of all joints.

    Returns (parameters, samples, 6): by joint; not a number for directions that redundant constraints leave open.
    """
    plant, motion = cycle.machine, cycle.machine.solved
    model, expressions = plant.model, plant.with_symbols(names)
    bodies = free_bodies(model, expressions, cycle.drives)
    drive_wrenches = bodies.drive_wrenches
    loads, tau = ca.SX.sym("lambda", sum(bodies.counts)), ca.SX.sym("tau", len(cycle.drives))
    shared = ca.SX.sym("mu", drive_wrenches.shape[1] - len(cycle.drives))
    unknown = ca.vertcat(loads, shared)
    residual = bodies.rows.T @ loads + drive_wrenches @ ca.vertcat(tau, shared) - bodies.required
    wrenches = ca.vertcat(*(bodies.unit_wrenches[:, which] @ loads[which] for which in bodies.slices))
    depends = [i for i in range(len(expressions.motion.motion.names)) if i not in set(motion.driven.tolist())]
    state = ca.vertcat(expressions.q[depends, :], expressions.qd[depends, :], expressions.qdd[depends, :])
    symbols = [expressions.q, expressions.qd, expressions.qdd, expressions.p, expressions.about]
    p = plant.values(expressions)
    at = (motion.q, motion.qd, motion.qdd, p, plant.about)
    torques = np.column_stack([cycle.torques[name] for name in cycle.drives])

    def evaluated(
        *outputs: Expression, extra: tuple[Expression, ...] = (), values: tuple[Array, ...] = ()
    ) -> list[Array]:
        function = ca.Function("f", [*symbols, *extra], [ca.densify(item) for item in outputs])
        return matrices(function, *at, *values)

    matrix, drives, required = evaluated(
        ca.jacobian(residual, unknown), drive_wrenches[:, : len(cycle.drives)], bodies.required
    )
    inverse = np.linalg.pinv(matrix, rcond=REDUNDANT_LOOPS)
    multipliers = (inverse @ (required - drives @ torques[:, :, None]))[:, :, 0]
    parts = [ca.jacobian(item, to) for item in (residual, wrenches) for to in (state, expressions.p)]
    h_z, h_p, w_z, w_p, w_l = evaluated(*parts, ca.jacobian(wrenches, unknown), extra=(unknown, tau),
                                        values=(multipliers, torques))  # fmt: skip
    d_state = dependent_derivatives(cycle, expressions)[:, : state.numel()]
    d_torque = total_derivatives(cycle, expressions, "parameters", expressions.names)[:, : len(cycle.drives)]
    change = -inverse @ (h_p + h_z @ d_state + drives @ d_torque)
    total = (w_p + w_z @ d_state + w_l @ change)[:, :, [expressions.names.index(name) for name in names]]
    result, undetermined = {}, reactions(cycle).undetermined
    for k, name in enumerate(model.joints):
        derivatives = total[:, 6 * k : 6 * k + 6].transpose(2, 0, 1).copy()
        derivatives[:, :, [DIRECTIONS.index(item) for item in undetermined.get(name, ())]] = np.nan
        derivatives.flags.writeable = False
        result[name] = derivatives
    return result
