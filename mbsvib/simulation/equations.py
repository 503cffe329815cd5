"""Equations of motion in minimal form, for a choice of independent coordinates that may change while a run goes on.

State (q, v, y): tree coordinates q (n,), rates v of the independent ones (m,), and what Maxwell dampers yield. With the
independent coordinates before the dependent ones, P q, and W J q' = 0 of the loops, W taking the redundant rows out,

    W J P^T = (J_i, J_d),  q' = T v,  q'' = T v' + c,  T = P^T (1; -J_d^-1 J_i),  c = P^T (0; -J_d^-1 W J' q')
    T^T M T v' = T^T (f + B u - M c)

Coordinates b without inertia, outside of loops, whose dampers resist, are states of first order: of their rates f_b is
a linear function, f_b = 0 tells these, and M_bb = 1 with no force keeps v_b, which nothing depends on.

P and W are parameters of the functions, so that one compiled integrator serves all choices.

Where W J as a whole loses rank the loops may go on in several ways. There d/dt ln|det J_d| = tr(J_d^-1 J_d') has a
pole, on whichever branch the motion goes on: as a state of the run it shows the integrator poses between its steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.finite_motion.frames import Expression
from mbsvib.finite_motion.loops import CLOSED
from mbsvib.linalg.dead_points import UNKNOWN
from mbsvib.linalg.rank import MASSLESS

if TYPE_CHECKING:
    from mbsvib.finite_motion.lagrange import FiniteMotion

# Small dense systems: QR of J_d, and LDL of the mass matrix.
GENERAL, SYMMETRIC = "qr", "ldl"
# The integrator asks for derivatives even where it does not use them; differences cost nothing to set up.
UNDIFFERENTIATED = {"enable_forward": False, "enable_reverse": False, "enable_jacobian": False, "enable_fd": True,
                    "never_inline": True}  # fmt: skip


@dataclass(frozen=True)
class MotionEquations:
    """Functions of CasADi for a mechanism of ``n`` tree coordinates, ``rank`` independent closures, ``dof`` = n - rank.

    ``closures``: (q, bases) -> (phi, J).  ``flow``: (q, v, y, P, W, bases, u, limit) -> (q', v', y', powers, l'),
    powers being those that dampers take, that loads and cross-coupling and that inputs give [W], l = ln|det J_d| where
    there are loops; NaN where dependent coordinates go more than ``limit`` times as fast as independent ones, and where
    loops are too far open to tell branches of their motion apart. ``smooth_flow`` is the same with derivatives, for
    Newton's method. ``unfolded``: the same arguments but the last -> (q', q''). ``first``: coordinates of first order.
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
    first: tuple[int, ...]

    @property
    def dof(self) -> int:
        """Number of degrees of freedom."""
        return self.n - self.rank

    @property
    def looped(self) -> int:
        """Number of logarithms of how far loops are from a singular pose: 1, or 0 without loops."""
        return min(self.rank, 1)


def first_order(statement: FiniteMotion) -> list[int]:
    """Return the numbers of coordinates without inertia, outside of loops, whose dampers determine their rates."""
    motion, mass, jacobian = statement.motion, statement.mass, statement.jacobian
    found = [k for k in range(motion.q.shape[0]) if mass[k, :].is_zero() and jacobian[:, k].is_zero()]
    if not found:
        return []
    rows = ca.Function("dampers", [motion.q, motion.qd, statement.yields, motion.bases],
                       [ca.jacobian(statement.forces[found], motion.qd)[:, found]])  # fmt: skip
    damping = -np.asarray(rows(0.0, 0.0, 0.0, motion.no_turns))
    size = np.sqrt(np.abs(damping.diagonal()))
    if not size.all() or np.linalg.svd(damping / size[:, None] / size)[1][-1] <= MASSLESS:
        return []
    return found


def _with_first_order(statement: FiniteMotion, forces: Expression, first: list[int]) -> tuple[Expression, Expression]:
    """Mass (n, n) with ones for coordinates of first order, and the rates (n,) of all."""
    mass, rates, none = (ca.SX(one) for one in (statement.mass, statement.motion.qd, statement.motion.qd))
    none[first] = 0.0
    force, slopes = ca.substitute(
        [forces[first], ca.jacobian(forces[first], statement.motion.qd)[:, first]], [statement.motion.qd], [none])
    rates[first] = ca.solve(ca.densify(-slopes), ca.densify(force))
    for k in first:
        mass[k, k] = 1.0
    return mass, rates


def motion_equations(statement: FiniteMotion, rank: int, scale: Array, first: list[int]) -> MotionEquations:
    """Return the equations of motion of a mechanism whose loops demand ``rank`` independent conditions.

    ``scale`` (n,): units in which all coordinates are of like size. ``first``: numbers of those of ``first_order``.
    """
    motion = statement.motion
    q, qd, y, bases = motion.q, motion.qd, statement.yields, motion.bases
    n, inputs = q.shape[0], tuple(statement.inputs)
    u = ca.SX.sym("u", len(inputs))
    driven = statement.input_forces @ u if inputs else ca.SX.zeros(n)
    powers = ca.vertcat(
        2.0 * sum(statement.dissipation.values(), ca.SX(0.0)),
        sum(statement.loads.values(), ca.dot(statement.cross_forces, qd)), ca.dot(driven, qd),
    )  # fmt: skip
    forces = statement.forces + driven
    mass, moving = _with_first_order(statement, forces, first) if first else (statement.mass, qd)
    forces, powers = ca.substitute([forces, powers], [qd], [moving]) if first else (forces, powers)
    forces[first] = 0.0
    jacobian_rate = ca.reshape(ca.jtimes(ca.vec(ca.densify(statement.jacobian)), q, qd), *statement.jacobian.shape)
    terms = ca.Function("terms", [q, qd, y, bases, u], [
        moving, mass, *map(ca.densify, (forces, statement.closure_bias, statement.yield_rates, powers, jacobian_rate))
    ], {"cse": True})  # fmt: skip
    closures = ca.Function("closures", [q, bases], [ca.densify(motion.closures), ca.densify(statement.jacobian)])
    rows = motion.closures.shape[0]
    dof = n - rank
    x = [ca.MX.sym("q", n), ca.MX.sym("v", dof), ca.MX.sym("y", y.shape[0])]
    P, W = ca.MX.sym("P", n, n), ca.MX.sym("W", rank, rows)
    prescribed = [ca.MX.sym("bases", bases.shape[0]), ca.MX.sym("u", len(inputs))]
    limit = ca.MX.sym("limit")
    T = P.T[:, :dof]
    if rank:
        openings, derivative = closures(x[0], prescribed[0])
        jacobian = W @ derivative @ P.T
        inverse = ca.solve(jacobian[:, dof:], ca.MX.eye(rank), GENERAL)
        follow = -(inverse @ jacobian[:, :dof])
        T = T + P.T[:, dof:] @ follow
    rates, M, f, bias, yd, power, opening_rate = terms(x[0], T @ x[1], x[2], *prescribed)
    path_acceleration = -(P.T[:, dof:] @ (inverse @ (W @ bias))) if rank else ca.MX.zeros(n)
    inertia = M @ T
    vd = ca.solve(T.T @ inertia, T.T @ f - inertia.T @ path_acceleration, SYMMETRIC)
    if rank:  # beyond a dead point of the chosen coordinates the rates would go on along another branch
        units = P @ ca.DM(scale)
        scaled = follow * ca.repmat(units[:dof].T, rank, 1) / ca.repmat(units[dof:], 1, dof)
        farthest = ca.mmax(ca.fabs(inverse / ca.repmat(units[dof:], 1, rank)))
        opening = ca.fmax(ca.mmax(ca.fabs(W @ openings)), CLOSED)
        known = ca.logic_and(ca.mmax(ca.fabs(scaled)) < limit, farthest**2 * UNKNOWN**2 * opening < 1.0)
        vd_in = vd * ca.if_else(known, 1.0, ca.MX(float("nan")))
        shrinking = ca.trace(inverse @ (W @ opening_rate @ P.T[:, dof:]))
    else:
        vd_in, shrinking = vd, ca.MX.zeros(0)
    arguments, results = [*x, P, W, *prescribed], [rates, vd_in, yd, power, shrinking]
    return MotionEquations(
        n, rank, y.shape[0], inputs, closures,
        ca.Function("flow", [*arguments, limit], results, {"cse": True} | UNDIFFERENTIATED),
        ca.Function("smooth_flow", [*arguments, limit], results, {"cse": True}),
        ca.Function("unfolded", arguments, [rates, T @ vd + path_acceleration], {"cse": True}),
        ca.Function("mass", [q, bases], [ca.densify(mass)]), tuple(first),
    )  # fmt: skip
