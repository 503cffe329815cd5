"""Equations of motion in minimal form, for a choice of independent coordinates that may change while a run goes on.

State (q, v, y): tree coordinates q (n,), rates v = Y q' (m,) of the independent ones, and what Maxwell dampers yield.
With W J q' = 0 of the loops, W taking the redundant rows out,

    q' = S^-1 (v, 0),  q'' = S^-1 (v', -W J' q') = T v' + c,  S = (Y; W J)
    T^T M T v' = T^T (f + B u - M c)

Y and W are parameters of the functions, so that one compiled integrator serves all choices.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.finite_motion.lagrange import FiniteMotion

# Small dense systems: QR of S, whose rows are no symmetric matrix, and LDL of the mass matrix.
GENERAL, SYMMETRIC = "qr", "ldl"
# The integrator asks for derivatives even where it does not use them; differences cost nothing to set up.
UNDIFFERENTIATED = {"enable_forward": False, "enable_reverse": False, "enable_jacobian": False, "enable_fd": True,
                    "never_inline": True}  # fmt: skip


@dataclass(frozen=True)
class MotionEquations:
    """Functions of CasADi for a mechanism of ``n`` tree coordinates, ``rank`` independent closures, ``dof`` = n - rank.

    ``closures``: (q, bases) -> (phi, J).  ``rates``: (q, qd, y, bases, u) -> (M, f + B u, J, J' q', y', powers), powers
    being those that dampers take, that loads and that inputs give [W].  ``flow``: (q, v, y, Y, W, bases, u, limit)
    -> (q', v', y', powers), NaN where dependent coordinates go more than ``limit`` times as fast as independent ones.
    ``smooth_flow`` is the same with derivatives, for Newton's method. ``unfolded``: the same arguments but the last ->
    (q', q'').
    """

    n: int
    rank: int
    yields: int
    inputs: tuple[str, ...]
    closures: Any
    flow: Any
    smooth_flow: Any
    unfolded: Any
    mass: Any

    @property
    def dof(self) -> int:
        """Number of degrees of freedom."""
        return self.n - self.rank


def motion_equations(statement: FiniteMotion, rank: int, scale: Array) -> MotionEquations:
    """Return the equations of motion of a mechanism whose loops demand ``rank`` independent conditions.

    ``scale`` (n,): units in which all coordinates are of like size.
    """
    motion = statement.motion
    q, qd, y, bases = motion.q, motion.qd, statement.yields, motion.bases
    n, inputs = q.shape[0], tuple(statement.inputs)
    u = ca.SX.sym("u", len(inputs))
    driven = statement.input_forces @ u if inputs else ca.SX.zeros(n)
    powers = ca.vertcat(
        2.0 * sum(statement.dissipation.values(), ca.SX(0.0)), sum(statement.loads.values(), ca.SX(0.0)),
        ca.dot(driven, qd),
    )  # fmt: skip
    terms = ca.Function("terms", [q, qd, y, bases, u], [
        ca.densify(statement.mass), ca.densify(statement.forces + driven), ca.densify(statement.jacobian),
        ca.densify(statement.closure_bias), ca.densify(statement.yield_rates), ca.densify(powers),
    ], {"cse": True})  # fmt: skip
    closures = ca.Function("closures", [q, bases], [ca.densify(motion.closures), ca.densify(statement.jacobian)])
    rows = motion.closures.shape[0]
    dof = n - rank
    x = [ca.MX.sym("q", n), ca.MX.sym("v", dof), ca.MX.sym("y", y.shape[0])]
    Y, W = ca.MX.sym("Y", dof, n), ca.MX.sym("W", rank, rows)
    prescribed = [ca.MX.sym("bases", bases.shape[0]), ca.MX.sym("u", len(inputs))]
    jacobian = closures(x[0], prescribed[0])[1]
    limit = ca.MX.sym("limit")
    if rank:
        S = ca.vertcat(Y, W @ jacobian)
        both = ca.solve(S, ca.vertcat(ca.horzcat(ca.MX.eye(dof), x[1]), ca.MX.zeros(rank, dof + 1)), GENERAL)
        T, rates = both[:, :dof], both[:, dof]
    else:
        T, rates = Y.T, Y.T @ x[1]
    M, f, _, bias, yd, power = terms(x[0], rates, x[2], *prescribed)
    path_acceleration = -ca.solve(S, ca.vertcat(ca.MX.zeros(dof), W @ bias), GENERAL) if rank else ca.MX.zeros(n)
    reduced = T.T @ M @ T
    vd = ca.solve(reduced, T.T @ (f - M @ path_acceleration), SYMMETRIC)
    if rank:  # beyond a dead point of the chosen coordinates the rates would go on along another branch
        scaled = T * ca.repmat(1.0 / ca.DM(scale), 1, dof) * ca.repmat((Y @ ca.DM(scale)).T, n, 1)
        vd_in = vd * ca.if_else(ca.mmax(ca.fabs(scaled)) < limit, 1.0, ca.MX(float("nan")))
    else:
        vd_in = vd
    arguments = [*x, Y, W, *prescribed]
    return MotionEquations(
        n, rank, y.shape[0], inputs, closures,
        ca.Function("flow", [*arguments, limit], [rates, vd_in, yd, power], {"cse": True} | UNDIFFERENTIATED),
        ca.Function("smooth_flow", [*arguments, limit], [rates, vd_in, yd, power], {"cse": True}),
        ca.Function("unfolded", arguments, [rates, T @ vd + path_acceleration], {"cse": True}),
        ca.Function("mass", [q, bases], [ca.densify(statement.mass)]),
    )  # fmt: skip
