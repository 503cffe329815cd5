"""Links that move as one: their mass, centre and inertia as one body."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.api.model import Model
    from mbsvib.common.arrays import Array
    from mbsvib.urdf.reading import Link


# Entries of symmetric tensors below this share of the largest one are rounding of rotated frames.
ROUNDING = 1e-15


@dataclass(slots=True, eq=False)
class Group:
    """Links that move as one: mass, first moment about the world's origin, and the axes of the first link."""

    name: str
    mass: float = 0.0
    first: Array = field(default_factory=lambda: np.zeros(3))
    links: list[tuple[Link, Array, Array]] = field(default_factory=list)
    axes: Array = field(default_factory=lambda: np.eye(3))

    def take(self, link: Link, origin: Array, axes: Array) -> None:
        """Add a link whose frame is at ``origin`` [m] with ``axes`` (columns), both in the world."""
        if not self.links:
            self.axes = axes
        self.links.append((link, origin + axes @ link.centre, axes @ link.inertia @ axes.T))
        self.mass += link.mass
        self.first += link.mass * self.links[-1][1]

    def add(self, model: Model) -> None:
        """Add the body that the links are together."""
        centre = self.first / self.mass if self.mass else self.links[0][1]
        tensor = np.zeros((3, 3))
        for link, at, inertia in self.links:
            arm = at - centre
            tensor += inertia + link.mass * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))
        tensor = self.axes.T @ tensor @ self.axes
        tensor = 0.5 * (tensor + tensor.T)
        tensor[np.abs(tensor) <= ROUNDING * np.abs(tensor).max()] = 0.0
        model.add_body(self.name, self.mass, tensor, centre, self.axes)
