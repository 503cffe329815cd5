"""Units of a problem's own, in which all variables of a run are of like size, so that its tolerances have no units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.finite_motion.elastic_block import ElasticBlock
    from mbsvib.finite_motion.lagrange import FiniteMotion
    from mbsvib.simulation.charts import Chart
    from mbsvib.simulation.equations import MotionEquations
    from mbsvib.simulation.states import State

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
