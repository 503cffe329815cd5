"""What families add to as the pose changes: rates of their parameters, and terms of parameters as described."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.vectors import cross, wide
from mbsvib.sensitivities.displaced_bodies import displaced
from mbsvib.sensitivities.force_layout import RowTerms

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Part
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.sensitivities.force_layout import ForceChanges
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network


class PoseRates:
    """How parameters change as bodies move, as those of a model do that is described in the new pose.

    ``table`` (parameters, c) has the changes for c motions of the bodies: ``motion`` (bodies, 6, c) at their centres of
    mass, ``second`` (n, 6, c) of second bodies at the points of forces; ``axes`` (n, 3, c) are the turns of axes.
    Points of ``forces`` go with the bodies.
    """

    def __init__(self, network: Network, forces: Forces, changes: ForceChanges, motion: Array) -> None:
        self.network, self._row, self.motion = network, changes.row, motion
        self.table = np.zeros((changes.count, motion.shape[2]))
        first, relative = forces.relative_motions(motion)
        self.second, self.axes = first + relative, first[:, 3:] + forces.turned_axes(relative)

    def carry(self, parts: Iterable[Part]) -> None:
        """Let points and axes of parts go with the bodies on which they are, as their roles say."""
        number, found = self.network.body_number, []
        for part in parts:
            for field, role in part.roles.items():
                point = (np.nan,) * 3 if role.turn else getattr(part, field) if role.moved == "point" else None
                if role.on and point is not None and (part.name, field, (0,)) in self._row:
                    found.append((self._row[part.name, field, (0,)], number[getattr(part, role.on)], point))
        if not found:
            return
        row, body, point = (np.array(column) for column in zip(*found, strict=True))
        motion = np.concatenate((self.motion, np.zeros((1, *self.motion.shape[1:]))))[body]
        arm = point - np.concatenate((self.network.position, np.zeros((1, 3))))[body]
        shift = motion[:, :3] + cross(motion[:, 3:], wide(arm, motion))
        turns = np.isnan(point[:, :1, None])
        self.table[row[:, None] + np.arange(3)] = np.where(turns, motion[:, 3:], shift)

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
        self.pose = displaced(origin, network.bodies)
        self.parameters, self.forces, self.openings = (RowTerms(changes.row, changes.at) for _ in range(3))
        self._turns: dict[tuple[str, str], Array] = {}
        away = np.zeros((len(forces.first), 6, 3))
        for k, joint in enumerate(network.joints):
            away[k, 3:] = self.turn(joint.second) - self.turn(joint.first)
        self.turned_axes = forces.turned_axes(away)

    def turn(self, body: str) -> Array:
        """Return the rotation matrix (3, 3) of a body since it was described."""
        return np.asarray(self.pose.rotations[self.pose.number[body]])

    def carry(self, part: Part) -> None:
        """Let the fields of a part go with the turns of the bodies on which they are, as their roles say."""
        for field, role in part.roles.items():
            if role.on and role.moved and (not role.follows or getattr(part, role.follows)):
                self.turns(part.name, field, self.turn(getattr(part, role.on)))

    def turns(self, part: str, field: str, turn: Array) -> None:
        """Let the three entries of a field go with a turn (3, 3) of what carries them."""
        self._turns[part, field] = turn

    def close(self) -> None:
        """Add the turns, and let all other parameters be what they are as described."""
        for (part, field, index), row in self._row.items():
            turn = self._turns.get((part, field))
            if turn is None:
                self.parameters.put((part, field, index), row, (1.0,))
            else:
                self.parameters.put((part, field, index), row - index[0], turn[:, index[0]])
