"""A notch hinge as an element: stiffness, mass and bent lines of a bar whose thickness varies along it.

The bar is symmetric about its middle, where x = 0. Its thickness is

h(x) = t for |x| <= f,   t + 2 c (1 - sqrt(1 - ((|x| - f) / a)^2)) beyond, up to |x| = f + a,

a quarter of an ellipse on either side of a straight neck. Under a moment and a force at its ends curvature is
M / (E I), shear 1.2 V / (G A), so that about the middle its six compliances are the integrals over x of

1 / (E b h),  12 x^2 / (E b^3 h) + 1.2 / (G b h),  12 x^2 / (E b h^3) + 1.2 / (G b h),  1 / (G J),  12 / (E b h^3),
12 / (E b^3 h).

J is that of the rectangle b h at x. Mass and bent lines follow from the deflections that these loads make.

Source: Paros, Weisbord, How to design flexure hinges, Machine Design 37 (1965), 151-156 (circular); Smith, Badami,
Dale, Xu, Elliptical flexure hinges, Rev. Sci. Instrum. 68 (1997), 1474-1483; Lobontiu, Compliant Mechanisms (2003),
chapter 2 (corner-filleted).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from math import pi
from typing import Any, NamedTuple

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements.beam_element import PLANES, BentLine, Element, MassPoints, in_columns
from mbsvib.elements.material import Material
from mbsvib.elements.sections import rectangle_torsion
from mbsvib.linalg.products import concatenated

# Gauss points on the neck and on a quarter of the ellipse. Over the angle p, x = f + a sin p, integrands are smooth,
# and their peak at the neck, of the width sqrt(t / c), is at an end, where the points are dense: errors of all numbers
# are below 1e-12 for t >= 1e-3 c.
POINTS = 96
# Shear factor of a rectangle, which the published formulas have.
SHEAR = 5.0 / 6.0


class Plane(NamedTuple):
    """Static deflections of one half in one plane, per d and per r, at the points: ``across`` (2, ..., n) deflection,
    ``about`` (2, ..., n) rotation of the section; ``compliance`` is that of d and of r, ``line`` the bent line.
    """

    compliance: tuple[Any, Any]
    across: Array
    about: Array
    line: BentLine


@dataclass(frozen=True)
class NotchElement(Element):
    """A bar of ``width`` b along y and of the thickness h(x) along z, with the neck's ``thickness`` t [m].

    ``flat`` f, ``along`` a and ``deep`` c describe its profile [m].
    """

    flat: float
    along: float
    deep: float
    thickness: float
    width: float
    material: Material

    @cached_property
    def _half(self) -> tuple[Array, Array, Array, Array]:
        """Points x (..., n) of one half [m], their weights (..., n), the integrals from the middle to each (..., n, n),
        and h (..., n).
        """
        unit, weight, running = _points()
        flat, along, deep, thickness = (np.asarray(value)[..., None] for value in (
            self.flat, self.along, self.deep, self.thickness))  # fmt: skip
        angle = 0.5 * pi * unit
        x, h = along * np.sin(angle), thickness + 4.0 * deep * np.sin(0.5 * angle) ** 2
        weight_of_notch = along * np.cos(angle) * 0.5 * pi
        if not np.any(self.flat):
            return x, weight * weight_of_notch, running * weight_of_notch[..., None, :], h
        count = len(unit)
        both = np.zeros((*np.broadcast_shapes(flat.shape, along.shape)[:-1], 2 * count, 2 * count), x.dtype)
        both[..., :count, :count] = running * flat[..., None]
        both[..., count:, :count] = weight * flat[..., None]
        both[..., count:, count:] = running * weight_of_notch[..., None, :]
        return (concatenated((flat * unit, flat + x), -1), concatenated((weight * flat, weight * weight_of_notch), -1),
                both, concatenated((thickness * np.ones(count), h), -1))  # fmt: skip

    @property
    def length(self) -> Any:
        """Its length [m]."""
        return 2.0 * (self.flat + self.along)

    @property
    def mass(self) -> Any:
        _, weight, _, h = self._half
        return 2.0 * self.material.rho * self.width * _over_half(weight, h)

    @property
    def arm(self) -> Any:
        """Distance of the weight of either half from its node [m], consistent with soft bending."""
        return 4.0 * _over_half(self._half[1], self._heavier * self._planes[1].about[1])

    @property
    def odd_load(self) -> tuple[Any, Any]:
        """Mass at the end [kg] and its distance from the node [m], of an acceleration that grows from the middle, in
        soft bending.
        """
        x, weight, _, h = self._half
        mass = 2.0 * self.material.rho * self.width * h * weight * (2.0 * x / self.length)
        at_end = float(mass @ self._planes[1].across[0])
        return at_end, 0.5 * self.length - 0.5 * float(mass @ x) / at_end

    @property
    def sections_turn(self) -> bool:
        return True

    @cached_property
    def _heavier(self) -> Array:
        """Share of the mass between the middle and each point (..., n)."""
        _, weight, running, h = self._half
        return np.asarray(0.5 * _up_to(running, h) / _over_half(weight, h)[..., None])

    @cached_property
    def _planes(self) -> tuple[Plane, Plane]:
        """The planes x-y, stiff, and x-z, soft."""
        h, b = self._half[3], np.asarray(self.width)[..., None]
        return self._plane(b**3 * h / 12.0), self._plane(b * h**3 / 12.0)

    def _plane(self, moment: Array) -> Plane:
        x, weight, running, h = self._half
        young, sheared = (np.asarray(value)[..., None] for value in (
            self.material.E, SHEAR * self.material.shear_modulus * self.width))  # fmt: skip
        bend, shear = 1.0 / (young * moment), 1.0 / (sheared * h)
        deflected, turned = 2.0 * _over_half(weight, x * x * bend + shear), 2.0 * _over_half(weight, bend)
        about_d = (_over_half(weight, x * bend)[..., None] - _up_to(running, x * bend)) / deflected[..., None]
        about_r = _up_to(running, bend) / turned[..., None]
        slope = about_d + shear / deflected[..., None]
        length = np.asarray(self.length)[..., None]
        across_r = 0.25 * length - (_over_half(weight, about_r)[..., None] - _up_to(running, about_r))
        more = slope - 1.0 / length
        line = BentLine(2.0 * _over_half(weight, more**2), 2.0 * _over_half(weight, about_r**2),
                        -2.0 * _over_half(weight, self._heavier * about_r * slope))  # fmt: skip
        across, about = (np.array(np.broadcast_arrays(*pair)) for pair in (
            (_up_to(running, slope), across_r), (about_d, about_r)))  # fmt: skip
        return Plane((deflected, turned), across, about, line)

    def stiffness(self) -> tuple[Any, ...]:
        (_, weight, _, h), (stiff, soft) = self._half, self._planes
        pull = 2.0 * _over_half(weight, 1.0 / h) / (self.material.E * self.width)
        twist = 2.0 * _over_half(weight, 1.0 / self._torsion)
        compliance = (pull, stiff.compliance[0], soft.compliance[0], twist, soft.compliance[1], stiff.compliance[1])
        return tuple([1.0 / value for value in compliance])

    @cached_property
    def _torsion(self) -> Array:
        """Torsional rigidity G J at the points (..., n)."""
        shear, b = (np.asarray(value)[..., None] for value in (self.material.shear_modulus, self.width))
        return np.asarray(shear * rectangle_torsion(b, self._half[3]))

    def bent_lines(self) -> tuple[BentLine, BentLine]:
        stiff, soft = self._planes
        return stiff.line, soft.line

    def mass_rows(self) -> Array:
        """Return the rows F (..., 12, 12) of the consistent mass matrix F^T F, rotary inertia included."""
        x, weight, running, h = self._half
        b, rho, length = (np.asarray(value)[..., None] for value in (self.width, self.material.rho, self.length))
        mass, parts = 2.0 * rho * b * h * weight, []
        difference, mean = np.array([-1.0, 1.0]), np.array([0.5, 0.5])
        for first, inertia, slope in ((0, mass, 1.0 / h), (3, mass * (b * b + h * h) / 12.0, 1.0 / self._torsion)):
            odd = 0.5 * _up_to(running, slope) / _over_half(weight, slope)[..., None]
            parts.append(([first, first + 6], _compressed(inertia, mean, odd[..., None] * difference)))
        # over (u1, theta1, u2, theta2): motion and rotation of the middle, d and r
        middle = (np.array([0.5, 0.0, 0.5, 0.0]) + length * np.array([0.0, 0.25, 0.0, -0.25]))[..., None, :]
        d = (np.array([-1.0, 0.0, 1.0, 0.0]) + length * np.array([0.0, -0.5, 0.0, -0.5]))[..., None, :]
        turn, r = np.array([0.0, 0.5, 0.0, 0.5]), np.array([0.0, -1.0, 0.0, 1.0])
        for (indices, sign), plane, square in zip(PLANES, self._planes, (b * b * np.ones_like(h), h * h),
                                                  strict=True):  # fmt: skip
            across, about = plane.across[..., None], plane.about[..., None]
            rotary = mass * square / 12.0
            even = concatenated((middle + across[1] * r, turn + about[0] * d), -2)
            odd = concatenated((x[..., None] * turn + across[0] * d, about[1] * r), -2)
            packed = _compressed(concatenated((mass, rotary), -1), even, odd)
            parts.append((indices, packed * np.array([1.0, sign, 1.0, sign])))
        return in_columns(parts)

    def mass_points(self) -> MassPoints:
        """Return its mass at the points of both halves."""
        x, weight, running, h = self._half
        b, rho, length, n = self.width, self.material.rho, self.length, len(x)
        mass = rho * b * np.concatenate((h * weight,) * 2)
        both, difference, mean = np.concatenate((h, h)), np.array([-1.0, 1.0]), np.array([0.5, 0.5])
        moves, turns = np.zeros((2, 2 * n, 3, 12))

        def mirrored(even: Array, odd: Array) -> Array:
            """Rows (2 n, ...) of both halves from their parts at the points of one."""
            return np.concatenate((even + odd, even - odd))

        for rows, first, slope in ((moves, 0, 1.0 / h), (turns, 3, 1.0 / self._torsion)):
            odd = 0.5 * (running @ slope) / (weight @ slope)
            rows[:, 0, [first, first + 6]] = mirrored(np.tile(mean, (n, 1)), np.outer(odd, difference))
        middle, turn = np.array([0.5, 0.25 * length, 0.5, -0.25 * length]), np.array([0.0, 0.5, 0.0, 0.5])
        d, r = np.array([-1.0, -0.5 * length, 1.0, -0.5 * length]), np.array([0.0, -1.0, 0.0, 1.0])
        for (indices, sign), plane, axis, about in zip(PLANES, self._planes, (1, 2), (2, 1), strict=True):
            slopes = np.array([1.0, sign, 1.0, sign])
            moves[:, axis, indices] = slopes * mirrored(
                middle + np.outer(plane.across[1], r), np.outer(x, turn) + np.outer(plane.across[0], d))  # fmt: skip
            turns[:, about, indices] = sign * slopes * mirrored(
                turn + np.outer(plane.about[0], d), np.outer(plane.about[1], r))  # fmt: skip
        squares = np.array([b * b + both * both, both * both, np.full_like(both, b * b)]).T
        return MassPoints(mass, mass[:, None] * squares / 12.0, moves, turns)


def _over_half(weight: Array, values: Array) -> Any:
    """Return the integral (...) of values (..., n) over one half."""
    return (weight * values).sum(axis=-1)


def _up_to(running: Array, values: Array) -> Array:
    """Return the integrals (..., n) of values (..., n) from the middle to each point."""
    return np.asarray((running @ values[..., None])[..., 0])


def _compressed(inertia: Array, *shapes: Array) -> Array:
    """Return as few rows (..., c, c) as columns with the same products as sqrt(inertia) times the rows of all shapes.

    R of Q R by Gram and Schmidt, column by column, which is smooth also for complex steps.

    ``inertia`` (..., n); ``shapes`` (..., n, c), c up to 4.
    """
    root = np.sqrt(inertia)[..., None]
    rows = concatenated([np.asarray(root * shape) for shape in shapes], -2)
    count = rows.shape[-1]
    result = np.zeros((*rows.shape[:-2], count, count), rows.dtype)
    for i in range(count):
        result[..., i, i] = size = np.sqrt((rows[..., i] ** 2).sum(axis=-1))
        unit = rows[..., i] / size[..., None]
        result[..., i, i + 1 :] = share = (unit[..., None, :] @ rows[..., i + 1 :])[..., 0, :]
        rows[..., i + 1 :] -= unit[..., None] * share[..., None, :]
    return result


@cache
def _points() -> tuple[Array, Array, Array]:
    """Gauss points (n,) and weights (n,) on 0..1, and the matrix (n, n) of integrals from 0 to each of them.

    The integrals are those of Legendre polynomials through the points.
    """
    x, weight = np.polynomial.legendre.leggauss(POINTS)
    orders = np.arange(POINTS)
    polynomials = np.polynomial.legendre.legvander(x, POINTS)
    to_coefficients = (orders + 0.5)[:, None] * polynomials[:, :-1].T * weight
    integrals = np.empty((POINTS, POINTS))
    integrals[:, 0] = x + 1.0
    integrals[:, 1:] = (polynomials[:, 2:] - polynomials[:, :-2]) / (2.0 * orders[1:] + 1.0)
    return 0.5 * (1.0 + x), 0.5 * weight, 0.5 * integrals @ to_coefficients
