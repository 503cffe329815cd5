"""How parameters change as bodies move, as those of a model do that is described in the new pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.vectors import cross, wide

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.sensitivities.force_layout import ForceChanges
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network


class PoseRates:
    """Changes ``table`` (parameters, c) of the parameters for motions of the bodies.

    Parameters
    ----------
    network, forces : Network, Forces
        The mechanism and its forces at the pose, whose points go with the bodies.
    changes : ForceChanges
        The parameters.
    motion : array, shape (bodies, 6, c)
        Motions at the centres of mass; ``start`` (n, 3, c) is that of starts of lines, ``second`` (n, 6, c) of second
        bodies at the points of forces, ``axes`` (n, 3, c) the turn of axes.
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
