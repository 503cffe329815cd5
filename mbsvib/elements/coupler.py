"""Couplers: linear relations between joint coordinates, such as gears and racks.

The constraint of a coupler is sum of c_i q_i = 0 for displacements from the reference pose; ``terms`` are the pairs
(q_i, c_i). q_i is a joint's coordinate "JOINT.direction", the motion of its second body relative to its first, of
joints in the spanning tree and of cut joints.

In any pose the constraint is sum of c_i (q_i - q_i of the reference pose) = 0, where q_i is

- the angle [rad] of a revolute, cylindrical or screw joint, full turns included;
- the displacement [m] along z of a prismatic or cylindrical joint;
- one of the two angles of a universal joint (about ``axis`` in the first body, then ``axis2`` in the second) or of
  another joint with two successive rotations;
- for any other joint a component of p_b - p_a or of the rotation vector from the first to the second body, in its axes,
  which are fixed in the first body.

A coupler with curvature is of a relation that is not linear, known to second order in the reference pose only:
sum of c_i q_i + sum of h_k q_k^2 / 2 = 0. Its force at rest makes stiffness of h (``equations.coupler_curvature``); in
other poses it is refused.

In another pose the components of a rotation vector are no linear function of the coordinates. Therefore mechanisms with
couplers on homokinetic joints cannot be moved, nor others across the component that is coupled. A coupler of ``rates``
relates velocities in each pose instead, with those of a rotation vector's components the angular velocity along the
joint's axes there; positions do not follow from it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, Self, TypeVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Bools
from mbsvib.elements.joint import Joint
from mbsvib.elements.part import Part, derived
from mbsvib.elements.placement import Placement
from mbsvib.elements.roles import ParameterField
from mbsvib.errors import ModelError, nearest

Terms = tuple[tuple[str, float], ...]
ROTATIONS, TRANSLATIONS = ("rx", "ry", "rz"), ("x", "y", "z")


@dataclass(frozen=True, slots=True)
class Coupling(Part):
    """The base class of couplers: ``terms`` are pairs (coordinate, coefficient), the sum of their products is zero."""

    symbol = "coupler"
    unit = ""  # of its factor; empty where numbers of any unit are given
    terms: Terms = derived(())

    def placed(self, to: Placement) -> Self:
        """Return its copy; between coordinates of which one changes its sign in a mirrored copy, its factor does."""
        raise NotImplementedError

    @property
    def curvatures(self) -> Terms | None:
        """Second derivatives of the relation by coordinates at the reference pose; None if it is linear everywhere."""
        return None

    @property
    def of_rates(self) -> bool:
        """Whether it relates velocities in each pose, and not displacements from the reference pose."""
        return False

    def coefficients_of(self, values: Mapping[str, Array]) -> Array:
        """Return the coefficients (terms, variants) of its terms for new ``values`` by field, with the variants on the
        last axis.
        """
        return values["coefficient"]

    def suspects(self, values: Mapping[str, Array]) -> Bools | bool:
        return np.asarray(~self.coefficients_of(values).all(axis=0))


@dataclass(frozen=True, slots=True)
class Coupler(Coupling):
    """A linear relation, sum of coefficient times coordinate = 0; ``coefficients`` are pairs (coordinate, number).

    ``curvature``: pairs (coordinate, second derivative) of a relation that is not linear, which holds to second order
    about the reference pose; None for a linear one. ``rates``: whether it relates velocities in each pose.
    """

    coefficients: Terms = ()
    curvature: Terms | None = None
    rates: bool = False

    @property
    def curvatures(self) -> Terms | None:
        return self.curvature

    @property
    def of_rates(self) -> bool:
        return self.rates

    def constructor_kwargs(self) -> dict[str, Any]:
        """Return the arguments of ``add_coupler`` that make this part."""
        return {"name": self.name, "coefficients": dict(self.coefficients), "rates": self.rates,
                "curvature": None if self.curvature is None else dict(self.curvature)}  # fmt: skip

    batched_fields = frozenset({"coefficient"})
    signed_fields = batched_fields

    def parameter_fields(self) -> Iterator[ParameterField]:
        suffixes = tuple(str(i + 1) for i in range(len(self.coefficients)))
        yield ParameterField("coefficient", tuple(value for _, value in self.coefficients), "-", suffixes)

    def with_values(self, values: Mapping[str, Any]) -> Coupler:
        terms = {name: value for (name, _), value in zip(self.coefficients, values["coefficient"], strict=True)}
        return _coupler(self.name, terms, self.curvature, self.rates)

    def placed(self, to: Placement) -> Coupler:
        terms = [(*_placed(name, to), value) for name, value in self.coefficients]
        first = terms[0][1]
        curvature = None if self.curvature is None else tuple(
            [(_placed(name, to)[0], first * value) for name, value in self.curvature])  # fmt: skip
        return _coupler(to.name(self.name), {name: first * sign * value for name, sign, value in terms}, curvature,
                        self.rates)  # fmt: skip


class Transmission(Coupling):
    """Two coordinates in a fixed ratio, the second a factor times the first: the three fields of a family after
    ``terms``, in this order.

    ``directions`` are those of both coordinates; the factor has the ``unit`` and is what is ``expected``.
    """

    __slots__ = ()
    directions = (ROTATIONS, ROTATIONS)
    unit = "-"
    expected = ""

    @property
    def batched_fields(self) -> frozenset[str]:
        return frozenset({_names(type(self))[2]})

    @property
    def signed_fields(self) -> frozenset[str]:
        return self.batched_fields

    def coefficients_of(self, values: Mapping[str, Array]) -> Array:
        factor = values[_names(type(self))[2]]
        return np.stack((-factor, np.ones(len(factor))))

    def parameter_fields(self) -> Iterator[ParameterField]:
        factor = _names(type(self))[2]
        yield ParameterField(factor, getattr(self, factor), self.unit)

    def with_values(self, values: Mapping[str, Any]) -> Self:
        first, second, factor = _names(type(self))
        return _transmission(type(self), self.name, getattr(self, first), getattr(self, second), values[factor])

    def placed(self, to: Placement) -> Self:
        first, second, factor = _names(type(self))
        (a, sign), (b, other) = (_placed(getattr(self, field), to) for field in (first, second))
        return _transmission(type(self), to.name(self.name), a, b, sign * other * getattr(self, factor))


@dataclass(frozen=True, slots=True)
class Gear(Transmission):
    """Two rotations in a fixed ratio: ``second`` = ``ratio`` times ``first`` [rad/rad]."""

    expected = "turns of second per turn of first, negative where they turn against each other, and not zero"

    first: str = ""
    second: str = ""
    ratio: float = 0.0


@dataclass(frozen=True, slots=True)
class Worm(Transmission):
    """A worm and its wheel: ``wheel`` = ``ratio`` times ``worm`` [rad/rad], ratio = +-(starts / teeth)."""

    expected = "turns of the wheel per turn of the worm (starts / teeth), signed and not zero"

    worm: str = ""
    wheel: str = ""
    ratio: float = 0.0


@dataclass(frozen=True, slots=True)
class Rack(Transmission):
    """A pinion and its rack: ``rack`` [m] = ``radius`` [m, signed] times ``pinion`` [rad]."""

    directions = (ROTATIONS, TRANSLATIONS)
    unit = "m"
    expected = "the pitch radius [m], negative where the rack goes against its axis, and not zero"

    pinion: str = ""
    rack: str = ""
    radius: float = 0.0


T = TypeVar("T", bound=Transmission)


def _names(family: type[Transmission]) -> list[str]:
    """Names of the first coordinate, the second one and the factor."""
    return [item.name for item in fields(family)[2:]]


def _placed(coordinate: str, to: Placement) -> tuple[str, float]:
    """Name of a coordinate of a copy, and the sign by which it differs from the original."""
    joint, _, direction = coordinate.rpartition(".")
    part: Any = to.parts[joint]
    return to.name(coordinate), part.coordinate_sign(direction, to)


def _coupler(name: str, terms: Mapping[str, Any], curvature: Terms | None, rates: bool) -> Coupler:
    checked = tuple((coordinate, _not_zero(value, f"coupler '{name}'", "coefficients",
                                           f"a finite number for '{coordinate}', not zero: leave it out"))
                    for coordinate, value in terms.items())  # fmt: skip
    return Coupler(name, checked, checked, curvature, rates)


def _transmission(family: type[T], name: str, first: str, second: str, factor: Any) -> T:
    number = _not_zero(factor, f"{family.__name__.lower()} '{name}'", _names(family)[2], family.expected)
    return family(name, ((first, -number), (second, 1.0)), first, second, number)  # type: ignore[call-arg]


def make_coupler(name: str, coefficients: Any, curvature: Any, rates: Any, joints: Mapping[str, Joint]) -> Coupler:
    """Check the values of a coupler and build it."""
    who = f"coupler '{name}'"
    expected = 'a coefficient for each of two or more joint coordinates, {"knee.rz": 1.0, "hip.rz": -2.0}'
    if not isinstance(coefficients, Mapping):
        raise check.refuse(who, "coefficients", coefficients, expected)
    terms: dict[str, Any] = {}
    for key, value in coefficients.items():
        coordinate = coordinate_of(key, joints, who, "coefficients")
        if coordinate in terms:
            raise check.refuse(who, "coefficients", dict(coefficients), expected, f"'{coordinate}' is given twice.")
        terms[coordinate] = value
    if len(terms) < 2:
        hint = "To lock one coordinate, take a joint that does not have it." if terms else ""
        raise check.refuse(who, "coefficients", dict(coefficients), expected, hint)
    if not isinstance(rates, bool) or (rates and curvature is not None):
        raise check.refuse(who, "rates", rates, "True or False, and False with a curvature")
    if curvature is None:
        return _coupler(name, terms, None, rates)
    expected = 'a second derivative for each of one or more joint coordinates, {"hip.rz": 0.5}'
    if not isinstance(curvature, Mapping) or not curvature:
        raise check.refuse(who, "curvature", curvature, expected)
    curves = {coordinate_of(key, joints, who, "curvature"): check.number(value, who, "curvature")
              for key, value in curvature.items()}  # fmt: skip
    return _coupler(name, terms, tuple(curves.items()), False)


def _make(family: type[T], name: str, first: Any, second: Any, factor: Any, joints: Mapping[str, Joint]) -> T:
    """Check the values of a transmission and build it."""
    who, names = f"{family.__name__.lower()} '{name}'", _names(family)
    a, b = (coordinate_of(value, joints, who, field, directions)
            for value, field, directions in zip((first, second), names, family.directions, strict=False))  # fmt: skip
    if a == b:
        raise ModelError(f"{who}: couples '{a}' with itself; name two different coordinates.",
                         element=who, field=names[1])  # fmt: skip
    return _transmission(family, name, a, b, factor)


make_gear, make_worm, make_rack = partial(_make, Gear), partial(_make, Worm), partial(_make, Rack)


def refuse_curved(parts: Iterable[Coupling], reason: str) -> None:
    """Refuse couplers of nonlinear relations, known at the reference pose only; ``reason`` says why and what to do."""
    for part in parts:
        if part.curvatures is not None:
            raise ModelError(f"coupler '{part.name}': its relation is not linear and known at the reference pose only, "
                             f"{reason}", element=part.name, field="curvature")  # fmt: skip


def coordinate_of(
    value: Any, joints: Mapping[str, Joint], who: str, field: str,
    directions: tuple[str, ...] = TRANSLATIONS + ROTATIONS,
) -> str:  # fmt: skip
    """Return the name "JOINT.direction" of a coordinate; "JOINT" is enough for a joint with one coordinate.

    ``value``: name of a coordinate, or a joint or its name.
    """
    kinds: dict[tuple[str, ...], str] = {ROTATIONS: "a rotation", TRANSLATIONS: "a translation"}
    kind = kinds.get(directions, "a coordinate")
    key = value if isinstance(value, str) else getattr(value, "name", value)
    expected = f"{kind} of a joint, as JOINT.{directions[-1]}"
    if not isinstance(key, str):
        raise check.refuse(who, field, value, expected)
    name, _, direction = key.rpartition(".")
    if key in joints:
        name, direction = key, ""
    joint = joints.get(name)
    if joint is None:
        known = [*joints, *(f"{other.name}.{d}" for other in joints.values() for d, _ in other.freedom)]
        raise check.refuse(who, field, value, expected, nearest(key, known).strip() or
                           "Add joints before what couples them.")  # fmt: skip
    free = [d for d, _ in joint.freedom if d in directions]
    if direction in free or (not direction and len(free) == 1):
        return f"{name}.{direction or free[0]}"
    has = ", ".join(d for d, _ in joint.freedom) or "none"
    raise check.refuse(who, field, value, expected, f"The {joint.kind} joint '{name}' has the coordinates {has}.")


def _not_zero(value: Any, who: str, field: str, expected: str) -> float:
    number = check.number(value, who, field, expected)
    if number == 0.0:
        raise check.refuse(who, field, value, expected)
    return number
