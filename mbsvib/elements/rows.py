"""Rows: scalar relative displacements of two bodies, in which springs, masses and ports are stated.

Those of elements have a stiffness, a damping and an inertance: K = D^T diag(k) D, C = D^T diag(c) D and, for inerters,
M = D^T diag(b) D have the same rows D. A direction with neither stiffness nor damping has no row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.common.fast_init import fast_init
from mbsvib.linalg.products import concatenated


@fast_init
@dataclass(frozen=True, slots=True)
class Rows:
    """Scalar relative displacements d = force . u + moment . theta of ``second`` relative to ``first`` at ``point``.

    Arrays over rows: ``first``, ``second`` (n,) body numbers, ``point``, ``force``, ``moment`` (3, n), world axes.
    """

    first: Index
    second: Index
    point: Array
    force: Array
    moment: Array

    @staticmethod
    def stack(tuples: list[tuple[float, ...]]) -> Rows:
        """Build rows from tuples (first, second, point xyz, force xyz, moment xyz)."""
        entries = columns(tuples, 11)
        first, second = entries[:2].astype(np.intp)
        return Rows(first, second, entries[2:5], entries[5:8], entries[8:])

    def take(self, which: Index | slice) -> Rows:
        """Return some of the rows."""
        return Rows(self.first[which], self.second[which], self.point[..., which], self.force[..., which],
                    self.moment[..., which])  # fmt: skip

    @staticmethod
    def join(parts: list[Rows]) -> Rows:
        """Return several stacks as one."""
        parts = [part for part in parts if len(part.first)] or parts[:1]
        if len(parts) == 1:
            return parts[0]
        return Rows(
            np.concatenate([part.first for part in parts]), np.concatenate([part.second for part in parts]),
            _joined([part.point for part in parts]), _joined([part.force for part in parts]),
            _joined([part.moment for part in parts]),
        )  # fmt: skip


def table(tuples: Sequence[tuple[Any, ...]], width: int) -> Array:
    """Return tuples of equal length as the rows of an array (n, width)."""
    return np.fromiter(chain.from_iterable(tuples), float, width * len(tuples)).reshape(-1, width)


def columns(tuples: Sequence[tuple[Any, ...]], width: int) -> Array:
    """Return tuples of equal length as the columns of an array (width, n) in C order."""
    return table(tuples, width).T.copy()


def _joined(arrays: list[Any]) -> Any:
    """Arrays concatenated along their last axis; if one has an axis of variants, the others are repeated along it."""
    try:
        return np.concatenate(arrays, axis=-1)
    except ValueError:
        variants = next(array.shape[1] for array in arrays if array.ndim == 3)
        return np.concatenate([
            array if array.ndim == 3 else np.broadcast_to(array[:, None], (3, variants, array.shape[1]))
            for array in arrays
        ], axis=-1)  # fmt: skip


@fast_init
@dataclass(frozen=True, slots=True)
class ElementRows:
    """Relative displacements ``rows`` with ``stiffness``, ``damping`` (..., n) and ``inertance`` (n,), None: all zero.

    ``owner`` (n,) is the number of each row's element among the model's connections, ``unit`` (..., n, 6) its direction
    in the axes of this element.
    """

    rows: Rows
    stiffness: Array
    damping: Array
    owner: Index
    unit: Array
    inertance: Array | None = None

    @staticmethod
    def along_lines(ends: Array, start: Array, line: Array, stiffness: Array, damping: Array,
                    inertance: Array | None = None) -> ElementRows:  # fmt: skip
        """Return rows of changes of length.

        ``ends`` (3, n): numbers of the first body, of the second body and of the owner. ``start``, ``line`` (3, n): a
        point of each line [m], and its unit vector, world axes. ``stiffness``, ``damping``, ``inertance`` (n,): their
        coefficients.
        """
        first, second, owner = ends.astype(np.intp)
        unit = np.zeros((len(owner), 6))
        unit[:, 2] = 1.0
        return ElementRows(Rows(first, second, start, line, np.zeros(line.shape)), stiffness, damping, owner, unit,
                           inertance)  # fmt: skip

    @staticmethod
    def join(parts: Sequence[ElementRows]) -> ElementRows:
        """Return the rows of several families as one."""
        if len(parts) == 1:
            return parts[0]
        inertance = None
        if any(part.inertance is not None for part in parts):
            inertance = concatenated([np.zeros(len(part.owner)) if part.inertance is None else part.inertance
                                      for part in parts], -1)  # fmt: skip
        stiffness, damping, owner, unit = (
            concatenated([getattr(part, key) for part in parts], axis)
            for key, axis in (("stiffness", -1), ("damping", -1), ("owner", -1), ("unit", -2)))
        return ElementRows(Rows.join([part.rows for part in parts]), stiffness, damping, owner, unit, inertance)

    def take(self, which: Index) -> ElementRows:
        """Return the rows with some numbers, in ascending order."""
        if len(which) == len(self.owner):
            return self
        return ElementRows(
            self.rows.take(which), self.stiffness.take(which, axis=-1), self.damping.take(which, axis=-1),
            self.owner.take(which), self.unit.take(which, axis=-2),
            None if self.inertance is None else self.inertance.take(which, axis=-1),
        )  # fmt: skip

    @property
    def weights(self) -> tuple[tuple[int, Array], ...]:
        """Order of the time derivative and coefficients: (0, stiffness), (1, damping) and (2, inertance), if any."""
        return tuple([(order, value) for order, value in enumerate((self.stiffness, self.damping, self.inertance))
                      if value is not None])  # fmt: skip
