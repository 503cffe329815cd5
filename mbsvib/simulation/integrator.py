"""The kept integrator: CVODES over a block of intervals, in one compiled object for all blocks of like grid."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.simulation.states import State

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.simulation.charts import Chart
    from mbsvib.simulation.equations import MotionEquations

# CVODES controls the error of single steps; these shares of the tolerance leave the sum of some thousand below it.
RELATIVE, ABSOLUTE = 1e-2, 1e-6
# Adams' method without Newton's takes a third of the time of BDF where little is damped strongly.
SMOOTH = {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
STRONGLY_DAMPED = {"linear_multistep_method": "bdf", "nonlinear_solver_iteration": "newton"}
# Steps within one interval of the output, beyond which it is given up, and the shortest as a share of a block: where
# the equations end steps become shorter and shorter.
STEPS, SHORTEST = 200_000, 1e-10


@dataclass
class Integrator:
    """CVODES for the equations of a mechanism; keeps what it compiled by the grids it was asked for.

    ``scale`` (n,) are units of the coordinates, ``degree`` is that of the polynomials of the inputs, ``tolerance`` the
    error of results that is asked for; ``stiff``: dampers are so strong that steps should not be bound to how fast they
    work.
    """

    equations: MotionEquations
    scale: Array
    degree: int
    tolerance: float
    stiff: bool = False
    compiled: dict[tuple[float, ...], Any] = field(default_factory=dict)

    def block(self, start: State, chart: Chart, grid: Array, coefficients: Array) -> list[State]:
        """Return the states at the ends of some intervals.

        ``grid`` (k,): ends of the intervals [s]. ``coefficients`` (k, inputs, degree + 1): the inputs on these
        intervals, as in ``Signals``.
        """
        eq, length = self.equations, float(grid[-1] - start.time)
        shares = (grid - start.time) / length
        key = tuple(np.round(shares, 13).tolist())
        solver = self.compiled.get(key)
        if solver is None:
            solver = self.compiled[key] = self._compile(shares)
        starts = np.concatenate(([0.0], shares[:-1]))
        powers = coefficients.reshape(len(grid), -1)
        of_interval = np.concatenate((starts[:, None], (shares - starts)[:, None], powers), axis=1)
        independent_scale = self.scale[chart.independent]
        x0 = np.concatenate((start.q / self.scale, start.qd[chart.independent] / independent_scale, start.y))
        p = np.concatenate(([length, chart.limit], independent_scale, chart.select.reshape(-1, order="F"),
                            chart.rows.reshape(-1, order="F"), chart.bases))  # fmt: skip
        result = solver(x0=x0, p=p, u=of_interval.T)
        x, work = np.asarray(result["xf"]), np.asarray(result["qf"])
        if not np.isfinite(x).all():
            raise RuntimeError("the state is not finite")
        states = []
        for k, time in enumerate(grid.tolist()):
            q = x[: eq.n, k] * self.scale
            v = x[eq.n : eq.n + eq.dof, k] * independent_scale
            y = x[eq.n + eq.dof :, k]
            u = np.einsum("ip->i", coefficients[k]) if coefficients.shape[1] else np.zeros(0)
            rates = np.asarray(eq.unfolded(q, v, y, chart.select, chart.rows, chart.bases, u)[0])[:, 0]
            states.append(State(time, q, rates, y, start.work + work[:, k]))
        return states

    def _compile(self, shares: Array) -> Any:
        eq = self.equations
        x = ca.MX.sym("x", eq.n + eq.dof + eq.yields)
        rows = eq.closures.size1_out(0)
        length, independent_scale, limit = ca.MX.sym("h"), ca.MX.sym("s", eq.dof), ca.MX.sym("l")
        select, closures = ca.MX.sym("Y", eq.dof, eq.n), ca.MX.sym("W", eq.rank, rows)
        bases, t = ca.MX.sym("b", eq.closures.size1_in(1)), ca.MX.sym("t")
        of_interval = ca.MX.sym("u", 2 + len(eq.inputs) * (self.degree + 1))
        share = (t - of_interval[0]) / of_interval[1]
        powers = ca.vertcat(*(share**k for k in range(self.degree + 1)))
        u = ca.reshape(of_interval[2:], self.degree + 1, len(eq.inputs)).T @ powers
        scale = ca.DM(self.scale)
        q, v, y = x[: eq.n] * scale, x[eq.n : eq.n + eq.dof] * independent_scale, x[eq.n + eq.dof :]
        flow = eq.smooth_flow if self.stiff else eq.flow
        qd, vd, yd, powers_taken = flow(q, v, y, select, closures, bases, u, limit)
        ode = length * ca.vertcat(qd / scale, vd / independent_scale, yd)
        p = ca.vertcat(length, limit, independent_scale, ca.vec(select), ca.vec(closures), bases)
        options: dict[str, Any] = STRONGLY_DAMPED if self.stiff else SMOOTH
        dae = {"x": x, "p": p, "u": of_interval, "t": t, "ode": ode, "quad": length * powers_taken}
        return ca.integrator("run", "cvodes", dae, 0.0, shares.tolist(), {
            "reltol": RELATIVE * self.tolerance, "abstol": ABSOLUTE * self.tolerance, "max_num_steps": STEPS,
            "quad_err_con": True,
            "min_step_size": SHORTEST, "disable_internal_warnings": True, "show_eval_warnings": False,
            "print_time": False,
        } | options)  # fmt: skip
