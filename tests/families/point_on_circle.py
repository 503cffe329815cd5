"""A point on a circle, a joint of curved geometry that mbsvib does not have: one call of two joints, and one row.

A body without mass turns about the axis of the circle in the first body; the point of the second body is a ball joint
on it. So each engine states it, in every pose.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.common import arguments as check

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.elements import Body

SECTION, WORD = "drives", "point_on_circle"


def add_point_on_circle(
    self, name: str, first: str | Body, second: str | Body, centre: ArrayLike, axis: ArrayLike, point: ArrayLike,
):  # fmt: skip
    """Hold a ``point`` of ``second`` on the circle through it about ``axis`` at ``centre`` in ``first`` [m].

    Its coordinates are those of ``NAME.turn``, ``NAME.turn.rz`` along the circle [rad], and of ``NAME.ball``.
    """
    who = f"point on circle '{name}'"
    holder, held = self._bodies_of(who, first=first, second=second)
    names = (f"{name}.ring", f"{name}.turn", f"{name}.ball")
    self._reserve(who, names)
    at, direction = check.vector(point, who, "point"), check.axis(axis, who, "axis")
    self.add_body(names[0], 0.0, (0.0, 0.0, 0.0), at)
    self.add_joint(names[1], "revolute", holder, names[0], check.vector(centre, who, "centre"), axis=direction)
    self.add_joint(names[2], "spherical", names[0], held, at)
    return names
