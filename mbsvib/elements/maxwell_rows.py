"""Expansion of Maxwell elements: a massless node that slides along the line, with rows of springs and damper."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

from mbsvib.elements import Body, Joint, Maxwell
from mbsvib.elements import joint as _joint
from mbsvib.elements.element_rows import ElementRows
from mbsvib.elements.rows import columns
from mbsvib.elements.shared_rows import ExpandedPart

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


class Node(Body):
    """The massless node between a spring and a damper of an element."""

    __slots__ = ()
    symbol = ""


class NodeJoint(Joint):
    """The joint of a node, such as the one whose coordinate is the deformation of a Maxwell element's damper."""

    __slots__ = ()
    symbol = ""


def as_node_joint(joint: Joint) -> NodeJoint:
    """Return a joint as one that belongs to an element."""
    return NodeJoint(*(getattr(joint, item.name) for item in fields(joint)))


def nodes(part: Maxwell) -> ExpandedPart:
    """Return the massless body between spring and damper, and the joint in which it slides along the line."""
    joint = _joint.make(part.name, "prismatic", part.second, part.node, part.end, None, part.line, None, None, None)
    return ExpandedPart(bodies={part.node: Node(part.node, 0.0, (0.0,) * 6, part.end)},
                        joints={part.name: as_node_joint(joint)})


def rows(parts: Sequence[tuple[int, Maxwell]], number: Mapping[str, int]) -> ElementRows:
    """Return the rows of Maxwell elements.

    k1 acts between the first body and the node, c between the node and the second body, k0 between both bodies. The
    element's force is the sum of those of k1 and k0; the force of c is equal to that of k1.

    ``parts`` are the elements and their numbers among the model's connections. The direction ``unit`` of the damper's
    row is zero: it adds no force.
    """
    tuples = []
    for i, p in parts:
        first, second, node = number[p.first], number[p.second], number[p.node]
        line = (*p.start, *p.line)
        tuples.append((first, node, i, *line, p.stiffness, 0.0, 1.0))
        if p.damping:
            tuples.append((second, node, i, *line, 0.0, p.damping, 0.0))
        if p.static_stiffness:
            tuples.append((first, second, i, *line, p.static_stiffness, 0.0, 1.0))
    table = columns(tuples, 12)
    result = ElementRows.along_lines(table[:3], table[3:6], table[6:9], table[9], table[10])
    result.unit[:, 2] = table[11]
    return result
