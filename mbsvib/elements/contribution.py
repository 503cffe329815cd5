"""Contributions of elements to the equations: relative displacements, and weights of their squares and products."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.rows import Rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Index


@dataclass(frozen=True, slots=True)
class Weights:
    """Weights ``value`` (n,) of the products of the rows d with the numbers ``first`` and ``second`` (n,).

    In a symmetric form each entry adds value d_i d_i^T to a matrix, or value (d_i d_j^T + d_j d_i^T) for two different
    rows; in an antisymmetric form it adds value (d_i d_j^T - d_j d_i^T). ``owner`` (n,) numbers the parts.
    """

    first: Index
    second: Index
    value: Array
    owner: Index

    def offset(self, by: int) -> Weights:
        """Return the weights with row numbers increased by ``by``."""
        return Weights(self.first + by, self.second + by, self.value, self.owner) if by else self

    @staticmethod
    def join(parts: Sequence[Weights]) -> Weights:
        """Return all weights in one."""
        parts = [part for part in parts if len(part.value)]
        if len(parts) < 2:
            return parts[0] if parts else NONE
        return Weights(*(np.concatenate([getattr(part, name) for part in parts]) for name in Weights.__slots__))


NONE = Weights(np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0, dtype=np.intp))


@dataclass(frozen=True, slots=True)
class Contribution:
    """Terms of the equations of motion, as quadratic forms of relative displacements.

    Row r is the sum of the relative displacements in ``rows`` whose ``row`` (n,) is r; there are ``count`` rows.
    ``stiffness`` is a symmetric form of them; ``circulatory`` (part of K) and ``gyroscopic`` (part of C) are
    antisymmetric forms.
    """

    rows: Rows
    row: Index
    count: int
    stiffness: Weights
    circulatory: Weights
    gyroscopic: Weights

    @staticmethod
    def of(
        rows: Rows, *, stiffness: Weights | None = None, circulatory: Weights | None = None,
        gyroscopic: Weights | None = None, row: Index | None = None,
    ) -> Contribution:  # fmt: skip
        """Return a contribution; without ``row`` each row is a single relative displacement."""
        row = np.arange(len(rows.first)) if row is None else row
        return Contribution(rows, row, int(row.max(initial=-1)) + 1, stiffness or NONE, circulatory or NONE,
                            gyroscopic or NONE)  # fmt: skip

    @staticmethod
    def join(parts: Sequence[Contribution]) -> Contribution:
        """Return all contributions as one."""
        if len(parts) == 1:
            return parts[0]
        *start, count = accumulate((part.count for part in parts), initial=0)
        starts = list(zip(parts, start, strict=True))
        return Contribution(
            Rows.join([part.rows for part in parts]), np.concatenate([part.row + at for part, at in starts]), count,
            Weights.join([part.stiffness.offset(at) for part, at in starts]),
            Weights.join([part.circulatory.offset(at) for part, at in starts]),
            Weights.join([part.gyroscopic.offset(at) for part, at in starts]),
        )  # fmt: skip


def rotation_rows(body: Index, along: Array, ground: int) -> Rows:
    """Return components of the rotations of bodies, along . theta.

    ``body`` (n,): numbers of the bodies. ``along`` (3, n): vectors, world axes.
    """
    zero = np.zeros(along.shape)
    return Rows(np.full(len(body), ground), body, zero, zero, along)


def displacement_rows(body: Index, along: Array, point: Array, ground: int) -> Rows:
    """Return components of the displacements of points (3, n) of bodies (n,) along vectors (3, n)."""
    return Rows(np.full(len(body), ground), body, point, along, np.zeros(along.shape))
