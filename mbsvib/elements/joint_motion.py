"""Joints in finite motion: the displacement that their coordinates make, and how far a cut joint is open.

Both are functions of components (see ``linalg.components``) in the world axes of the pose as described, which turn with
the first body. Rows of constraints are first derivatives of the openings, geometric stiffness follows from second ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg import components as c
from mbsvib.linalg.displacements import Displacement

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mbsvib.linalg.components import Component, Rotation, Triple

Directions = tuple[tuple[str, Any], ...]


@dataclass(frozen=True, slots=True)
class Columns:
    """The numbers of a joint, or of many joints of one kind, as components.

    ``free`` and ``locked`` are pairs of a direction's name and its six-vector; ``point`` on the second body and
    ``start`` on the first, the same but for rods [m]; ``successive``: two free rotations that follow each other.
    """

    free: Directions
    locked: Directions
    point: Triple
    start: Triple
    successive: bool = False

    @property
    def turns(self) -> list[Triple]:
        """Axes of the free rotations."""
        return [(six[3], six[4], six[5]) for name, six in self.free if name[0] == "r"]


@dataclass(frozen=True, slots=True)
class Motion:
    """The finite motion of a kind of joint.

    ``displacement`` of the second body by the coordinates q; ``openings``, one for each locked direction, are zero
    where the joint is assembled, and equal the relative displacement to first order.
    """

    displacement: Callable[[Sequence[Component], Columns], Displacement]
    openings: Callable[[Displacement, Columns], list[Component]]


def displaced(q: Sequence[Component], j: Columns) -> Displacement:
    """Translate by the sum of q times the free directions, and turn about the joint's point."""
    return Displacement(_turned(q, j), _translated(q, j), j.point)


def displaced_on_sphere(q: Sequence[Component], j: Columns) -> Displacement:
    """Move the end of a rod on its sphere, as far along an arc as its coordinates across the rod say."""
    across, rod = _translated(q, j), c.subtract(j.point, j.start)
    square = c.dot(across, across) / c.dot(rod, rod)
    half = c.sinc(0.25 * square)
    shift = c.subtract(c.scale(c.sinc(square), across), c.scale(0.5 * square * half * half, rod))
    return Displacement(_turned(q, j), shift, j.point)


def open_by(x: Displacement, j: Columns) -> list[Component]:
    """Return the gap along locked translations, and what the axes of free rotations have come apart.

    One free rotation: its axis is fixed in both bodies. Two successive ones: the angle of both axes is constant.
    Others: components of the antisymmetric part of the relative rotation, sin(a) n; of two that bisect the angle a of
    both bodies divided by cos(a / 2), by which its slope is one along the bisected axis at any angle.
    """
    gap, turns = x.moved(j.point), j.turns
    rotates = any(name[0] == "r" for name, _ in j.locked)
    tilt = c.cross(turns[0], x.vector(turns[0])) if rotates and len(turns) == 1 else None
    opened = []
    for name, six in j.locked:
        if name[0] != "r":
            opened.append(c.dot(six[:3], gap))
        elif j.successive:
            first, second = turns
            change = c.dot(first, second) - c.dot(first, x.vector(second))
            opened.append(change / c.dot(c.cross(first, second), six[3:]))
        elif tilt is not None:
            opened.append(c.dot(six[3:], tilt))
        else:
            opened.append(c.dot(six[3:], c.axial(x.rotation)) / (half_cosine(x.rotation) if turns else 1.0))
    return opened


def half_cosine(rotation: Rotation) -> Component:
    """Return the cosine of half the angle of a rotation."""
    return 0.5 * c.sqrt(1.0 + rotation[0][0] + rotation[1][1] + rotation[2][2])


def open_along_rod(x: Displacement, j: Columns) -> list[Component]:
    """Return (r . r - L^2) / 2 L of the line r between the ends of a rod of length L."""
    rod, described = c.subtract(x.point(j.point), j.start), c.subtract(j.point, j.start)
    square = c.dot(described, described)
    return [(0.5 * c.dot(rod, rod) - 0.5 * square) / c.sqrt(square)]


def open_off_thread(x: Displacement, j: Columns) -> list[Component]:
    """Return what a screw is open; along its axis, the pitch times the sine of the angle that its advance is ahead."""
    (axis,), (_, six) = j.turns, j.free[0]
    pitch, gap = c.dot(six[:3], axis), x.moved(j.point)
    across = normals(axis)[0]
    third = c.cross(axis, across)
    sine = 0.5 * (c.dot(third, x.vector(across)) - c.dot(across, x.vector(third)))
    cosine = 0.5 * (c.dot(across, x.vector(across)) + c.dot(third, x.vector(third)))
    angle = c.dot(axis, gap) / pitch
    ahead = pitch * (c.sin(angle) * cosine - c.cos(angle) * sine)
    return [ahead if name == "z" else value for (name, _), value in zip(j.locked, open_by(x, j), strict=True)]


def normals(axis: Triple) -> tuple[Triple, Triple]:
    """Return two unit vectors across a unit vector of numbers, which complete a right-handed frame with it last."""
    x, y, z = np.broadcast_arrays(*(np.real(a) for a in axis))
    smallest = np.argmin(np.abs((x, y, z)), axis=0)
    first = c.cross((1.0 * (smallest == 0), 1.0 * (smallest == 1), 1.0 * (smallest == 2)), axis)
    first = c.scale(1.0 / c.norm(first), first)
    return first, c.cross(axis, first)


def _translated(q: Sequence[Component], j: Columns) -> Triple:
    shift: Triple = (0.0, 0.0, 0.0)
    for value, (_, six) in zip(q, j.free, strict=True):
        shift = c.add(shift, c.scale(value, six[:3]))
    return shift


def _turned(q: Sequence[Component], j: Columns) -> Rotation:
    angles = [value for value, (name, _) in zip(q, j.free, strict=True) if name[0] == "r"]
    turns = j.turns
    if len(turns) == 1:
        return c.turn(turns[0], angles[0])
    if j.successive:
        return c.product(c.turn(turns[0], angles[0]), c.turn(turns[1], angles[1]))
    if not turns:
        return c.IDENTITY
    vector: Triple = (0.0, 0.0, 0.0)
    for axis, angle in zip(turns, angles, strict=True):
        vector = c.add(vector, c.scale(angle, axis))
    return c.exponential(vector)


STRAIGHT = Motion(displaced, open_by)
SCREW = Motion(displaced, open_off_thread)
ROD = Motion(displaced_on_sphere, open_along_rod)
