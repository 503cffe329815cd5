"""What a run needs from its first to its last step: equations, loops, inputs and the integrator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import eigh

from mbsvib.common.arrays import Array
from mbsvib.elements.bushing import LARGEST_ANGLE
from mbsvib.errors import ModelError, SingularPoseError
from mbsvib.finite_motion.evaluation import evaluated
from mbsvib.finite_motion.lagrange import FiniteMotion
from mbsvib.finite_motion.loops import Loops, straight_way
from mbsvib.kinematics.pose import size_of
from mbsvib.linalg.rank import MASSLESS
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.simulation.equations import MotionEquations, first_order, motion_equations
from mbsvib.simulation.integrator import Integrator, coordinate_units, magnitudes
from mbsvib.simulation.signals import Signals
from mbsvib.simulation.states import Chart, FreeRotation, chart_at, free_rotations

# Poses this far off (rad, mechanism sizes), in which as many closures must be independent as where a run starts.
NEIGHBOUR = 1e-3
# Decays over the time of a run, beyond which an explicit method takes more steps for its stability than for accuracy.
STIFF = 1e6
# Where a run stops at this share of the angle up to which moments are defined, that is why.
NEXT_TO = 0.9


@dataclass(frozen=True)
class Session:
    """A mechanism that is ready to be integrated.

    ``limits`` are functions (q, bases) -> angles [rad] of the connections ``limited``, which must stay below that up to
    which moments are defined.
    """

    model: Mechanism
    statement: FiniteMotion
    equations: MotionEquations
    loops: Loops
    free_rotations: tuple[FreeRotation, ...]
    integrator: Integrator
    signals: Signals
    limited: tuple[str, ...]
    limits: Any

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the tree coordinates."""
        return self.statement.motion.names

    def at_limit(self, q: Array, bases: Array) -> str | None:
        """Return the connection whose angle is next to the limit, or None."""
        if not self.limited:
            return None
        angles = np.asarray(self.limits(q, bases))[:, 0]
        worst = int(np.argmax(angles))
        return self.limited[worst] if angles[worst] > NEXT_TO * LARGEST_ANGLE else None

    def within_limits(self, poses: Sequence[Array], bases: Array) -> list[bool]:
        """Return whether connections stay within their limits on the way to each pose (n,) but the first; steps of the
        integrator may jump over angles beyond.
        """
        if not self.limited or len(poses) < 2:
            return [True] * (len(poses) - 1)
        ways = [straight_way(*ends, self.statement.motion.turns) for ends in pairwise(poses)]
        within = (evaluated(self.limits, np.concatenate(ways), bases)[0] <= LARGEST_ANGLE).all(axis=1)
        return [bool(part.all()) for part in np.split(within, np.cumsum([len(way) for way in ways])[:-1])]


def session(model: Mechanism, statement: FiniteMotion, signals: Signals, tolerance: float) -> Session:
    """Return a mechanism that is ready to be integrated."""
    motion = statement.motion
    size, duration = size_of(model), float(np.ptp(signals.breaks))
    scale, closure_scale = coordinate_units(statement, size)
    rows, bases = 1.0 / closure_scale, motion.no_turns
    rank = _rank(model, statement, scale, rows, bases)
    if rank == len(motion.names):
        raise ModelError(f"simulate: model '{model.name}' is fully locked; it has no motion to follow.",
                         element=model.name)  # fmt: skip
    equations = motion_equations(statement, rank, scale, first_order(statement))
    loops = Loops(equations.closures, scale, rows, rank)
    start = _checked_mass(equations, loops, motion.names, bases)
    stiff = _fastest_decay(statement, equations.first, start[1:], bases) * duration > STIFF
    angles = {name: part.angle for name, part in statement.connections.items() if part.angle is not None}
    return Session(
        model, statement, equations, loops, free_rotations(motion),
        Integrator(equations, magnitudes(statement, equations, start, scale, size, duration),
                   signals.coefficients.shape[2] - 1, tolerance, stiff), signals, tuple(angles),
        ca.Function("limits", [motion.q, motion.bases], [ca.vertcat(*angles.values())]),
    )  # fmt: skip


def _rank(model: Mechanism, statement: FiniteMotion, scale: Array, rows: Array, bases: Array) -> int:
    """Number of independent closures, the same where the run starts and next to it."""
    if not len(rows):
        return 0
    motion = statement.motion
    closures = ca.Function("closures", [motion.q, motion.bases], [motion.closures, statement.jacobian])
    loops, origin = Loops(closures, scale, rows), np.zeros(len(scale))
    rank = loops.rank_at(origin, bases)
    generator = np.random.default_rng(0)
    step = loops.rates(origin, bases, NEIGHBOUR * generator.standard_normal(len(scale)) * scale)
    next_to, opening = loops.projected(step, bases)
    if opening > NEIGHBOUR**2 or loops.rank_at(next_to, bases) != rank:
        cut = ", ".join(motion.topology.joints[k].name for k in motion.topology.cut)
        coordinates = [name for name in motion.names if name.rpartition(".")[0] in model.joints]
        pose = ", ".join(f"'{name}': ..." for name in coordinates[: len(scale) - rank])
        raise SingularPoseError(
            f"simulate: the loops closed by {cut} have another number of degrees of freedom in the pose as described "
            f"than next to it, as several motions start here; start a little off, where enough coordinates say which "
            f"one it is: model.moved({{{pose}}}).simulate(...)."
        )  # fmt: skip
    return rank


def _fastest_decay(
    statement: FiniteMotion, first: Sequence[int], reduced: tuple[Array, Array], bases: Array
) -> float:  # fmt: skip
    """The largest rate [1/s] at which dampers alone would bring a motion to rest where a run starts."""
    to_all, mass = reduced
    motion = statement.motion
    dissipation = sum(statement.dissipation.values(), ca.SX(0.0))
    damping = ca.jacobian(ca.gradient(dissipation, motion.qd), motion.qd)
    yielding = ca.jacobian(statement.yield_rates, statement.yields)
    stiffness = -ca.jacobian(statement.forces[list(first)], motion.q)[:, list(first)] if first else ca.SX(0, 0)
    function = ca.Function("damping", [motion.q, motion.qd, statement.yields, motion.bases],
                           [damping, yielding, stiffness])  # fmt: skip
    origin = np.zeros(len(motion.names))
    matrix, yields, stiff = map(np.asarray, function(origin, origin, np.zeros(statement.yields.shape), bases))
    relaxed = np.diag(stiff) / matrix.diagonal()[list(first)]
    matrix[list(first)] = matrix[:, list(first)] = 0.0
    rates = np.abs([*eigh(to_all.T @ matrix @ to_all, mass, eigvals_only=True), *np.diag(yields), *relaxed])
    return float(rates.max(initial=0.0))


def _checked_mass(
    equations: MotionEquations, loops: Loops, names: tuple[str, ...], bases: Array
) -> tuple[Chart, Array, Array]:
    """The independent coordinates, their motions (n, m) and mass (m, m); refuse those without inertia by name."""
    origin = np.zeros(equations.n)
    chart = chart_at(loops, origin, bases)
    jacobian = chart.rows @ np.asarray(equations.closures(origin, bases)[1])
    closed = np.concatenate((chart.order[: equations.dof], jacobian))
    to_all = np.linalg.solve(closed, np.eye(equations.n)[:, : equations.dof])
    mass = to_all.T @ np.asarray(equations.mass(origin, bases)) @ to_all
    diagonal = mass.diagonal()
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    values, vectors = np.linalg.eigh(mass / scale[:, None] / scale)
    if values[0] <= MASSLESS:
        name = names[chart.independent[int(np.argmax(np.abs(vectors[:, 0])))]]
        raise ModelError(
            f"simulate: the motion '{name}' has no inertia, so that no acceleration follows from the forces; give the "
            f"body behind it a mass, or join it firmly to one that has.", element=name,
        )  # fmt: skip
    return chart, to_all, mass
