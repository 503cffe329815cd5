"""Maxwell elements in plain parts: a massless node that slides along the line, and rows of spring and damper on it."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

from mbsvib.elements import Body, Joint, Maxwell
from mbsvib.elements import joint as _joint
from mbsvib.elements.element_rows import ElementRows
from mbsvib.elements.rows import columns

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from mbsvib.elements.part import Part


class Node(Body):
    """The massless node between the spring and the damper of a Maxwell element; no part that the user gave."""

    __slots__ = ()


class Slide(Joint):
    """What the damper of a Maxwell element yields; no part that the user gave."""

    __slots__ = ()


def node_body(part: Maxwell) -> Node:
    """Return the massless body between the spring and the damper of a Maxwell element."""
    return Node(part.node, 0.0, (0.0,) * 6, part.end)


def slide(part: Maxwell) -> Slide:
    """Return the joint that lets the node of a Maxwell element slide along its line."""
    plain = _joint.make(part.name, "prismatic", part.second, part.node, part.end, None, part.line, None, None, None)
    return Slide(*(getattr(plain, item.name) for item in fields(plain)))


def given(parts: Iterable[Part]) -> tuple[Part, ...]:
    """Return the parts that the user gave out of all.

    Parameters
    ----------
    parts : iterable of Part
        Parts of a model with nodes.

    Returns
    -------
    tuple of Part
        Those that are no nodes of Maxwell elements, and not what these slide on.
    """
    return tuple(part for part in parts if not isinstance(part, (Node, Slide)))


def rows(parts: Sequence[tuple[int, Maxwell]], number: Mapping[str, int]) -> ElementRows:
    """Return the rows of Maxwell elements.

    k1 acts between the first body and the node, c between the node and the second body, k0 between both bodies; the
    element's force is that of k1 and k0, which is what c hands on.

    Parameters
    ----------
    parts : sequence of (int, Maxwell)
        The elements and their numbers among the model's connections.
    number : mapping
        Number of each body and node, ground included.

    Returns
    -------
    ElementRows
        Up to three rows an element; that of the damper has no direction in the owner's axes, as it adds no force.
    """
    tuples = []
    for i, p in parts:
        first, second, node = number[p.first], number[p.second], number[p.node]
        on = (*p.start, *p.line)
        tuples.append((first, node, i, *on, p.stiffness, 0.0, 1.0))
        if p.damping:
            tuples.append((second, node, i, *on, 0.0, p.damping, 0.0))
        if p.static_stiffness:
            tuples.append((first, second, i, *on, p.static_stiffness, 0.0, 1.0))
    table = columns(tuples, 12)
    result = ElementRows.along_lines(table[:3], table[3:6], table[6:9], table[9], table[10])
    result.unit[:, 2] = table[11]
    return result
