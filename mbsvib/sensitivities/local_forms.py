"""Forms of what parts see of motions, as data: what a number of a part does to x^T T(s) y, T(s) = K + s C + s^2 M.

Everything that a number changes is local. With motions and wrenches a and b of its part, and a matrix D,

x^T dT y = a(x) . D b(y) + a(y) . D b(x)

Stiffness, damping and inertia see motions only, half of which is weighted by 1, s or s^2. Where a part moves, the
wrench in it works on what the change does to the motion: a connection at p turned by rho and moved by dp sees
(u + theta x dp, theta) turned back by rho, a joint of the tree hands on the same with the other sign:

x^T dT y = dp . (f x theta) + rho . (f x u + t x theta)

Source: Jiang, Chen & Luo (2011), equations 78-87; here by the wrenches that connections transmit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.linalg.products import real_product
from mbsvib.linalg.rank import ZERO_SLOPE
from mbsvib.linalg.rotations import skew
from mbsvib.linalg.vectors import Field, any_nonzero, transformed
from mbsvib.sensitivities.adjoint_fields import Fields

# Fields of so many numbers are looked through for components that are zero, as planar mechanisms have many.
LARGE = 2_000
NONE, UNIT = np.zeros((1, 3)), np.eye(3)[None]
# Rows, columns (p,) and values (k, entries of the field, p) of the entries of matrices that are not zero in all.
Entries = tuple[Index, Index, Array]


@dataclass(frozen=True, slots=True)
class Local:
    """Vectors of an ``array`` of ``Fields``: those of the bodies or connections ``number`` (k,), or (k, c) for c of
    them one behind the other; times a ``weight``: half of "stiff", "rate" or "square", all of "stiff" or "rate" on the
    "left" only, the "spin" of rotors, or none. ``axes`` (k, n, 6 c) are those in which they are seen; None: the world.
    """

    array: str
    number: Index
    weight: str = ""
    axes: Array | None = None

    def of(self, fields: Fields, which: slice) -> Field:
        """Return some of the vectors, (k, n, ...)."""
        number, array = self.number[which], getattr(fields, self.array)
        if number.ndim > 1:
            vectors = array[number]
            vectors = vectors.reshape(len(number), number.shape[1] * array.shape[1], *array.shape[2:])
        else:
            first, last = int(number[0]), int(number[-1])
            vectors = array[first : last + 1] if last - first == len(number) - 1 else array[number]
        if self.array == "tied":
            vectors = vectors[:, None]
        if self.axes is not None:
            vectors = transformed(self.axes[which], vectors)
        return np.asarray(vectors * _weight(fields, self.weight) if self.weight else vectors)


def _weight(fields: Fields, weight: str) -> Field:
    if weight == "spin":
        return np.asarray(-fields.side * fields.rate)
    side, _, power = weight.rpartition(" ")
    return np.asarray((0.5 * (1 - fields.side) if side else 0.5) * getattr(fields, power))


@dataclass(frozen=True, slots=True)
class LocalForm:
    """Forms a(x) . D b(y) + a(y) . D b(x) of k vectors ``a`` and ``b``, by the entries of D that are not zero
    in all: their ``rows`` and ``columns``, and ``factor`` (k, entries of the field, p), or (1, ...) for all alike.
    """

    a: Local
    b: Local
    rows: Index
    columns: Index
    factor: Array

    def products(self, which: slice, left: Fields, right: Fields | None, numbers: int) -> tuple[Array, Field] | None:
        """Return factors (k, entries, q) and products (k, q, ...) whose sums are the forms of some of the parts; None
        if all are zero. ``right`` None: half of the form with y = x. Fields of many ``numbers`` are looked through.
        """
        if not len(self.rows):
            return None
        factor = self.factor if len(self.factor) == 1 else self.factor[which]
        other = left if right is None else right
        sides = [(self.a.of(left, which), self.b.of(other, which))]
        if right is not None:
            sides.append((self.a.of(right, which), self.b.of(left, which)))
        rows, columns = self.rows, self.columns
        if numbers * len(sides[0][0]) > LARGE:
            moves = [[np.array([any_nonzero(array[:, i]) for i in range(array.shape[1])]) for array in side]
                     for side in sides]  # fmt: skip
            acts = np.flatnonzero(np.any([a[rows] & b[columns] for a, b in moves], axis=0))
            if len(acts) < len(rows):
                factor, rows, columns = factor[:, :, acts], rows[acts], columns[acts]
        if not len(rows):
            return None
        first, *second = (a.take(rows, axis=1) * b.take(columns, axis=1) for a, b in sides)
        return factor, first if not second else first + second[0]


@dataclass(frozen=True, slots=True)
class Shift:
    """How the centres of mass of bodies ``number`` (k,) ``move``, (k, entries of the field, 3) or (1, ...)."""

    number: Index
    move: Array


def summed_products(factor: Array, products: Field, parts: int) -> Field:
    """Return sums (parts, entries, ...) of products (k, q, ...) with factors (k, entries, q); all k make one part if
    there is one.
    """
    k, q, *tail = products.shape
    if parts == 1 < k:
        factor = np.broadcast_to(factor, (k, *factor.shape[1:])).swapaxes(0, 1).reshape(1, -1, k * q)
        products, k, q = products.reshape(1, k * q, *tail), 1, k * q
    return real_product(factor, products.reshape(k, q, prod(tail))).reshape(k, factor.shape[1], *tail)


def entries(matrix: Array) -> Entries:
    """Return the entries of matrices D (k, entries of the field, n, m)."""
    rows, columns = np.nonzero(matrix.any(axis=(0, 1)))
    return rows, columns, matrix[:, :, rows, columns]


def single_entries(pairs: Sequence[tuple[int, int]], *, symmetric: bool = True) -> Entries:
    """Return the entries of matrices (1, pairs, 6, 6) with a 1 in the places of pairs; ``symmetric`` ones also have it
    in the opposite places, and both are one entry, their sum.
    """
    rows, columns = np.array(pairs).T
    twice = symmetric & (rows != columns)
    return rows, columns, np.diag(np.where(twice, 2.0, 1.0))[None]


def square(array: str, number: Index, power: str, change: Entries, axes: Array | None = None) -> LocalForm:
    """Return the form of a change of symmetric matrices of stiffness, damping or inertia on motions.

    Pairs of entries may be one, their sum. ``power``: "stiff", "rate" or "square"; ``axes``: those of ``Local``.
    """
    return LocalForm(Local(array, number, power, axes), Local(array, number, "", axes), *change)


def six_axes(axes: Array) -> Array | None:
    """Return for axes (k, 3, 3), the columns, those (k, 6, 6) of six-vectors, the rows; None where all are the world's.
    """
    if bool((axes == UNIT).all()):
        return None
    result = np.zeros((len(axes), 6, 6))
    result[:, :3, :3] = result[:, 3:, 3:] = axes.swapaxes(1, 2)
    return result


def factored(matrices: Array) -> tuple[Entries, Array]:
    """Return symmetric matrices (k, n, n) as the entries of diagonal ones in axes (k, n, n) of their own, without what
    is rounding in all.
    """
    sizes, vectors = np.linalg.eigh(0.5 * (matrices + matrices.swapaxes(1, 2)))
    sizes[np.abs(sizes) <= ZERO_SLOPE * np.abs(matrices).max(initial=0.0)] = 0.0
    used = np.flatnonzero(sizes.any(axis=0))
    return (used, used, sizes[:, None, used]), vectors.swapaxes(1, 2)


def displaced(move: Array, turn: Array) -> Array:
    """Return matrices D (..., 6, 6) between wrench and motion where parts move and turn, (..., 3) each, at their point;
    of joints with the other sign, which hand on what bushings take.
    """
    move, turn = np.broadcast_arrays(move, turn)
    result = np.zeros((*move.shape[:-1], 6, 6))
    result[..., :3, :3] = result[..., 3:, 3:] = skew(turn).swapaxes(-1, -2)
    result[..., :3, 3:] = skew(move).swapaxes(-1, -2)
    return result


# Constants: one number, and a shift or a turn of connections.
ONE = entries(np.ones((1, 1, 1, 1)))
SHIFTED, TURNED = entries(displaced(UNIT, NONE)), entries(displaced(NONE, UNIT))


def moved_connection(number: Index, change: Entries) -> LocalForm:
    """Return the form of connections that move and turn, with the entries of ``displaced``."""
    return LocalForm(Local("wrench", number), Local("relative", number), *change)
