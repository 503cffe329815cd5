"""Springs along a line whose stiffness depends on frequency.

Beside the spring without relaxations there is, for each relaxation, a spring in series with a damper along the same
line, with a massless node between them that slides along it on one of the bodies, the ground if it is one: as in
Maxwell elements. The force is the sum of those of the springs. The factor at rest also scales the tension by a free
length.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from mbsvib.common.arguments import Vector
from mbsvib.elements import joint as _joint
from mbsvib.elements import spring
from mbsvib.elements.connection import line_between
from mbsvib.elements.deformations import Law, length
from mbsvib.elements.dynamic import Dynamic
from mbsvib.elements.maxwell import Node, as_node_joint
from mbsvib.elements.part import Part
from mbsvib.elements.pose import Pose
from mbsvib.elements.relaxing import RelaxingAxis, relaxing
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.elements.spring import Spring

GROUND = "ground"


@dataclass(frozen=True, slots=True)
class DynamicSpring(RelaxingAxis):
    """A spring-damper as ``Spring`` is one, whose stiffness ``dynamic`` lets depend on frequency."""

    law = Law(length, "rest_stiffness", "rest_damping", preload="preload", free="free_length",
              relaxations="relaxations")  # fmt: skip

    roles = Spring.roles
    made_at_rest = staticmethod(spring.make)

    start: Vector
    end: Vector
    stiffness: float
    dynamic: Dynamic
    damping: float = 0.0
    preload: float | None = None
    free_length: float | None = None

    @property
    def line(self) -> Vector:
        """Unit vector from start to end."""
        return line_between(self.name, self.start, self.end, "")[2]

    def replacement(self, *_: Any) -> ExpandedPart:
        # nodes are on the ground if it is an end
        bodies, joints, dampers = {}, {}, {}
        carriers: dict[str, Spring] = {}
        if self.at_rest is not None:
            carriers[f"{self.name}.rest"] = replace(self.at_rest, name=f"{self.name}.rest")
        (far, start), (base, end) = (self.first, self.start), (self.second, self.end)
        if self.first == GROUND:
            (far, start), (base, end) = (base, end), (far, start)
        for k, ((stiffness,), tau) in enumerate(self.relaxations, 1):
            if not stiffness:
                continue
            stem = f"{self.name}.{k}"
            node = f"{stem}.node"
            line = spring.make(f"{stem}.spring", far, node, start, end, stiffness, 0.0)
            bodies[node] = Node(node, 0.0, (0.0,) * 6, end)
            slides = _joint.make(stem, "prismatic", base, node, end, None, line.line, None, None, None)
            joints[stem] = as_node_joint(slides)
            carriers[line.name] = line
            dampers[f"{stem}.damper"] = replace(line, name=f"{stem}.damper", first=base, stiffness=0.0,
                                                damping=tau * stiffness)  # fmt: skip
        return ExpandedPart(bodies=bodies, joints=joints, springs=carriers | dampers, carriers=tuple(carriers))

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        if pose.is_unmoved(self.first) and pose.is_unmoved(self.second):
            return self
        if self.at_rest is None:
            return super(DynamicSpring, self).in_pose(pose, relaxed)
        there = self.at_rest.in_pose(pose, relaxed)
        assert isinstance(there, dict)
        return there | {"stiffness": self.stiffness, "damping": self.damping, "dynamic": self.dynamic}


def make(
    name: str, first: str, second: str, start: Any, end: Any, stiffness: Any = 0.0, damping: Any = 0.0,
    preload: Any = None, free_length: Any = None, dynamic: Any = None,
) -> Spring | DynamicSpring:  # fmt: skip
    """Check the values of a line spring, whose stiffness may depend on frequency, and build it."""
    plain = spring.make(name, first, second, start, end, stiffness, damping, preload, free_length)
    return plain if dynamic is None else relaxing(DynamicSpring, plain, dynamic, "N/m")
