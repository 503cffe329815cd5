"""Rows that more than two bodies share: the mass of a beam element, the stiffness of a reduced model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Composed, Part


@dataclass(frozen=True, slots=True)
class Node:
    """A point of a body whose displacement composite rows see; ``rides`` tells whether the moving ground carries it
    (internal coordinates of a reduced model count from their own body, which it does not carry). ``against`` is the
    body it is measured from; ``point`` [m], world axes.
    """

    body: str
    point: tuple[float, float, float]
    rides: bool = True
    against: str = "ground"


@dataclass(frozen=True, slots=True)
class Piece:
    """Rows of one matrix (rows, 6 nodes) on the six displacements of its nodes, with a coefficient for each row: they
    belong to part ``owner``.
    """

    owner: str
    nodes: tuple[Node, ...]
    matrix: Array
    stiffness: Array | None = None
    damping: Array | None = None


@dataclass(frozen=True, slots=True)
class Pieces:
    """Rows of a model that more than two bodies share: ``mass``, W of M = W^T W, and ``elastic`` ones; ``nodes`` are
    the bodies whose mass these rows are.
    """

    mass: tuple[Piece, ...]
    elastic: tuple[Piece, ...]
    nodes: frozenset[str]
    owners: tuple[Composed, ...] = ()

    def said(self, parts: tuple[Part, ...]) -> tuple[Part, ...]:
        """Return parts as the user knows them: the owners in place of what they have become."""
        made = {name for owner in self.owners for name in owner.made}
        return (*[part for part in parts if part.name not in made], *self.owners)
