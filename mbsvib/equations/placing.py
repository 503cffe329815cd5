"""Directions and points of rows and twists as functions of the numbers of the parts that own them.

Twists, locked rows and elastic rows are directions at a point of a part. They turn with its orientation, move with its
position, and are along the line between its ends. Which columns follow which numbers is found once; for many variants
the vectors are then made by a few operations on all columns.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.elements import Joint
from mbsvib.elements.pose import Pose
from mbsvib.elements.rows import Rows
from mbsvib.equations.batch_values import Values
from mbsvib.equations.inertia import SpatialInertia
from mbsvib.equations.scene import Scene
from mbsvib.linalg.rotations import frames_along
from mbsvib.mechanism.changes import Slots
from mbsvib.mechanism.topology import Topology

Vectors = tuple["Array", "Array", "Array"]


@dataclass
class _Columns:
    """Columns, with rows of numbers for each: a list of arrays (3,) or numbers."""

    columns: list[int] = field(default_factory=list)
    rows: list[Any] = field(default_factory=list)

    def add(self, columns: Iterable[int], row: Any) -> None:
        """Add columns that all have the same rows."""
        for column in columns:
            self.columns.append(column)
            self.rows.append(row)

    def arrays(self) -> tuple[Index, Index]:
        """The columns (k,), and the rows (k,) or (3, k)."""
        return np.array(self.columns, dtype=np.intp), np.array(self.rows, dtype=np.intp).T


@dataclass(frozen=True)
class Placing:
    """Two directions, ``first`` and ``second``, and a ``point`` (3, n) of each column, with the columns that vary.

    Columns ``placed`` have their points at the numbers ``place`` (3, k). Those ``turned`` turn with the
    rotations of parts, or with the lines of ``rods`` (start and end (3, q), axes (q, 3, 3)) behind them, whose number
    is in ``turn``. Columns ``lined`` are along the lines from ``start`` to ``end`` (3, k). In columns
    ``pitched`` the vector ``along`` (3, k) times the number ``pitch`` (k,) is the first direction, or the second one
    if ``pitches_second``.
    """

    first: Array
    second: Array
    point: Array
    placed: Index
    place: Index
    turned: Index
    turn: Index
    rods: tuple[Index, Index, Array]
    lined: Index
    start: Index
    end: Index
    pitched: Index
    pitch: Index
    along: Array
    pitches_second: bool

    @staticmethod
    def of(
        vectors: Vectors, owners: Sequence[tuple[Any, Sequence[int]]], slots: Slots,
        centres: Sequence[tuple[Index, Sequence[int]]] = (), pitched: Sequence[tuple[Index, int, Array]] = (),
        pitches_second: bool = False,
    ) -> Placing | None:  # fmt: skip
        """Return how columns follow from the numbers of their owners, None where none varies.

        ``vectors`` (3, n): directions and points of the model. ``owners``: parts and their columns. ``slots``: places
        of the numbers that vary. ``centres``: rows of the positions of bodies with the
        columns at their centres of mass. ``pitched``: row of a pitch, column, and vector.
        """
        owners = [owner for owner in owners if owner[0].name in slots.complete]
        if not (owners or centres or pitched):
            return None
        placed, turned, lined, ends = _Columns(), _Columns(), _Columns(), _Columns()
        rods: list[tuple[Index, Index, Array]] = []
        rod_columns = _Columns()
        for part, columns in owners:
            fields = slots.complete[part.name]
            if getattr(part, "is_rod", False) and fields:
                rod_columns.add(columns, len(rods))
                rods.append((fields["position"], fields["end"], np.array(part.axes)))
                placed.add(columns, fields["end"])
                continue
            if "orientation" in fields:
                turned.add(columns, slots.turning[part.name])
            if "position" in fields:
                placed.add(columns, fields["position"])
            if "start" in fields:
                lined.add(columns, fields["start"])
                ends.add(columns, fields["end"])
                placed.add(columns, fields["start"])
        for rows, columns in centres:
            placed.add(columns, rows)
        if not (placed.columns or turned.columns or lined.columns or pitched):
            return None
        turned.columns += rod_columns.columns
        turned.rows += [len(slots.turning) + k for k in rod_columns.rows]
        starts, stops, axes = zip(*rods, strict=True) if rods else ((), (), ())
        along = np.array([vector for _, _, vector in pitched]).reshape(-1, 3).T
        return Placing(
            *vectors, *placed.arrays(), *turned.arrays(),
            (np.array(starts, dtype=np.intp).T, np.array(stops, dtype=np.intp).T, np.array(axes)),
            *lined.arrays(), ends.arrays()[1], np.array([column for _, column, _ in pitched], dtype=np.intp),
            np.array([row for row, _, _ in pitched], dtype=np.intp), along, pitches_second,
        )  # fmt: skip

    def at(self, values: Values) -> Vectors:
        """Return the vectors of variants: (3, variants, n) where some vary, else (3, n)."""
        numbers = values.numbers
        first, second, point = self.first, self.second, self.point
        if len(self.pitched):
            vectors = self.along[:, None] * numbers[self.pitch].T
            if self.pitches_second:
                second = with_columns(second, self.pitched, vectors)
            else:
                first = with_columns(first, self.pitched, vectors)
        if len(self.turned):
            rotation = self._rotations(values).take(self.turn, axis=1)
            first, second = (self._rotated(array, rotation) for array in (first, second))
        if len(self.lined):
            line = numbers[self.end] - numbers[self.start]
            line /= np.sqrt(np.add.reduce(line * line))
            first = with_columns(first, self.lined, line.swapaxes(1, 2))
        if len(self.placed):
            point = with_columns(point, self.placed, numbers[self.place].swapaxes(1, 2))
        return first, second, point

    def _rotations(self, values: Values) -> Array:
        """The rotations (variants, r + q, 3, 3) of parts and of rods from their axes in the model."""
        start, end, axes = self.rods
        if not len(axes):
            return values.rotations
        line = values.numbers[end] - values.numbers[start]
        line /= np.sqrt(np.add.reduce(line * line))
        return np.concatenate((values.rotations, frames_along(line.transpose(2, 1, 0)) @ axes.swapaxes(1, 2)), axis=1)

    def _rotated(self, array: Array, rotation: Array) -> Array:
        """Vectors with the columns that turn; those that are zero stay constant."""
        own = array[..., self.turned]
        if not own.any():
            return array
        letters = "vcij,jc->ivc" if own.ndim == 2 else "vcij,jvc->ivc"
        return with_columns(array, self.turned, np.einsum(letters, rotation, own))


def with_columns(array: Array, columns: Any, vectors: Array) -> Array:
    """Return vectors (3, n) or (3, variants, n) with others (3, variants, k) in some columns."""
    lead = array if array.ndim == 3 else array[:, None]
    result = np.empty((3, vectors.shape[1], array.shape[-1]), np.result_type(array, vectors))
    result[:] = lead
    result[:, :, columns] = vectors
    return result


def moved_bodies(scene: Scene, values: Values) -> dict[int, Array]:
    """Return the centres of mass (3, variants) [m] that differ in variants, by the number of the body."""
    number = scene.topology.body_numbers
    return {number[name]: values.numbers[fields["position"]] for name, fields in values.index.items()
            if name in number and "position" in fields}  # fmt: skip


def joint_axes(joints: Sequence[Joint], values: Values) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return axes (variants, 3, 3) and lengths (variants,), of rods or pitches, of the joints that vary, by name."""
    axes, lengths, turning = {}, {}, values.slots.turning
    turned = [joint for joint in joints if joint.name in turning and not joint.is_rod]
    if turned:
        rotations = values.rotations[:, [turning[joint.name] for joint in turned]].swapaxes(0, 1)
        now = rotations @ np.array([joint.axes for joint in turned])[:, None]
        axes = dict(zip([joint.name for joint in turned], now, strict=True))
    for joint in joints:
        if not (fields := values.index.get(joint.name)):
            continue
        if "pitch" in fields:
            lengths[joint.name] = values.numbers[fields["pitch"]]
        if joint.is_rod:
            rod = rod_ends(joint, values)
            line = rod[1] - rod[0]
            lengths[joint.name] = length = np.sqrt(np.square(line).sum(axis=0))
            axes[joint.name] = frames_along((line / length).T)
    return axes, lengths


def fixed_points(topology: Topology, values: Values, pose: Pose | None) -> dict[int, Array]:
    """Return the points (variants, 3) [m] of joints without coordinates or locked rows, where variants differ in them.

    They are by the numbers of the joints.
    """
    result: dict[int, Array] = {}
    if pose is None and not any("position" in fields for fields in values.index.values()):
        return result
    for k, joint in enumerate(topology.joints):
        if joint.point is None or (joint.freedom and joint.locked):
            continue
        if pose is not None:
            second = np.array([topology.body_numbers[joint.second]])
            result[k] = pose.points(second, np.array([joint.point]))[..., 0, :]
        elif "position" in values.fields.get(joint.name, {}):
            result[k] = values.fields[joint.name]["position"].T
    return result


def rod_ends(joint: Joint, values: Values) -> tuple[Array, Array]:
    """Return the points (3, variants) [m] of a rod on its first and on its second body."""
    fields = values.fields.get(joint.name, {})
    start, end = (np.broadcast_to(fields.get(field, np.array(getattr(joint, field))[:, None]), (3, values.count))
                  for field in ("position", "end"))  # fmt: skip
    return start, end


def scene_of_variant(scene: Scene, i: int) -> Scene:
    """Return the geometry and the inertia of one variant, of bodies, joints and loops."""
    twists, cuts, inertia = scene.coordinates, scene.cuts, scene.inertia
    linear, angular, point = (_of_variant(array, i) for array in (twists.linear, twists.angular, twists.point))
    if cuts is not None:
        couplings = cuts.couplings
        if couplings is not None:
            couplings = replace(couplings, value=couplings.value if couplings.value.ndim == 1 else couplings.value[i],
                                measured=_rows_of_variant(couplings.measured, i))  # fmt: skip
        cuts = replace(cuts, rows=_rows_of_variant(cuts.rows, i), couplings=couplings)
    inertia = SpatialInertia(inertia.linear if inertia.linear.ndim == 1 else inertia.linear[i],
                             inertia.angular if inertia.angular.ndim == 3 else inertia.angular[i])  # fmt: skip
    position = scene.position if scene.position.ndim == 2 else scene.position[i]
    return replace(scene, position=position, cuts=cuts, inertia=inertia,
                   coordinates=replace(twists, linear=linear, angular=angular, point=point))  # fmt: skip


def _rows_of_variant(rows: Rows, i: int) -> Rows:
    return Rows(rows.first, rows.second, *(_of_variant(array, i) for array in (rows.point, rows.force, rows.moment)))


def _of_variant(array: Array, i: int) -> Array:
    return array if array.ndim == 2 else array[:, i]
