"""The structure in universal files: a node for each body and each point at which something acts or is measured.

A port along or about an axis of the world has direction ±1 ... ±6 at the node of its body and point. One in another
direction has a node of its own, whose displacement coordinate system has its x axis along it, and direction ±1 or ±4.
What is no motion or force of one body (relative to another body, forces in joints, strains) has a node of its own
without a position, and direction 0.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.common.expected import kind_of
from mbsvib.elements.part import Part
from mbsvib.elements.ports import BaseMotion, Input, Output
from mbsvib.measurement.data import MeasuredMode
from mbsvib.measurement.points import GROUND, UNIT, Node, Point, body_positions, matrix3

Ends = tuple[tuple[Node, ...], tuple[Point, ...], tuple[Point, ...]]


@dataclass(slots=True)
class _Numbering:
    """Numbers of nodes by what they stand for."""

    positions: dict[str, Vector]
    numbers: dict[Hashable, int] = field(default_factory=dict)
    nodes: list[Node] = field(default_factory=list)

    def number(self, key: Hashable) -> int:
        return self.numbers.setdefault(key, len(self.numbers) + 1)

    def node_number(self, body: str, position: Vector, axes: Array | None = None) -> int:
        key = (body, position, None if axes is None else tuple(axes[:, 0].tolist()))
        is_new = key not in self.numbers
        number = self.number(key)
        if is_new:
            self.nodes.append(Node(number, body, position, None if axes is None else matrix3(axes)))
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


def geometry_of(linear: Any) -> Ends:
    """Return the nodes of a system that have a position, those of bodies first, and the points of its ports.

    A closed loop has the geometry of its plant. Equations from files have none: each port gets a node of its own.
    """
    system = linear.plant.system if kind_of(linear) == "closed loop" else linear
    parts, ports = (system.provenance.parts, system.provenance.ports) if isinstance(system, System) else ((), ())
    positions = body_positions(parts)
    numbering = _Numbering(positions)
    for body in getattr(system, "bodies", ()):
        if body in positions:
            numbering.node_number(body, positions[body])
    entries = {port.name: port for port in ports if isinstance(port, (Input, BaseMotion))}
    exits = {port.name: port for port in ports if not isinstance(port, (Input, BaseMotion))}
    if entries.keys() >= set(linear.inputs) and exits.keys() >= set(linear.outputs):
        inputs, outputs = (tuple([numbering.point(known[name]) for name in names])
                           for known, names in ((entries, linear.inputs), (exits, linear.outputs)))  # fmt: skip
    else:
        inputs, outputs = (tuple([Point(numbering.number((kind, name)), 0) for name in names])
                           for kind, names in (("input", linear.inputs), ("output", linear.outputs)))  # fmt: skip
    return tuple(numbering.nodes), inputs, outputs


def by_body(nodes: Sequence[Node]) -> dict[str, list[Node]]:
    """Return the nodes of each body, of which the first is its centre of mass."""
    groups: dict[str, list[Node]] = {}
    for node in nodes:
        groups.setdefault(node.name, []).append(node)
    return groups


def lines_of(nodes: Sequence[Node]) -> tuple[tuple[int, int], ...]:
    """Return lines from the centre of mass of each body to its other nodes, as pairs of numbers."""
    return tuple((group[0].number, node.number) for group in by_body(nodes).values() for node in group[1:]
                 if node.position != group[0].position)  # fmt: skip


def modes_of(system: System, nodes: Sequence[Node]) -> tuple[MeasuredMode, ...]:
    """Return the modes of a system at each node of a body, u + theta x r and theta."""
    modes, centres = system.modes(), {name: group[0].position for name, group in by_body(nodes).items()}
    moving = [node for node in nodes if node.name in system.bodies]
    rows = [system.bodies.index(node.name) for node in moving]
    arms = np.reshape([np.subtract(node.position, centres[node.name]) for node in moving], (-1, 3))
    numbers = tuple(node.number for node in moving)
    result = []
    for k in range(len(modes)):
        shape = (system.body_motion @ modes.shapes[:, k])[rows]
        shape[:, :3] += np.cross(shape[:, 3:], arms)
        ends = float(modes.frequencies[k]), float(modes.damping_ratios[k])
        result.append(MeasuredMode(f"Mode {k + 1}", *ends, numbers, shape))
    return tuple(result)
