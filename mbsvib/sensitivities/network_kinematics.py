"""Relative motions and loops of a network, out of dense equations: what its coordinates are, and what closes loops.

The forces in the rows of Phi that close loops and couple coordinates follow from what dependent coordinates feel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from scipy.sparse import csr_array

from mbsvib.elements.coupler import Coupling
from mbsvib.equations.scene import cut_rows
from mbsvib.kinematics.couplers import terms, with_couplers
from mbsvib.kinematics.relative_motion import relative_motion, twists
from mbsvib.linalg.vectors import DENSE, entries_matrix
from mbsvib.mechanism.topology import FLOATS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Body
    from mbsvib.elements.rows import Rows
    from mbsvib.equations.equations import Equations
    from mbsvib.kinematics.relative_motion import Twists


@dataclass(frozen=True, slots=True)
class Constraints:
    """What cut joints lock and couplers tie: rows of Phi. A force in one is ``share`` (t, rows) of ``wrench`` (t, 6)
    of each term, a locked row or what a coupler measures in a cut joint, at its joint's point, world axes; ``closing``
    (j, t) adds them up by joint. Of ``dependent`` coordinates (d,): the ``body`` behind and from the network's origin
    the ``arm`` (d, 3) of the ``twist`` (d, 6); ``pull`` (rows, d), a matrix or what multiplies like one, leads from
    what they feel to the forces in the rows, the smallest; ``stress`` (rows, r) are combinations of redundant rows that
    load nothing.
    """

    wrench: Array
    closing: Any
    share: Any
    dependent: Index
    body: Index
    arm: Array
    twist: Array
    pull: Any
    stress: Array


def constraints(
    system: Equations, coordinates: Twists, bodies: Sequence[Body], number: dict[str, int], origin: Array
) -> Constraints | None:
    """Return what closes the loops of a system and couples its coordinates.

    ``origin`` (3,): the point that sums of wrenches are taken about.
    """
    topology, reduction = system.provenance.topology, system.provenance.reduction
    couplers = [part for part in system.provenance.parts if isinstance(part, Coupling)]
    cuts = cut_rows(topology, bodies, number)
    if couplers:
        cuts = with_couplers(cuts, couplers, topology, bodies, number, coordinates)
    if cuts is None or not cuts.names:
        return None
    behind, sign = _coordinates(system)
    free = np.zeros(len(coordinates.names), dtype=bool)
    free[reduction.independent] = True
    dependent, locked = np.flatnonzero(~free), len(cuts.rows.first)
    phi = relative_motion(coordinates, cuts.rows).dense(0, locked)
    wrench, share = np.concatenate((cuts.rows.force, cuts.rows.moment)).T, np.eye(locked, len(cuts.names))
    joint = np.array(topology.cut, dtype=np.intp)[cuts.joint[:locked]]
    if cuts.couplings is not None:
        phi = np.concatenate((phi, cuts.couplings.dense(coordinates)))
        _, measured = terms(couplers, coordinates.names, topology, bodies, number)
        rows, added = cuts.couplings.measured, np.flatnonzero(cuts.couplings.column < 0)
        wrench = np.concatenate((wrench, np.concatenate((rows.force, rows.moment)).T))
        joint = np.concatenate((joint, measured))
        added_share = np.zeros((len(added), len(cuts.names)))
        added_share[np.arange(len(added)), locked + cuts.couplings.row[added]] = cuts.couplings.value[added]
        share = np.concatenate((share, added_share))
    pull, stress = _solution(phi[:, dependent])
    twist = np.concatenate((coordinates.linear, coordinates.angular))[:, dependent].T * sign[dependent, None]
    return Constraints(
        wrench,
        entries_matrix(np.ones(len(joint)), joint, np.arange(len(joint)), (len(topology.joints), len(joint))), share,
        dependent,
        behind[dependent], origin - coordinates.point[:, dependent].T, twist,
        pull, stress,
    )  # fmt: skip


def _solution(phi: Array) -> tuple[Array, Array]:
    """The least mu = ``pull`` f (rows, d) with phi^T mu = f, and what may be added to it, phi^T ``stress`` = 0."""
    rows, d = phi.shape
    if rows == d:
        return np.asarray(np.linalg.inv(phi).T, dtype=float), np.zeros((rows, 0))
    q, r = np.linalg.qr(phi, mode="complete")
    return np.linalg.solve(r[:d], q[:, :d].T).T, q[:, d:]


def _coordinates(system: Equations) -> tuple[Index, Array]:
    """Body behind each joint coordinate and its sign; those of floating bodies come last."""
    topology = system.provenance.topology
    hangs = {branch.joint: branch for branch in topology.branches if branch.joint != FLOATS}
    bodies_and_signs = [(hangs[k].body, hangs[k].sign) for k in sorted(hangs) for _ in topology.joints[k].freedom]
    bodies_and_signs += [(branch.body, 1) for branch in topology.branches if branch.joint == FLOATS for _ in range(6)]
    table = np.array(bodies_and_signs, dtype=np.intp).reshape(-1, 2)
    return table[:, 0], table[:, 1].astype(float)


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
        matrix, massless = self.system.provenance.reduction.matrix, self.system.provenance.separation
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
