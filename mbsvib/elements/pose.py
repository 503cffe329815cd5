"""Poses: positions of the bodies of a model and their rotations from the reference pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.common.arrays import Array, Index
from mbsvib.linalg.rotations import orthonormal

IDENTITY = np.eye(3)


@dataclass(frozen=True)
class Pose:
    """A pose of all bodies, ground last.

    ``number`` of each body by name; ``origin`` (bodies + 1, 3) are the centres of mass in the reference pose,
    ``centre`` (..., bodies + 1, 3) in this pose [m], ``rotations`` (..., bodies + 1, 3, 3) the rotations between them.
    Leading axes are those of many poses at once.
    """

    number: Mapping[str, int]
    origin: Array
    centre: Array
    rotations: Array

    @cached_property
    def _still(self) -> tuple[bool, ...]:
        unmoved = (self.centre == self.origin).all(axis=1) & (self.rotations == IDENTITY).all(axis=(1, 2))
        return tuple(unmoved.tolist())

    @cached_property
    def change(self) -> tuple[Array, Array]:
        """Translations of centres (bodies + 1, 3), and rotations less the identity (bodies + 1, 3, 3)."""
        return self.centre - self.origin, self.rotations - IDENTITY

    @property
    def as_described(self) -> bool:
        """Whether this is the reference pose."""
        return self.centre is self.origin

    def points(self, body: Index, at: Array) -> Array:
        """Return points (..., n, 3) of bodies (n,) that are ``at`` [m] in the reference pose; exact if none has moved.
        """
        shift, change = self.change
        arm = at - self.origin.take(body, axis=-2)
        return np.asarray(at + (shift.take(body, axis=-2) + (change.take(body, axis=-3) @ arm[..., None])[..., 0]))

    def vectors(self, body: Index, vectors: Array) -> Array:
        """Return vectors (..., n, 3) that turn with bodies (n,)."""
        return np.asarray((self.rotations.take(body, axis=-3) @ vectors[..., None])[..., 0])

    def point(self, body: str, at: Sequence[float]) -> Vector:
        """Return the point of a body that is ``at`` [m] in the reference pose."""
        origin, centre = self._numbers[0][self.number[body]]
        x, y, z = self.rotated_vector(body, (at[0] - origin[0], at[1] - origin[1], at[2] - origin[2]))
        return x + centre[0], y + centre[1], z + centre[2]

    def rotated_vector(self, body: str, vector: Sequence[float]) -> Vector:
        """Return a vector that turns with a body."""
        (x, y, z), ((a, b, c), (d, e, f), (g, h, i)) = vector, self._numbers[1][self.number[body]]
        return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z

    def rotated_axes(self, body: str, axes: Matrix3) -> Matrix3:
        """Return axes (columns) that turn with a body."""
        (r, s, t), ((a, b, c), (d, e, f), (g, h, i)) = axes, self._numbers[1][self.number[body]]
        (x, y, z), (u, v, w), (k, m, n) = r, s, t
        return ((a * x + b * u + c * k, a * y + b * v + c * m, a * z + b * w + c * n),
                (d * x + e * u + f * k, d * y + e * v + f * m, d * z + e * w + f * n),
                (g * x + h * u + i * k, g * y + h * v + i * m, g * z + h * w + i * n))  # fmt: skip

    @cached_property
    def _numbers(self) -> tuple[Any, Any]:
        """Origin and centre, and rotation of each body as lists, which is faster for single points."""
        return np.stack((self.origin, self.centre), axis=1).tolist(), self.rotations.tolist()

    def rotated(self, body: str, vectors: Sequence[float] | Sequence[Sequence[float]] | Array) -> Array:
        """Return a vector (3,) or axes (3, 3), as an array, that turn with a body."""
        return np.asarray(self.rotations[self.number[body]] @ np.asarray(vectors))

    def centre_of(self, body: str) -> Vector:
        """Return where the centre of mass of a body is [m]."""
        x, y, z = self.centre[self.number[body]].tolist()
        return x, y, z

    def is_unmoved(self, body: str) -> bool:
        """Tell whether a body is exactly in its reference pose."""
        return self._still[self.number[body]]

    def moved_by(self, motion: Array) -> Pose:
        """Return the pose after motions [R - 1, u] (..., bodies + 1, 3, 4): rotations R, translations u of centres."""
        turned = motion[..., :3] if self.as_described else motion[..., :3] @ self.rotations
        return Pose(self.number, self.origin, self.centre + motion[..., 3], orthonormal(self.rotations + turned))

    def __getitem__(self, which: Any) -> Pose:
        """Return some of many poses, or one of them."""
        return Pose(self.number, self.origin, self.centre[which], self.rotations[which])
