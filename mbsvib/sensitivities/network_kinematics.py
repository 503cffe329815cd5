"""Relative motions and loops of a network, out of dense equations: what its coordinates are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from scipy.sparse import csr_array

from mbsvib.kinematics.relative_motion import relative_motion, twists
from mbsvib.linalg.vectors import DENSE
from mbsvib.sensitivities.constraint_forces import constraints

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body
    from mbsvib.elements.rows import Rows
    from mbsvib.equations.equations import Equations
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.sensitivities.constraint_forces import Constraints


class Kinematics(Protocol):
    """Coordinates of a network: joint coordinates, or amplitudes of modes."""

    @property
    def coordinates(self) -> Twists | None:
        """The joint coordinates, None where these are too many to hold all their paths."""

    @property
    def reduction(self) -> Array | None:
        """Coordinates (n, m) of minimal ones; None: they are the same."""

    def relative(self, rows: Rows) -> Any:
        """Return relative displacements (rows, n) over the coordinates."""

    def constraints(self, bodies: Sequence[Body], number: dict[str, int], origin: Array) -> Constraints | None:
        """Return what closes loops and couples coordinates, with moments about a point."""


@dataclass(frozen=True)
class JointCoordinates:
    """The joint coordinates of a ``system``, by the path rule."""

    system: Equations
    coordinates: Twists

    @staticmethod
    def of(system: Equations, bodies: Sequence[Body]) -> JointCoordinates:
        """Return the joint coordinates of a system with these bodies."""
        return JointCoordinates(system, twists(system.provenance.topology, list(bodies)))

    @property
    def reduction(self) -> Array | None:
        """Motions that follow from statics do no work, and need no derivative."""
        matrix, massless = self.system.provenance.reduction.matrix, self.system.provenance.massless
        condensed = None if massless is None else massless.transform
        return matrix if condensed is None else condensed if matrix is None else matrix @ condensed

    def relative(self, rows: Rows) -> Any:
        """Return relative displacements over the joint coordinates."""
        entries = relative_motion(self.coordinates, rows)
        if entries.shape[0] * entries.shape[1] > DENSE:
            return csr_array((entries.value, (entries.row, entries.column)), shape=entries.shape)
        return entries.dense(0, entries.shape[0])

    def constraints(self, bodies: Sequence[Body], number: dict[str, int], origin: Array) -> Constraints | None:
        """Return what closes loops and couples coordinates."""
        return constraints(self.system, self.coordinates, bodies, number, origin)
