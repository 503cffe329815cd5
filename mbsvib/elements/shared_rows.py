"""Rows that more than two bodies share: the mass of a beam element, the stiffness of a reduced model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mbsvib.common.arrays import Array
from mbsvib.elements.body import Body
from mbsvib.elements.connection import Connection
from mbsvib.elements.joint import Joint
from mbsvib.elements.part import Part
from mbsvib.elements.ports import Output, Signal


@dataclass(frozen=True, slots=True)
class Node:
    """A ``point`` [m, world axes] of a body, whose displacement relative to another body enters shared rows.

    ``moves_with_ground`` is False for internal coordinates of a reduced model, which base motion does not change.
    ``owner`` is the part whose points vary by themselves in variants, so that no other part shares the node.
    """

    body: str
    point: tuple[float, float, float]
    moves_with_ground: bool = True
    relative_to: str = "ground"
    owner: str = ""


@dataclass(frozen=True, slots=True)
class SharedRows:
    """Rows of part ``owner``: a ``matrix`` (rows, 6 nodes) on the six displacements of each node.

    Elastic and damping rows have a coefficient for each row, gyroscopic ones an antisymmetric matrix (rows, rows).
    """

    owner: str
    nodes: tuple[Node, ...]
    matrix: Array
    stiffness: Array | None = None
    damping: Array | None = None
    gyroscopic: Array | None = None


@dataclass(frozen=True, slots=True)
class ExpandedPart:
    """The bodies, joints, springs, inputs and outputs by name, and the shared rows, that replace a part.

    ``carriers`` are the springs whose forces add up to that of the part, where these have other names.
    """

    bodies: Mapping[str, Body] = field(default_factory=dict)
    joints: Mapping[str, Joint] = field(default_factory=dict)
    springs: Mapping[str, Connection] = field(default_factory=dict)
    outputs: Mapping[str, Output] = field(default_factory=dict)
    inputs: Mapping[str, Signal] = field(default_factory=dict)
    mass: tuple[SharedRows, ...] = ()
    elastic: tuple[SharedRows, ...] = ()
    carriers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Expansion:
    """Shared rows of an expanded model, and the parts before the expansion.

    ``mass`` rows are W of M = W^T W, and ``nodes`` the bodies with this mass. ``owners`` are the parts that are
    replaced, ``generated_names`` the names of their replacements, ``order`` the names of all parts of the user,
    ``carriers`` the springs whose forces add up to that of an owner.
    """

    mass: tuple[SharedRows, ...]
    elastic: tuple[SharedRows, ...]
    nodes: frozenset[str]
    owners: tuple[Part, ...] = ()
    generated_names: frozenset[str] = frozenset()
    order: tuple[str, ...] = ()
    gyroscopic: tuple[SharedRows, ...] = ()
    carriers: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def declared(self, parts: tuple[Part, ...]) -> tuple[Part, ...]:
        """Return the parts of the user in their ``order``, with the owners in place of generated parts."""
        known = {part.name: part for part in parts if part.name not in self.generated_names}
        known |= {part.name: part for part in self.owners}
        return tuple([known[name] for name in self.order if name in known])


def carriers(expansion: Expansion | None, element: str) -> tuple[str, ...]:
    """Return the connections whose forces add up to that of an element: it, or those that stand for it."""
    return (element,) if expansion is None else expansion.carriers.get(element, (element,))
