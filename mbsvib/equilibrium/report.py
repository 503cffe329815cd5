"""The result of a search for equilibrium: the model there, and the steps of the search."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from mbsvib.common import tables
from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.elements.pose import Pose
from mbsvib.equations.equations import Equations
from mbsvib.errors import MbsvibError, counted
from mbsvib.linalg.rotations import logarithm
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.sparse.equations import SparseEquations

if TYPE_CHECKING:
    from mbsvib.modes import Modes


M = TypeVar("M", bound=Mechanism)

# Number of the lowest modes that are checked where the equations are sparse.
LOWEST = 10
# Displacements below this share of the largest one are rounding in the table.
STILL = 1e-12


@dataclass(frozen=True, repr=False)
class Equilibrium(Columnar, Displayed, Generic[M]):
    """A model in equilibrium and the steps of the search.

    ``residuals`` are the residuals as shares of the forces, before and after each step under the full load,
    ``iterations`` counts all steps, ``load_steps`` are the shares of the load that were applied in turn.
    ``displacements`` are those of the bodies: translation of the centre of mass [m] and rotation vector [rad], world
    axes. The search itself does not ensure stability: see ``stable`` and ``unstable_modes``.
    """

    model: M
    """The model in its equilibrium, balanced."""
    iterations: int
    residuals: tuple[float, ...]
    load_steps: tuple[float, ...]
    displacements: dict[str, Array]

    def columns(self) -> dict[str, Any]:
        """Return a row for each body: its name, its translation x y z [m] and rotation vector rx ry rz [rad]."""
        motions = np.array([*self.displacements.values()]).reshape(-1, 6)
        return {"body": np.array([*self.displacements]), **dict(zip(DIRECTIONS, motions.T, strict=True))}

    @cached_property
    def stable(self) -> bool:
        """Whether the equilibrium is stable: no mode is unstable."""
        return not self.unstable_modes

    @cached_property
    def unstable_modes(self) -> tuple[int, ...]:
        """Numbers of the unstable modes, from 1 as ``print(model.linearize().modes())`` lists them, one for each
        unstable direction; of large mechanisms among the lowest ten.
        """
        return () if self._modes is None else tuple((np.flatnonzero(self._modes.growing) + 1).tolist())

    @cached_property
    def _modes(self) -> Modes | None:
        return modes_of(self.model)

    def _stability(self) -> str:
        """The stability of the pose in words: unstable modes, or rigid-body modes."""
        try:
            numbers, modes = self.unstable_modes, self._modes
        except MbsvibError as error:
            return f"stability unknown: {error}"
        if modes is None:
            return "stable: there is no degree of freedom"
        if not numbers:
            return "stable" + (f" except for {counted(modes.rigid, 'rigid-body mode')} at 0 Hz" if modes.rigid
                               else "")  # fmt: skip
        most = modes.strongest()
        listed = ", ".join(f"{number} (largest motion: {' '.join(most[number - 1])})" for number in numbers)
        return f"UNSTABLE: {counted(len(numbers), 'unstable mode')} of model.linearize().modes(): {listed}"

    def __str__(self) -> str:
        steps = f" in {counted(len(self.load_steps) - 1, 'load step')}" if len(self.load_steps) > 1 else ""
        lines = [
            f"Equilibrium of {self.model.name} after {counted(self.iterations, 'step')}{steps}; residual of the "
            f"forces: {self.residuals[-1]:.1e}",
            f"  {self._stability()}",
        ]
        if len(self.residuals) > 1:
            lines.append("  residuals: " + ", ".join(f"{value:.1e}" for value in self.residuals))
        return "\n".join(lines + ([self._table()] if self.displacements else []))

    def _table(self) -> str:
        """Table of the displacements of the bodies: translations of centres of mass, and rotation vectors."""
        rows = np.array(list(self.displacements.values()))
        columns: list[tuple[str, Any]] = [("body", "left")]
        for part, unit in ((slice(3), "m"), (slice(3, 6), "rad")):
            rows[:, part][np.abs(rows[:, part]) <= STILL * np.abs(rows[:, part]).max()] = 0.0
            columns += [(f"{direction} [{unit}]", "right") for direction in DIRECTIONS[part]]
        words = [(name, *(f"{value:.6g}" for value in row)) for name, row in
                 zip(self.displacements, rows.tolist(), strict=True)]  # fmt: skip
        return tables.text("Displacements from the described pose", columns, words)


def modes_of(model: Mechanism) -> Modes | None:
    """Return the modes of a model, the lowest ones where its equations are sparse; None if nothing can move."""
    from mbsvib.modes.result import RTOL, modes
    from mbsvib.sparse.choice import linearized
    system: Equations | SparseEquations = linearized(model)
    if not system.dof:
        return None
    if not isinstance(system, SparseEquations):
        return modes(system, RTOL, clean=False)
    from mbsvib.sparse.modes import modes as some_modes

    return some_modes(system, min(LOWEST, system.dof))


def displacements(pose: Pose) -> dict[str, Array]:
    """Return the displacement of each body from the reference pose."""
    result = {}
    for name, k in pose.number.items():
        if name != "ground":
            result[name] = np.concatenate((pose.centre[k] - pose.origin[k], logarithm(pose.rotations[k])))
    return result
