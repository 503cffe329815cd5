"""Torsion springs whose stiffness depends on frequency: bushings of this kind with stiffness about one axis only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.elements import dynamic_bushing, torsion_spring
from mbsvib.elements.bushing import Bushing, matrix6
from mbsvib.elements.deformations import Law, swing, twist
from mbsvib.elements.dynamic import Dynamic
from mbsvib.elements.dynamic_bushing import DynamicBushing
from mbsvib.elements.part import Part
from mbsvib.elements.pose import Pose
from mbsvib.elements.relaxing import RelaxingAxis, relaxing
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.elements.torsion_spring import NOWHERE, TorsionSpring


@dataclass(frozen=True, slots=True)
class DynamicTorsionSpring(RelaxingAxis):
    """A torsion spring as ``TorsionSpring`` is one, whose stiffness ``dynamic`` lets depend on frequency."""

    law = Law(twist, "rest_stiffness", "rest_damping", preload="preload", wrench=True, rotations=slice(0, 1),
              across=swing, relaxations="relaxations")  # fmt: skip

    roles = TorsionSpring.roles
    made_at_rest = TorsionSpring

    axis: Vector
    stiffness: float
    dynamic: Dynamic
    damping: float = 0.0
    preload: float | None = None

    @property
    def as_bushing(self) -> DynamicBushing:
        """The bushing of the same name about the axis; it has no force, so that its point does not matter."""
        k, c, preload = ((*NOWHERE, 0.0, 0.0, value) for value in (self.stiffness, self.damping, self.preload or 0.0))
        return DynamicBushing(self.name, self.first, self.second, NOWHERE, k, self.dynamic, c,
                              check.frame_along(self.axis), None if self.preload is None else preload)  # fmt: skip

    def replaced_coefficients(self, fields: Mapping[str, Array]) -> dict[str, dict[str, Array]]:
        own = super(DynamicTorsionSpring, self).replaced_coefficients(fields)
        return {name: {field: np.concatenate((np.zeros((5, len(value))), value[None]))
                       for field, value in values.items()} for name, values in own.items()}  # fmt: skip

    def replacement(self, *_: Any) -> ExpandedPart:
        return self.as_bushing.replacement()

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        # relaxations are relaxed there, and act in the directions in which a damper about the axis does
        if pose.is_unmoved(self.first) and pose.is_unmoved(self.second):
            return self
        there = TorsionSpring(self.name, self.first, self.second, self.axis, self.rest_stiffness, self.stiffness,
                              self.preload).in_pose(pose, relaxed)  # fmt: skip
        if isinstance(there, dict):
            return there | {"stiffness": self.stiffness, "damping": self.damping, "dynamic": self.dynamic}
        assert isinstance(there, Bushing)
        acting = matrix6(there.damping)
        stiffness = matrix6(there.stiffness) + (1.0 - self.dynamic.static) * acting
        return dynamic_bushing.make(self.name, self.first, self.second, NOWHERE, stiffness,
                                    self.damping / self.stiffness * acting, there.orientation, there.preload,
                                    self.dynamic, acting)  # fmt: skip


def make(
    name: str, first: str, second: str, axis: Any, stiffness: Any = 0.0, damping: Any = 0.0, preload: Any = None,
    dynamic: Any = None,
) -> TorsionSpring | DynamicTorsionSpring:  # fmt: skip
    """Check the values of a torsion spring, whose stiffness may depend on frequency, and build it."""
    plain = torsion_spring.make(name, first, second, axis, stiffness, damping, preload)
    return plain if dynamic is None else relaxing(DynamicTorsionSpring, plain, dynamic, "N m/rad")
