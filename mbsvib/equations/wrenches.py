"""Applied wrenches: gravity, loads on bodies, and the preloads of springs and bushings.

A wrench pair is the opposite wrenches of a joint, spring, bushing or load on the two bodies that it connects.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.elements.rows import Rows, columns
from mbsvib.linalg.products import concatenated, sums_by_number
from mbsvib.linalg.rotations import cross, crossed_product, exponential
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from mbsvib.equations.batch_values import Values


# Fields by which forces at the pose stay as they are, where springs have no free length.
KEEPING_FORCES = frozenset({"stiffness", "static_stiffness", "damping", "inertance", "inertia", "alpha", "beta",
                            "damping_ratio"})  # fmt: skip
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
    follower: Bools

    def on_bodies(self, position: Array) -> tuple[Array, Array]:
        """Return the sums of weights and pairs on each body and their sizes, as ``WrenchPairs.on_bodies``."""
        wrench, sizes = self.pairs.on_bodies(position)
        weight = leading(self.weight)
        length, zero = np.sqrt(np.square(weight).sum(axis=-2, keepdims=True)), np.zeros_like(weight)
        return wrench + np.concatenate((weight, zero), axis=-2), sizes + np.concatenate((length, zero[..., :1, :]), -2)

    def on_ground(self, position: Array, wrench: Array) -> Rows:
        """Return rows relative to ground that add up to the change of the sum of loads and weights along a wrench (6,)
        about the origin. ``position`` (3, ..., bodies): centres of mass [m].
        """
        pairs, loads, bodies = self.pairs, slice(self.loads), np.arange(position.shape[-1])
        end, force, torque = (leading(array)[..., loads] for array in (pairs.end, pairs.force, pairs.torque))
        along, about = wrench[:3, None], wrench[3:, None]
        at_end = along + cross(about, end, -2)
        moment = self.follower * (cross(torque, about, -2) + cross(force, at_end, -2))
        weight, turned = (crossed_product(vectors, about) for vectors in (self.weight[..., :-1], trailing(force)))
        return Rows.join([
            Rows(pairs.first[loads], pairs.second[loads], trailing(end), turned, trailing(moment)),
            Rows(np.full(len(bodies), len(bodies)), bodies, position, weight, np.zeros_like(weight)),
        ])  # fmt: skip

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
        moment = cross(arm, force, -2)
        lengths = [np.sqrt(np.square(part).sum(axis=-2, keepdims=True)) for part in (force, moment, torque)]
        both = concatenated((force, moment + torque, lengths[0], lengths[1] + lengths[2]), -2)
        sums = _by_body(both, body, position.shape[-1])
        return sums[..., :6, :], sums[..., 6:, :]


def _by_body(vectors: Array, body: Index, count: int) -> Array:
    """Sums (..., count) of entries (..., n) by the numbers of their bodies."""
    rows = prod(vectors.shape[:-1])
    at = (count * np.arange(rows)[:, None] + body).reshape(-1)
    sums = sums_by_number(at, vectors.reshape(-1), count * rows)
    return sums.reshape(*vectors.shape[:-1], count)


def leading(vectors: Array) -> Array:
    """Return vectors (3, variants, n) as (variants, 3, n); (3, n) stay as they are."""
    return vectors if vectors.ndim == 2 else vectors.swapaxes(0, 1)


def trailing(vectors: Array) -> Array:
    """Return vectors (variants, 3, n) as (3, variants, n); (3, n) stay as they are."""
    return np.ascontiguousarray(leading(vectors))


def loaded_in_variants(model: Mechanism, varying: Mapping[str, Mapping[str, Any]]) -> bool:
    """Return whether gravity, or the preload of an element, is among the fields that vary, by part and name."""
    return bool("gravity" in varying and model.gravity is not None) or bool(preloaded(model, varying))


def keeps_forces(model: Mechanism, varying: Mapping[str, Mapping[str, Any]]) -> bool:
    """Return whether no variant has other forces at the pose, by the part and name of the fields that vary."""
    kept = KEEPING_FORCES if any(model.gravity or ()) else KEEPING_FORCES | {"mass"}
    return not preloaded(model, varying) and all(fields.keys() <= kept for fields in varying.values())


def preloaded(model: Mechanism, varying: Mapping[str, Mapping[str, Any]]) -> frozenset[str]:
    """Return the names of the elements whose preload may differ in variants."""
    return frozenset(
        name for name, fields in varying.items() if name in model.springs and (
            "preload" in fields or getattr(model.springs[name], "free_length", None) is not None))  # fmt: skip


def applied_of_variants(
    model: Mechanism, values: Values, positions: Mapping[int, Array], also: Collection[str] = (),
    made: Mapping[str, Mapping[str, Array]] = MappingProxyType({}),
) -> AppliedWrenches:  # fmt: skip
    """Return the applied wrenches of all variants; ``positions`` (3, variants): moved centres of mass by number.

    ``also``: elements that have one, even if it is zero. ``made``: fields of loads within other parts, by name.
    """
    number = {name: i for i, name in enumerate((*model.bodies, "ground"))}
    applied = applied_wrenches(model, number, preloaded(model, values.index).union(also))
    pairs, weight = applied.pairs, applied.weight
    arrays = {key: getattr(pairs, key) for key in ("start", "end", "force", "torque")}
    for k, name in enumerate(applied.names[: applied.loads]):
        fields, load = values.fields.get(name, made.get(name, {})), model.loads[name]
        if load.position is None and number[load.body] in positions:
            fields = {**fields, "position": positions[number[load.body]]}
        for field, keys in (("force", ("force",)), ("torque", ("torque",)), ("position", ("start", "end"))):
            for key in keys if field in fields else ():
                arrays[key] = with_values_at(arrays[key], slice(k, k + 1), fields[field], values.count)
    for k, name in enumerate(applied.names[applied.loads :], applied.loads):
        if name in values.fields:
            for key, vectors in _of_element(model.springs[name], values.fields[name], values.count).items():
                arrays[key] = with_values_at(arrays[key], slice(k, k + 1), vectors, values.count)
    masses = {number[name]: fields["mass"] for name, fields in values.fields.items()
              if name in model.bodies and "mass" in fields}  # fmt: skip
    gravity = values.fields.get("gravity", {}).get("")
    if model.gravity is not None and (gravity is not None or masses):
        mass = np.array([[body.mass for body in model.bodies.values()] + [0.0]])
        mass = values.repeated(mass[0])
        for body, array in masses.items():
            mass[:, body] = array
        direction = np.array(model.gravity)[:, None] if gravity is None else gravity
        weight = direction[:, :, None] * mass
    return replace(applied, pairs=replace(pairs, **arrays), weight=weight)


def _of_element(part: Any, fields: Mapping[str, Array], count: int) -> dict[str, Array]:
    """Points and wrenches (3, variants) of an element with other values of some fields."""

    def value(name: str) -> Array:
        return np.asarray(fields[name]) if name in fields else np.array(getattr(part, name), dtype=float)[..., None]

    if part.acts_along_line:
        start, end = value("start"), value("end")
        line = np.broadcast_to(end - start, (3, count))
        length = np.sqrt(np.square(line).sum(axis=0))
        if getattr(part, "free_length", None) is not None:
            tension = value("stiffness") * (length - value("free_length"))
        else:
            tension = value("preload") if getattr(part, "preload", None) is not None else np.zeros(1)
        return {"start": np.broadcast_to(start, (3, count)), "end": np.broadcast_to(end, (3, count)),
                "force": -tension / length * line}  # fmt: skip
    axes = np.array(part.orientation)
    if "orientation" in fields:
        axes = exponential(fields["orientation"].T) @ axes
    preload = np.zeros((6, 1)) if part.preload is None else value("preload")
    wrench: Any = np.broadcast_to(preload, (6, count)).T
    force, torque = ((axes @ vectors[..., None])[..., 0].T for vectors in (wrench[:, :3], wrench[:, 3:]))
    point = np.broadcast_to(value("position"), (3, count))
    return {"start": point, "end": point, "force": force, "torque": torque}


def with_values_at(array: Array, at: Any, value: Array, count: int) -> Array:
    """Return vectors (3, variants, n) with values (3, variants, ...) in some columns."""
    result = array if array.ndim == 3 else np.repeat(array[:, None], count, axis=1)
    result = result.astype(np.result_type(result, value), copy=False)
    result[:, :, at] = value if value.ndim == 3 else value[:, :, None]
    return result
