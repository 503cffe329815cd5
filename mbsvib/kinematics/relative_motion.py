"""Kinematics: from joint coordinates to relative displacements of two bodies.

A joint coordinate moves all outer bodies by a twist (v, w) at the joint's point p. A body with centre c then moves by
v + w x (c - p) and turns by w, so every entry follows from the geometry without accumulation along a chain. The
relative displacement of two bodies depends only on the joints on the tree path between them (the path rule): the signs
of the common joints cancel as integers, not as rounded numbers.

Geometry may have an axis of variants before its last one, vectors (3, variants, n) instead of (3, n). Results then have
it as their first axis, (variants, ...).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.common.fast_init import fast_init
from mbsvib.elements import Body, Joint
from mbsvib.elements.rows import Rows, columns
from mbsvib.linalg.rank import LARGEST_ROUNDING, ZERO_MOTION
from mbsvib.linalg.rotations import CYCLE
from mbsvib.mechanism.topology import FLOATS, Branch, Topology

# Paths of up to this number of rows times coordinates are cached: a few megabytes in all.
REMEMBERED = 20_000
_FREE = tuple((d, tuple(float(i == j) for j in range(6))) for i, d in enumerate(("x", "y", "z", "rx", "ry", "rz")))


@fast_init
@dataclass(frozen=True, slots=True)
class Twists:
    """The joint coordinates of the tree as twists in world axes.

    ``linear`` and ``angular`` (3, n) at ``point`` (3, n) [m]; ``path`` (bodies + 1, n) holds +1 or -1 where the
    coordinate lies on the path from ground to the body (last row: ground); ``turns`` (n,) is true for rotations (rad)
    and false for translations (m); ``pitch`` [m] is the largest one of the screws, cut ones included. Components come
    first, so that each is one contiguous vector.
    """

    names: tuple[str, ...]
    linear: Array
    angular: Array
    point: Array
    path: NDArray[np.int8]
    turns: Bools
    pitch: float = 0.0


@fast_init
@dataclass(frozen=True, slots=True)
class Triplets:
    """A matrix of ``shape`` by its entries: ``row`` (ascending) and ``column`` (entries,), ``value`` (..., entries)."""

    row: Index
    column: Index
    value: Array
    shape: tuple[int, int]

    def nonzero_rows(self, start: int, stop: int) -> Bools:
        """Tell which of the rows start..stop have an entry that is not zero."""
        entry = self.value != 0.0
        result = np.zeros(self.shape[0], dtype=bool)
        result[self.row[entry if entry.ndim == 1 else entry.any(axis=0)]] = True
        return result[start:stop]

    def dense(self, start: int, stop: int, columns: Bools | None = None) -> Array:
        """Return the rows start..stop, those that ``columns`` picks of them, as an array (..., rows, columns)."""
        first, last = self.row.searchsorted((start, stop)).tolist()
        row, column, value = self.row[first:last] - start, self.column[first:last], self.value[..., first:last]
        count = stop - start if columns is None else int(np.count_nonzero(columns))
        if columns is not None and count < len(columns):
            picked = columns.take(row).nonzero()[0]
            row = (columns.cumsum() - 1).take(row.take(picked))
            column, value = column.take(picked), value.take(picked, axis=-1)
        result = np.zeros((*value.shape[:-1], count, self.shape[1]), value.dtype)
        if value.ndim == 1:
            result[row, column] = value
        else:
            result.reshape(len(result), -1)[:, row * self.shape[1] + column] = value
        return result


def twists(topology: Topology, bodies: list[Body]) -> Twists:
    """Return the twists of all joint coordinates of the tree.

    They are in the order in which their joints were added, those of floating bodies last.
    """
    order, path = order_and_paths(topology.branches, tuple([len(joint.freedom) for joint in topology.joints]))
    names, entries, turns, _ = twists_of_branches(topology, bodies, order)
    return Twists(names, entries[:3], entries[3:6], entries[6:], path, turns, largest_pitch(topology.joints))


def twists_of_branches(
    topology: Topology, bodies: Sequence[Body], order: Sequence[Branch]
) -> tuple[tuple[str, ...], Array, Bools, list[int]]:
    """Return names, twists (9, n) (linear, angular, point) and whether they are rotations (n,) of the coordinates of
    branches, and the number of coordinates of each branch.
    """
    names: list[str] = []
    twist: list[tuple[float, ...]] = []
    turns: list[bool] = []
    count: list[int] = []
    for branch in order:
        if branch.joint == FLOATS:
            name, at, freedom = topology.bodies[branch.body], bodies[branch.body].position, _FREE
        else:
            joint = topology.joints[branch.joint]
            name, at, freedom = joint.name, joint.point or bodies[branch.body].position, joint.freedom
        for direction, six in freedom:
            names.append(f"{name}.{direction}")
            twist.append(six + at)
            turns.append(direction[0] == "r")
        count.append(len(freedom))
    return tuple(names), columns(twist, 9), np.array(turns, dtype=bool), count


def in_order(branches: Sequence[Branch]) -> list[Branch]:
    """Return branches in the order of their coordinates: by joint as added, those of floating bodies last."""
    return [*sorted([b for b in branches if b.joint != FLOATS], key=attrgetter("joint")),
            *[b for b in branches if b.joint == FLOATS]]  # fmt: skip


@lru_cache(maxsize=16)
def order_and_paths(
    branches: tuple[Branch, ...], freedoms: tuple[int, ...]
) -> tuple[tuple[Branch, ...], NDArray[np.int8]]:
    """The branches in the order of their coordinates, and ``Twists.path``.

    Both depend on nothing but the tree and the numbers of coordinates of its joints, and are cached for mechanisms that
    are built again with other values.
    """
    order = in_order(branches)
    columns_of, n = {}, 0
    for branch in order:
        width = 6 if branch.joint == FLOATS else freedoms[branch.joint]
        columns_of[branch.body] = slice(n, n + width)
        n += width
    path = np.zeros((len(branches) + 1, n), dtype=np.int8)
    for branch in branches:
        path[branch.body] = path[branch.parent]
        path[branch.body, columns_of[branch.body]] = branch.sign
    path.setflags(write=False)
    return tuple(order), path


def largest_pitch(joints: Sequence[Joint]) -> float:
    """Return the largest pitch of the screws among joints [m], 0 where there is none."""
    return max([abs(joint.pitch) for joint in joints if joint.pitch], default=0.0)


def arm(topology: Topology, position: Array, names: Iterable[str]) -> float:
    """Return the largest distance [m], along one of the world axes, of joints from the centres of mass of the bodies
    they connect.

    ``position`` (bodies, 3): centres of mass [m]. ``names``: those of joints; others are ignored.
    """
    number = {name: i for i, name in enumerate(topology.bodies)}
    joints, requested = {joint.name: joint for joint in topology.joints}, set(names)
    arms = [np.abs(np.subtract(joint.point, position[number[body]])).max()
            for joint in map(joints.get, requested & set(joints)) if joint is not None and joint.point is not None
            for body in (joint.first, joint.second) if body in number]  # fmt: skip
    return float(max(arms, default=0.0))


def relative_motion(coordinates: Twists, rows: Rows) -> Triplets:
    """Return the rows of relative displacements per unit joint coordinate, by the path rule.

    d_r = sum over the coordinates k between first and second of +-(f_r . v_k + w_k . ((p_r - p_k) x f_r + m_r)) q_k

    Source: Jiang, Chen & Luo (2011), the linear transformation of displacements between ports.
    """
    path, first, second = (np.asarray(array, kind) for array, kind in (
        (coordinates.path, np.int8), (rows.first, np.intp), (rows.second, np.intp)))  # fmt: skip
    shape = len(first), path.shape[1]
    on_paths = _entries if shape[0] * shape[1] <= REMEMBERED else _entries.__wrapped__
    row, column, signs = on_paths(path.tobytes(), path.shape, first.tobytes(), second.tobytes())
    vectors = _alike(coordinates.linear, coordinates.angular, coordinates.point, rows.force, rows.moment, rows.point)
    return Triplets(row, column, entry_values(vectors[:3], vectors[3:], row, column, signs), shape)


def _alike(*vectors: Array) -> list[Array]:
    """Vectors (3, n), all with an axis of variants (3, variants, n) where one has it; of length one if constant."""
    if all(array.ndim == 2 for array in vectors):
        return list(vectors)
    return [array if array.ndim == 3 else array[:, None] for array in vectors]


def entry_values(twist: Sequence[Array], ends: Sequence[Array], row: Index, column: Index, sign: Any) -> Array:
    """Return sign (f . v + w . m + (p_r - p_k) . (f x w)), (..., n), for pairs of a row and a coordinate, (n,) each.

    ``twist``: v, w and p_k of the coordinates, (3, ..., coordinates) each; ``ends``: f, m and p_r of the rows.
    """
    force, moment, point = (array.take(row, axis=-1) for array in ends)
    linear, angular, start = (array.take(column, axis=-1) for array in twist)
    turned, wide = force.take(CYCLE, axis=0), angular.take(CYCLE, axis=0)
    lever = turned[1:4] * wide[2:] - turned[2:] * wide[1:4]
    terms = (point - start) * lever + (moment * angular + force * linear)
    value: Array = (terms[0] + terms[1] + terms[2]) * sign
    clear_rounding(value, force, moment, linear, angular, point, start)
    return value


@lru_cache(maxsize=32)
def _entries(path: bytes, shape: tuple[int, ...], first: bytes, second: bytes) -> tuple[Index, Index, NDArray[np.int8]]:
    """Row, column and sign of each joint coordinate on the way from ``first`` to ``second``, of arrays by their bytes.

    They depend on nothing but the tree and are cached for mechanisms that are built again with other values.
    """
    of_body = np.frombuffer(path, np.int8).reshape(shape)
    ends = [of_body.take(np.frombuffer(end, np.intp), axis=0) for end in (first, second)]
    sign = ends[1] - ends[0]
    flat: Index = (sign != 0).reshape(-1).nonzero()[0]
    row = flat // max(1, shape[1])
    column, signs = flat - shape[1] * row, sign.reshape(-1).take(flat)
    for array in (row, column, signs):
        array.setflags(write=False)
    return row, column, signs


def clear_rounding(value: Array, *vectors: Array) -> None:
    """Set entries of relative motion to zero, in place, that are rounding.

    ``value`` (..., entries): f . v + w . ((p_r - p_k) x f + m). ``vectors`` (3, ..., entries): f, m, v, w, p_r and p_k
    of each. Directions are rounded by eps of one, points by eps of their distance from the origin.
    """
    small = (np.abs(value) < LARGEST_ROUNDING) & (value != 0.0)
    if not np.count_nonzero(small):
        return
    at = (small if small.ndim == 1 else small.any(axis=0)).nonzero()[0]
    entries = value.take(at, axis=-1)
    noise = _noise(*[np.maximum.reduce(np.abs(array.take(at, axis=-1))) for array in vectors])
    entries.real[np.abs(entries) <= noise] = 0.0
    value[..., at] = entries


def _noise(force: Array, moment: Array, linear: Array, angular: Array, point: Array, start: Array) -> Array:
    """Rounding of entries made of f, m, v, w, p_r and p_k, whose sizes these are."""
    noise: Array = ZERO_MOTION * (((point + start) * force + moment) * angular + force * linear)
    return noise


def body_motion(coordinates: Twists, position: Array) -> Array:
    """Return the open-loop constraint matrix B' (..., bodies, 6, n): displacements of the bodies per unit joint
    coordinate.

    x_j = sum over the coordinates k on the path ground -> j of (v_k + w_k x (c_j - p_k), w_k) q_k

    ``position`` (..., bodies, 3): centres of mass [m], world axes. Displacements are translations of the centres of
    mass, then rotations, world axes.

    Source: Jiang, Chen & Luo (2011), open-loop constraint matrix B'.
    """
    path, n = coordinates.path[:-1], coordinates.path.shape[1]
    body, column, sign, shifts, turns = _on_paths(path.tobytes(), path.shape)
    *vectors, centre = _alike(coordinates.linear, coordinates.angular, coordinates.point,
                              position.transpose(-1, *range(position.ndim - 1)))  # fmt: skip
    linear, angular, point = (array.take(column, axis=-1) for array in vectors)
    arm, wide = (centre.take(body, axis=-1) - point).take(CYCLE, axis=0), angular.take(CYCLE, axis=0)
    translation = wide[1:4] * arm[2:]
    translation -= wide[2:] * arm[1:4]
    translation = (translation + linear) * sign
    result = np.zeros((*translation.shape[1:-1], len(path) * 6 * n), translation.dtype)
    result[..., shifts], result[..., turns] = translation.swapaxes(0, -2), (angular * sign).swapaxes(0, -2)
    return result.reshape(*result.shape[:-1], len(path), 6, n)


@lru_cache(maxsize=32)
def _on_paths(path: bytes, shape: tuple[int, int]) -> tuple[Index, Index, Array, Index, Index]:
    """Body, coordinate and sign of each coordinate on the path from ground to a body, and the places (3, k) of its
    translations and rotations in B'.
    """
    of_body = np.frombuffer(path, np.int8).reshape(shape)
    body, column = of_body.nonzero()
    at: Index = (6 * body + np.arange(6)[:, None]) * shape[1] + column
    return body, column, of_body[body, column].astype(float), at[:3], at[3:]
