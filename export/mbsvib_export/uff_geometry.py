"""The structure in universal files: a node for each body and each point at which something acts or is measured, and the
data sets that say it: units 164, coordinate systems 2420, nodes 2411, groups 2467, lines 82, modes 55.

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
    from collections.abc import Hashable, Iterator

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.elements.part import Part
_PER_LINE = 8
_NODES = 7  # type of entities in groups
_REAL, _COMPLEX = 2, 5
_LONGEST_NAME = 80


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


def geometry_sets(geometry: Geometry) -> Iterator[str]:
    """Yield the data sets that say units, nodes, bodies and lines."""
    yield _set(164, [f"{1:10}{'SI: metre (newton)':<20}{2:10}", _reals(1.0, 1.0, 1.0), _reals(273.15)])
    if not geometry.nodes:
        return
    systems = [node for node in geometry.nodes if node.axes is not None]
    if systems:
        lines = [f"{1:10}", "directions of inputs and outputs"]
        for node in systems:
            assert node.axes is not None
            lines += [f"{node.number:10}{0:10}{0:10}", f"direction at node {node.number}",
                      *(_reals(*row) for row in node.axes.T.tolist()), _reals(0.0, 0.0, 0.0)]  # fmt: skip
        yield _set(2420, lines)
    lines = []
    for node in geometry.nodes:
        lines += [f"{node.number:10}{0:10}{0 if node.axes is None else node.number:10}{1:10}", _reals(*node.position)]
    yield _set(2411, lines)
    groups: dict[str, list[PlacedNode]] = {}
    for node in geometry.nodes:
        groups.setdefault(node.body, []).append(node)
    lines = []
    for k, (body, nodes) in enumerate(groups.items(), 1):
        entries = [f"{_NODES:10}{node.number:10}{0:10}{0:10}" for node in nodes]
        lines += ["".join(f"{number:10}" for number in (k, 0, 0, 0, 0, 0, 0, len(nodes))), _plain(body),
                  *("".join(entries[i : i + 2]) for i in range(0, len(entries), 2))]  # fmt: skip
    yield _set(2467, lines)
    for k, (body, nodes) in enumerate(groups.items(), 1):
        centre, *others = nodes
        distant = [node for node in others if node.position != centre.position]
        if distant:
            trace = [number for node in distant for number in (centre.number, node.number, 0)]
            yield _set(82, [f"{k:10}{len(trace):10}{0:10}", _plain(body), *_integers(trace)])


def mode_sets(system: System, geometry: Geometry) -> Iterator[str]:
    """Yield the modes as data sets 55, at each node of a body: u + theta x r; for normal modes theta as well.

    Modes that creep or diverge without oscillating have no place in the format and are left out.
    """
    modes = system.modes()
    rows = dict(zip(system.bodies, system.body_motion, strict=True))
    centres: dict[str, Array] = {}
    for node in geometry.nodes:
        centres.setdefault(node.body, np.array(node.position))
    nodes = [node for node in geometry.nodes if node.body in rows]
    is_real = not np.iscomplexobj(modes.shapes)
    # characteristic, displacement, type and numbers at a node; common readers take three complex numbers, not six
    kind, layout = (2, (3, 8, _REAL, 6)) if is_real else (3, (2, 8, _COMPLEX, 3))
    for k, eigenvalue in enumerate(modes.pairs[:, 0].tolist()):
        frequency, damping = float(modes.frequencies[k]), float(modes.damping_ratios[k])
        is_rigid = frequency == 0.0 and damping == 0.0
        if not (is_rigid or abs(damping) < 1.0):
            continue
        reals = (frequency, 0.0, damping, 0.0) if is_real else (eigenvalue.real, eigenvalue.imag, 0.0, 0.0, 0.0, 0.0)
        lines = [
            f"Mode {k + 1}", _plain(system.name), "NONE", "NONE", "NONE",
            "".join(f"{number:10}" for number in (1, kind, *layout)),
            "".join(f"{number:10}" for number in (2, len(reals), 1, k + 1)),
            "".join(f"{number:13.5E}" for number in reals),
        ]  # fmt: skip
        for node in nodes:
            motion = rows[node.body] @ modes.shapes[:, k]
            numbers = _at(node, motion, np.array(node.position) - centres[node.body])
            flat = numbers if is_real else np.stack((numbers.real, numbers.imag), axis=1)[:3].ravel()
            words = [f"{number:13.5E}" for number in flat.tolist()]
            lines += [f"{node.number:10}", *("".join(words[i : i + 6]) for i in range(0, len(words), 6))]
        yield _set(55, lines)


def _at(node: PlacedNode, motion: Complex, arm: Array) -> Complex:
    """Displacement and rotation of a point of a body, in the displacement coordinate system of the node."""
    moved, turned = motion[:3] + np.cross(motion[3:], arm), motion[3:]
    axes = np.eye(3) if node.axes is None else node.axes.T
    result: Complex = np.concatenate((axes @ moved, axes @ turned))
    return result


def _set(kind: int, lines: list[str]) -> str:
    return "".join(f"{line}\n" for line in (f"{-1:6}", f"{kind:6}", *lines, f"{-1:6}"))


def _reals(*values: float) -> str:
    return "".join(f"{value:25.16E}" for value in values).replace("E", "D")


def _integers(numbers: list[int]) -> Iterator[str]:
    for k in range(0, len(numbers), _PER_LINE):
        yield "".join(f"{number:10}" for number in numbers[k : k + _PER_LINE])


def _plain(name: str) -> str:
    """A name as a line of ASCII; a line of -1 would end the data set."""
    text = "".join(letter if letter.isprintable() else " " for letter in name)[:_LONGEST_NAME]
    return f"'{text}'" if text.strip() == "-1" else text
