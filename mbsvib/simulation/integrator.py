"""The kept integrator: CVODES over a block of intervals, in one compiled object for all blocks of like grid.

All variables of a run are in units of its own, in which they are of like size, so that its tolerances have no units.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.simulation.equations import MotionEquations
from mbsvib.simulation.states import Chart, State

if TYPE_CHECKING:
    from mbsvib.finite_motion.elastic_block import ElasticBlock
    from mbsvib.finite_motion.lagrange import FiniteMotion


# What is smaller than this share of its unit may have an error of that size.
SMALL = 1e-4
WORKS = 3  # that dampers take, loads and inputs give
# Step of differences of accelerations, in units of coordinates.
STEP = 1e-6


@dataclass(frozen=True)
class Magnitudes:
    """Units of the variables of a run.

    ``coordinates`` (n,) are those of tree coordinates, ``rates`` (n,) [1/s] those of their rates over these,
    ``inertia`` (n,) masses, ``yields`` that of first-order states. ``elastic`` numbers the modes of each beam or
    superelement, all of which have the energy of the one with most of it as a unit.
    """

    coordinates: Array
    rates: Array
    inertia: Array
    yields: float
    elastic: tuple[Index, ...] = ()

    def at(self, state: State, independent: Index) -> Array:
        """Return units of the variables (q, v, y, works) at a state; no rate has a smaller one than the largest."""
        q, speeds = self.coordinates.copy(), np.abs(state.qd) / self.coordinates
        rates = np.maximum(self.rates, float(speeds.max(initial=0.0)))
        for modes in self.elastic:  # of a mass of one
            amplitude = np.maximum(self.rates * np.abs(state.q), np.abs(state.qd))[modes].max()
            q[modes] = np.maximum(q[modes], amplitude / (SMALL * self.rates[modes]))
        energy = float(self.inertia @ (self.coordinates * rates) ** 2)
        return np.concatenate((q, (q * rates)[independent], np.full(len(state.y), self.yields), np.full(WORKS, energy)))


def coordinate_units(statement: FiniteMotion, size: float) -> tuple[Array, Array]:
    """Return the units of tree coordinates (n,) and of loop closures (rows,): 1 rad of rotations, the size of the
    mechanism [m] of displacements. That of a mode is the amplitude at which it moves a node by one of these units, or
    at which its mass is that of the nodes moved by one.
    """
    motion = statement.motion
    units, closures = motion.scales(size)
    for block in statement.blocks:
        for k, name in enumerate(block.mode_names):
            if name in motion.names:
                units[motion.names.index(name)] = _amplitude(block, block.modes[:, k], size)
    return units, closures


def _amplitude(block: ElasticBlock, mode: Array, size: float) -> float:
    units = np.tile([size, size, size, 1.0, 1.0, 1.0], len(block.points))
    inertia = float(block.mass.diagonal()[: len(units)] @ units**2)
    moved = float((np.abs(mode[: 6 * len(block.elastic)]) / units[: 6 * len(block.elastic)]).max(initial=0.0))
    least = 1.0 / np.sqrt(inertia) if inertia > 0.0 else 0.0
    return 1.0 / (max(moved, least) or 1.0)  # 1 for a mode that nothing can excite


def magnitudes(
    statement: FiniteMotion, equations: MotionEquations, start: tuple[Chart, Array, Array], units: Array, size: float,
    duration: float,
) -> Magnitudes:  # fmt: skip
    """Return the units of a run.

    ``start``: choice of coordinates in the pose as described, their motions T (n, m) and mass (m, m). ``units`` (n,):
    those of the coordinates. ``duration``: of the run [s], within which a motion without stiffness may move by one
    unit; any other does so at its own frequency.
    """
    (chart, motions, mass), names = start, statement.motion.names
    independent = chart.independent
    inertia, rates = np.zeros(len(names)), np.full(len(names), 1.0 / duration)
    inertia[independent] = mass.diagonal()
    rest = np.zeros(equations.dof), np.zeros(equations.yields), chart.order, chart.rows, chart.bases, \
        np.zeros(len(equations.inputs))  # fmt: skip
    described = np.asarray(equations.unfolded(np.zeros(len(names)), *rest)[1])[:, 0]
    for i, k in enumerate(independent.tolist()):
        moved = np.asarray(equations.unfolded(STEP * units[k] * motions[:, i], *rest)[1])[:, 0]
        square = abs(float(moved[k] - described[k])) / (STEP * float(units[k]))
        rates[k] = max(rates[k], np.sqrt(square)) if np.isfinite(square) else rates[k]
    elastic = []
    for block in statement.blocks:
        modes = [names.index(name) for name in block.mode_names if name in names]
        rates[modes] = np.sqrt([value for name, value in zip(block.mode_names, block.eigenvalues, strict=True)
                                if name in names])  # fmt: skip
        if modes:
            elastic.append(np.array(modes))
    return Magnitudes(units, rates, inertia, size, tuple(elastic))


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
