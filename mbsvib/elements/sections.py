"""Cross sections of beams: area, second moments, torsion constant and shear factors, in closed form.

The section's axes are the beam's local y and z; Iy = integral of z^2 dA belongs to bending in the x-z plane.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from functools import cache
from math import pi
from typing import Any, TypeVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.errors import ModelError, nearest

R = TypeVar("R")

# Odd numbers n of the series of torsion; e^(-pi n) of the next one is below 1e-55.
ODD = np.arange(1.0, 41.0, 2.0)


@dataclass(frozen=True, slots=True)
class Properties:
    """Area ``A`` [m^2], second moments ``Iy`` and ``Iz`` and torsion constant ``J`` [m^4], and shear factors ``ky`` and
    ``kz`` (None: not known) for forces along y and z.
    """

    A: float
    Iy: float
    Iz: float
    J: float
    ky: float | None
    kz: float | None


class Checked:
    """What has numbers that are positive; those that are None by default may be so."""

    __slots__ = ()

    @property
    def doubtful(self) -> Any:
        """Whether positive numbers, also arrays of them, do not fit together."""
        return False

    def __post_init__(self) -> None:
        family: Any = type(self)
        for item in fields(family):
            value = getattr(self, item.name)
            if value is None and item.default is None:
                continue
            value = check.number(value, family.__name__.lower(), item.name)
            if value <= 0.0:
                raise check.refuse(family.__name__.lower(), item.name, value, "a positive number")
            object.__setattr__(self, item.name, value)


@dataclass(frozen=True, slots=True)
class Section(Checked):
    """A section by its properties: A [m^2], Iy, Iz, J [m^4]; shear factors are needed by beams with shear."""

    A: float
    Iy: float
    Iz: float
    J: float
    ky: float | None = None
    kz: float | None = None

    def properties(self, nu: float) -> Properties:
        """Return the properties.

        Parameters
        ----------
        nu : float
            Poisson's ratio, on which shear factors depend.

        Returns
        -------
        Properties
            Area, second moments, torsion constant and shear factors.
        """
        return Properties(self.A, self.Iy, self.Iz, self.J, self.ky, self.kz)


@dataclass(frozen=True, slots=True)
class Circle(Checked):
    """A solid circle of ``radius`` [m]; default shear factors after Cowper."""

    radius: float
    ky: float | None = None
    kz: float | None = None

    def properties(self, nu: float) -> Properties:
        """Return the properties; shear factor 6 (1 + nu) / (7 + 6 nu) (Cowper, 1966).

        Parameters
        ----------
        nu : float
            Poisson's ratio, on which shear factors depend.

        Returns
        -------
        Properties
            Area, second moments, torsion constant and shear factors.
        """
        area, bending, factor = pi * self.radius**2, 0.25 * pi * self.radius**4, 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu)
        return Properties(area, bending, bending, 2.0 * bending, *_factors(self, factor))


@dataclass(frozen=True, slots=True)
class Tube(Checked):
    """A circular tube of outer ``radius`` and thickness ``wall`` [m]; default shear factors after Cowper."""

    radius: float
    wall: float
    ky: float | None = None
    kz: float | None = None

    @property
    def doubtful(self) -> Any:
        """Whether it has no place for its wall."""
        return self.wall > self.radius

    def __post_init__(self) -> None:
        super(Tube, self).__post_init__()
        if self.doubtful:
            raise check.refuse("tube", "wall", self.wall, f"at most the outer radius {self.radius:g} m")

    def properties(self, nu: float) -> Properties:
        """Return the properties; shear factor of a thick tube (Cowper, 1966).

        Parameters
        ----------
        nu : float
            Poisson's ratio, on which shear factors depend.

        Returns
        -------
        Properties
            Area, second moments, torsion constant and shear factors.
        """
        outer, inner = self.radius, self.radius - self.wall
        area = pi * self.wall * (outer + inner)
        bending = 0.25 * area * (outer * outer + inner * inner)
        ratio = (inner / outer) ** 2
        square = (1.0 + ratio) ** 2
        factor = 6.0 * (1.0 + nu) * square / ((7.0 + 6.0 * nu) * square + (20.0 + 12.0 * nu) * ratio)
        return Properties(area, bending, bending, 2.0 * bending, *_factors(self, factor))


@dataclass(frozen=True, slots=True)
class Rectangle(Checked):
    """A rectangle, ``width`` along y and ``height`` along z [m]; default shear factors after Cowper."""

    width: float
    height: float
    ky: float | None = None
    kz: float | None = None

    def properties(self, nu: float) -> Properties:
        """Return the properties; torsion after Saint-Venant, shear factor 10 (1 + nu) / (12 + 11 nu) (Cowper, 1966).

        Parameters
        ----------
        nu : float
            Poisson's ratio, on which shear factors depend.

        Returns
        -------
        Properties
            Area, second moments, torsion constant and shear factors.
        """
        b, h = self.width, self.height
        factor = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu)
        return Properties(b * h, b * h**3 / 12.0, h * b**3 / 12.0, rectangle_torsion(b, h), *_factors(self, factor))


SHAPES: dict[str, type[Section | Circle | Tube | Rectangle]] = {
    "tube": Tube, "circle": Circle, "rectangle": Rectangle, "properties": Section,
}  # fmt: skip
Shape = Section | Circle | Tube | Rectangle
_NAMES = {shape: name for name, shape in SHAPES.items()}


def _factors(shape: Any, factor: Any) -> tuple[Any, Any]:
    """Shear factors as given, else ``factor``."""
    return (factor if shape.ky is None else shape.ky, factor if shape.kz is None else shape.kz)


def rectangle_torsion(width: Any, height: Any) -> Any:
    """Return the torsion constant of a rectangle, or of many of shapes (...) [m^4], by Saint-Venant's series.

    J = a b^3 / 3 (1 - 192 b / (pi^5 a) sum over odd n of tanh(n pi a / 2 b) / n^5),  a >= b

    With tanh x = 1 - 2 / (1 + e^2x) the sum of ones has a closed form.

    Source: Timoshenko, Goodier, Theory of Elasticity, 3rd ed., section 109.
    """
    a, b = np.maximum(width, height), np.minimum(width, height)
    decay = np.exp(-pi * ODD * (a / b)[..., None])
    # 31/32 zeta(5) is the sum over odd n of n^-5
    total = 31.0 * 1.0369277551433699263 / 32.0 - (2.0 * decay / (1.0 + decay) / ODD**5).sum(axis=-1)
    return a * b**3 / 3.0 * (1.0 - 192.0 / pi**5 * b / a * total)


def make(value: Any, who: str) -> Shape:
    """Return a section from an object of this module or from a dict such as {"type": "tube", "radius": ..., ...}."""
    if isinstance(value, Section | Circle | Tube | Rectangle):
        return value
    if not hasattr(value, "keys"):
        raise check.refuse(who, "section", value, "a Tube, Circle, Rectangle or Section, or a dict: {'type': 'tube', "
                           "'radius': 0.1, 'wall': 0.01}, {'A': ..., 'Iy': ..., 'Iz': ..., 'J': ...}")  # fmt: skip
    kwargs: dict[str, Any] = dict(value)
    kind = kwargs.pop("type", "properties")
    if kind not in SHAPES:
        expected = f"type: one of {', '.join(SHAPES)}"
        raise check.refuse(who, "section", value, expected, nearest(str(kind), SHAPES).strip())
    known = {name: {item.name for item in fields(other)} for name, other in SHAPES.items()}
    if "type" not in value and not kwargs.keys() <= known[kind]:
        fitting = sorted((len(names), name) for name, names in known.items() if kwargs.keys() <= names)
        if fitting:
            raise ModelError(f"{who}: section = {check.shown(kwargs)} has no type; expected 'type': "
                             f"'{fitting[0][1]}' beside it.", element=who, field="section")  # fmt: skip
    result: Shape = built(SHAPES[kind], kwargs, who, "section")
    return result


def constructor_kwargs(shape: Shape) -> dict[str, Any]:
    """Return the dict from which ``make`` makes the same section."""
    kind = {"type": _NAMES[type(shape)]} if not isinstance(shape, Section) else {}
    return kind | {item.name: value for item in fields(shape) if (value := getattr(shape, item.name)) is not None}


def with_fields(record: R, values: Mapping[str, Any]) -> R:
    """Return the same with those of the ``values`` that are its fields, unchecked, such as arrays of many variants."""
    result = object.__new__(type(record))
    kind: Any = type(record)
    for name in _names(kind):
        object.__setattr__(result, name, values[name] if name in values else getattr(record, name))
    return result


@cache
def _names(kind: Any) -> tuple[str, ...]:
    return tuple([item.name for item in fields(kind)])


def built(kind: type, kwargs: Mapping[str, Any], who: str, field: str) -> Any:
    """Build a section or material, with messages that name the element."""
    is_required = {item.name: item.default is MISSING for item in fields(kind)}
    for key in kwargs:
        if key not in is_required:
            raise ModelError(f"{who}: {field} has no '{key}'.{nearest(str(key), is_required)} It has "
                             f"{', '.join(is_required)}.", element=who, field=field)  # fmt: skip
    missing = [key for key, required in is_required.items() if required and key not in kwargs]
    if missing:
        raise ModelError(f"{who}: {field} = {check.shown(kwargs)} needs {', '.join(missing)}.", element=who,
                         field=field)  # fmt: skip
    try:
        return kind(**kwargs)
    except ModelError as error:
        raise ModelError(f"{who}: {field}: {error}", element=who, field=field) from error
