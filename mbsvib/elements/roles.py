"""Roles of the fields of parts: what each is, which body carries it, and so what other poses, places and values make
of it.

A family states the role of each field once, in ``roles``, in the order of its parameters. From there follow the names
and units of its parameters, itself with other values, in another pose and as a mirrored copy, and what batches check.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array, Bools
from mbsvib.common.fast_init import fast_init

# Where parts might refuse values (..., parts, variants) of a field, from nominal ones (..., parts, 1) by field.
Doubtful = Callable[[Mapping[str, Array], str, Mapping[str, Array]], Bools | bool]

Index = tuple[int, ...]
Unit = str | Callable[[Index], str]


@fast_init
@dataclass(frozen=True, slots=True)
class ParameterField:
    """A field of a part whose values are parameters: a number, a vector or a 6x6 matrix as tuples.

    ``suffixes`` name the entries of a vector or matrix. ``unit`` is the unit of all entries, or a function of the
    index.
    """

    name: str
    value: Any
    unit: Unit
    suffixes: tuple[str, ...] | None = None

    @property
    def is_symmetric(self) -> bool:
        """Whether it is a symmetric matrix, whose pairs of entries are one number each."""
        return self.suffixes is not None and isinstance(self.value[0], tuple) and not is_unsymmetric(self.value)

    @property
    def places(self) -> tuple[tuple[str, Index, str], ...]:
        """Suffix, index and unit of each entry, of a symmetric matrix those of the upper triangle."""
        return _places(self.suffixes, self.unit, self.suffixes is not None and isinstance(self.value[0], tuple),
                       self.is_symmetric)  # fmt: skip

    def entries(self) -> Iterator[tuple[str, Index, float, str]]:
        """Yield suffix, index, value and unit of each of the ``places``."""
        for suffix, index, unit in self.places:
            value = self.value
            for i in index:
                value = value[i]
            yield suffix, index, value, unit


@lru_cache(maxsize=256)
def _places(
    suffixes: tuple[str, ...] | None, unit: Unit, matrix: bool, symmetric: bool
) -> tuple[tuple[str, Index, str], ...]:
    indices: list[Index] = [()] if suffixes is None else [(i,) for i in range(len(suffixes))]
    if matrix:
        indices = [(i, j) for i in range(6) for j in range(i if symmetric else 0, 6)]
    return tuple([("".join([f".{suffixes[i]}" for i in dict.fromkeys(index)]) if suffixes else "", index,
                   unit(index) if callable(unit) else unit) for index in indices])  # fmt: skip


def is_unsymmetric(value: Any) -> bool:
    """Tell whether a coefficient is a matrix, rows as tuples, that differs from its transpose."""
    return isinstance(value[0], tuple) and value != tuple(zip(*value, strict=True))


def _becomes_zero(nominal: Mapping[str, Array], field: str, values: Mapping[str, Array]) -> Bools:
    """Where an entry is zero that is not so in the part."""
    zero = (values[field] == 0.0) & (nominal[field] != 0.0)
    return np.asarray(zero.any(axis=tuple(range(zero.ndim - 2))))


@dataclass(frozen=True, slots=True)
class Role:
    """What a field is.

    ``unit`` is that of its parameters, of vectors and matrices with ``suffixes``; without one it is no parameter. A
    ``turn`` is a rotation vector from what the field is. ``on`` is the field that names the body with which it goes, if
    that of the name ``follows`` is true or there is none; ``moved`` and ``placed`` are the methods of ``Pose`` and
    ``Placement`` that return its value in another pose and in a copy, where it is another one. ``checked``: other
    fields follow from it, so that a part in another pose is checked anew. ``batched``: many variants can have other
    values at once; None: if the family says so. ``signed``: a part accepts all values with the signs of its own; of
    others ``doubtful`` tells where it might refuse them.
    """

    unit: Unit | None = None
    suffixes: tuple[str, ...] | None = None
    turn: bool = False
    on: str = ""
    follows: str = ""
    moved: str = ""
    placed: str = ""
    checked: bool = False
    batched: bool | None = None
    signed: bool = True
    doubtful: Doubtful = _becomes_zero

    def field(self, name: str, value: Any) -> ParameterField:
        """Return a field of this role with a value."""
        assert self.unit is not None
        return ParameterField(name, (0.0, 0.0, 0.0) if self.turn else value, self.unit, self.suffixes)


def number(unit: str, *, positive: bool = False, signed: bool = True) -> Role:
    """Return the role of a number; ``positive``: it may be refused where it is not above zero."""
    return Role(unit, signed=signed, doubtful=_not_positive if positive else _becomes_zero if signed else _always)


def point(on: str = "", *, other: str = "", batched: bool | None = None) -> Role:
    """Return the role of a point [m], world axes, ``on`` the body that a field names, or in the world.

    ``other`` is the field of the point at the other end of a line through both.
    """
    def no_line(nominal: Mapping[str, Array], field: str, values: Mapping[str, Array]) -> Bools | bool:
        far = values.get(other, nominal.get(other)) if other else None
        if far is None:
            return False
        line = np.abs(values[field] - far)
        return np.asarray(~line.any(axis=0) | ~np.isfinite(line).all(axis=0))

    return Role("m", DIRECTIONS[:3], on=on, moved="point", placed="point", checked=bool(other), batched=batched,
                signed=not other, doubtful=no_line)  # fmt: skip


def vector(unit: str, *, axial: bool = False, on: str = "", follows: str = "") -> Role:
    """Return the role of a vector in world axes: a polar one, such as a force, or an ``axial`` one.

    It turns with the body that the field ``on`` names where the field ``follows`` is true.
    """
    return Role(unit, DIRECTIONS[:3], on=on, follows=follows, moved="rotated_vector",
                placed="axial" if axial else "vector")  # fmt: skip


def axis(on: str = "", *, axial: bool = True) -> Role:
    """Return the role of a unit vector that turns with a body: an ``axial`` one, such as that of a spin, or a line."""
    return replace(vector("", axial=axial, on=on), unit=None, suffixes=None, checked=True)


def axes(on: str) -> Role:
    """Return the role of an ``orientation``, axes as columns that turn with a body; its parameters are a turn [rad]."""
    return Role("rad", DIRECTIONS[3:], True, on, moved="rotated_axes", placed="axes", doubtful=_never)


def six(units: tuple[str, str, str], *, wrench: bool = False) -> Role:
    """Return the role of six values or of a 6x6 matrix on x y z rx ry rz, in axes of the part.

    ``units`` are those of entries between two translations, a translation and a rotation, and two rotations. Six
    coefficients are those of squares, so that they are the same in a mirrored copy; six components of a ``wrench`` are
    not.
    """
    return Role(lambda index: units[sum(i > 2 for i in (*index, index[0])[:2])], DIRECTIONS,
                placed="local" if wrench else "matrix")  # fmt: skip


def _not_positive(_: Mapping[str, Array], field: str, values: Mapping[str, Array]) -> Bools:
    return np.asarray(~(values[field] > 0.0))


def _always(*_: Any) -> bool:
    return True


def _never(*_: Any) -> bool:
    return False


def stated(**roles: Role) -> Mapping[str, Role]:
    """Return the roles of the fields of a family, by name."""
    return MappingProxyType(roles)


def batched(**roles: Role) -> Mapping[str, Role]:
    """Return the roles of the fields of a family whose numbers the equations of batches read, by name."""
    return stated(**{name: replace(role, batched=role.batched is None) for name, role in roles.items()})


# A field that names a body.
BODY = Role(placed="body")
POINT, TURN = point(), axes("name")
# Stiffness and damping of bushings.
STIFFNESS, DAMPING = six(("N/m", "N/rad", "N m/rad")), six(("N s/m", "N s/rad", "N m s/rad"))
