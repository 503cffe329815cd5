"""Places and axes of single parts in variants, and the geometry of one variant of many."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.rows import Rows
from mbsvib.equations.inertia import SpatialInertia
from mbsvib.linalg.rotations import exponential, frames_along

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.pose import Pose
    from mbsvib.mechanism.topology import Topology


def moved_bodies(scene: Scene, values: Values) -> dict[int, Array]:
    """Return the centres of mass (3, variants) [m] that differ in variants, by the number of the body."""
    number = scene.topology.body_numbers
    return {number[name]: values.numbers[fields["position"]] for name, fields in values.index.items()
            if name in number and "position" in fields}  # fmt: skip


def joint_axes(joints: Sequence[Joint], values: Values) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return the axes (variants, 3, 3) and the lengths (variants,), of rods or pitches, of joints by name, where
    variants differ in them.
    """
    axes, lengths = {}, {}
    for joint in joints:
        fields = values.fields.get(joint.name, {})
        if "orientation" in fields:
            axes[joint.name] = exponential(fields["orientation"].T) @ np.array(joint.axes)
        if "pitch" in fields:
            lengths[joint.name] = fields["pitch"]
        if joint.is_rod and fields:
            rod = rod_ends(joint, values)
            line = rod[1] - rod[0]
            lengths[joint.name] = length = np.sqrt(np.square(line).sum(axis=0))
            axes[joint.name] = frames_along((line / length).T)
    return axes, lengths


def fixed_points(topology: Topology, values: Values, pose: Pose | None) -> dict[int, Array]:
    """Return the points (variants, 3) [m] of joints without coordinates, by number, where variants differ in them."""
    result: dict[int, Array] = {}
    if pose is None and not any("position" in fields for fields in values.index.values()):
        return result
    for k, joint in enumerate(topology.joints):
        if joint.point is None or joint.freedom:
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


def with_values_at(array: Array, at: Any, value: Array, count: int) -> Array:
    """Vectors (3, variants, n) with values (3, variants, ...) in some columns."""
    result = array if array.ndim == 3 else np.repeat(array[:, None], count, axis=1)
    result = result.astype(np.result_type(result, value), copy=False)
    result[:, :, at] = value if value.ndim == 3 else value[:, :, None]
    return result


def scene_of_variant(scene: Scene, i: int) -> Scene:
    """Return the geometry and the inertia of one variant, of bodies, joints and loops."""
    twists, cuts, inertia = scene.coordinates, scene.cuts, scene.inertia
    linear, angular, point = (_of_variant(array, i) for array in (twists.linear, twists.angular, twists.point))
    if cuts is not None:
        couplings = cuts.couplings
        if couplings is not None:
            skew = tuple([(k, _of_variant(a, i), _of_variant(b, i), which) for k, a, b, which in couplings.skew])
            couplings = replace(couplings, value=couplings.value if couplings.value.ndim == 1 else couplings.value[i],
                                measured=_rows_of_variant(couplings.measured, i), skew=skew)  # fmt: skip
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
