"""Beams: a line of elements between two bodies, or with free ends."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np

from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.common.arrays import Array
from mbsvib.elements import material as _material
from mbsvib.elements import sections as _sections
from mbsvib.elements.beam_element import Element, Prismatic, check_flags, checked_damping, checked_displacements
from mbsvib.elements.beam_points import check_lines, end_along, line_axes, points_of, tuples, y_axis_of
from mbsvib.elements.beam_variants import MATERIAL, InVariants
from mbsvib.elements.bushing import Six
from mbsvib.elements.elastic_part import bent_nodes, is_unmoved, refuse_other_root
from mbsvib.elements.material import Material
from mbsvib.elements.part import Part, derived
from mbsvib.elements.placement import Placement
from mbsvib.elements.pose import Pose
from mbsvib.elements.roles import POINT, ParameterField
from mbsvib.elements.sections import Properties, Shape
from mbsvib.errors import ModelError, counted
from mbsvib.linalg.components import stacked
from mbsvib.linalg.products import concatenated
from mbsvib.linalg.rotations import exponential

# Units of parameters other than lengths.
UNITS = {"E": "N/m^2", "G": "N/m^2", "rho": "kg/m^3", "nu": "-", "A": "m^2", "Iy": "m^4", "Iz": "m^4", "J": "m^4",
         "ky": "-", "kz": "-", "alpha": "1/s", "beta": "s", "damping_ratio": "-"}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Beam(InVariants):
    """A beam from ``start`` to ``end`` or along ``nodes`` [m, world axes]; the bodies ``a`` and ``b`` hold its ends.

    An end without a body is free. ``points`` are its nodes. ``y_axis`` is the direction of the section's y axis, one
    for all elements or one for each. ``alpha`` [1/s] and ``beta`` [s] are the coefficients of Rayleigh damping,
    ``damping_ratio`` is that of all modes of the free beam. ``displacements`` (nodes, 6) [m, rad], world axes, are
    those of its nodes relative to the beam without forces, in the frame of its ``root``. If ``second_order``, slopes
    add to its strain as it bends.
    """

    a: str | None
    b: str | None
    section: Shape
    """Cross-section."""
    material: Material
    """Elastic constants and density."""
    start: Vector | None = None
    end: Vector | None = None
    axis: Vector | None = None
    length: float | None = None
    nodes: tuple[Vector, ...] | None = None
    elements: int | None = None
    shear: bool = False
    """Whether shear deforms it (Timoshenko), or not (Euler and Bernoulli)."""
    y_axis: Vector | tuple[Vector, ...] | None = None
    alpha: float = 0.0
    beta: float = 0.0
    damping_ratio: float = 0.0
    displacements: tuple[Six, ...] | None = None
    second_order: bool = True
    points: tuple[Vector, ...] = derived(())

    def constructor_kwargs(self) -> dict[str, Any]:
        """Return the arguments of ``add_beam`` that make this part, except those at their default."""
        required = {"name": self.name, "a": self.a, "b": self.b, "section": _sections.constructor_kwargs(self.section),
                    "material": self.material.constructor_kwargs()}  # fmt: skip
        optional = ("start", "end", "axis", "length", "nodes", "elements", "shear", "y_axis", "alpha", "beta",
                    "damping_ratio", "displacements")  # fmt: skip
        given = {key: value for key in optional if (value := getattr(self, key)) not in (None, False, 0.0)}
        return required | given | ({} if self.second_order else {"second_order": False})

    def parameter_fields(self) -> Iterator[ParameterField]:
        for part in (self.material, self.section):
            for item in fields(part):
                if (value := getattr(part, item.name)) is not None:
                    yield ParameterField(item.name, value, UNITS.get(item.name, "m"))
        for field in ("start", "end"):
            if (value := getattr(self, field)) is not None:
                yield POINT.field(field, value)
        if self.length is not None:
            yield ParameterField("length", self.length, "m")
        for field in ("alpha", "beta", "damping_ratio"):
            yield ParameterField(field, getattr(self, field), UNITS[field])

    def with_values(self, values: Mapping[str, Any]) -> Beam:
        kwargs = self.constructor_kwargs()
        for field, value in values.items():
            owner = kwargs["material"] if field in MATERIAL else kwargs if hasattr(self, field) else kwargs["section"]
            owner[field] = value
        return make(**kwargs)

    @property
    def properties(self) -> Properties:
        """Area, second moments, torsion constant and shear factors."""
        return self.section.properties(self.material.poisson)

    def element(self, length: float) -> Element:
        """Return what an element between two nodes is made of.

        Parameters
        ----------
        length : float
            Distance of its nodes [m].

        Returns
        -------
        Element
            Its stiffness, mass and bent lines.
        """
        return Prismatic(length, self.properties, self.material, self.shear)

    def body_of(self, i: int) -> str:
        if i == 0 and self.a is not None:
            return self.a
        if i == len(self.points) - 1 and self.b is not None:
            return self.b
        return f"{self.name}.{i}"

    @property
    def node_names(self) -> dict[str, Vector]:
        return {body: point for i, (body, point) in enumerate(self.node_bodies) if body == f"{self.name}.{i}"}

    @property
    def outlines(self) -> tuple[tuple[int, ...], ...]:
        """One line through all nodes."""
        return (tuple(range(len(self.points))),)

    @property
    def element_names(self) -> tuple[str, ...]:
        """Names of the elements from the start: ``"tube.e1"``, ``"tube.e2"``, ..."""
        return tuple([f"{self.name}.e{i}" for i in range(1, len(self.points))])

    @property
    def generated_names(self) -> tuple[str, ...]:
        return (*self.node_names, *self.element_names)

    @property
    def summary(self) -> str:
        kind = "Timoshenko" if self.shear else "Euler-Bernoulli"
        elements = counted(len(self.element_names), f"{kind} element")
        return f"beam '{self.name}': {elements}, {counted(len(self.node_names), 'node')} of its own"

    @property
    def root(self) -> str:
        """Body in whose frame it is linear: ground if it holds an end, else a body that does, else its first node."""
        return "ground" if "ground" in (self.a, self.b) else self.a or self.b or self.body_of(0)

    def frames(self) -> list[tuple[float, Matrix3]]:
        """Return length and axes (columns, x along the element) of all elements."""
        lines = [(length, axes) for length, axes, _ in self.lines()]
        if len(lines) == 1:
            lines = [(lines[0][0] / (len(self.points) - 1), lines[0][1])] * (len(self.points) - 1)
        return lines

    def lines(self) -> list[tuple[Any, Any, Any]]:
        """Return length and axes of all elements, or of all in one where they are on a line, and the sines of the
        angles to their y axes.
        """
        points, y_axis = self.points, self.y_axis
        if y_axis is not None and isinstance(y_axis[0], tuple):
            return [line_axes(p, q, y) for (p, q), y in zip(pairwise(points), y_axis, strict=True)]
        if self.nodes is not None:
            return [line_axes(p, q, y_axis) for p, q in pairwise(points)]
        return [line_axes(points[0], points[-1], y_axis)]

    def parts(self) -> list[Element]:
        """Return what its elements are made of; those of one length are the same."""
        lengths = [length for length, _ in self.frames()]
        keys = [length if isinstance(length, float) else id(length) for length in lengths]
        made = {key: self.element(length) for key, length in dict(zip(keys, lengths, strict=True)).items()}
        return [made[key] for key in keys]

    def middle(self, i: int) -> Vector:
        """Return the midpoint of element i.

        Parameters
        ----------
        i : int
            Number of the element, from 0.

        Returns
        -------
        tuple
            The point [m].
        """
        (a, b, c), (d, e, f) = self.points[i : i + 2]
        return (0.5 * (a + d), 0.5 * (b + e), 0.5 * (c + f))

    def check_compression(self, share: float) -> None:
        """Warn of elements that nearly buckle; beams of several elements are exact there, and nothing is to be told.

        Parameters
        ----------
        share : float
            The largest compression over that at which an element buckles sideways with its ends guided.
        """

    def without_forces(self) -> Beam:
        """Return the beam without forces, in the frame of its root in this pose."""
        if self.displacements is None:
            return self
        six = np.array(self.displacements)
        rotations = exponential(-0.5 * (six[1:, 3:] + six[:-1, 3:]))
        return self.through(np.array(self.points) - six[:, :3], np.einsum("eij,ej->ei", rotations, self.y_axes()))

    def y_axes(self) -> Array:
        """Return the direction of each element's y axis (elements, 3), which need not be normal to the element."""
        if self.y_axis is None:
            return np.array([np.array(axes)[:, 1] for _, axes in self.frames()])
        return np.tile(self.y_axis, (len(self.points) - 1, 1)) if isinstance(self.y_axis[0], float) else \
            np.array(self.y_axis)  # fmt: skip

    def lengths(self) -> list[float]:
        """Return the lengths of its elements without forces [m], which determine their mass."""
        return [length for length, _ in self.without_forces().frames()]

    def node_weights(self) -> tuple[Array, Array]:
        """Return the masses at which gravity acts on the nodes, and their points: consistent nodal loads.

        Half of each element's mass acts on either of its nodes, at a sixth of its length towards the other one. Force
        and moment m g L / 12 are those of the cubic deflection, so that nodes sag exactly; and as it turns with the
        node, so is the second-order work of the tension that grows along the element.

        Returns
        -------
        mass : array, shape (..., nodes)
            Masses [kg].
        point : array, shape (..., nodes, 3)
            Where they are in this pose [m], fixed to the bodies of the nodes.

        Source: Cook, Malkus, Plesha, Witt, Concepts and Applications of Finite Element Analysis, 4th ed., 3.11.
        """
        rest = self.without_forces()
        points, lengths = stacked(rest.points), [length for length, _ in rest.frames()]
        between = np.diff(points, axis=-2)
        parts = list(zip(rest.parts(), lengths, strict=True))
        half = np.stack(np.broadcast_arrays(*[0.5 * part.mass for part, _ in parts]), axis=-1)
        arms = half * np.stack(np.broadcast_arrays(*[part.arm / length for part, length in parts]), axis=-1)
        none = np.zeros_like(half[..., :1])
        mass = concatenated((half, none), -1) + concatenated((none, half), -1)
        moment, zero = arms[..., None] * between, np.zeros((1, 3))
        arm = (concatenated((moment, zero), -2) - concatenated((zero, moment), -2)) / mass[..., None]
        if self.displacements is not None:
            arm = np.einsum("nij,nj->ni", exponential(np.array(self.displacements)[:, 3:]), arm)
        return mass, stacked(self.points) + arm

    def through(self, points: Array, y_axes: Array, displacements: Array | None = None) -> Beam:
        """Return the same beam through other nodes.

        Parameters
        ----------
        points : array, shape (nodes, 3)
            Its nodes [m].
        y_axes : array, shape (elements, 3)
            Direction of the y axis of each element.
        displacements : array, shape (nodes, 6), optional
            Displacements of these nodes relative to the beam without forces [m, rad].

        Returns
        -------
        Beam
            The beam, unchecked.
        """
        nodes = tuples(points)
        return replace(self, start=None, end=None, axis=None, length=None, elements=None, nodes=nodes, points=nodes,
                       y_axis=tuples(y_axes), displacements=None if displacements is None else tuples(displacements),
                       )  # fmt: skip

    reversed_axis = 2  # of its elements

    def placed(self, to: Placement) -> dict[str, Any]:
        refuse_other_root(self, to)
        kwargs: dict[str, Any] = {"a": to.body(self.a), "b": to.body(self.b), "start": to.point(self.start),
                                  "end": to.point(self.end)}  # fmt: skip
        if self.nodes is not None:
            kwargs["nodes"] = [to.point(point) for point in self.nodes]
        if self.axis is not None:
            kwargs["axis"] = to.vector(self.axis)
        if self.displacements is not None:
            kwargs["displacements"] = [to.six(six) for six in self.displacements]
        return kwargs | ({"y_axis": _one_or_each(self.y_axes() @ to.turn.T)} if to.turns else {})

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        if is_unmoved(self, pose):
            return self
        before = np.zeros((len(self.points), 6)) if self.displacements is None else np.array(self.displacements)
        points, after, bends = bent_nodes(self, before, pose)
        if not bends and self.displacements is None:
            return self._as_rigid_body(pose)
        turn = exponential(0.5 * (after[1:, 3:] + after[:-1, 3:])) @ pose.rotations[pose.number[self.root]]
        return self.through(points, np.einsum("eij,ej->ei", turn, self.without_forces().y_axes()), after)

    def _as_rigid_body(self, pose: Pose) -> dict[str, Any]:
        kwargs = self.constructor_kwargs()
        for key in ("start", "end"):
            if kwargs.get(key) is not None:
                kwargs[key] = pose.point(self.root, kwargs[key])
        if kwargs.get("nodes") is not None:
            kwargs["nodes"] = [pose.point(self.root, point) for point in kwargs["nodes"]]
        if kwargs.get("axis") is not None:
            kwargs["axis"] = pose.rotated(self.root, kwargs["axis"])
        kwargs["y_axis"] = _one_or_each(self.y_axes() @ pose.rotations[pose.number[self.root]].T)
        return kwargs


def _one_or_each(y_axes: Array) -> Array:
    """A direction (3,) if it is that of all elements, else one for each (elements, 3)."""
    return np.asarray(y_axes[0] if np.abs(y_axes - y_axes[0]).max() == 0.0 else y_axes)


def make(
    name: str, a: str | None, b: str | None, section: Any, material: Any, start: Any = None, end: Any = None,
    axis: Any = None, length: Any = None, nodes: Any = None, elements: Any = None, shear: Any = False,
    y_axis: Any = None, alpha: Any = 0.0, beta: Any = 0.0, damping_ratio: Any = 0.0, displacements: Any = None,
    second_order: Any = True,
) -> Beam:  # fmt: skip
    """Check the values of a beam and build it."""
    who = f"beam '{name}'"
    shape, material = _sections.make(section, who), _material.make(material, who)
    check_flags(who, shear, second_order)
    properties = shape.properties(material.poisson)
    if shear and (properties.ky is None or properties.kz is None):
        raise ModelError(f"{who}: shear=True needs the section's shear factors ky and kz; give them (5/6 for a "
                         f"rectangle), or use a tube, circle or rectangle.", element=who, field="section")  # fmt: skip
    rayleigh = checked_damping(who, "alpha", alpha), checked_damping(who, "beta", beta)
    ratio = checked_damping(who, "damping_ratio", damping_ratio)
    if axis is not None or length is not None:
        axis, length, far_end = end_along(who, start, end, axis, length)
        (start, _), nodes, points, elements = points_of(who, start, far_end, nodes, elements)
    else:
        (start, end), nodes, points, elements = points_of(who, start, end, nodes, elements)
    if y_axis is not None:
        y_axis = y_axis_of(who, y_axis, len(points) - 1)
    if displacements is not None:
        displacements = checked_displacements(who, displacements, len(points))
    beam = Beam(name, a, b, shape, material, start, end, axis, length, nodes, elements, shear, y_axis, *rayleigh, ratio,
                displacements, second_order, points)  # fmt: skip
    check_lines(who, points, y_axis, beam.lines)
    if a is not None and a == b and len(points) == 2:
        raise ModelError(f"{who}: both ends are on '{a}' and nothing between them can move; give it more elements, "
                         f"or another body (None: a free end).", element=who, field="b")  # fmt: skip
    return beam
