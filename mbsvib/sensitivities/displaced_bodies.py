"""Bodies in a pose of equilibrium that was found elsewhere, against where they are described."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Bushing
from mbsvib.linalg.rank import ZERO_TURN

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Part
    from mbsvib.mechanism.mechanism import Mechanism



class Displaced:
    """Where bodies went from where they are described."""

    def __init__(self, origin: Mechanism, displaced: Mapping[str, Any]) -> None:
        self._origin, self._displaced = origin.bodies, displaced

    def turn(self, body: str) -> Array:
        """Return the rotation matrix (3, 3) of a body since it was described."""
        if body == "ground":
            return np.eye(3)
        return np.asarray(np.array(self._displaced[body].orientation) @ np.array(self._origin[body].orientation).T)

    def point(self, body: str, at: Any) -> Array:
        """Return where a point (3,) [m] of a body has gone."""
        if body == "ground":
            return np.array(at)
        arm = np.subtract(at, self._origin[body].position)
        return np.asarray(self._displaced[body].position + self.turn(body) @ arm)


def turned(origin: Mechanism, parts: Iterable[Part]) -> frozenset[str]:
    """Return the bushings whose bodies turned against each other: what they do about axes changes in ways of its own.
    """
    known = {part.name: part for part in parts}
    pose = Displaced(origin, known)
    return frozenset(part.name for part in known.values() if isinstance(part, Bushing)
                     and np.abs(pose.turn(part.first) - pose.turn(part.second)).max() > ZERO_TURN)  # fmt: skip


def holds_turns(bushing: Bushing) -> bool:
    """Tell whether a bushing carries moments, or forces by rotations."""
    blocks = [np.array(value) for value in (bushing.stiffness, bushing.damping, bushing.preload or np.zeros(6))]
    return any(value[3:].any() or (value.ndim == 2 and value[:, 3:].any()) for value in blocks)
