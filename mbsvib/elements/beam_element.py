"""A straight beam element: stiffness at its midpoint, mass as factor rows.

At its midpoint an element of length L is equal to six independent springs between its ends, in its axes (x along it):
EA/L, 12 E Iz/(L^3 (1 + phi_y)), 12 E Iy/(L^3 (1 + phi_z)), GJ/L, E Iy/L, E Iz/L. This is the exact static stiffness of
Euler-Bernoulli (phi = 0) and Timoshenko beams, phi_y = 12 E Iz/(ky G A L^2). The consistent mass matrix is F^T F with
rows F: displacements at Gauss points, which integrate it exactly, times sqrt(rho A weight).

Source: Przemieniecki, Theory of Matrix Structural Analysis (1968), sections 5.6 and 11.6.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.elements.joint_kinds import Six
from mbsvib.elements.material import Material
from mbsvib.elements.sections import Properties

# Of both planes of bending: indices of deflection and rotation of both ends in (u1, theta1, u2, theta2), and the ratio
# of slope to rotation.
PLANES = (([1, 5, 7, 11], 1.0), ([2, 4, 8, 10], -1.0))


class BentLine(NamedTuple):
    """The bent line of an element in one plane: per unit deflection d and rotation r of its end against its start,
    about the midpoint, the integrals of its squared slope less that of the chord.

    ``deflected`` [1/m] and ``turned`` [m] are those of d^2 and r^2; ``weighed`` [1] is the work in d r of the tension
    that unit weight along the element makes, beyond that of weights on straight halves.
    """

    deflected: float
    turned: float
    weighed: float


class MassPoints(NamedTuple):
    """An element's mass at points along it, in its axes: ``masses`` (n,) [kg] and ``sections`` (n, 3), the moments of
    inertia of the sections about x, y, z [kg m^2], with the rows of their displacements and rotations ``moves`` and
    ``turns`` (n, 3, 12) over (u1, theta1, u2, theta2).
    """

    masses: Array
    sections: Array
    moves: Array
    turns: Array


class Element(ABC):
    """What a beam is made of between two nodes, in the axes of the element (x along it)."""

    __slots__ = ()
    length: Any
    """Its length [m]."""

    @property
    @abstractmethod
    def mass(self) -> Any:
        """Its mass [kg]."""

    @property
    @abstractmethod
    def arm(self) -> Any:
        """Distance of the weight of either half from its node [m], of consistent nodal loads."""

    @property
    @abstractmethod
    def odd_load(self) -> tuple[Any, Any]:
        """Consistent nodal load of an acceleration that grows from the middle to unity at the end: the mass at the end
        [kg] and its distance from the node [m]; the same with the other sign at the start.
        """

    @property
    @abstractmethod
    def sections_turn(self) -> bool:
        """Whether sections turn about all axes, not only along x."""

    @abstractmethod
    def stiffness(self) -> tuple[Any, ...]:
        """Return the six stiffnesses at the midpoint, along and about the element's axes [N/m, N m/rad]."""

    @abstractmethod
    def mass_rows(self) -> Array:
        """Return the rows F (..., n, 12) of the consistent mass matrix F^T F, over (u1, theta1, u2, theta2).

        Numbers of the element may have leading axes.
        """

    @abstractmethod
    def mass_points(self) -> MassPoints:
        """Return its mass at points along it."""

    @abstractmethod
    def bent_lines(self) -> tuple[BentLine, BentLine]:
        """Return its bent lines in the planes x-y and x-z."""


@dataclass(frozen=True, slots=True)
class Prismatic(Element):
    """An element of constant section; with ``shear``, a Timoshenko beam, it has shear deformation and rotary inertia.
    """

    length: float
    section: Properties
    material: Material
    shear: bool

    @property
    def mass(self) -> float:
        return self.material.rho * self.section.A * self.length

    @property
    def arm(self) -> float:
        return self.length / 6.0

    @property
    def odd_load(self) -> tuple[float, float]:
        return 0.2 * self.mass, self.length / 12.0

    @property
    def sections_turn(self) -> bool:
        return self.shear

    @property
    def _shear_ratios(self) -> tuple[Any, Any]:
        return shear_ratios(self.length, self.section, self.material, self.shear)

    def stiffness(self) -> tuple[float, ...]:
        (phi_y, phi_z), section, material = self._shear_ratios, self.section, self.material
        e, length, cubed = material.E, self.length, self.length**3
        return (e * section.A / length, 12.0 * e * section.Iz / (cubed * (1.0 + phi_y)),
                12.0 * e * section.Iy / (cubed * (1.0 + phi_z)), material.shear_modulus * section.J / length,
                e * section.Iy / length, e * section.Iz / length)  # fmt: skip

    def mass_rows(self) -> Array:
        """Return the rows F (..., 12, 12) or (..., 18, 12), one for each Gauss point and direction."""
        section, density, length = self.section, self.material.rho, self.length
        mass, polar_inertia = density * section.A * length, density * (section.Iy + section.Iz) * length
        two, three, four, parts = gauss(2), gauss(3), gauss(4), []
        for inertia, ends in ((mass, [0, 6]), (polar_inertia, [3, 9])):
            parts.append((inertia, two.weight, ends, two.linear))
        for (indices, sign), phi, moment in zip(PLANES, self._shear_ratios, (section.Iz, section.Iy), strict=True):
            slopes = np.array([1.0, sign, 1.0, sign])
            parts.append((mass, four.weight, indices, slopes * deflection(four.deflection, length, phi)))
            if self.shear:
                turns = slopes * rotation(three.rotation, length, phi)
                parts.append((density * moment * length, three.weight, indices, turns))
        return in_columns([(indices, np.sqrt(np.asarray(inertia)[..., None] * weight)[..., None] * values)
                           for inertia, weight, indices, values in parts])  # fmt: skip

    def mass_points(self) -> MassPoints:
        """Return its mass at four Gauss points."""
        at, shares = gauss(4), gauss(4).weight
        moves, turns = np.zeros((2, len(shares), 3, 12))
        moves[:, 0, [0, 6]] = turns[:, 0, [3, 9]] = at.linear
        for (indices, sign), phi, across, about in zip(PLANES, self._shear_ratios, (1, 2), (2, 1), strict=True):
            slopes = np.array([1.0, sign, 1.0, sign])
            moves[:, across, indices] = slopes * deflection(at.deflection, self.length, phi)
            if self.shear:
                turns[:, about, indices] = sign * slopes * rotation(at.rotation, self.length, phi)
        iy, iz = self.section.Iy, self.section.Iz
        sections = self.length * self.material.rho * np.array([iy + iz, iy, iz])
        return MassPoints(self.mass * shares, shares[:, None] * sections, moves, turns)

    def bent_lines(self) -> tuple[BentLine, BentLine]:
        length = self.length
        one, other = (BentLine(0.2 * s * s / length, length / 12.0, s / 30.0 - 1.0 / 12.0)
                      for s in (1.0 / (1.0 + phi) for phi in self._shear_ratios))  # fmt: skip
        return one, other


def shear_ratios(length: float, section: Properties, material: Material, shear: bool) -> tuple[Any, Any]:
    """Return (phi_y, phi_z), the ratios of bending to shear stiffness, zero without shear deformation."""
    if not shear:
        return 0.0, 0.0
    shear_stiffness = material.shear_modulus * section.A * length * length
    assert section.ky is not None
    assert section.kz is not None
    return (12.0 * material.E * section.Iz / (section.ky * shear_stiffness),
            12.0 * material.E * section.Iy / (section.kz * shear_stiffness))  # fmt: skip


def in_columns(parts: Sequence[tuple[list[int], Array]]) -> Array:
    """Return rows (..., n, 12), those of each part (..., k, c) in its c columns, one part below the other."""
    lead = np.broadcast_shapes(*[rows.shape[:-2] for _, rows in parts])
    result = np.zeros((*lead, sum(rows.shape[-2] for _, rows in parts), 12),
                      np.result_type(*[rows for _, rows in parts]))  # fmt: skip
    start = 0
    for indices, rows in parts:
        result[..., start : start + rows.shape[-2], indices] = rows
        start += rows.shape[-2]
    return result


class Shapes(NamedTuple):
    """Shapes of an element of unit length at points x (n,), 0..1, with integration weights.

    ``linear`` (n, 2): linear shapes. ``deflection`` and ``rotation`` (2, n, 4): per deflection and rotation of either
    end, without shear and what is added per ratio of bending to shear stiffness.
    """

    x: Array
    weight: Array
    linear: Array
    deflection: Array
    rotation: Array


def shapes_at(x: Array, weight: Array) -> Shapes:
    """Return the shapes at points x (n,) with weights (n,)."""
    y = 1.0 - x
    both, none = x * y, np.zeros_like(x)
    deflection = np.array([(y * y * (1.0 + 2.0 * x), both * y, x * x * (1.0 + 2.0 * y), -both * x),
                           (y, 0.5 * both, x, -0.5 * both)])  # fmt: skip
    rotation = np.array([(-6.0 * both, y * (1.0 - 3.0 * x), 6.0 * both, x * (1.0 - 3.0 * y)), (none, y, none, x)])
    return Shapes(x, weight, np.stack((y, x), axis=-1), deflection.swapaxes(1, 2), rotation.swapaxes(1, 2))


@cache
def gauss(points: int) -> Shapes:
    """Return the shapes at Gauss points."""
    x, weight = np.polynomial.legendre.leggauss(points)
    return shapes_at(0.5 * (1.0 + x), 0.5 * weight)


def deflection(shapes: Array, length: Any, phi: Any) -> Array:
    """Return the deflection (..., n, 4) of elements of lengths (...) [m], for ratios phi (...), from (2, n, 4)."""
    return _with_shear(shapes, phi) * _per_end(length)


def rotation(shapes: Array, length: Any, phi: Any) -> Array:
    """Return the rotation (..., n, 4) of the sections of elements of lengths (...) [m], for ratios phi (...)."""
    return np.asarray(_with_shear(shapes, phi) * _per_end(length) / np.asarray(length)[..., None, None])


def _per_end(length: Any) -> Array:
    """Factors (..., 1, 4) of shapes per deflection and per rotation of either end."""
    return np.stack(np.broadcast_arrays(1.0, length, 1.0, length), axis=-1)[..., None, :]


def _with_shear(shapes: Array, phi: Any) -> Array:
    phi = np.asarray(phi)[..., None, None]
    return np.asarray((shapes[0] + phi * shapes[1]) / (1.0 + phi))


def check_flags(who: str, shear: Any, second_order: Any) -> None:
    """Refuse what is neither True nor False."""
    if type(shear) is not bool:
        raise check.refuse(who, "shear", shear, "True (Timoshenko) or False (Euler-Bernoulli)")
    if type(second_order) is not bool:
        raise check.refuse(who, "second_order", second_order, "True (slopes add to the strain) or False (linear)")


def checked_displacements(who: str, value: Any, nodes: int) -> tuple[Six, ...]:
    """Return displacements (nodes, 6) of the nodes of a beam, checked."""
    expected = f"x y z [m] and rx ry rz [rad] of each of the {nodes} nodes"
    items = check.listed(value, who, "displacements", expected)
    if len(items) != nodes:
        raise check.refuse(who, "displacements", value, expected)
    return tuple([check.numbers(item, (6,), who, "displacements", expected) for item in items])


def checked_damping(who: str, word: str, value: Any) -> float:
    """Return a coefficient of damping, which is not negative."""
    result = check.number(value, who, word)
    if result < 0.0:
        raise check.refuse(who, word, value, "a number that is not negative")
    return result
