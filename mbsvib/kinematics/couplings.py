"""The terms of all couplers as arrays, and their rows over the joint coordinates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.kinematics.relative_motion import relative_motion

if TYPE_CHECKING:
    from collections.abc import Callable

    from mbsvib.common.arrays import Array, Bools, Index
    from mbsvib.elements.rows import Rows
    from mbsvib.kinematics.relative_motion import Twists

    Moving = Callable[[Index, Array], Array]


@dataclass(frozen=True)
class Couplings:
    """The terms (t,) of all couplers: ``row`` is the number of the coupler, ``value`` (..., t) the coefficient,
    ``turns`` is true for angles.

    ``column`` (t,) is the coordinate of a joint in the tree, or -1 where the term is the next of ``measured``, the
    relative motions of cut joints. ``skew`` lists those of them that are one of two successive angles: (number among
    ``measured``, axis in first, axis in second, 0 or 1). ``touched`` (couplers, n) are the coordinates involved.
    """

    row: Index
    value: Array
    turns: Bools
    column: Index
    measured: Rows
    skew: tuple[tuple[int, Array, Array, int], ...]
    touched: Bools

    def dense(self, coordinates: Twists) -> Array:
        """Return the rows (..., couplers, n) over the joint coordinates."""
        measured = relative_motion(coordinates, self.measured).dense(0, len(self.measured.first))
        lead = np.broadcast_shapes(measured.shape[:-2], self.value.shape[:-1])
        result = np.zeros((*lead, *self.touched.shape), np.result_type(measured, self.value))
        number = 0
        for k, (row, column) in enumerate(zip(self.row.tolist(), self.column.tolist(), strict=True)):
            if column >= 0:
                result[..., row, column] += self.value[..., k]
            else:
                result[..., row, :] += self.value[..., k, None] * measured[..., number, :]
                number += 1
        return result

    @cached_property
    def largest(self) -> Array:
        """The largest coefficients (2, ..., couplers) of angles and of distances of each coupler."""
        count = len(self.touched)
        result = np.zeros((2, *self.value.shape[:-1], count))
        places: Any = np.where(self.turns, 0, 1), ..., self.row
        np.maximum.at(result, places, np.moveaxis(np.abs(self.value), -1, 0))
        return result

    def sums(self, travel: Array) -> Array:
        """Return the sums (..., couplers) of displacements (..., t) of the coordinates, which couplers hold at zero."""
        return np.asarray((self.value * travel) @ (self.row[:, None] == np.arange(len(self.touched))))

    def row_scale(self, length: float | Array, members: Index | slice = slice(None)) -> Array:
        """Return factors that scale some rows to entries of at most one, with ``length`` [m] as the unit of length: one
        for all, or one for each (members,).
        """
        angle, distance = self.largest[..., members]
        return np.asarray(1.0 / np.maximum(angle, distance * length))

    def nearby(self, turn: Moving, shift: Moving) -> Couplings:
        """Return the same in a neighbouring pose: ``turn`` and ``shift`` move directions and points with bodies."""
        rows = self.measured
        if not len(rows.first):
            return self
        force, moment = turn(rows.first, rows.force), 0.5 * (turn(rows.first, rows.moment) +
                                                             turn(rows.second, rows.moment))  # fmt: skip
        for k, first, second, which in self.skew:
            at = slice(k, k + 1)
            moment[..., at] = dual(turn(rows.first[at], first), turn(rows.second[at], second), which)
        measured = replace(rows, point=shift(rows.second, rows.point), force=force, moment=moment)
        return replace(self, measured=measured)


def dual(a: Array, b: Array, which: int) -> Array:
    """Return the covector of q_a (0) or q_b (1) in theta = q_a a + q_b b, vectors (3, ...)."""
    n = np.cross(a, b, axis=0)
    result: Array = np.cross(*((b, n) if which == 0 else (n, a)), axis=0) / (n * n).sum(axis=0)
    return result
