"""Maxwell elements: a spring in series with a damper along a line, and an optional static spring parallel to them.

The dynamic stiffness between its points is k0 + k1 c s / (k1 + c s): k0 at low and k0 + k1 at high frequencies, with
damping in between.

In the equations the element has a massless node between spring and damper, which slides along the line, and rows of
springs and damper.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from math import dist
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.elements import joint as _joint
from mbsvib.elements import spring
from mbsvib.elements.body import Body
from mbsvib.elements.connection import ENDS, Connection, PreloadForm, along, check_ends, line_between, line_force
from mbsvib.elements.deformations import Law, length
from mbsvib.elements.joint import Joint
from mbsvib.elements.part import Part, derived
from mbsvib.elements.pose import Pose
from mbsvib.elements.roles import batched, number, point
from mbsvib.elements.rows import ElementRows, columns
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.errors import ModelError

# Smaller changes of the length, relative to the length, are rounding errors.
ROUNDING = 1.6e-14


@dataclass(frozen=True, slots=True)
class Maxwell(Connection):
    """A spring (``stiffness`` k1 [N/m]) in series with a damper (``damping`` c [N s/m]), parallel to both a spring of
    ``static_stiffness`` k0, along the line from ``start`` on ``first`` to ``end`` on ``second`` [m, world axes].

    ``preload`` is the tension of the static spring in the reference pose [N]; the spring in series is relaxed there.
    The damper is at the end; its deformation is the coordinate ``"NAME.z"``. ``line`` is the line's unit vector.
    """

    law = Law(length, "static_stiffness", preload="preload", series=("stiffness", "damping"))

    roles = batched(
        **ENDS, stiffness=number("N/m", positive=True), damping=number("N s/m", positive=True),
        static_stiffness=number("N/m", signed=False), preload=number("N", signed=False),
        start=point("first", other="end"), end=point("second", other="start"),
    )  # fmt: skip

    start: Vector
    end: Vector
    stiffness: float
    damping: float
    static_stiffness: float = 0.0
    preload: float | None = None
    line: Vector = derived((0.0, 0.0, 1.0))

    @property
    def family(self) -> str:
        return "Maxwell element"

    @property
    def body_positions(self) -> Mapping[str, Vector]:
        return {self.node: self.end}

    @property
    def tension(self) -> float:
        """Tension in the reference pose [N]."""
        return self.preload or 0.0

    @property
    def rest_wrench(self) -> tuple[float, ...]:
        return line_force(self.tension, self.line)

    @property
    def at_rest(self) -> Connection | None:
        """Its static spring, None without one."""
        return spring.make(self.name, self.first, self.second, self.start, self.end, self.static_stiffness, 0.0,
                           self.preload) if self.static_stiffness else None  # fmt: skip

    def preload_form(self, size: float) -> PreloadForm | None:
        direction = line_force(1.0, self.line)
        return along(self, self.start, direction, self.static_stiffness, size, lambda tension: {"preload": tension})

    @property
    def node(self) -> str:
        """Name of the massless node between spring and damper."""
        return f"{self.name}.node"

    def replaced_places(self, fields: Mapping[str, Array]) -> dict[str, dict[str, Array]]:
        return {self.node: {"position": fields["end"]}} if "end" in fields else {}

    def row_values(self, fields: Mapping[str, Array], unit: Array) -> Mapping[str, Array]:
        count = len(next(iter(fields.values())))
        k, c, static = (np.broadcast_to(fields.get(field, getattr(self, field)), (count,))
                        for field in ("stiffness", "damping", "static_stiffness"))  # fmt: skip
        stiffness, damping = np.zeros((2, len(unit), count), np.result_type(k, c, static))
        damper = unit[:, 2] == 0.0
        stiffness[0], damping[damper] = k, c
        stiffness[1:][~damper[1:]] = static
        return {"stiffness": stiffness, "damping": damping}

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        # the damper deforms until the spring in series is relaxed; only the static spring changes its force
        there = super(Maxwell, self).in_pose(pose, relaxed)
        if isinstance(there, dict) and not relaxed and self.static_stiffness:
            length = dist(there["start"], there["end"])
            change = length - dist(self.start, self.end)
            if abs(change) > ROUNDING * length:
                there["preload"] = self.tension + self.static_stiffness * change
        return there


def make(
    name: str, first: str, second: str, start: Any, end: Any, stiffness: Any, damping: Any, static_stiffness: Any,
    preload: Any = None,
) -> Maxwell:  # fmt: skip
    """Check the values of a Maxwell element and build it."""
    who = f"maxwell '{name}'"
    check_ends(who, first, second)
    a, b, line, _ = line_between(who, start, end, "An element of no length has no line to act along.")
    expected = "a positive number [N/m]"
    k = check.number(stiffness, who, "stiffness", expected)
    if k <= 0.0:
        raise check.refuse(who, "stiffness", stiffness, expected,
                           "Without its spring the element does nothing; a damper alone is an add_spring with "
                           "damping only.")  # fmt: skip
    c = check.number(damping, who, "damping", "a number that is not negative [N s/m]")
    if c < 0.0:
        raise check.refuse(who, "damping", damping, "a number that is not negative [N s/m]")
    k0 = check.number(static_stiffness, who, "static_stiffness", "a finite number [N/m]")
    if preload is not None:
        preload = check.number(preload, who, "preload", "the tension of its static spring in the given pose [N]")
        if preload and not k0:
            raise ModelError(f"{who}: preload = {preload} needs a static_stiffness, as a damper has no force at rest; "
                             f"give one, or leave preload out.", element=who, field="preload")  # fmt: skip
    return Maxwell(name, first, second, a, b, k, c, k0, preload, line)


class Node(Body):
    """The massless node between a spring and a damper of an element."""

    __slots__ = ()
    symbol = ""


class NodeJoint(Joint):
    """The joint of a node, such as the one whose coordinate is the deformation of a Maxwell element's damper."""

    __slots__ = ()
    symbol = ""


def as_node_joint(joint: Joint) -> NodeJoint:
    """Return a joint as one that belongs to an element."""
    return NodeJoint(*(getattr(joint, item.name) for item in fields(joint)))


def nodes(part: Maxwell) -> ExpandedPart:
    """Return the massless body between spring and damper, and the joint in which it slides along the line."""
    joint = _joint.make(part.name, "prismatic", part.second, part.node, part.end, None, part.line, None, None, None)
    return ExpandedPart(bodies={part.node: Node(part.node, 0.0, (0.0,) * 6, part.end)},
                        joints={part.name: as_node_joint(joint)})


def rows(parts: Sequence[tuple[int, Maxwell]], number: Mapping[str, int]) -> ElementRows:
    """Return the rows of Maxwell elements.

    k1 acts between the first body and the node, c between the node and the second body, k0 between both bodies. The
    element's force is the sum of those of k1 and k0; the force of c is equal to that of k1.

    ``parts`` are the elements and their numbers among the model's connections. The direction ``unit`` of the damper's
    row is zero: it adds no force.
    """
    tuples = []
    for i, p in parts:
        first, second, node = number[p.first], number[p.second], number[p.node]
        line = (*p.start, *p.line)
        tuples.append((first, node, i, *line, p.stiffness, 0.0, 1.0))
        if p.damping:
            tuples.append((second, node, i, *line, 0.0, p.damping, 0.0))
        if p.static_stiffness:
            tuples.append((first, second, i, *line, p.static_stiffness, 0.0, 1.0))
    table = columns(tuples, 12)
    result = ElementRows.along_lines(table[:3], table[3:6], table[6:9], table[9], table[10])
    result.unit[:, 2] = table[11]
    return result
