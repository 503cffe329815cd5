"""The nodes of a beam, as users give them: two ends, an end with an axis and a length, or all of them; their axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.common.arrays import Array
from mbsvib.errors import ModelError
from mbsvib.linalg.components import Triple, cross, norm, subtract, transpose

# Smallest sine of the angle between a beam and the direction of its y axis
PARALLEL = 1e-6
ELEMENTS = 8
# A chain of this many bodies is solved in seconds; a larger number is most probably an error in the input.
MAX_ELEMENTS = 100_000


def tuples(array: Array) -> tuple[Any, ...]:
    """Return rows (n, m) as tuples."""
    return tuple([tuple(row) for row in array.tolist()])


def straight(first: Triple, last: Triple, elements: int) -> tuple[Any, ...]:
    """Return the points of the nodes on the line between two points, whose components may be arrays of variants."""
    fractions = (np.arange(elements + 1) / elements).tolist()
    return tuple([tuple([(1.0 - x) * a + x * b for a, b in zip(first, last, strict=True)]) for x in fractions])


def y_axis_of(who: str, value: Any, elements: int) -> Any:
    """One direction, or one for each element."""
    items = list(value) if hasattr(value, "__iter__") else []
    if not items or not hasattr(items[0], "__len__"):
        return check.axis(value, who, "y_axis")
    if len(items) != elements:
        raise check.refuse(who, "y_axis", value, f"a direction, or one for each of the {elements} elements")
    return tuple([check.axis(item, who, "y_axis") for item in items])


def end_along(who: str, start: Any, end: Any, axis: Any, length: Any) -> tuple[Vector, float, Vector]:
    """Checked axis and length, and the end point that follows from them."""
    if end is not None:
        raise ModelError(f"{who}: axis and length are given, so leave out end.", element=who, field="end")
    if axis is None or length is None:
        raise ModelError(f"{who}: axis and length go together; give both, or start and end.", element=who,
                         field="axis" if axis is None else "length")  # fmt: skip
    size = check.number(length, who, "length")
    if size <= 0.0:
        raise check.refuse(who, "length", length, "a positive number [m]")
    unit, first = check.axis(axis, who, "axis"), check.vector(start, who, "start", "a point (x, y, z) [m], world axes")
    return check.vector(axis, who, "axis"), size, (
        first[0] + size * unit[0], first[1] + size * unit[1], first[2] + size * unit[2])  # fmt: skip


def points_of(
    who: str, start: Any, end: Any, nodes: Any, elements: Any
) -> tuple[tuple[Vector | None, Vector | None], tuple[Vector, ...] | None, tuple[Vector, ...], int | None]:
    """Checked start and end, nodes, points of all nodes, and number of elements."""
    count = ELEMENTS if elements is None else elements
    if type(count) is not int or not 1 <= count <= MAX_ELEMENTS:
        raise check.refuse(who, "elements", elements, f"a whole number from 1 to {MAX_ELEMENTS}")
    if nodes is not None:
        if start is not None or end is not None or elements is not None:
            raise ModelError(f"{who}: nodes are given, so leave out start, end and elements.",
                             element=who, field="nodes")  # fmt: skip
        items = check.listed(nodes, who, "nodes", "two or more points")
        if len(items) < 2:
            raise check.refuse(who, "nodes", nodes, "two or more points")
        points = tuple([check.vector(point, who, "nodes") for point in items])
        return (None, None), points, points, None
    for word, value in (("start", start), ("end", end)):
        if value is None:
            raise check.refuse(who, word, None, "a point (x, y, z) [m], world axes, or nodes")
    first, last = check.vector(start, who, "start"), check.vector(end, who, "end")
    if first == last:
        raise check.refuse(who, "end", end, "a point other than start", "A beam needs a length.")
    return (first, last), None, straight(first, last, count), elements


def line_axes(p: Triple, q: Triple, y_axis: Triple | None) -> tuple[Any, Any, Any]:
    """Return length and axes (columns, x along the line, y towards ``y_axis``, by default horizontal, world y if it is
    vertical) of a line between two points, and the sine of the angle to ``y_axis``; components may be arrays.
    """
    d = subtract(q, p)
    length = norm(d)
    x = (d[0] / length, d[1] / length, d[2] / length)
    if y_axis is None:
        level = np.hypot(np.real(x[0]), np.real(x[1])) > PARALLEL
        y_axis = (-x[1], x[0], 0.0) if np.all(level) else (0.0, 1.0, 0.0) if not np.any(level) else (
            np.where(level, -x[1], 0.0), np.where(level, x[0], 1.0), 0.0)  # fmt: skip
    n = cross(x, y_axis)
    size = norm(n)
    divisor = size + (size == 0.0)  # a y axis along the line is refused by its sine
    z = (n[0] / divisor, n[1] / divisor, n[2] / divisor)
    return length, transpose((x, cross(z, x), z)), np.real(size) / np.real(norm(y_axis))


def check_lines(who: str, points: Sequence[Vector], y_axis: Any, lines: Callable[[], Sequence[Any]]) -> None:
    """Refuse elements without a length, and y axes along them; ``lines`` returns the ``line_axes`` of all."""
    point = next((p for p, q in pairwise(points) if p == q), None)
    if point is not None:
        raise ModelError(f"{who}: two of its nodes are both at {point}; an element needs a length.", element=who,
                         field="nodes")  # fmt: skip
    for k, (_, axes, sine) in enumerate(lines()):
        if sine < PARALLEL:
            own = y_axis[k] if isinstance(y_axis[0], tuple) else y_axis
            x, y, z = (row[0] for row in axes)
            raise check.refuse(who, "y_axis", own, "a direction across the beam, which runs along "
                               f"({x:g}, {y:g}, {z:g})")  # fmt: skip
