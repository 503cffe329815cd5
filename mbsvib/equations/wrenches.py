"""Applied wrenches: gravity, loads on bodies, and the preloads of springs and bushings.

A wrench pair is the opposite wrenches of a joint, spring, bushing or load on the two bodies that it connects.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.core.geometric_stiffness import cross
from mbsvib.elements.rows import columns
from mbsvib.linalg.products import concatenated

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.mechanism.mechanism import Mechanism
    Mask = NDArray[np.bool_]
    from collections.abc import Sequence


ORIGIN = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class AppliedWrenches:
    """Wrenches on the bodies: ``weight`` (3, bodies + 1) [N] at the centres of mass, and ``pairs``.

    ``names`` are the elements of the pairs: the loads (with ground as first body, where they have no effect), then the
    elements along lines, then the others; ``loads`` and ``lines`` are numbers of pairs, ``follower`` (loads,) is true
    for loads that turn with their body.
    """

    weight: Array
    pairs: WrenchPairs
    names: tuple[str, ...]
    loads: int
    lines: int
    follower: Mask

    def on_bodies(self, position: Array) -> tuple[Array, Array]:
        """Return the sums of weights and pairs on each body and their sizes, as ``WrenchPairs.on_bodies``."""
        wrench, sizes = self.pairs.on_bodies(position)
        weight = leading(self.weight)
        length, zero = np.sqrt(np.square(weight).sum(axis=-2, keepdims=True)), np.zeros_like(weight)
        return wrench + np.concatenate((weight, zero), axis=-2), sizes + np.concatenate((length, zero[..., :1, :]), -2)

    @property
    def tension(self) -> Index:
        """Numbers of the pairs that are tensions along lines."""
        return np.arange(self.loads, self.loads + self.lines)

    @property
    def bushings(self) -> Index:
        """Numbers of the pairs that are preloads of other elements, which turn with the first body."""
        return np.arange(self.loads + self.lines, len(self.names))


def is_loaded(model: Mechanism) -> bool:
    """Return whether a model has gravity, a load or a preload."""
    gravity = model.gravity is not None and any(model.gravity)
    return gravity or bool(model.loads) or any(spring.loaded for spring in model.springs.values())


def has_antisymmetric_forces(model: Mechanism) -> bool:
    """Return whether a model has rotors, parts on hubs or elements with cross-coupling."""
    turning = model.expansion is not None and bool(model.expansion.gyroscopic)
    return turning or bool(model.rotors) or any(part.cross_coupling is not None for part in model.springs.values())


def applied_wrenches(
    model: Mechanism, number: Mapping[str, int], also: Collection[str] = ()
) -> AppliedWrenches:
    """Return the applied wrenches of a model; elements ``also`` have one, even if it is zero at the pose."""
    weight = np.zeros((3, len(model.bodies) + 1))
    if model.gravity is not None:
        weight[:, :-1] = np.multiply.outer(model.gravity, [body.mass for body in model.bodies.values()])
    ground = number["ground"]
    tuples: list[tuple[float, ...]] = []
    names: list[str] = []
    for load in model.loads.values():
        point = load.position or model.bodies[load.body].position
        tuples.append((ground, number[load.body], *point, *point, *load.force, *load.torque))
        names.append(load.name)
    springs = [spring for spring in model.springs.values() if spring.loaded or spring.name in also]
    lines = [spring for spring in springs if spring.acts_along_line]
    for spring in (*lines, *(spring for spring in springs if not spring.acts_along_line)):
        points = spring.points or (ORIGIN,)
        tuples.append((number[spring.first], number[spring.second], *points[0], *points[-1], *spring.rest_wrench))
        names.append(spring.name)
    follower = np.array([load.follower for load in model.loads.values()], dtype=bool)
    pairs = WrenchPairs.stack(tuples)
    return AppliedWrenches(weight, pairs, tuple(names), len(model.loads), len(lines), follower)


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
