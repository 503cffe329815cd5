"""Line springs: a spring-damper along the line between two points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import dist
from typing import Any

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.fast_init import fast_init
from mbsvib.elements.connection import ENDS, LINE, Connection, PreloadForm, along, check_ends, line_between, line_force
from mbsvib.elements.deformations import Law, length
from mbsvib.elements.part import Part, derived
from mbsvib.elements.pose import Pose
from mbsvib.elements.roles import batched, number
from mbsvib.elements.rows import ElementRows, columns
from mbsvib.errors import ModelError

# Forces below this fraction of stiffness times length are rounding errors of the length.
ROUNDING = 1e-15


@fast_init
@dataclass(frozen=True, slots=True)
class Spring(Connection):
    """A spring-damper along the line from ``start`` on ``first`` to ``end`` on ``second`` [m, world axes].

    ``stiffness`` [N/m] and ``damping`` [N s/m] act on the change of its length. Unit vector ``line``, ``length`` [m]
    and ``tension`` [N] are those in the reference pose. The tension is the ``preload`` [N], or stiffness (length -
    free_length) if ``free_length`` [m] is given.
    """

    law = Law(length, "stiffness", "damping", preload="preload", free="free_length")

    roles = batched(**ENDS, stiffness=number("N/m"), damping=number("N s/m"), **LINE, preload=number("N"),
                   free_length=number("m", positive=True))  # fmt: skip

    start: Vector
    end: Vector
    stiffness: float = 0.0
    damping: float = 0.0
    preload: float | None = None
    free_length: float | None = None
    line: Vector = derived((0.0, 0.0, 1.0))
    length: float = derived(1.0)
    tension: float = derived(0.0)

    @property
    def loaded(self) -> bool:
        return self.tension != 0.0

    @property
    def rest_wrench(self) -> tuple[float, ...]:
        return line_force(self.tension, self.line)

    def preload_form(self, size: float) -> PreloadForm | None:
        free: dict[str, Any] = {"free_length": None}
        direction = line_force(1.0, self.line)
        return along(self, self.start, direction, self.stiffness, size, lambda tension: free | {"preload": tension})

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        there = super(Spring, self).in_pose(pose, relaxed)
        if isinstance(there, Part):
            return there
        if relaxed:
            if self.free_length is not None:
                there["preload"] = self.tension
                del there["free_length"]
        elif self.free_length is None:
            tension = self.tension + self.stiffness * (dist(there["start"], there["end"]) - self.length)
            if abs(tension) < ROUNDING * abs(self.stiffness) * self.length:
                tension = 0.0
            if tension or self.preload is not None:
                there["preload"] = tension
        return there


def make(
    name: str, first: str, second: str, start: Any, end: Any, stiffness: Any, damping: Any, preload: Any = None,
    free_length: Any = None,
) -> Spring:  # fmt: skip
    """Check the values of a line spring and build it."""
    who = f"spring '{name}'"
    check_ends(who, first, second)
    a, b, line, length = line_between(who, start, end, "A spring of no length has no line to act along: use a bushing.")
    k = check.number(stiffness, who, "stiffness", "a finite number [N/m]")
    c = check.number(damping, who, "damping", "a finite number [N s/m]")
    tension = 0.0
    if preload is not None:
        preload = tension = check.number(preload, who, "preload", "the tension in the given pose [N]")
    if free_length is not None:
        free_length = check.number(free_length, who, "free_length", "the length without load [m]")
        if preload is not None:
            raise ModelError(f"{who}: both preload and free_length are given; give one of them.",
                             element=who, field="free_length")  # fmt: skip
        if free_length < 0.0:
            raise check.refuse(who, "free_length", free_length, "a length that is not negative [m]")
        if k == 0.0:
            raise ModelError(f"{who}: free_length = {free_length} needs a stiffness; give one, or give the tension as "
                             f"preload.", element=who, field="free_length")  # fmt: skip
        tension = k * (length - free_length)
    if k == 0.0 and c == 0.0 and not tension:
        raise ModelError(f"{who}: neither stiffness nor damping is given; give one, or leave the spring out.",
                         element=who, field="stiffness")  # fmt: skip
    return Spring(name, first, second, a, b, k, c, preload, free_length, line, length, tension)


def rows(parts: Sequence[tuple[int, Spring]], number: Mapping[str, int]) -> ElementRows:
    """Return the rows of line springs, the changes of their lengths.

    ``parts`` are the springs and their numbers among the model's connections.
    """
    table = columns([(number[s.first], number[s.second], i, *s.start, *s.line, s.stiffness, s.damping)
                     for i, s in parts], 11)  # fmt: skip
    return ElementRows.along_lines(table[:3], table[3:6], table[6:9], table[9], table[10])
