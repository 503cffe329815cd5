"""Springs along a line whose stiffness depends on frequency.

Beside the spring without relaxations there is, for each relaxation, a spring in series with a damper along the same
line, with a massless node between them that slides along it on one of the bodies, the ground if it is one: as in
Maxwell elements. The force is the sum of those of the springs. The factor at rest also scales the tension by a free
length.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from mbsvib.common.arguments import Vector
from mbsvib.elements import joint as _joint
from mbsvib.elements import spring
from mbsvib.elements.connection import line_between
from mbsvib.elements.deformations import Law, length
from mbsvib.elements.dynamic import Dynamic
from mbsvib.elements.maxwell import Node, as_node_joint
from mbsvib.elements.part import Part
from mbsvib.elements.relaxing import RelaxingAxis, check_axis, factor_of
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.elements.spring import Spring

if TYPE_CHECKING:
    from mbsvib.elements.placement import Pose

GROUND = "ground"


@dataclass(frozen=True, slots=True)
class DynamicSpring(RelaxingAxis):
    """A spring-damper as ``Spring`` is one, whose stiffness ``dynamic`` lets depend on frequency."""

    law = Law(length, "rest_stiffness", "rest_damping", preload="preload", free="free_length",
              relaxations="relaxations")  # fmt: skip

    roles = Spring.roles

    start: Vector
    end: Vector
    stiffness: float
    dynamic: Dynamic
    damping: float = 0.0
    preload: float | None = None
    free_length: float | None = None

    @property
    def generated_names(self) -> tuple[str, ...]:
        made = expand(self)
        return (*made.bodies, *made.joints, *made.springs)

    @property
    def body_positions(self) -> Mapping[str, Vector]:
        return {name: node.position for name, node in expand(self).bodies.items()}

    @property
    def line(self) -> Vector:
        """Unit vector from start to end."""
        return line_between(self.name, self.start, self.end, "")[2]

    @property
    def at_rest(self) -> Spring | None:
        """The spring without relaxations; None where nothing is left."""
        if not (self.rest_stiffness or self.rest_damping or self.preload):
            return None
        return spring.make(self.name, self.first, self.second, self.start, self.end, self.rest_stiffness,
                           self.rest_damping, self.preload, self.free_length)  # fmt: skip

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
    if dynamic is None:
        return plain
    who = f"spring '{name}'"
    factor = factor_of(dynamic, who)
    check_axis(plain, factor, who, "N/m")
    result = DynamicSpring(name, first, second, plain.start, plain.end, plain.stiffness, factor, plain.damping,
                           plain.preload, plain.free_length)  # fmt: skip
    result.at_rest  # noqa: B018  a free length needs a stiffness at rest
    return result


def expand(part: DynamicSpring, *_: Any) -> ExpandedPart:
    """Return the nodes, their joints and the springs that replace it; nodes are on the ground if it is an end."""
    bodies, joints, dampers = {}, {}, {}
    carriers: dict[str, Spring] = {}
    if part.at_rest is not None:
        carriers[f"{part.name}.rest"] = replace(part.at_rest, name=f"{part.name}.rest")
    (far, start), (base, end) = (part.first, part.start), (part.second, part.end)
    if part.first == GROUND:
        (far, start), (base, end) = (base, end), (far, start)
    for k, ((stiffness,), tau) in enumerate(part.relaxations, 1):
        if not stiffness:
            continue
        stem = f"{part.name}.{k}"
        node = f"{stem}.node"
        line = spring.make(f"{stem}.spring", far, node, start, end, stiffness, 0.0)
        bodies[node] = Node(node, 0.0, (0.0,) * 6, end)
        joints[stem] = as_node_joint(_joint.make(stem, "prismatic", base, node, end, None, line.line, None, None, None))
        carriers[line.name] = line
        dampers[f"{stem}.damper"] = replace(line, name=f"{stem}.damper", first=base, stiffness=0.0,
                                            damping=tau * stiffness)  # fmt: skip
    return ExpandedPart(bodies=bodies, joints=joints, springs=carriers | dampers, carriers=tuple(carriers))
