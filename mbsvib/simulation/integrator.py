"""The kept integrator: CVODES over a block of intervals, in one compiled object for all blocks of like grid."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.simulation.magnitudes import SMALL, WORKS, Magnitudes
from mbsvib.simulation.states import State

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.simulation.charts import Chart
    from mbsvib.simulation.equations import MotionEquations

# CVODES controls the error of single steps; this share of the tolerance leaves the sum of some thousand below it.
RELATIVE = 1e-2
# Adams' method without Newton's takes a third of the time of BDF where little is damped strongly.
SMOOTH = {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
STRONGLY_DAMPED = {"linear_multistep_method": "bdf", "nonlinear_solver_iteration": "newton"}
# Steps within one interval of the output, beyond which it is given up, and the shortest as a share of a block: where
# the equations end steps become shorter and shorter.
STEPS, SHORTEST = 200_000, 1e-10
# Steps are so short that the logarithm of how far loops are from a singular pose is off by less: only next to one they
# become shorter by this, and none leads across it.
PASSAGE = 1e-3


@dataclass
class Integrator:
    """CVODES for the equations of a mechanism; keeps what it compiled by the grids it was asked for.

    ``magnitudes`` are units of the states, ``degree`` is that of the polynomials of the inputs, ``tolerance`` the
    error of results that is asked for; ``stiff``: dampers are so strong that steps should not be bound to how fast they
    work.
    """

    equations: MotionEquations
    magnitudes: Magnitudes
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
        passage = np.full(eq.looped, PASSAGE / (SMALL * RELATIVE * self.tolerance))
        units = np.concatenate((self.magnitudes.at(start, chart.independent), passage))
        x0 = np.concatenate((start.q, start.qd[chart.independent], start.y, start.work, 0.0 * passage)) / units
        p = np.concatenate(([length, chart.limit], units, chart.order.reshape(-1, order="F"),
                            chart.rows.reshape(-1, order="F"), chart.bases))  # fmt: skip
        x = np.asarray(solver(x0=x0, p=p, u=of_interval.T)["xf"]) * units[:, None]
        if not np.isfinite(x).all():
            raise RuntimeError("the state is not finite")
        states = []
        for k, time in enumerate(grid.tolist()):
            q, v, y, work, _ = np.split(x[:, k], np.cumsum((eq.n, eq.dof, eq.yields, WORKS)))
            u = np.einsum("ip->i", coefficients[k]) if coefficients.shape[1] else np.zeros(0)
            rates = np.asarray(eq.unfolded(q, v, y, chart.order, chart.rows, chart.bases, u)[0])[:, 0]
            states.append(State(time, q, rates, y, work))
        return states

    def _compile(self, shares: Array) -> Any:
        eq = self.equations
        count = eq.n + eq.dof + eq.yields + WORKS + eq.looped
        x, units = ca.MX.sym("x", count), ca.MX.sym("s", count)
        rows = eq.closures.size1_out(0)
        length, limit = ca.MX.sym("h"), ca.MX.sym("l")
        order, closures = ca.MX.sym("P", eq.n, eq.n), ca.MX.sym("W", eq.rank, rows)
        bases, t = ca.MX.sym("b", eq.closures.size1_in(1)), ca.MX.sym("t")
        of_interval = ca.MX.sym("u", 2 + len(eq.inputs) * (self.degree + 1))
        share = (t - of_interval[0]) / of_interval[1]
        powers = ca.vertcat(*(share**k for k in range(self.degree + 1)))
        u = ca.reshape(of_interval[2:], self.degree + 1, len(eq.inputs)).T @ powers
        q, v, y, _ = ca.vertsplit(x * units, np.cumsum((0, eq.n, eq.dof, eq.yields, WORKS + eq.looped)).tolist())
        flow = eq.smooth_flow if self.stiff else eq.flow
        ode = length * ca.vertcat(*flow(q, v, y, order, closures, bases, u, limit)) / units
        p = ca.vertcat(length, limit, units, ca.vec(order), ca.vec(closures), bases)
        options: dict[str, Any] = STRONGLY_DAMPED if self.stiff else SMOOTH
        dae = {"x": x, "p": p, "u": of_interval, "t": t, "ode": ode}
        relative = RELATIVE * self.tolerance
        return ca.integrator("run", "cvodes", dae, 0.0, shares.tolist(), {
            "reltol": relative, "abstol": SMALL * relative, "max_num_steps": STEPS,
            "min_step_size": SHORTEST, "disable_internal_warnings": True, "show_eval_warnings": False,
            "print_time": False,
        } | options)  # fmt: skip
