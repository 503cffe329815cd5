"""Wrench pairs: the opposite wrenches of a joint, spring, bushing or load on the two bodies that it connects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.rows import Rows, columns
from mbsvib.kinematics.mobility import crossed_product

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

    def arms(self, position: Array) -> tuple[Array, Array]:
        """Return the arms (3, n) from the centres of mass (3, bodies + 1) to ``start`` and to ``end``."""
        return self.start - position[:, self.first], self.end - position[:, self.second]

    def on_bodies(self, position: Array) -> tuple[Array, Array]:
        """Return the sum of the wrenches on each body about its centre of mass, and the sizes of the terms.

        ``position`` (3, bodies + 1): centres of mass [m]. Returns ``wrench`` (6, bodies + 1): sums over all pairs [N, N
        m], ground last; ``size`` (2, bodies + 1): sums of the lengths of the forces, and of those of torques and
        moments of forces. All vectors may have an axis of variants behind the first.
        """
        if max(array.ndim for array in (self.start, self.end, self.force, self.torque, position)) > 2:
            return self._on_bodies_of_variants(position)
        body, n = np.concatenate((self.first, self.second)), len(self.first)
        parts = np.empty((9, 2 * n))
        np.negative(self.force, out=parts[:3, :n])
        np.negative(self.torque, out=parts[6:, :n])
        parts[:3, n:], parts[6:, n:] = self.force, self.torque
        parts[3:6] = crossed_product(np.concatenate((self.start, self.end), axis=1) - position[:, body], parts[:3])
        lengths = np.sqrt(np.square(parts).reshape(3, 3, -1).sum(axis=1))
        parts[3:6] += parts[6:]
        parts[6] = lengths[0]
        np.add(lengths[1], lengths[2], out=parts[7])
        sums = np.array([np.bincount(body, part, position.shape[1]) for part in parts[:8]], dtype=float)
        return sums[:6], sums[6:]

    def _on_bodies_of_variants(self, position: Array) -> tuple[Array, Array]:
        wrench: Array | float = 0.0
        size: Array | float = 0.0
        for body, point, sign in ((self.first, self.start, -1.0), (self.second, self.end, 1.0)):
            on_body = np.eye(position.shape[-1])[body]
            moment = crossed_product(_wide(point) - _wide(position)[..., body], sign * _wide(self.force))
            force, moment, torque = np.broadcast_arrays(_wide(self.force), moment, _wide(self.torque))
            lengths = [np.sqrt(np.square(part).sum(axis=0)) for part in (force, moment, torque)]
            wrench = wrench + np.concatenate((sign * force, moment + sign * torque)) @ on_body
            size = size + np.stack((lengths[0], lengths[1] + lengths[2])) @ on_body
        return np.asarray(wrench), np.asarray(size)


def _wide(vectors: Array) -> Array:
    """Vectors (3, n) with an axis of variants."""
    return vectors[:, None] if vectors.ndim == 2 else vectors


def unit_wrenches(rows: Rows, position: Array) -> Array:
    """Return the wrenches of unit forces along rows (n,) on the bodies, (6, bodies + 1, n).

    Forces, then moments about the centres of mass at ``position`` (3, bodies + 1); the origin for ground.
    """
    n = len(rows.first)
    result, which = np.zeros((6, position.shape[1], n)), np.arange(n)
    for body, sign in ((rows.second, 1.0), (rows.first, -1.0)):
        moment = rows.moment + crossed_product(rows.point - position[:, body], rows.force)
        result[:, body, which] += sign * np.concatenate((rows.force, moment))
    return result
