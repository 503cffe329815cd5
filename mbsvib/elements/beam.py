"""Beams: a line of elements between two bodies, or with free ends."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import pairwise
from math import hypot
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.elements import material as _material
from mbsvib.elements import sections as _sections
from mbsvib.elements.material import Material
from mbsvib.elements.part import Composed, ParameterField, derived, point
from mbsvib.elements.sections import Properties, Shape
from mbsvib.errors import ModelError, counted

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

ELEMENTS = 8
# sine of the angle between a beam and the direction that says where its y axis is
PARALLEL = 1e-6
MATERIAL = ("E", "rho", "nu", "G")
# Units of parameters that are no lengths.
UNITS = {"E": "N/m^2", "G": "N/m^2", "rho": "kg/m^3", "nu": "-", "A": "m^2", "Iy": "m^4", "Iz": "m^4", "J": "m^4",
         "ky": "-", "kz": "-", "alpha": "1/s", "beta": "s", "damping_ratio": "-"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Beam(Composed):
    """A beam from ``start`` to ``end`` or along ``nodes`` [m, world axes], its ends held by bodies ``a`` and ``b``
    (None: free).

    ``points`` are the nodes that follow from this, ``y_axis`` says where the section's y axis points; ``alpha`` [1/s]
    and ``beta`` [s] are Rayleigh's damping, ``damping_ratio`` that of every mode of the free beam.
    """

    a: str | None
    b: str | None
    section: Shape
    material: Material
    start: Vector | None = None
    end: Vector | None = None
    axis: Vector | None = None
    length: float | None = None
    nodes: tuple[Vector, ...] | None = None
    elements: int | None = None
    shear: bool = False
    y_axis: Vector | None = None
    alpha: float = 0.0
    beta: float = 0.0
    damping_ratio: float = 0.0
    points: tuple[Vector, ...] = derived(())

    def words(self) -> dict[str, Any]:
        """Return the arguments of ``add_beam`` that make this part, without those at their default."""
        said = {"name": self.name, "a": self.a, "b": self.b, "section": _sections.words_of(self.section),
                "material": self.material.words()}  # fmt: skip
        rest = ("start", "end", "axis", "length", "nodes", "elements", "shear", "y_axis", "alpha", "beta",
                "damping_ratio")  # fmt: skip
        return said | {word: value for word in rest if (value := getattr(self, word)) not in (None, False, 0.0)}

    def parameter_fields(self) -> Iterator[ParameterField]:
        for part in (self.material, self.section):
            for item in fields(part):
                if (value := getattr(part, item.name)) is not None:
                    yield ParameterField(item.name, value, UNITS.get(item.name, "m"))
        for field in ("start", "end"):
            if (value := getattr(self, field)) is not None:
                yield point(field, value)
        if self.length is not None:
            yield ParameterField("length", self.length, "m")
        for field in ("alpha", "beta", "damping_ratio"):
            yield ParameterField(field, getattr(self, field), UNITS[field])

    def with_values(self, values: Mapping[str, Any]) -> Beam:
        words = self.words()
        for field, value in values.items():
            owner = words["material"] if field in MATERIAL else words if hasattr(self, field) else words["section"]
            owner[field] = value
        return make(**words)

    @property
    def properties(self) -> Properties:
        """Area, second moments, torsion constant and shear factors."""
        return self.section.properties(self.material.poisson)

    def node(self, i: int) -> str:
        """Return the name of the body at node i: the node itself, or what holds this end.

        Parameters
        ----------
        i : int
            Number of the node, from 0.

        Returns
        -------
        str
            Name of a body or ground.
        """
        if i == 0 and self.a is not None:
            return self.a
        if i == len(self.points) - 1 and self.b is not None:
            return self.b
        return f"{self.name}.{i}"

    @property
    def node_names(self) -> dict[str, Vector]:
        """Names and points of the nodes that are bodies of their own."""
        own = ((self.node(i), i, point) for i, point in enumerate(self.points))
        return {name: point for name, i, point in own if name == f"{self.name}.{i}"}

    @property
    def element_names(self) -> tuple[str, ...]:
        """Names of the elements, ``"tube.e1"`` being the one at the start."""
        return tuple([f"{self.name}.e{i}" for i in range(1, len(self.points))])

    @property
    def made(self) -> tuple[str, ...]:
        """Names of the bodies, joints and springs that it becomes."""
        return (*self.node_names, *self.element_names)

    @property
    def account(self) -> str:
        """What it is made of, in a few words."""
        kind = "Timoshenko" if self.shear else "Euler-Bernoulli"
        made = counted(len(self.element_names), f"{kind} element")
        return f"beam '{self.name}': {made}, {counted(len(self.node_names), 'node')} of its own"

    def frames(self) -> list[tuple[float, Matrix3]]:
        """Return length and axes (columns, x along the element) of all elements."""
        who, points = f"beam '{self.name}'", self.points
        if self.nodes is not None:
            return [_frame(p, q, self.y_axis, who) for p, q in pairwise(points)]
        length, axes = _frame(points[0], points[-1], self.y_axis, who)
        return [(length / (len(points) - 1), axes)] * (len(points) - 1)


def make(
    name: str, a: str | None, b: str | None, section: Any, material: Any, start: Any = None, end: Any = None,
    axis: Any = None, length: Any = None, nodes: Any = None, elements: Any = None, shear: Any = False,
    y_axis: Any = None, alpha: Any = 0.0, beta: Any = 0.0, damping_ratio: Any = 0.0,
) -> Beam:  # fmt: skip
    """Check the values of a beam and build it."""
    who = f"beam '{name}'"
    shape, stuff = _sections.make(section, who), _material.make(material, who)
    if type(shear) is not bool:
        raise check.refuse(who, "shear", shear, "True (Timoshenko) or False (Euler-Bernoulli)")
    properties = shape.properties(stuff.poisson)
    if shear and (properties.ky is None or properties.kz is None):
        raise ModelError(f"{who}: shear=True needs the section's shear factors ky and kz; give them (5/6 for a "
                         f"rectangle), or use a tube, circle or rectangle.", element=who, field="section")  # fmt: skip
    rayleigh = _damping(who, "alpha", alpha), _damping(who, "beta", beta)
    ratio = _damping(who, "damping_ratio", damping_ratio)
    given = None if y_axis is None else check.axis(y_axis, who, "y_axis")
    if axis is not None or length is not None:
        axis, length, far = _reached(who, start, end, axis, length)
        ends, between, points, count = _points(who, start, far, nodes, elements)
        ends = ends[0], None
    else:
        ends, between, points, count = _points(who, start, end, nodes, elements)
    beam = Beam(name, a, b, shape, stuff, *ends, axis, length, between, count, shear, given, *rayleigh, ratio, points)
    beam.frames()
    if a is not None and a == b and len(points) == 2:
        raise ModelError(f"{who}: both ends are on '{a}' and nothing between them can move; give it more elements, "
                         f"or another body (None: a free end).", element=who, field="b")  # fmt: skip
    return beam


def _damping(who: str, word: str, value: Any) -> float:
    result = check.number(value, who, word)
    if result < 0.0:
        raise check.refuse(who, word, value, "a number that is not negative")
    return result


def moved(beam: Beam, **changes: Any) -> Beam:
    """Return a beam with some fields replaced unchecked."""
    return replace(beam, **changes)


def _reached(who: str, start: Any, end: Any, axis: Any, length: Any) -> tuple[Vector, float, Vector]:
    """Axis and length as given, and the end that they lead to."""
    if end is not None:
        raise ModelError(f"{who}: axis and length are given, so leave out end.", element=who, field="end")
    if axis is None or length is None:
        raise ModelError(f"{who}: axis and length go together; give both, or start and end.", element=who,
                         field="axis" if axis is None else "length")  # fmt: skip
    size = check.number(length, who, "length")
    if size <= 0.0:
        raise check.refuse(who, "length", length, "a positive number [m]")
    along, first = check.axis(axis, who, "axis"), check.vector(start, who, "start", "a point (x, y, z) [m], world axes")
    return check.vector(axis, who, "axis"), size, (
        first[0] + size * along[0], first[1] + size * along[1], first[2] + size * along[2])  # fmt: skip


def _points(
    who: str, start: Any, end: Any, nodes: Any, elements: Any
) -> tuple[tuple[Vector | None, Vector | None], tuple[Vector, ...] | None, tuple[Vector, ...], int | None]:
    count = ELEMENTS if elements is None else elements
    if type(count) is not int or count < 1:
        raise check.refuse(who, "elements", elements, "a whole number, 1 or more")
    if nodes is not None:
        if start is not None or end is not None or elements is not None:
            raise ModelError(f"{who}: nodes are given, so leave out start, end and elements.",
                             element=who, field="nodes")  # fmt: skip
        items = check.listed(nodes, who, "nodes", "two or more points")
        if len(items) < 2:
            raise check.refuse(who, "nodes", nodes, "two or more points")
        between = tuple([check.vector(point, who, "nodes") for point in items])
        return (None, None), between, between, None
    for word, value in (("start", start), ("end", end)):
        if value is None:
            raise check.refuse(who, word, None, "a point (x, y, z) [m], world axes, or nodes")
    first, last = check.vector(start, who, "start"), check.vector(end, who, "end")
    if first == last:
        raise check.refuse(who, "end", end, "a point other than start", "A beam needs a length.")
    share = (np.arange(count + 1) / count)[:, None]
    line = (1.0 - share) * first + share * last
    return (first, last), None, tuple([tuple(point) for point in line.tolist()]), elements


def _frame(p: Vector, q: Vector, y_axis: Vector | None, who: str) -> tuple[float, Matrix3]:
    """Length and axes: x along the element, y towards ``y_axis``, or horizontal (z x axis; the y axis if vertical)."""
    d = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
    length = hypot(*d)
    if length == 0.0:
        raise ModelError(f"{who}: two of its nodes are both at {p}; an element needs a length.",
                         element=who, field="nodes")  # fmt: skip
    x = (d[0] / length, d[1] / length, d[2] / length)
    if y_axis is None:
        y_axis = (-x[1], x[0], 0.0) if hypot(x[0], x[1]) > PARALLEL else (0.0, 1.0, 0.0)
    n = (x[1] * y_axis[2] - x[2] * y_axis[1], x[2] * y_axis[0] - x[0] * y_axis[2], x[0] * y_axis[1] - x[1] * y_axis[0])
    size = hypot(*n)
    if size < PARALLEL * hypot(*y_axis):
        raise check.refuse(who, "y_axis", y_axis, "a direction across the beam, which runs along "
                           f"({x[0]:g}, {x[1]:g}, {x[2]:g})")  # fmt: skip
    z = (n[0] / size, n[1] / size, n[2] / size)
    y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
    return length, ((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]))
