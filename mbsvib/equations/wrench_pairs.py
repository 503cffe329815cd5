"""Wrench pairs: the opposite wrenches of a joint, spring, bushing or load on the two bodies that it connects."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.core.geometric_stiffness import cross
from mbsvib.elements.rows import columns
from mbsvib.linalg.products import concatenated

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Index


@dataclass(frozen=True, slots=True)
class WrenchPairs:
    """Wrenches between bodies: ``force`` [N] at ``end`` [m] and ``torque`` [N m] on ``second``, -force at ``start`` and
    -torque on ``first``; body numbers (n,) and vectors (3, n) in world axes.
    """

    first: Index
    second: Index
    start: Array
    end: Array
    force: Array
    torque: Array

    @staticmethod
    def stack(tuples: Sequence[tuple[float, ...]]) -> WrenchPairs:
        """Build pairs from tuples (first, second, start xyz, end xyz, force xyz, torque xyz)."""
        table = columns(tuples, 14)
        bodies = table[:2].astype(np.intp)
        return WrenchPairs(bodies[0], bodies[1], table[2:5], table[5:8], table[8:11], table[11:])

    @staticmethod
    def join(a: WrenchPairs, b: WrenchPairs) -> WrenchPairs:
        """Return the pairs of both, those of ``a`` first."""
        keys = WrenchPairs.__slots__
        return WrenchPairs(*(np.concatenate((getattr(a, key), getattr(b, key)), axis=-1) for key in keys))

    def on_bodies(self, position: Array) -> tuple[Array, Array]:
        """Return the sum of the wrenches on each body about its centre of mass, and the sizes of the terms.

        ``position`` (3, bodies + 1): centres of mass [m], or (3, variants, bodies + 1). Returns ``wrench`` (..., 6,
        bodies + 1): sums over all pairs [N, N m], ground last; ``size`` (..., 2, bodies + 1): sums of the lengths of
        the forces, and of those of torques and moments of forces.
        """
        ends, body = (self.start, self.end), np.concatenate((self.first, self.second))
        point, force, torque = (concatenated([leading(array) for array in pair], -1) for pair in (
            ends, (-self.force, self.force), (-self.torque, self.torque)))  # fmt: skip
        arm = point - leading(position)[..., body]
        moment = cross(arm[..., None, :], force[..., None, :])[..., 0, :]
        lengths = [np.sqrt(np.square(part).sum(axis=-2, keepdims=True)) for part in (force, moment, torque)]
        both = concatenated((force, moment + torque, lengths[0], lengths[1] + lengths[2]), -2)
        sums = _by_body(both, body, position.shape[-1])
        return sums[..., :6, :], sums[..., 6:, :]


def _by_body(vectors: Array, body: Index, count: int) -> Array:
    """Sums (..., count) of entries (..., n) by the numbers of their bodies."""
    rows = prod(vectors.shape[:-1])
    at = (count * np.arange(rows)[:, None] + body).reshape(-1)
    sums: Array = np.bincount(at, vectors.real.reshape(-1), count * rows).astype(float)
    if np.iscomplexobj(vectors):
        sums = sums + 1j * np.bincount(at, vectors.imag.reshape(-1), count * rows)
    return sums.reshape(*vectors.shape[:-1], count)


def leading(vectors: Array) -> Array:
    """Return vectors (3, variants, n) as (variants, 3, n); (3, n) stay as they are."""
    return vectors if vectors.ndim == 2 else vectors.swapaxes(0, 1)
