"""Rows that more than two bodies share: the mass of a beam element, the stiffness of a reduced model."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.elements.body import Body
    from mbsvib.elements.connection import Connection
    from mbsvib.elements.joint import Joint
    from mbsvib.elements.part import Part
    from mbsvib.elements.ports import Output


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
class PlainParts:
    """What a part becomes when equations are made: bodies, joints, springs and outputs by name, and shared rows."""

    bodies: Mapping[str, Body] = field(default_factory=dict)
    joints: Mapping[str, Joint] = field(default_factory=dict)
    springs: Mapping[str, Connection] = field(default_factory=dict)
    outputs: Mapping[str, Output] = field(default_factory=dict)
    mass: tuple[Piece, ...] = ()
    elastic: tuple[Piece, ...] = ()


@dataclass(frozen=True, slots=True)
class Pieces:
    """Rows of a model that more than two bodies share: ``mass``, W of M = W^T W, and ``elastic`` ones; ``nodes`` are
    the bodies whose mass these rows are. ``owners`` are the parts that have become others, ``made`` the names of these,
    ``order`` the names of all parts that the user gave.
    """

    mass: tuple[Piece, ...]
    elastic: tuple[Piece, ...]
    nodes: frozenset[str]
    owners: tuple[Part, ...] = ()
    made: frozenset[str] = frozenset()
    order: tuple[str, ...] = ()

    def declared(self, parts: tuple[Part, ...]) -> tuple[Part, ...]:
        """Return parts as the user knows them, the owners in place of what they have become, in the ``order``."""
        known = {part.name: part for part in parts if part.name not in self.made}
        known |= {part.name: part for part in self.owners}
        return tuple([known[name] for name in self.order if name in known])
