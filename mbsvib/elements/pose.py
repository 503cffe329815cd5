"""The interface of a pose by which parts are moved there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arguments import Matrix3, Vector
    from mbsvib.common.arrays import Array, Index


class Pose(Protocol):
    """A pose of all bodies, relative to the reference pose, in which the mechanism is described."""

    @property
    def number(self) -> Mapping[str, int]:
        """The number of each body by name."""

    @property
    def origin(self) -> Array:
        """Centres of mass in the reference pose [m], (bodies, 3)."""

    @property
    def centre(self) -> Array:
        """Centres of mass in this pose [m], (bodies, 3)."""

    @property
    def rotations(self) -> Array:
        """Rotations of the bodies from the reference pose, (bodies, 3, 3)."""

    def points(self, body: Index, at: Array) -> Array:
        """Return points (n, 3) of bodies (n,) that are ``at`` [m] in the reference pose."""

    def is_unmoved(self, body: str) -> bool:
        """Return whether a body is exactly in its reference pose."""

    def centre_of(self, body: str) -> Vector:
        """Return the centre of mass of a body [m]."""

    def point(self, body: str, at: Sequence[float]) -> Vector:
        """Return the point of a body that is ``at`` [m] in the reference pose."""

    def rotated_vector(self, body: str, vector: Sequence[float]) -> Vector:
        """Return a vector that is fixed in a body."""

    def rotated_axes(self, body: str, axes: Matrix3) -> Matrix3:
        """Return axes (columns) that are fixed in a body."""

    def rotated(self, body: str, vectors: Sequence[float] | Sequence[Sequence[float]] | Array) -> Array:
        """Return a vector (3,) or axes (3, 3) that are fixed in a body, as an array."""
