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
from mbsvib.linalg.rotations import exponential

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.elements.bushing import Six

ELEMENTS = 8
# A line of so many bodies is solved in seconds; more is a slip of a file or a pen.
MOST_ELEMENTS = 100_000
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

    ``points`` are the nodes that follow from this, ``y_axis`` says where the section's y axis points, of all elements
    or of each; ``alpha`` [1/s] and ``beta`` [s] are Rayleigh's damping, ``damping_ratio`` that of every mode of the
    free beam. ``displacements`` (nodes, 6) [m, rad], world axes, are how far its nodes are from where the beam without
    forces has them in the frame of the body that carries it, ``root``.
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
    y_axis: Vector | tuple[Vector, ...] | None = None
    alpha: float = 0.0
    beta: float = 0.0
    damping_ratio: float = 0.0
    displacements: tuple[Six, ...] | None = None
    points: tuple[Vector, ...] = derived(())

    def words(self) -> dict[str, Any]:
        """Return the arguments of ``add_beam`` that make this part, without those at their default."""
        said = {"name": self.name, "a": self.a, "b": self.b, "section": _sections.words_of(self.section),
                "material": self.material.words()}  # fmt: skip
        rest = ("start", "end", "axis", "length", "nodes", "elements", "shear", "y_axis", "alpha", "beta",
                "damping_ratio", "displacements")  # fmt: skip
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

    @property
    def root(self) -> str:
        """Name of the body that carries it: ground if that holds an end, else a body that does, else its first node."""
        held = [body for body in (self.a, self.b) if body is not None]
        return "ground" if "ground" in held else next(iter(held), self.node(0))

    def frames(self) -> list[tuple[float, Matrix3]]:
        """Return length and axes (columns, x along the element) of all elements."""
        who, points, towards = f"beam '{self.name}'", self.points, self.y_axis
        if towards is not None and isinstance(towards[0], tuple):
            return [_frame(p, q, y, who) for (p, q), y in zip(pairwise(points), towards, strict=True)]
        if self.nodes is not None:
            return [_frame(p, q, towards, who) for p, q in pairwise(points)]
        length, axes = _frame(points[0], points[-1], towards, who)
        return [(length / (len(points) - 1), axes)] * (len(points) - 1)

    def without_forces(self) -> Beam:
        """Return the beam as it is without forces, in the frame of the body that carries it in this pose."""
        if self.displacements is None:
            return self
        six = np.array(self.displacements)
        turn = exponential(-0.5 * (six[1:, 3:] + six[:-1, 3:]))
        return self.through(np.array(self.points) - six[:, :3], np.einsum("eij,ej->ei", turn, self.y_axes()))

    def y_axes(self) -> Array:
        """Return where the y axis of each element is to point (elements, 3); it is what is across the element of it."""
        if self.y_axis is None:
            return np.array([np.array(axes)[:, 1] for _, axes in self.frames()])
        return np.tile(self.y_axis, (len(self.points) - 1, 1)) if isinstance(self.y_axis[0], float) else \
            np.array(self.y_axis)  # fmt: skip

    def lengths(self) -> list[float]:
        """Return the lengths of its elements without forces [m], which tell their mass."""
        return [length for length, _ in self.without_forces().frames()]

    def through(self, points: Array, y_axes: Array, displacements: Array | None = None) -> Beam:
        """Return the same beam through other nodes.

        Parameters
        ----------
        points : array, shape (nodes, 3)
            Its nodes [m].
        y_axes : array, shape (elements, 3)
            Where the y axis of each element points.
        displacements : array, shape (nodes, 6), optional
            How far these nodes are from where they would be without forces [m, rad].

        Returns
        -------
        Beam
            The beam, unchecked.
        """
        nodes = _tuples(points)
        return replace(self, start=None, end=None, axis=None, length=None, elements=None, nodes=nodes, points=nodes,
                       y_axis=_tuples(y_axes), displacements=None if displacements is None else _tuples(displacements),
                       )  # fmt: skip


def _tuples(array: Array) -> tuple[Any, ...]:
    return tuple([tuple(row) for row in array.tolist()])


def make(
    name: str, a: str | None, b: str | None, section: Any, material: Any, start: Any = None, end: Any = None,
    axis: Any = None, length: Any = None, nodes: Any = None, elements: Any = None, shear: Any = False,
    y_axis: Any = None, alpha: Any = 0.0, beta: Any = 0.0, damping_ratio: Any = 0.0, displacements: Any = None,
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
    if axis is not None or length is not None:
        axis, length, far = _reached(who, start, end, axis, length)
        ends, between, points, count = _points(who, start, far, nodes, elements)
        ends = ends[0], None
    else:
        ends, between, points, count = _points(who, start, end, nodes, elements)
    towards = None if y_axis is None else _y_axis(who, y_axis, len(points) - 1)
    bent = None if displacements is None else _displacements(who, displacements, len(points))
    beam = Beam(name, a, b, shape, stuff, *ends, axis, length, between, count, shear, towards, *rayleigh, ratio, bent,
                points)  # fmt: skip
    beam.frames()
    if a is not None and a == b and len(points) == 2:
        raise ModelError(f"{who}: both ends are on '{a}' and nothing between them can move; give it more elements, "
                         f"or another body (None: a free end).", element=who, field="b")  # fmt: skip
    return beam


def _y_axis(who: str, value: Any, elements: int) -> Any:
    """One direction, or one for each element."""
    items = list(value) if hasattr(value, "__iter__") else []
    if not items or not hasattr(items[0], "__len__"):
        return check.axis(value, who, "y_axis")
    if len(items) != elements:
        raise check.refuse(who, "y_axis", value, f"a direction, or one for each of the {elements} elements")
    return tuple([check.axis(item, who, "y_axis") for item in items])


def _displacements(who: str, value: Any, nodes: int) -> tuple[Six, ...]:
    expected = f"x y z [m] and rx ry rz [rad] of each of the {nodes} nodes"
    items = check.listed(value, who, "displacements", expected)
    if len(items) != nodes:
        raise check.refuse(who, "displacements", value, expected)
    return tuple([check.numbers(item, (6,), who, "displacements", expected) for item in items])


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
    if type(count) is not int or not 1 <= count <= MOST_ELEMENTS:
        raise check.refuse(who, "elements", elements, f"a whole number from 1 to {MOST_ELEMENTS}")
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
