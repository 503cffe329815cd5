"""Copies of parts: under other names, in another place, and mirrored.

A copy is reflected first, x -> F x, in a plane through the origin of its own axes, F = diag with one entry -1, then
turned by R and shifted by p. Points go to p + R F x. Forces, displacements and lines are polar vectors, R F v. Moments,
rotations and spins are axial vectors, det(F) R F w. Axes of parts stay right-handed: one of the three columns, which
the part chooses, is reversed, so that Q -> R F Q diag(s) with s = -1 for this column and 1 for the others. Components
in these axes are those of the original times s, of axial vectors times -s.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arguments import DIRECTIONS, UNIT6, Matrix3, Vector
from mbsvib.common.arrays import Array

GROUND = "ground"


@dataclass(frozen=True, slots=True)
class Placement:
    """Where and under which names the ``parts`` of a model are copied.

    ``turn`` is R F, ``mirrored`` whether F reflects, ``offset`` p [m]; ``ground`` is the body that takes the place of
    the ground. ``parts`` are the joints, connections and bodies of the original by name, and beams by the names of
    their elements.
    """

    prefix: str
    offset: Vector
    turn: Array
    mirrored: bool
    ground: str
    parts: Mapping[str, Any]

    @property
    def turns(self) -> bool:
        """Whether directions change."""
        return not np.array_equal(self.turn, np.eye(3))

    def name(self, name: str) -> str:
        """Return the name of a copy."""
        return f"{self.prefix}.{name}"

    def body(self, name: Any) -> Any:
        """Return the name of the body in place of one of the original; None for none."""
        return None if name is None else self.ground if name == GROUND else self.name(name)

    def point(self, point: Any) -> Any:
        """Return a point [m] of the copy, or None for none."""
        return None if point is None else _tuple(np.array(self.vector(point)) + self.offset)

    def vector(self, vector: Sequence[float]) -> Vector:
        """Return a polar vector, such as a force or a line."""
        return _tuple(self.turn @ np.array(vector))

    def axial(self, vector: Sequence[float]) -> Vector:
        """Return an axial vector, such as a moment or a spin."""
        return _tuple((-1.0 if self.mirrored else 1.0) * (self.turn @ np.array(vector)))

    def six(self, six: Sequence[float]) -> tuple[float, ...]:
        """Return a wrench or twist (6,), world axes: a polar and an axial vector."""
        return (*self.vector(six[:3]), *self.axial(six[3:]))

    def axes(self, axes: Matrix3, reverse: int = 2) -> Matrix3:
        """Return axes (columns) of the copy; of a mirrored one the column ``reverse`` changes its sign."""
        if not self.turns:
            return axes
        x, y, z = (self.turn @ np.array(axes) * self.signs(reverse)[:3]).tolist()
        return (tuple(x), tuple(y), tuple(z))

    def inertia(self, inertia: Sequence[float]) -> tuple[float, ...]:
        """Return the entries (xx, yy, zz, xy, xz, yz) of a tensor in axes of the copy, whose third one is reversed."""
        xx, yy, zz, xy, xz, yz = inertia
        sign = -1.0 if self.mirrored else 1.0
        return (xx, yy, zz, xy, sign * xz, sign * yz)

    def signs(self, reverse: int = 2) -> Array:
        """Return by which signs components x y z rx ry rz in axes of the copy differ from those of the original."""
        if not self.mirrored:
            return np.ones(6)
        signs = np.ones(3)
        signs[reverse] = -1.0
        return np.concatenate((signs, -signs))

    def local(self, six: Sequence[float], reverse: int = 2) -> tuple[float, ...]:
        """Return components (6,) in axes of the copy."""
        return tuple((self.signs(reverse) * np.array(six)).tolist())

    def matrix(self, values: Any, reverse: int = 2) -> Any:
        """Return six values or a 6x6 matrix on x y z rx ry rz in axes of the copy."""
        if not self.mirrored or not isinstance(values[0], tuple):
            return values
        signs = self.signs(reverse)
        return tuple([tuple(row) for row in (signs[:, None] * np.array(values) * signs).tolist()])


def direction(word: str | tuple[float, ...], six: tuple[float, ...]) -> str | tuple[float, ...]:
    """Return a direction (6,) by its ``word``, if it is the same."""
    return word if isinstance(word, str) and six == UNIT6[DIRECTIONS.index(word)] else six


def _tuple(array: Array) -> Vector:
    x, y, z = (array + 0.0).tolist()
    return (x, y, z)
