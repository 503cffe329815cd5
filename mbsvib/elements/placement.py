"""Where bodies are in another pose, as parts ask for it when they say what they are there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arguments import Matrix3, Vector
    from mbsvib.common.arrays import Array, Index


class Placement(Protocol):
    """A pose of all bodies, against the one in which the mechanism is described."""

    @property
    def number(self) -> Mapping[str, int]:
        """The number of each body by name."""

    @property
    def turn(self) -> Array:
        """Rotations of the bodies, (bodies, 3, 3)."""

    def points(self, body: Index, at: Array) -> Array:
        """Return where points (n, 3) of bodies (n,) are that were ``at`` [m] as described."""

    def stays(self, body: str) -> bool:
        """Tell whether a body is exactly where it was described."""

    def centre_of(self, body: str) -> Vector:
        """Return where the centre of mass of a body is [m]."""

    def point(self, body: str, at: Sequence[float]) -> Vector:
        """Return where the point of a body is that was ``at`` [m] as described."""

    def direction(self, body: str, what: Sequence[float]) -> Vector:
        """Return a vector that turns with a body."""

    def axes(self, body: str, what: Matrix3) -> Matrix3:
        """Return axes (columns) that turn with a body."""

    def turned(self, body: str, what: Sequence[float] | Sequence[Sequence[float]] | Array) -> Array:
        """Return a vector (3,) or axes (3, 3), as an array, that turn with a body."""
