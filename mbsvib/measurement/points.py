"""Where channels are: nodes, directions, labels such as ``101X+``, and the points of a model's inputs and outputs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.common.arrays import Array
from mbsvib.common.expected import kind_of
from mbsvib.elements.body import Body
from mbsvib.elements.families import EXPANSIONS
from mbsvib.elements.ports import Input, Output
from mbsvib.errors import ModelError, ResponseError

GROUND = "ground"
# The length of a direction differs from 1 by no more, but for rounding.
UNIT = 1e-12
_AXES = ("X", "Y", "Z", "RX", "RY", "RZ")
_LABEL = re.compile(r"(?:.*[:\s])?(\d+)(?:([+-]?)(R?[XYZ])|(R?[XYZ])([+-]))", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Node:
    """A point of the structure: its ``number`` in the file, ``name`` (of its body, where known), ``position`` [m], and
    the ``axes`` of its displacements, as columns, where they are not those of the world.
    """

    number: int
    name: str
    position: Vector
    axes: Matrix3 | None = None


@dataclass(frozen=True, slots=True)
class Point:
    """Where and how something is measured or excited: number of the node, and ``direction``.

    1, 2, 3 are translations along x, y, z, 4, 5, 6 rotations about them, with their sign, in the displacement
    coordinate system of the node; 0 is none of these, such as a relative displacement.
    """

    node: int
    direction: int


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Where a channel acts: ``position`` (3,) [m], ``direction`` (6,), a unit translation or rotation, and ``body``."""

    position: Array
    direction: Array
    body: str = ""

    def distance(self, other: Place) -> float:
        """Return the distance of two places [m]."""
        return float(np.linalg.norm(self.position - other.position))

    def cosine(self, other: Place) -> float:
        """Return the cosine of the angle of two directions; 0 between a translation and a rotation."""
        return float(self.direction @ other.direction)


def label_of(node: int, axis: int) -> str:
    """Return the label of a direction 0 to 5 at a node."""
    return f"{node}{_AXES[axis]}+"


def point_of(label: str) -> Point | None:
    """Return node and direction of a label, ``101X+``, ``101+X``, ``101RZ-``; None of other names."""
    match = _LABEL.fullmatch(label)
    if match is None:
        return None
    axis, sign = match[3] or match[4], match[2] or match[5]
    return Point(int(match[1]), (-1 if sign == "-" else 1) * (_AXES.index(axis.upper()) + 1))


def nodes_of(given: Any) -> list[Node]:
    """Return nodes as a list, from nodes, or from positions by their numbers."""
    numbered = isinstance(given, dict)
    nodes = list(given)
    if not all(isinstance(node, (int, np.integer) if numbered else Node) for node in nodes):
        raise ResponseError(f"nodes = {check.shown(given)}; expected positions [m] by their numbers, "
                            f"{{101: (0.3, 0.2, 0.3)}}, or Node objects.")  # fmt: skip
    return [Node(int(number), "", check.vector(at, "nodes", str(number))) for number, at in given.items()] \
        if numbered else nodes  # fmt: skip


def points_of(given: Any, names: Sequence[str], nodes: Sequence[Node], who: str) -> tuple[list[Point], list[Node]]:
    """Return the points of channels, and nodes with those that had to be added.

    ``given``: points, or pairs of position [m] and direction (``"x"`` ... ``"rz"``, or a vector of 3 or 6), or None
    where that is not known; None: labels where names are such, else unknown.
    """
    free = 1 + max((node.number for node in nodes), default=0)
    if given is None:
        given = [point_of(name) for name in names]
        free = max([free, *(1 + point.node for point in given if point is not None)])
    if len(given) != len(names):
        raise ResponseError(f"{who}: {len(given)} points for the channels {', '.join(names)}; expected one of each.")
    points, added = [], list(nodes)
    for name, item in zip(names, given, strict=True):
        if isinstance(item, Point):
            points.append(item)
            continue
        direction = 0
        if item is not None:
            node, direction = _placed_node(item, free, f"{who}: the point of {name!r}")
            added.append(node)
        points.append(Point(free, direction))
        free += 1
    return points, added


def _placed_node(item: Any, number: int, who: str) -> tuple[Node, int]:
    try:
        position, along = item
    except (TypeError, ValueError) as error:
        raise ResponseError(f"{who} = {check.shown(item)}; expected a Point, or a position [m] and a direction, "
                            f"((0.1, 0, 0.2), 'z').") from error  # fmt: skip
    try:
        place, six = check.vector(position, who, "position"), np.array(check.direction(along, who))
    except ModelError as error:
        raise ResponseError(str(error)) from error
    first = 3 if six[3:].any() else 0
    if six[3 - first : 6 - first].any():
        raise ResponseError(f"{who}: direction = {check.shown(along)}; expected a translation or a rotation.")
    x = six[first : first + 3] / np.linalg.norm(six[first : first + 3])
    z_along = np.array(check.frame_along(tuple(x.tolist())))
    return Node(number, "", place, matrix3(np.column_stack((x, z_along[:, 0], z_along[:, 1])))), first + 1


def matrix3(axes: Array) -> Matrix3:
    """Return axes (3, 3) as the tuple that a node has."""
    x, y, z = ((a, b, c) for a, b, c in axes.tolist())
    return (x, y, z)


def place_of(point: Point, nodes: dict[int, Node]) -> Place | None:
    """Return place and direction of a measured channel in world axes; None where they are not known."""
    node = nodes.get(point.node)
    if node is None or not point.direction:
        return None
    axis, direction = abs(point.direction) - 1, np.zeros(6)
    axes = np.eye(3) if node.axes is None else np.array(node.axes)
    direction[3 * (axis // 3) : 3 * (axis // 3) + 3] = np.sign(point.direction) * axes[:, axis % 3]
    return Place(np.array(node.position), direction, node.name)


def body_positions(parts: Iterable[Any]) -> dict[str, Vector]:
    """Return the centres of mass of all bodies [m], also those that beams and superelements consist of."""
    positions: dict[str, Vector] = {}
    for part in parts:
        if isinstance(part, Body):
            positions[part.name] = part.position
        elif type(part) in EXPANSIONS:
            positions |= {name: body.position for name, body in EXPANSIONS[type(part)](part, {}).bodies.items()}
    return positions


def model_places(linear: Any) -> dict[tuple[str, str], Place]:
    """Return places of the inputs and outputs of a model, system or measurement that act on one body, by (kind, name).

    ``kind``: "input" or "output". Equations from files or matrices have none; a closed loop has those of its plant.
    """
    parts: Any
    ports: Any
    if hasattr(linear, "output_points"):  # a measurement
        known = {node.number: node for node in linear.nodes}
        listed = [((kind, name), place_of(point, known)) for kind in ("output", "input")
                  for name, point in zip(getattr(linear, f"{kind}s", ()), getattr(linear, f"{kind}_points", ()),
                                         strict=True)]  # fmt: skip
        return {key: place for key, place in listed if place is not None}
    if kind_of(linear) == "model":
        parts, ports = linear.declared_parts, chain(linear.inputs.values(), linear.outputs.values())
    else:
        system = linear.plant.system if kind_of(linear) == "closed loop" else linear
        provenance = getattr(system, "provenance", None)
        parts, ports = (provenance.parts, provenance.ports) if provenance is not None else ((), ())
    positions, places = body_positions(parts), {}
    for port in ports:
        if not isinstance(port, (Input, Output)) or port.relative_to != GROUND or not port.wrench:
            continue
        position = positions.get(port.body) if port.position is None else port.position
        wrench = np.array(port.wrench)
        is_unit = abs(np.linalg.norm(wrench) - 1.0) <= UNIT  # others are products with a factor
        if position is not None and is_unit and not (wrench[:3].any() and wrench[3:].any()):
            kind = "input" if isinstance(port, Input) else "output"
            places[kind, port.name] = Place(np.array(position), wrench, port.body)
    return places
