"""Exact derivatives of the reactions of a cycle.

With what drives supply, J^T lambda + e tau = M q'' - f along the coordinates, the wrenches w - E lambda of the joints,
and z the coordinates, their rates and accelerations,

h = J^T lambda + e tau - (M q'' - f) = 0,

d lambda / dp = -J^T^+ (h_p + h_z dz/dp + e d tau / dp),

and so the wrenches, which are linear in lambda. What redundant constraints leave open has no derivative.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.cycles.elastic import parameter_derivatives, with_parameters
from mbsvib.cycles.reactions import reactions, wrench_terms
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
