"""What families add to as the pose changes: rates of their parameters, and terms of parameters as described."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.vectors import cross, wide
from mbsvib.sensitivities.displaced_bodies import Displaced
from mbsvib.sensitivities.force_layout import RowTerms

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.sensitivities.force_layout import ForceChanges
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network


class PoseRates:
    """How parameters change as bodies move, as those of a model do that is described in the new pose.

    ``table`` (parameters, c) has the changes for c motions of the bodies: ``motion`` (bodies, 6, c) at their centres of
    mass, ``start`` (n, 3, c) of starts of lines, ``second`` (n, 6, c) of second bodies at the points of forces;
    ``axes`` (n, 3, c) are the turns of axes. Points of ``forces`` go with the bodies.
    """

    def __init__(self, network: Network, forces: Forces, changes: ForceChanges, motion: Array) -> None:
        self.network, self._row, self.motion = network, changes.row, motion
        self.table = np.zeros((changes.count, motion.shape[2]))
        first, relative = forces.relative_motions(motion)
        self.second = first + relative
        self.start = first[:, :3] - cross(first[:, 3:], wide(forces.span, first))
        self.axes = first[:, 3:] + forces.turned_axes(relative)

    def put(self, part: str, field: str, rates: Array) -> None:
        """Set the rates (entries, c) of a field; parts that the user did not give have none."""
        for i, rate in enumerate(rates if (part, field, (0,)) in self._row else ()):
            self.table[self._row[part, field, (i,)]] = rate


class ReferenceTerms:
    """What parameters as described in ``origin`` do in a pose of equilibrium that was found elsewhere.

    Families add terms of ``parameters``, of ``forces`` and of ``openings``, by how far joints come apart. The network,
    its forces and their changes are those of the pose there.
    """

    def __init__(self, network: Network, forces: Forces, changes: ForceChanges, origin: Mechanism) -> None:
        self.network, self.origin, self.at, self._row = network, origin, changes.at, changes.row
        self.pose = Displaced(origin, {body.name: body for body in network.bodies})
        self.parameters, self.forces, self.openings = (RowTerms(changes.row, changes.at) for _ in range(3))
        self._known: set[tuple[str, str, tuple[int, ...]]] = set()
        away = np.zeros((len(forces.first), 6, 3))
        for k, joint in enumerate(network.joints):
            away[k, 3:] = self.pose.turn(joint.second) - self.pose.turn(joint.first)
        self.turned_axes = forces.turned_axes(away)

    def turns(self, part: str, field: str, turn: Array) -> None:
        """Let the three entries of a field go with a turn (3, 3) of what carries them; parts without it have none."""
        for i in range(3 if (part, field, (0,)) in self._row else 0):
            self._known.add((part, field, (i,)))
            for j in range(3):
                self.parameters.put((part, field, (i,)), self._row[part, field, (j,)], (turn[j, i],))

    def retain_others(self) -> None:
        """Let all other parameters be what they are as described."""
        for key, row in self._row.items():
            if key not in self._known:
                self.parameters.put(key, row, (1.0,))
