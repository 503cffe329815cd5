"""Nodes and directions of universal files: a node for each body and each point at which something acts or is measured.

A port along or about an axis of the world has direction ±1 ... ±6 at the node of its body and point. One in another
direction has a node of its own, whose displacement coordinate system has its x axis along it, and direction ±1 or ±4.
What is no motion or force of one body (relative to another body, forces in joints, strains) has a node of its own
without a position, and direction 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.common.expected import kind_of
from mbsvib.elements.ports import BaseMotion, Input, Output
from mbsvib.measurement.points import GROUND, UNIT, Point, body_positions

if TYPE_CHECKING:
    from collections.abc import Hashable

    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Part



@dataclass(frozen=True, slots=True, eq=False)
class PlacedNode:
    """A node of the geometry: ``body``, ``position`` [m], and the ``axes`` (3, 3) of its displacements as columns where
    they are not those of the world.
    """

    number: int
    body: str
    position: tuple[float, float, float]
    axes: Array | None = None


@dataclass(frozen=True, slots=True)
class Geometry:
    """All nodes with a position, and the points of inputs and outputs in their order."""

    nodes: tuple[PlacedNode, ...]
    inputs: tuple[Point, ...]
    outputs: tuple[Point, ...]


@dataclass(slots=True)
class _Numbering:
    """Numbers of nodes by what they stand for."""

    positions: dict[str, tuple[float, float, float]]
    numbers: dict[Hashable, int] = field(default_factory=dict)
    nodes: list[PlacedNode] = field(default_factory=list)

    def number(self, key: Hashable) -> int:
        return self.numbers.setdefault(key, len(self.numbers) + 1)

    def node_number(self, body: str, position: tuple[float, float, float], axes: Array | None = None) -> int:
        key = (body, position, None if axes is None else tuple(axes[:, 0].tolist()))
        is_new = key not in self.numbers
        number = self.number(key)
        if is_new:
            self.nodes.append(PlacedNode(number, body, position, axes))
        return number

    def point(self, port: Part) -> Point:
        """Return node and direction of a port."""
        body = GROUND if isinstance(port, BaseMotion) else port.body if isinstance(port, (Input, Output)) else ""
        position = port.position if isinstance(port, (Input, Output, BaseMotion)) else None
        position = self.positions.get(body) if position is None else position
        relative = port.relative_to if isinstance(port, (Input, Output)) else GROUND
        wrench = np.array(getattr(port, "wrench", ()), dtype=float)
        if not body or position is None or relative != GROUND or wrench.shape != (6,):
            return Point(self.number(_scalar_key(port)), 0)
        first_entry = 3 if wrench[3:].any() else 0
        along = wrench[first_entry : first_entry + 3]
        if wrench[3 - first_entry : 6 - first_entry].any() or abs(np.linalg.norm(along) - 1.0) > UNIT:
            return Point(self.number(_scalar_key(port)), 0)
        sign = 1 if along[np.flatnonzero(along)[0]] > 0.0 else -1
        if np.count_nonzero(along) == 1:
            return Point(self.node_number(body, position), sign * (first_entry + int(np.flatnonzero(along)[0]) + 1))
        z_along = np.array(check.frame_along(tuple((sign * along).tolist())))
        axes = np.column_stack((sign * along, z_along[:, 0], z_along[:, 1]))
        return Point(self.node_number(body, position, axes), sign * (first_entry + 1))


def _scalar_key(port: Part) -> Hashable:
    """Input and output between the same two bodies, at the same point in the same direction, are a driving point."""
    if isinstance(port, (Input, Output)):
        return ("between", port.body, port.relative_to, port.position, port.wrench)
    return (type(port).__name__, port.name)


def geometry_of(linear: Any) -> Geometry:
    """Return nodes and directions of a system.

    Nodes of the bodies come first, in the order of ``system.bodies``, then those of the ports. A closed loop has the
    geometry of its plant. Equations from a file or from matrices have none: each port gets a node of its own.
    """
    system = linear.plant.system if kind_of(linear) == "closed loop" else linear
    parts = system.provenance.parts if isinstance(system, System) else ()
    ports = system.provenance.ports if isinstance(system, System) else ()
    positions = body_positions(parts)
    numbering = _Numbering(positions)
    for body in getattr(system, "bodies", ()):
        if body in positions:
            numbering.node_number(body, positions[body])
    entries = {port.name: port for port in ports if isinstance(port, (Input, BaseMotion))}
    exits = {port.name: port for port in ports if not isinstance(port, (Input, BaseMotion))}
    if not (entries.keys() >= set(linear.inputs) and exits.keys() >= set(linear.outputs)):
        count = len(numbering.numbers)
        return Geometry(tuple(numbering.nodes), tuple(Point(count + 1 + k, 0) for k in range(len(linear.inputs))),
                        tuple(Point(count + len(linear.inputs) + 1 + k, 0) for k in range(len(linear.outputs))))
    inputs, outputs = (tuple([numbering.point(known[name]) for name in names])
                       for known, names in ((entries, linear.inputs), (exits, linear.outputs)))  # fmt: skip
    return Geometry(tuple(numbering.nodes), inputs, outputs)
