"""Superelements as plain parts: nodes are bodies that hang freely on the first, internal coordinates ride on bodies of
their own, three on each; mass, stiffness and damping are rows on all of them.

Stiffness sees displacements relative to the first node only, so that rigid-body motions are exactly free.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arguments import UNIT6
from mbsvib.elements import joint as _joint
from mbsvib.elements.body import Body
from mbsvib.elements.joint import Joint
from mbsvib.elements.shared_rows import Node, Piece, PlainParts

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.superelement import Superelement

_NO_INERTIA = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def plain(part: Superelement, *_: Any) -> PlainParts:
    """Return nodes, joints and shared rows of a superelement."""
    return PlainParts({body.name: body for body in node_bodies(part)}, dict(links(part)), mass=tuple(masses(part)),
                      elastic=tuple(elastic(part)))  # fmt: skip


def node_bodies(part: Superelement) -> list[Body]:
    """Return bodies without mass of their own: the nodes that no body holds, and those that carry coordinates."""
    origin = part.nodes[0][1]
    own = [Body(name, 0.0, _NO_INERTIA, point) for name, point in part.node_names.items()]
    return own + [Body(name, 0.0, _NO_INERTIA, origin) for name in part.carriers]


def links(part: Superelement) -> list[tuple[str, Joint]]:
    """Return the free joints between the first node and the others, and those whose freedoms are the coordinates."""
    result = []
    for i, (name, point) in enumerate(part.nodes[1:], 1):
        key = f"{part.name}.{name}"
        first, second = part.body_of(0), part.body_of(i)
        if first != second:
            axes = part.orientation
            joint = _joint.make(key, "free", first, second, point, axes, None, None, None, None)
            result.append((key, joint))
    origin = part.nodes[0][1]
    for i, carrier in enumerate(part.carriers):
        count = min(3, part.internal - 3 * i)
        freedom = tuple([(f"mode{3 * i + j + 1}", UNIT6[j]) for j in range(count)])
        names = ("x", "y", "z", "rx", "ry", "rz")
        locked = tuple([(names[j], UNIT6[j]) for j in range(count, 6)])
        joint = Joint(part.name, "custom", "ground", carrier, origin, freedom=freedom, locked=locked, point=origin,
                      free=names[:count])  # fmt: skip
        result.append((carrier, joint))
    return result


def masses(part: Superelement) -> list[Piece]:
    """Return the rows W of M = W^T W."""
    values, rows = part.factors[0]
    return [Piece(part.name, _nodes(part, 0), _on_nodes(part, rows * np.sqrt(values)[:, None], 0))]


def elastic(part: Superelement) -> list[Piece]:
    """Return the rows of K, and those of C where there is one."""
    result = []
    _, (k, rows), damping = part.factors
    first = len(part.M) - rows.shape[1]
    if len(k):
        result.append(Piece(part.name, _nodes(part, first), _on_nodes(part, rows, first), stiffness=k))
    if damping is not None and len(damping[0]):
        c, rows = damping
        first = len(part.M) - rows.shape[1]
        result.append(Piece(part.name, _nodes(part, first), _on_nodes(part, rows, first), damping=c))
    return result


def _nodes(part: Superelement, first: int) -> tuple[Node, ...]:
    """The nodes that rows from coordinate ``first`` on see: all, or the others relative to the first one."""
    origin = part.nodes[0][1]
    against = "ground" if first == 0 else part.body_of(0)
    seen = [Node(part.body_of(i), point, against=against) for i, (_, point) in enumerate(part.nodes) if 6 * i >= first]
    return (*seen, *(Node(name, origin, rides=False) for name in part.carriers))


def _on_nodes(part: Superelement, rows: Array, first: int) -> Array:
    """Rows on coordinates from ``first`` on, as rows on six displacements in world axes of each node and carrier."""
    interface = 6 * len(part.nodes) - first
    world = (rows[:, :interface].reshape(-1, 3) @ np.array(part.orientation).T).reshape(len(rows), interface)
    carried = np.zeros((len(rows), len(part.carriers), 6))
    for j in range(part.internal):
        carried[:, j // 3, j % 3] = rows[:, interface + j]
    return np.concatenate((world, carried.reshape(len(rows), 6 * len(part.carriers))), axis=1)
