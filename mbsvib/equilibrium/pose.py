"""Poses: where the bodies of a model are and how they have turned since the pose in which it was described."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rotations import orthonormal

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.mechanism.mechanism import Mechanism


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose of all bodies, ground last.

    ``number`` of each body by name; ``origin`` (bodies + 1, 3) are the centres of mass as described, ``centre`` the
    same now [m], ``turn`` (bodies + 1, 3, 3) the rotations since then.
    """

    number: Mapping[str, int]
    origin: Array
    centre: Array
    turn: Array
    _still: tuple[bool, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        still = (self.centre == self.origin).all(axis=1) & (self.turn == np.eye(3)).all(axis=(1, 2))
        object.__setattr__(self, "_still", tuple(still.tolist()))

    def point(self, body: str, at: Sequence[float] | Array) -> Array:
        """Return where the point of a body is that was ``at`` [m] as described."""
        k = self.number[body]
        return np.asarray(self.centre[k] + self.turn[k] @ (np.asarray(at) - self.origin[k]))

    def turned(self, body: str, what: Sequence[float] | Sequence[Sequence[float]] | Array) -> Array:
        """Return a vector (3,) or axes (3, 3) that turn with a body."""
        return np.asarray(self.turn[self.number[body]] @ np.asarray(what))

    def stays(self, body: str) -> bool:
        """Tell whether a body is exactly where it was described."""
        return self._still[self.number[body]]

    def moved_to(self, centre: Array, turn: Array) -> Pose:
        """Return the pose after displacements: the new centres, and the rotations that come on top of those before."""
        turns = np.array([orthonormal(more @ before) for more, before in zip(turn, self.turn, strict=True)])
        same = (turn == np.eye(3)).all(axis=(1, 2))
        turns[same] = self.turn[same]
        return Pose(self.number, self.origin, centre, turns)


def start(model: Mechanism) -> Pose:
    """Return the pose in which a model is described."""
    number = {name: k for k, name in enumerate(model.bodies)}
    number["ground"] = len(number)
    origin = np.array([*(body.position for body in model.bodies.values()), (0.0, 0.0, 0.0)])
    return Pose(number, origin, origin, np.tile(np.eye(3), (len(origin), 1, 1)))
