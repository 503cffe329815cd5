"""Rows: scalar relative displacements of two bodies, in which springs, masses and ports are stated."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.fast_init import fast_init

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Index


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
