"""What the search for equilibrium found: the model there, and how it got there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equilibrium.rotations import logarithm
from mbsvib.errors import counted

if TYPE_CHECKING:
    from mbsvib.equilibrium.pose import Pose
    from mbsvib.kinematics import Array
    from mbsvib.model import Model


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """A model in equilibrium and how it was found.

    ``residuals`` are the shares of the forces that were left over before and after each step under the whole load,
    ``iterations`` counts all steps, ``load_steps`` are the shares of the load on the way. ``displacements`` tells how
    far each body moved: translation of its centre of mass [m] and rotation vector [rad], world axes.
    """

    model: Model
    iterations: int
    residuals: tuple[float, ...]
    load_steps: tuple[float, ...]
    displacements: dict[str, Array]

    def __str__(self) -> str:
        steps = f" in {counted(len(self.load_steps) - 1, 'load step')}" if len(self.load_steps) > 1 else ""
        lines = [
            f"equilibrium of '{self.model.name}' after {counted(self.iterations, 'step')}{steps}; forces left over: "
            f"{self.residuals[-1]:.1e}",
            "  residuals: " + ", ".join(f"{value:.1e}" for value in self.residuals),
        ]
        width = max(map(len, self.displacements), default=0)
        for name, six in self.displacements.items():
            went, turned = np.linalg.norm(six[:3]), np.linalg.norm(six[3:])
            lines.append(f"  {name:<{width}}  {went:.6g} m  {turned:.6g} rad")
        return "\n".join(lines)


def displacements(pose: Pose) -> dict[str, Array]:
    """Return how far each body is from where it was described."""
    result = {}
    for name, k in pose.number.items():
        if name != "ground":
            result[name] = np.concatenate((pose.centre[k] - pose.origin[k], logarithm(pose.turn[k])))
    return result
