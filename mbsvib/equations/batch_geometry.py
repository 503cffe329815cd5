"""Geometry: the mechanism in numbers, with an axis of variants where something varies and without one elsewhere."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Bushing, Input, Joint, Output
from mbsvib.elements.rows import Rows
from mbsvib.equations.batch_springs import springs_of, stacked
from mbsvib.equations.inertia import SpatialInertia, roots
from mbsvib.mechanism.changes import rotations
from mbsvib.mechanism.topology import FLOATS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.ports import Ports
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.mechanism import Mechanism


def varied(model: Mechanism, scene: Scene, values: Values) -> Scene:
    """Return the mechanism in numbers, in all variants.

    Parameters
    ----------
    model : Mechanism
        The mechanism, for its inputs and outputs.
    scene : Scene
        The same in numbers, as it is.
    values : Values
        What varies.

    Returns
    -------
    Scene
        Arrays (3, n) of vectors become (3, variants, n) where they vary, all others (variants, ...).
    """
    number = {name: i for i, name in enumerate(scene.topology.bodies)}
    number["ground"] = len(scene.bodies)
    moved = {number[name]: whole["position"] for name, whole in values.fields.items()
             if name in number and "position" in whole}  # fmt: skip
    position = scene.position
    if moved:
        position = np.repeat(position[None], values.count, axis=0)
        for body, array in moved.items():
            position[:, body] = array.T
    return replace(
        scene, position=position, coordinates=_twists(scene, values, moved), cuts=_cuts(scene, values),
        springs=springs_of(scene, values, number), port=_ports(model, scene.port, values.count, moved, number),
        inertia=_inertia(scene, values, number),
    )  # fmt: skip


def _twists(scene: Scene, values: Values, moved: Mapping[int, Array]) -> Twists:
    twists, start = scene.coordinates, 0
    linear, angular, point = twists.linear, twists.angular, twists.point
    for branch in sorted(scene.topology.branches, key=_order):
        joint = None if branch.joint == FLOATS else scene.topology.joints[branch.joint]
        at = slice(start, start + (6 if joint is None else len(joint.freedom)))
        start = at.stop
        whole = values.fields.get(joint.name, {}) if joint is not None else {}
        if joint is not None and joint.kind == "distance" and whole:
            linear, angular, point = (stacked(array, values.count) for array in (linear, angular, point))
            six, point[:, :, at] = _of_rods(joint.name, values, "freedom")
            linear[:, :, at], angular[:, :, at] = six[:3], six[3:]
            continue
        carried = joint is None or joint.position is None
        place = moved.get(branch.body) if carried else whole.get("position")
        if place is not None:
            point = stacked(point, values.count)
            point[:, :, at] = place[:, :, None]
        if "pitch" in whole:
            linear = stacked(linear, values.count)
            linear[:, :, at] = whole["pitch"][:, None] * twists.angular[:, None, at]
        if "orientation" in whole:
            turn = rotations(whole["orientation"])
            linear = stacked(linear, values.count)
            angular = stacked(angular, values.count)
            linear[:, :, at] = _turned(turn, linear[:, :, at])
            angular[:, :, at] = _turned(turn, angular[:, :, at])
    return replace(twists, linear=linear, angular=angular, point=point)


def _of_rods(name: str, values: Values, directions: str) -> tuple[Array, Array]:
    """Six-vectors (6, variants, n) of a distance joint, whose axes follow its two points, and where they are taken."""
    joints: list[Any] = [values.part(name, i) for i in range(values.count)]
    six = np.array([[vector for _, vector in getattr(joint, directions)] for joint in joints])
    return np.moveaxis(six, -1, 0), np.array([joint.point for joint in joints]).T[:, :, None]


def _order(branch: object) -> tuple[bool, int]:
    """Coordinates come in the order of the joints, those of floating bodies last."""
    joint: int = branch.joint  # type: ignore[attr-defined]
    return (joint == FLOATS, joint)


def _turned(turn: Array, vectors: Array) -> Array:
    """Turn vectors (3, variants, n) by matrices (variants, 3, 3)."""
    result: Array = np.einsum("vij,jvk->ivk", turn, vectors)
    return result


def _cuts(scene: Scene, values: Values) -> Cuts | None:
    cuts = scene.cuts
    if cuts is None:
        return None
    point, force, moment = cuts.rows.point, cuts.rows.force, cuts.rows.moment
    for count, k in enumerate(scene.topology.cut):
        joint = scene.topology.joints[k]
        whole = values.fields.get(joint.name, {})
        rows = np.flatnonzero(cuts.joint == count)
        if joint.kind == "distance" and whole:
            force, point = stacked(force, values.count), stacked(point, values.count)
            six, point[:, :, rows] = _of_rods(joint.name, values, "locked")
            force[:, :, rows] = six[:3]
            continue
        if "position" in whole:  # where a joint has none, what it locks is the same at every point
            point = stacked(point, values.count)
            point[:, :, rows] = whole["position"][:, :, None]
        if "pitch" in whole:
            moment = stacked(moment, values.count)
            row = rows[[direction for direction, _ in joint.locked].index("z")]
            moment[:, :, row] = -whole["pitch"] * cuts.rows.force[:, None, row]
        if "orientation" in whole:
            turn = rotations(whole["orientation"])
            force = stacked(force, values.count)
            moment = stacked(moment, values.count)
            force[:, :, rows] = _turned(turn, force[:, :, rows])
            moment[:, :, rows] = _turned(turn, moment[:, :, rows])
    couplings = cuts.couplings
    if couplings is not None:
        from mbsvib.equations.batch_couplers import varied_couplings

        couplings = varied_couplings(couplings, scene, values)
    return replace(cuts, rows=Rows(cuts.rows.first, cuts.rows.second, point, force, moment), couplings=couplings)


def _ports(model: Mechanism, port: Ports, count: int, moved: Mapping[int, Array], number: Mapping[str, int]) -> Ports:
    """Ports without a position are at the centre of mass of their body."""
    if not moved:
        return port
    parts = [part for part in (*model.inputs.values(), *model.outputs.values()) if isinstance(part, Input | Output)]
    point, carried = port.rows.point, {}
    for row, part in enumerate(parts):
        body = _centre(part, number)
        if part.position is None and body in moved:
            point = stacked(point, count)
            point[:, :, row] = moved[body]
            carried[part] = moved[body].T
    return replace(port, rows=replace(port.rows, point=point), inertial_outputs=tuple(
        (row, output, carried.get(output, at)) for row, output, at in port.inertial_outputs))  # fmt: skip


def _centre(part: Input | Output, number: Mapping[str, int]) -> int:
    """The body at whose centre of mass a port is: its own, or the one it refers to where its own is the ground."""
    a, b = number[part.relative_to], number[part.body]
    return b if b < len(number) - 1 else a


def _inertia(scene: Scene, values: Values, number: Mapping[str, int]) -> SpatialInertia:
    linear, angular = scene.inertia.linear, scene.inertia.angular
    for name, whole in values.fields.items():
        if name not in number:
            continue
        i = number[name]
        body = scene.bodies[i]
        if "mass" in whole:
            linear = np.repeat(linear[None], values.count, axis=0) if linear.ndim == 1 else linear
            linear[:, i] = np.sqrt(whole["mass"])
        if "inertia" in whole or "orientation" in whole:
            angular = np.repeat(angular[None], values.count, axis=0) if angular.ndim == 3 else angular
            axes = np.array(body.orientation)
            if "orientation" in whole:
                axes = rotations(whole["orientation"]) @ axes
            root = roots(whole["inertia"].T if "inertia" in whole else np.array([body.inertia]))
            angular[:, i] = root @ np.swapaxes(axes, -1, -2)
    return SpatialInertia(linear, angular)


def moves_geometry(values: Values) -> bool:
    """Tell whether anything varies but masses, inertia, stiffness and damping."""
    return values.varies((Joint,)) or any(
        field in whole for whole in values.fields.values() for field in ("position", "start", "end")
    ) or values.varies((Bushing,), "orientation")


def slice_variant(array: Array, i: int) -> Array:
    """Return vectors (3, n) of variant ``i`` out of (3, variants, n)."""
    return array if array.ndim == 2 else array[:, i]


def cuts_of(cuts: Cuts, i: int) -> Cuts:
    """Return the locked rows of one variant."""
    rows, couplings = cuts.rows, cuts.couplings
    if couplings is not None:
        from mbsvib.equations.batch_couplers import couplings_of

        couplings = couplings_of(couplings, i)
    return replace(cuts, couplings=couplings, rows=Rows(rows.first, rows.second, *(
        slice_variant(array, i) for array in (rows.point, rows.force, rows.moment))))  # fmt: skip


def twists_of(twists: Twists, i: int) -> Twists:
    """Return the joint coordinates of one variant."""
    return replace(twists, linear=slice_variant(twists.linear, i), angular=slice_variant(twists.angular, i),
                   point=slice_variant(twists.point, i))  # fmt: skip

