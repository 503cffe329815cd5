"""Geometry of a batch: arrays of a mechanism, with an axis of variants where they vary.

Twists, locked rows and elastic rows are directions at a point of a part. In a variant they turn with its orientation,
move with its position, and are along the line between its ends.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.bushing import Bushing, symmetric_part
from mbsvib.elements.element_rows import ElementRows
from mbsvib.elements.families import connection_rows
from mbsvib.elements.rows import Rows
from mbsvib.equations.inertia import SpatialInertia, tensor_factors
from mbsvib.linalg.products import signed_rows
from mbsvib.linalg.rotations import exponential, frames_along
from mbsvib.mechanism.topology import FLOATS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.ports import Ports
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.couplings import Couplings
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.mechanism import Mechanism

# Fields of elements by which there is a row, or none.
COEFFICIENTS = ("stiffness", "damping", "inertance", "static_stiffness")


def scene_of_variants(model: Mechanism, scene: Scene, values: Values) -> Scene:
    """Return the arrays of a mechanism in all variants.

    Arrays (3, n) of vectors become (3, variants, n) where they vary, all others (variants, ...).
    """
    number, positions = scene.topology.body_numbers, moved_bodies(scene, values)
    position = scene.position
    if positions:
        position = values.repeated(position)
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


def _of_parts(
    vectors: tuple[Array, Array, Array], owners: Sequence[tuple[Any, Any]], values: Values
) -> tuple[Array, Array, Array]:
    """Directions of translations and of rotations, and their points (3, n), in all variants; ``owners`` are parts and
    their columns.
    """
    first, second, point = vectors
    for part, columns in owners:
        fields = values.fields.get(part.name, {})
        if getattr(part, "is_rod", False) and fields:
            axes = joint_axes([part], values)[0][part.name]
            own = np.array(part.axes).T
            first, second = (
                with_values_at(array, columns, np.einsum("vij,jk->ivk", axes, own @ _columns(array, columns)[:, 0]),
                               values.count)
                for array in (first, second)
            )
            point = with_values_at(point, columns, rod_ends(part, values)[1], values.count)
            continue
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
    return replace(cuts, rows=Rows(rows.first, rows.second, point, force, moment), couplings=_couplings(scene, values))


def _couplings(scene: Scene, values: Values) -> Couplings | None:
    couplings = None if scene.cuts is None else scene.cuts.couplings
    if couplings is None:
        return None
    value = couplings.value
    for i, part in enumerate(scene.couplers):
        if part.name in values.fields:
            value = values.repeated(value) if value.ndim == 1 else value
            value[:, couplings.row == i] = part.coefficients_of(values.fields[part.name]).T
    joints, rows = [joint for joint, _ in scene.measured], couplings.measured
    owners = [(joint, slice(k, k + 1)) for k, joint in enumerate(joints)]
    force, moment, point = _of_parts((rows.force, rows.moment, rows.point), owners, values)
    axes, _ = joint_axes(joints, values)
    skew = []
    for k, *pair, which in couplings.skew:
        frame = axes.get(joints[k].name)
        if frame is not None:
            turn = frame @ np.array(joints[k].axes).T
            pair = [np.einsum("vij,jk->ivk", turn, axis) for axis in pair]
        skew.append((k, pair[0], pair[1], which))
    measured = Rows(rows.first, rows.second, point, force, moment)
    return replace(couplings, value=value, measured=measured, skew=tuple(skew))


def _springs(scene: Scene, values: Values, number: Mapping[str, int]) -> ElementRows:
    """Rows of the spring-dampers, in all directions with stiffness or damping in some variant."""
    parts = list(scene.elements)
    varying = [i for i, part in enumerate(parts) if part.name in values.fields]
    if not varying:
        return scene.springs
    matrices = [i for i in varying if isinstance(scene.elements[i], Bushing) and _has_matrix(scene.elements[i])]
    for i in varying:
        if i not in matrices:
            active = {field: _active(getattr(parts[i], field), array)
                      for field, array in values.fields[parts[i].name].items() if field in COEFFICIENTS}  # fmt: skip
            parts[i] = replace(parts[i], **active)
    springs = scene.springs if parts == list(scene.elements) else connection_rows(parts, number)
    owners = [(scene.elements[i], (springs.owner == i).nonzero()[0]) for i in varying if i not in matrices]
    rows = springs.rows
    force, moment, point = _of_parts((rows.force, rows.moment, rows.point), owners, values)
    weights: dict[str, Any] = {key: value for key, value in zip(COEFFICIENTS, (
        springs.stiffness, springs.damping, springs.inertance), strict=False) if value is not None}  # fmt: skip
    for part, columns in owners:
        for field, new in part.row_values(values.fields[part.name], springs.unit[columns]).items():
            if weights[field].ndim == 1:
                weights[field] = values.repeated(weights[field])
            weights[field][:, columns] = new.T
    springs = replace(springs, rows=Rows(rows.first, rows.second, point, force, moment), **weights)
    if not matrices:
        return springs
    others = springs.take((~np.isin(springs.owner, matrices)).nonzero()[0])
    return ElementRows.join([others, *(_of_matrix(scene.elements[i], i, number, values) for i in matrices)])


def _active(nominal: Any, array: Array) -> Any:
    """Values that are not zero where some variant's is not, so that the element has a row there."""
    if array.ndim == 2:
        return tuple((array != 0.0).any(axis=1).astype(float).tolist())
    return nominal or float(array.any())


def _has_matrix(part: Any) -> bool:
    return isinstance(part.stiffness[0], tuple) or isinstance(part.damping[0], tuple)


def _of_matrix(part: Any, owner: int, number: Mapping[str, int], values: Values) -> ElementRows:
    """Rows of a bushing with matrices: eigenvectors of its stiffness, then of its damping (symmetric parts)."""
    fields, count = values.fields[part.name], values.count
    axes = np.broadcast_to(np.array(part.orientation), (count, 3, 3))
    if "orientation" in fields:
        axes = exponential(fields["orientation"].T) @ np.array(part.orientation)
    point = np.broadcast_to(fields.get("position", np.array(part.position)[:, None]), (3, count))
    values_of, units = [], []
    for field in ("stiffness", "damping"):
        matrix = np.moveaxis(fields[field], -1, 0) if field in fields else np.array(getattr(part, field))
        if matrix.shape[-2:] != (6, 6):
            matrix = matrix[..., None] * np.eye(6)
        value, unit = signed_rows(symmetric_part(np.broadcast_to(matrix, (count, 6, 6))))
        values_of.append(value)
        units.append(unit)
    unit = np.concatenate(units, axis=1)
    force, moment = (np.einsum("vij,vrj->ivr", axes, unit[..., half]) for half in (slice(3), slice(3, 6)))
    length = unit.shape[1]
    first, second = (np.full(length, number[body], dtype=np.intp) for body in (part.first, part.second))
    rows = Rows(first, second, np.repeat(point[:, :, None], length, axis=2), force, moment)
    stiffness, damping = (np.concatenate([value if i == k else np.zeros_like(value)
                                          for i, value in enumerate(values_of)], axis=1) for k in (0, 1))  # fmt: skip
    return ElementRows(rows, stiffness, damping, np.full(length, owner, dtype=np.intp), unit)


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
            linear = values.repeated(linear) if linear.ndim == 1 else linear
            linear[:, i] = np.sqrt(fields["mass"])
        if "inertia" in fields or "orientation" in fields:
            angular = values.repeated(angular) if angular.ndim == 3 else angular
            axes = np.array(body.orientation)
            if "orientation" in fields:
                axes = exponential(fields["orientation"].T) @ axes
            root = tensor_factors(fields["inertia"].T if "inertia" in fields else np.array([body.inertia]))
            angular = _with_rows(angular, root.shape[-2])
            angular[:, i, : root.shape[-2]] = root @ np.swapaxes(axes, -1, -2)
    return SpatialInertia(linear, angular)


def _with_rows(angular: Array, count: int) -> Array:
    """Square roots of tensors (variants, bodies, rows, 3) with at least so many rows, further ones zero."""
    missing = max(0, count - angular.shape[-2])
    return np.pad(angular, ((0, 0), (0, 0), (0, missing), (0, 0))) if missing else angular


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
