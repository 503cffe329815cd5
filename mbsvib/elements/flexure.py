"""Flexures: leaf springs and notch hinges between two bodies, with the closed-form stiffness of a bar.

A flexure is a beam of one element. z of its axes is along it, y along its width; it is soft in bending about y and in
displacement along x. In the element's axes, x along it, these are the axes z, y and -x.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.common.arrays import Array
from mbsvib.elements import material as _material
from mbsvib.elements.beam import Beam
from mbsvib.elements.beam_element import Element, Prismatic, check_flags, checked_damping, checked_displacements
from mbsvib.elements.beam_variants import MATERIAL
from mbsvib.elements.connection import check_ends
from mbsvib.elements.elastic_part import bent_nodes, is_unmoved, refuse_other_root
from mbsvib.elements.material import Material
from mbsvib.elements.notch_element import NotchElement
from mbsvib.elements.part import derived
from mbsvib.elements.placement import Placement
from mbsvib.elements.pose import Pose
from mbsvib.elements.roles import POINT, TURN, ParameterField
from mbsvib.elements.sections import Checked, Properties, built, rectangle_torsion, with_fields
from mbsvib.errors import AccuracyWarning, nearest
from mbsvib.linalg.components import add, product, scale, subtract, transpose
from mbsvib.linalg.components import exponential as turned_by
from mbsvib.linalg.rotations import exponential

# Neck over the depth of the cuts below which the Gauss points of a notch are too few for 12 digits.
THINNEST = 1e-3
# Compression over that of buckling from which on the stiffness of one element is off by more than 0.6 %.
COMPRESSED = 0.5


@dataclass(frozen=True, slots=True)
class Leaf(Checked):
    """A leaf spring of constant section: ``length``, ``width`` and ``thickness`` [m], thickness <= width."""

    length: float
    width: float
    thickness: float

    @property
    def doubtful(self) -> Any:
        """Whether it is thicker than wide."""
        return self.thickness > self.width

    def __post_init__(self) -> None:
        super(Leaf, self).__post_init__()
        if self.doubtful:
            raise check.refuse("leaf", "thickness", self.thickness, f"at most the width, {self.width:g} m")

    def properties(self, nu: float) -> Properties:
        """Return the properties of its section for Poisson's ratio, with the torsion constant of clamped ends and shear
        factors 5/6.

        J = J_r / (1 - tanh(x) / x),  x = L / b sqrt(12 G / E) = L / b sqrt(6 / (1 + nu))

        J_r is that of the rectangle; the ends hold its warping.

        Source: Meijaard, Brouwer, Jonker, Multibody Syst. Dyn. 23 (2010), 271-289; Vlasov's theory with the warping
        constant b^3 t^3 / 144.
        """
        b, t = self.width, self.thickness
        x = self.length / b * np.sqrt(6.0 / (1.0 + nu))
        return Properties(b * t, b * t**3 / 12.0, t * b**3 / 12.0, rectangle_torsion(b, t) / (1.0 - np.tanh(x) / x),
                          5.0 / 6.0, 5.0 / 6.0)  # fmt: skip

    @property
    def extent(self) -> float:
        """Its length [m]."""
        return self.length

    def element(self, length: float, material: Material, shear: bool) -> Element:
        """Return the element of this shape stretched to a length [m]."""
        return Prismatic(length, self.properties(material.poisson), material, shear)


@dataclass(frozen=True, slots=True)
class _Cut(Checked):
    """A hinge that is cut from both sides of a bar, of ``width`` and of ``thickness`` at its neck [m]."""

    width: float
    thickness: float

    def profile(self) -> tuple[float, float, float]:
        """Return half the length of the straight neck, and the half axes of the ellipses along and across it [m]."""
        raise NotImplementedError

    @property
    def extent(self) -> float:
        """Its length [m]."""
        flat, along, _ = self.profile()
        return 2.0 * (flat + along)

    @property
    def _too_thin(self) -> Any:
        return self.thickness < THINNEST * self.profile()[2]

    @property
    def doubtful(self) -> Any:
        """Whether its neck is too thin for the points along it."""
        return self._too_thin

    def element(self, length: float, material: Material, shear: bool) -> Element:
        """Return the element of this shape stretched to a length [m]; it always has shear deformation."""
        (flat, along, deep), stretch = self.profile(), length / self.extent
        if np.any(self._too_thin):
            expected = f"at least {THINNEST:g} of the depth of the cuts, {deep:g} m"
            raise check.refuse(type(self).__name__.lower(), "thickness", self.thickness, expected)
        return NotchElement(flat * stretch, along * stretch, deep, self.thickness, self.width, material)


@dataclass(frozen=True, slots=True)
class Notch(_Cut):
    """A circular notch hinge: cuts of ``radius`` R, neck ``thickness`` t, ``width`` b [m]; its length is 2 R."""

    radius: float

    def profile(self) -> tuple[float, float, float]:
        """Return half the length of the straight neck, and the half axes of the ellipses along and across it [m].

        Source: Paros, Weisbord, How to design flexure hinges, Machine Design 37 (1965), 151-156.
        """
        return 0.0, self.radius, self.radius


@dataclass(frozen=True, slots=True)
class Elliptic(_Cut):
    """An elliptic notch hinge: cuts of ``length`` and ``depth``, neck ``thickness``, ``width`` [m]."""

    length: float
    depth: float

    def profile(self) -> tuple[float, float, float]:
        """Return half the length of the straight neck, and the half axes of the ellipses along and across it [m].

        Source: Smith, Badami, Dale, Xu, Elliptical flexure hinges, Rev. Sci. Instrum. 68 (1997), 1474-1483.
        """
        return 0.0, 0.5 * self.length, self.depth


@dataclass(frozen=True, slots=True)
class CornerFilleted(_Cut):
    """A hinge of ``length``: a neck of ``thickness``, quarter circles of ``radius`` at its corners, ``width`` [m]."""

    length: float
    radius: float

    @property
    def doubtful(self) -> Any:
        """Whether its corners are longer than it, or its neck is too thin."""
        return self._too_wide | self._too_thin

    @property
    def _too_wide(self) -> Any:
        return self.radius > 0.5 * self.length

    def __post_init__(self) -> None:
        super(CornerFilleted, self).__post_init__()
        if self._too_wide:
            raise check.refuse("corner-filleted hinge", "radius", self.radius, f"at most half the length, "
                               f"{0.5 * self.length:g} m")  # fmt: skip

    def profile(self) -> tuple[float, float, float]:
        """Return half the length of the straight neck, and the half axes of the ellipses along and across it [m].

        Source: Lobontiu, Compliant Mechanisms: Design of Flexure Hinges (2003), section 2.3.
        """
        return 0.5 * self.length - self.radius, self.radius, self.radius


Shape = Leaf | Notch | Elliptic | CornerFilleted
SHAPES: dict[str, type[Shape]] = {
    "leaf": Leaf, "notch": Notch, "elliptic": Elliptic, "corner_filleted": CornerFilleted,
}  # fmt: skip
_NAMES = {shape: name for name, shape in SHAPES.items()}


@dataclass(frozen=True, slots=True)
class Flexure(Beam):
    """A flexure of some ``shape`` whose ends the bodies ``a``, at -z, and ``b``, at +z, hold clamped.

    ``position`` is its middle [m] without forces and ``orientation`` its axes (columns), in the frame of its ``root``.
    ``displacements`` (2, 6) are those of its ends relative to the flexure without forces.
    """

    section: Any = field(repr=False, compare=False, metadata={"derived": True})  # its shape
    start: None = derived()
    end: None = derived()
    axis: None = derived()
    length: None = derived()
    nodes: None = derived()
    elements: None = derived()
    y_axis: Any = derived()
    shape: Any = None
    position: Vector = (0.0, 0.0, 0.0)
    orientation: Matrix3 = check.IDENTITY

    def constructor_kwargs(self) -> dict[str, Any]:
        """Return the arguments of ``add_flexure`` that make this part, except those at their default."""
        result: dict[str, Any] = {"name": self.name, "a": self.a, "b": self.b, "shape": shape_kwargs(self.shape),
                  "material": self.material.constructor_kwargs(), "position": self.position}  # fmt: skip
        if self.orientation is not check.IDENTITY:
            result["orientation"] = self.orientation
        optional = ("shear", "alpha", "beta", "damping_ratio", "displacements")
        given = {key: value for key in optional if (value := getattr(self, key)) not in (None, False, 0.0)}
        return result | given | ({} if self.second_order else {"second_order": False})

    def parameter_fields(self) -> Iterator[ParameterField]:
        """Yield numbers of material and shape, its place and orientation, and its damping."""
        for item in super(Flexure, self).parameter_fields():
            if item.name == "alpha":
                yield POINT.field("position", self.position)
                yield TURN.field("orientation", self.orientation)
            yield item

    @property
    def places(self) -> frozenset[str]:
        """Numbers that put its ends elsewhere."""
        return frozenset({"position", "orientation", "radius" if isinstance(self.shape, Notch) else "length"})

    def of_variants(self, values: Mapping[str, Array]) -> Self:
        """Return the flexure with the numbers of many variants, unchecked; see ``Beam.of_variants``."""
        return with_fields(super(Flexure, self).of_variants(values), {"shape": with_fields(self.shape, values)})

    def nodes_of_variants(self, values: Mapping[str, Array]) -> dict[str, Any]:
        """Return its points and the direction of its width; see ``Beam.nodes_of_variants``."""
        half, axes = 0.5 * with_fields(self.shape, values).extent, self.orientation
        if "orientation" in values:
            axes = product(turned_by(tuple(values["orientation"])), axes)
        _, width, along = transpose(axes)
        centre = tuple(values.get("position", self.position))
        return {"points": (subtract(centre, scale(half, along)), add(centre, scale(half, along))), "y_axis": width}

    def with_values(self, values: Mapping[str, Any]) -> Flexure:
        kwargs = self.constructor_kwargs()
        for key, value in values.items():
            if key == "orientation":
                kwargs[key] = check.rotated(value, self.orientation)
            elif key in MATERIAL:
                kwargs["material"][key] = value
            else:
                (kwargs["shape"] if key in kwargs["shape"] else kwargs)[key] = value
        return make(**kwargs)

    @property
    def summary(self) -> str:
        """Its name and kind."""
        return f"flexure '{self.name}': {_NAMES[type(self.shape)]}"

    def element(self, length: float) -> Element:
        """Return what it is made of, stretched to a length [m]."""
        result: Element = self.shape.element(length, self.material, self.shear)
        return result

    def check_compression(self, share: float) -> None:
        """Warn of a flexure that nearly buckles, where one element is too stiff: 0.6 % at half of that load, 2 % at
        0.7, 10 % at 0.9; ``share`` is the compression over that at which it buckles sideways with its ends guided.
        """
        if share > COMPRESSED:
            warnings.warn(f"flexure '{self.name}': its compression is {share:.2g} of that at which it buckles "
                          f"sideways, where its stiffness is more than 0.6 % too large; describe it by add_beam with "
                          f"several elements.", AccuracyWarning, stacklevel=2)  # fmt: skip

    def without_forces(self) -> Flexure:
        """Return the flexure without forces, in the frame of its root in this pose."""
        return self if self.displacements is None else _between(replace(self, displacements=None))

    def placed(self, to: Placement) -> dict[str, Any]:
        refuse_other_root(self, to)
        kwargs = {"a": to.body(self.a), "b": to.body(self.b), "position": to.point(self.position),
                  "orientation": to.axes(self.orientation, 0)}  # fmt: skip
        return kwargs if self.displacements is None else kwargs | {
            "displacements": [to.six(six) for six in self.displacements]}  # fmt: skip

    def in_pose(self, pose: Pose, relaxed: bool) -> Flexure:
        if is_unmoved(self, pose):
            return self
        before = np.zeros((2, 6)) if self.displacements is None else np.array(self.displacements)
        points, after, bends = bent_nodes(self, before, pose)
        bends = bends or self.displacements is not None
        moved = replace(self, position=pose.point(self.root, self.position),
                        orientation=pose.rotated_axes(self.root, self.orientation),
                        displacements=tuple([tuple(six) for six in after.tolist()]) if bends else None)  # fmt: skip
        return replace(_between(moved), points=tuple([(x, y, z) for x, y, z in points.tolist()]))


def _between(part: Flexure) -> Flexure:
    """The same flexure with the points of its ends and the direction of its width, as its other fields tell."""
    axes, half = np.array(part.orientation), 0.5 * part.shape.extent
    ends: Array = np.array(part.position) + np.outer((-half, half), axes[:, 2])
    width = axes[:, 1]
    if part.displacements is not None:
        six = np.array(part.displacements)
        ends, width = ends + six[:, :3], exponential(0.5 * (six[0, 3:] + six[1, 3:])) @ width
    return replace(part, points=tuple([tuple(point) for point in ends.tolist()]), y_axis=tuple(width.tolist()))


def make(
    name: str, a: str, b: str, shape: Any, material: Any, position: Any = (0.0, 0.0, 0.0), orientation: Any = None,
    shear: Any = False, alpha: Any = 0.0, beta: Any = 0.0, damping_ratio: Any = 0.0, displacements: Any = None,
    second_order: Any = True,
) -> Flexure:  # fmt: skip
    """Check the values of a flexure and build it."""
    who = f"flexure '{name}'"
    check_ends(who, a, b)
    form, stuff = _shape(shape, who), _material.make(material, who)
    check_flags(who, shear, second_order)
    damping = [checked_damping(who, word, value) for word, value in (
        ("alpha", alpha), ("beta", beta), ("damping_ratio", damping_ratio))]  # fmt: skip
    if displacements is not None:
        displacements = checked_displacements(who, displacements, 2)
    part = Flexure(name, a, b, form, stuff, shear=shear, alpha=damping[0], beta=damping[1], damping_ratio=damping[2],
                   displacements=displacements, second_order=second_order, shape=form,
                   position=check.vector(position, who, "position"),
                   orientation=check.orientation(orientation, who))  # fmt: skip
    form.element(form.extent, stuff, shear)
    return _between(part)


def _shape(value: Any, who: str) -> Shape:
    """A shape, or one from a dict such as {"type": "leaf", "length": ..., "width": ..., "thickness": ...}."""
    if isinstance(value, Shape):
        return value
    kwargs: dict[str, Any] = dict(value) if hasattr(value, "keys") else {}
    kind = kwargs.pop("type", None)
    if kind not in SHAPES:
        raise check.refuse(who, "shape", value, f"a dict whose type is one of {', '.join(SHAPES)}, such as {{'type': "
                           "'leaf', 'length': 0.05, 'width': 0.02, 'thickness': 0.0005}",
                           nearest(str(kind), SHAPES).strip())  # fmt: skip
    result: Shape = built(SHAPES[kind], kwargs, who, "shape")
    return result


def shape_kwargs(shape: Shape) -> dict[str, Any]:
    """Return the dict from which the same shape is made."""
    return {"type": _NAMES[type(shape)]} | {item.name: getattr(shape, item.name) for item in fields(shape)}
