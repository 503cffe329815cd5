"""Geometry of a batch: arrays of a mechanism, with an axis of variants where they vary.

Twists, locked rows and elastic rows are directions at a point of a part. In a variant they turn with its orientation,
move with its position, and are along the line between its ends.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.families import connection_rows
from mbsvib.elements.rows import Rows
from mbsvib.equations.inertia import SpatialInertia, tensor_factors
from mbsvib.linalg.rotations import exponential
from mbsvib.mechanism.topology import FLOATS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements.element_rows import ElementRows
    from mbsvib.elements.part import Part
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.ports import Ports
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.mechanism import Mechanism


def scene_of_variants(model: Mechanism, scene: Scene, values: Values) -> Scene:
    """Return the arrays of a mechanism in all variants.

    No line of a distance joint and no 6x6 matrix varies. Arrays (3, n) of vectors become (3, variants, n) where they
    vary, all others (variants, ...).
    """
    number, positions = scene.topology.body_numbers, moved_bodies(scene, values)
    position = scene.position
    if positions:
        position = np.repeat(position[None], values.count, axis=0)
        for body, array in positions.items():
            position[:, body] = array.T
    return replace(
        scene, position=position, coordinates=_twists(scene, values, positions), cuts=_cuts(scene, values),
        springs=_springs(scene, values, number), port=_ports(model, scene.port, positions, number),
        inertia=_inertia(scene, values, number),
    )  # fmt: skip


def moved_bodies(scene: Scene, values: Values) -> dict[int, Array]:
    """Return the centres of mass (3, variants) [m] that differ in variants, by the number of the body."""
    number = scene.topology.body_numbers
    return {number[name]: fields["position"] for name, fields in values.fields.items()
            if name in number and "position" in fields}  # fmt: skip


def with_values_at(array: Array, at: Any, value: Array, count: int) -> Array:
    """Vectors (3, variants, n) with values (3, variants, ...) in some columns."""
    result = array if array.ndim == 3 else np.repeat(array[:, None], count, axis=1)
    result[:, :, at] = value if value.ndim == 3 else value[:, :, None]
    return result


def _of_parts(
    vectors: tuple[Array, Array, Array], owners: Sequence[tuple[Part, Any]], values: Values
) -> tuple[Array, Array, Array]:
    """Directions of translations and of rotations, and their points (3, n), in all variants; ``owners`` are parts and
    their columns.
    """
    first, second, point = vectors
    for part, columns in owners:
        fields = values.fields.get(part.name, {})
        if "orientation" in fields:
            rotation = exponential(fields["orientation"].T)
            first, second = (
                with_values_at(array, columns, np.einsum("vij,jvk->ivk", rotation, _columns(array, columns)),
                                values.count)
                for array in (first, second)
            )
        if "position" in fields:
            point = with_values_at(point, columns, fields["position"], values.count)
        if "start" in fields or "end" in fields:
            start, end = (np.broadcast_to(fields.get(field, np.array(getattr(part, field))[:, None]), (3, values.count))
                          for field in ("start", "end"))  # fmt: skip
            line = end - start
            first = with_values_at(first, columns, line / np.sqrt(np.einsum("iv,iv->v", line, line)), values.count)
            point = with_values_at(point, columns, start, values.count)
    return first, second, point


def _columns(array: Array, at: Any) -> Array:
    """Some columns of vectors, with an axis of variants of length one if they are constant."""
    result: Array = array[:, None, at] if array.ndim == 2 else array[:, :, at]
    return result


def _at_centres(point: Array, bodies: Sequence[tuple[int, Any]], positions: Mapping[int, Array]) -> Array:
    """Points at the new centres of mass of ``bodies``, given by number and columns."""
    for body, columns in bodies:
        if body in positions:
            point = with_values_at(point, columns, positions[body], positions[body].shape[1])
    return point


def _twists(scene: Scene, values: Values, positions: Mapping[int, Array]) -> Twists:
    twists, start = scene.coordinates, 0
    linear, owners, at_centre = twists.linear, [], []
    # coordinates come in the order of the joints, those of floating bodies last
    for branch in sorted(scene.topology.branches, key=lambda one: (one.joint == FLOATS, one.joint)):
        joint = None if branch.joint == FLOATS else scene.topology.joints[branch.joint]
        columns = slice(start, start + (6 if joint is None else len(joint.freedom)))
        start = columns.stop
        if joint is None or joint.position is None:
            at_centre.append((branch.body, columns))
        if joint is not None:
            owners.append((joint, columns))
            pitch = values.fields.get(joint.name, {}).get("pitch")
            if pitch is not None:
                along = pitch[:, None] * twists.angular[:, None, columns]
                linear = with_values_at(linear, columns, along, values.count)
    linear, angular, point = _of_parts((linear, twists.angular, twists.point), owners, values)
    return replace(twists, linear=linear, angular=angular, point=_at_centres(point, at_centre, positions))


def _cuts(scene: Scene, values: Values) -> Cuts | None:
    cuts = scene.cuts
    if cuts is None:
        return None
    rows, moment, owners = cuts.rows, cuts.rows.moment, []
    for count, k in enumerate(scene.topology.cut):
        joint, rows_of_joint = scene.topology.joints[k], np.flatnonzero(cuts.joint == count)
        owners.append((joint, rows_of_joint))
        pitch = values.fields.get(joint.name, {}).get("pitch")
        if pitch is not None:
            row = rows_of_joint[[direction == "z" for direction, _ in joint.locked]]
            moment = with_values_at(moment, row, -pitch[:, None] * rows.force[:, None, row], values.count)
    force, moment, point = _of_parts((rows.force, moment, rows.point), owners, values)
    return replace(cuts, rows=Rows(rows.first, rows.second, point, force, moment))


def _springs(scene: Scene, values: Values, number: Mapping[str, int]) -> ElementRows:
    """Rows of the spring-dampers, in all directions with stiffness or damping in some variant."""
    parts = list(scene.elements)
    varying = [i for i, part in enumerate(parts) if part.name in values.fields]
    if not varying:
        return scene.springs
    for i in varying:
        active: dict[str, Any] = {field: tuple((array != 0.0).any(axis=1).astype(float).tolist())
                                for field, array in values.fields[parts[i].name].items()
                                if field in ("stiffness", "damping") and array.ndim == 2}  # fmt: skip
        if active:
            parts[i] = replace(parts[i], **active)
    springs = scene.springs if parts == list(scene.elements) else connection_rows(parts, number)
    owners = [(scene.elements[i], (springs.owner == i).nonzero()[0]) for i in varying]
    rows = springs.rows
    force, moment, point = _of_parts((rows.force, rows.moment, rows.point), owners, values)
    weights = {"stiffness": springs.stiffness, "damping": springs.damping}
    if springs.inertance is not None:
        weights["inertance"] = springs.inertance
    for part, columns in owners:
        for field in weights.keys() & values.fields[part.name].keys():
            array, new = weights[field], values.fields[part.name][field]
            array = array if array.ndim == 2 else np.repeat(array[None], values.count, axis=0)
            new = new[None] if new.ndim == 1 else new[springs.unit[columns].argmax(axis=1)]
            array[:, columns] = new.T
            weights[field] = array
    return replace(springs, rows=Rows(rows.first, rows.second, point, force, moment), **weights)


def _ports(model: Mechanism, port: Ports, positions: Mapping[int, Array], number: Mapping[str, int]) -> Ports:
    """Ports; without a position they are at the centre of mass of their body, or of the body relative to ground."""
    if not positions:
        return port
    parts: list[Any] = [*(part for part in model.inputs.values() if not part.moves_ground),
                        *(part for part in model.outputs.values() if part.element is None)]  # fmt: skip
    at_centre, centres = [], {}
    for row, part in enumerate(parts):
        a, b = number[part.relative_to], number[part.body]
        body = b if b < len(number) - 1 else a
        if part.position is None and body in positions:
            at_centre.append((body, slice(row, row + 1)))
            centres[part] = positions[body].T
    return replace(port, rows=replace(port.rows, point=_at_centres(port.rows.point, at_centre, positions)),
                   inertial_outputs=tuple((row, output, centres.get(output, at))
                                          for row, output, at in port.inertial_outputs))  # fmt: skip


def _inertia(scene: Scene, values: Values, number: Mapping[str, int]) -> SpatialInertia:
    linear, angular = scene.inertia.linear, scene.inertia.angular
    for name, fields in values.fields.items():
        if name not in number:
            continue
        i = number[name]
        body = scene.bodies[i]
        if "mass" in fields:
            linear = np.repeat(linear[None], values.count, axis=0) if linear.ndim == 1 else linear
            linear[:, i] = np.sqrt(fields["mass"])
        if "inertia" in fields or "orientation" in fields:
            angular = np.repeat(angular[None], values.count, axis=0) if angular.ndim == 3 else angular
            axes = np.array(body.orientation)
            if "orientation" in fields:
                axes = exponential(fields["orientation"].T) @ axes
            root = tensor_factors(fields["inertia"].T if "inertia" in fields else np.array([body.inertia]))
            angular[:, i] = root @ np.swapaxes(axes, -1, -2)
    return SpatialInertia(linear, angular)


def scene_of_variant(scene: Scene, i: int) -> Scene:
    """Return the geometry of one variant, of joints and loops."""
    twists, cuts = scene.coordinates, scene.cuts
    linear, angular, point = (_of_variant(array, i) for array in (twists.linear, twists.angular, twists.point))
    if cuts is not None:
        rows = cuts.rows
        cuts = replace(cuts, rows=Rows(rows.first, rows.second, *(
            _of_variant(array, i) for array in (rows.point, rows.force, rows.moment))))  # fmt: skip
    return replace(scene, position=scene.position if scene.position.ndim == 2 else scene.position[i], cuts=cuts,
                   coordinates=replace(twists, linear=linear, angular=angular, point=point))  # fmt: skip


def _of_variant(array: Array, i: int) -> Array:
    return array if array.ndim == 2 else array[:, i]
