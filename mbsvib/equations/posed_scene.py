"""The scene of a mechanism without forces in many poses: directions and points of rows go with the bodies they are on.

Rows of elements along a line go from a point of the first body to one of the second; those of other elements turn with
the first body, at a point of the second. Points of ports go with their bodies, while their directions stay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.rows import Rows
from mbsvib.equations.inertia import SpatialInertia
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.kinematics.characteristic_length import size_of
from mbsvib.kinematics.pose import start
from mbsvib.kinematics.pose_kinematics import pose_kinematics
from mbsvib.linalg.rotations import components_first

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.equations import Equations
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.pose import Pose
    from mbsvib.kinematics.pose_kinematics import PoseKinematics
    from mbsvib.mechanism.mechanism import Mechanism


@dataclass(frozen=True)
class PosedScene:
    """How the arrays of a mechanism follow from poses.

    ``kinematics`` are those of its tree. ``lines`` (k,) are the columns of elements along lines, with their ``start``
    and ``end`` (k, 3) [m]; ``others`` those of other elements. ``holder`` (ports,) are the bodies of the ports' points.
    """

    kinematics: PoseKinematics
    lines: Index
    start: Array
    end: Array
    others: Index
    holder: Index

    def at(self, scene: Scene, pose: Pose) -> Scene:
        """Return the arrays in poses (v): vectors become (3, v, n), all others (v, ...)."""
        coordinates, cuts = self.kinematics.at(pose)
        rotations = pose.rotations[:, :-1]
        inertia = SpatialInertia(scene.inertia.linear, scene.inertia.angular @ rotations.swapaxes(-1, -2))
        springs, rows = scene.springs, scene.springs.rows
        force, moment, point = (np.repeat(array[:, None], len(rotations), axis=1)
                                for array in (rows.force, rows.moment, rows.point))  # fmt: skip
        first, second, lines, others = rows.first, rows.second, self.lines, self.others
        begin = pose.points(first[lines], self.start)
        line = pose.points(second[lines], self.end) - begin
        line /= np.sqrt((line * line).sum(axis=-1, keepdims=True))
        force[..., lines], point[..., lines] = components_first(line), components_first(begin)
        for array in (force, moment):
            turned = pose.vectors(first[others], array[:, 0, others].T)
            array[..., others] = components_first(turned)
        point[..., others] = components_first(pose.points(second[others], rows.point[:, others].T))
        port = scene.port.rows
        at = np.ascontiguousarray(components_first(pose.points(self.holder, port.point.T)))
        return replace(
            scene, position=pose.centre[:, :-1], coordinates=coordinates, cuts=cuts, inertia=inertia,
            springs=replace(springs, rows=Rows(first, second, point, force, moment)),
            port=replace(scene.port, rows=replace(port, point=at)),
        )  # fmt: skip


def posed_scene(user_model: Mechanism, model: Mechanism, scene: Scene, nominal: Equations) -> PosedScene | None:
    """Return how the arrays of a mechanism follow from poses; None where they have parts of which this is not stated.

    These are forces at the pose, spin, motions without mass, parts that others stand for, couplers, redundant loops,
    forces in joints, and outputs relative to inertial space.
    """
    port, provenance = scene.port, nominal.provenance
    redundant = any(group.surplus for group in provenance.reduction.groups)
    turning = any(joint.successive and joint.free is not None for joint in scene.topology.joints)
    replaced = model.expansion is not None or list(user_model.bodies) != list(model.bodies)
    if (scene.loads is not None or model.derived(has_antisymmetric_forces) or provenance.separation is not None
            or turning or replaced or redundant or scene.couplers or port.wrench_outputs or port.inertial_outputs
            or port.base_motions):  # fmt: skip
        return None
    pose, number = start(model), scene.topology.body_numbers
    kinematics = pose_kinematics(scene.topology, pose, scene.coordinates, scene.cuts, (), size_of(model))
    owners = [scene.elements[i] for i in scene.springs.owner.tolist()]
    straight = np.array([part.acts_along_line for part in owners], dtype=bool)
    lines = np.flatnonzero(straight)
    ends: list[Any] = [(owners[k].points[0], owners[k].points[-1]) for k in lines.tolist()]
    begin, end = np.array(ends).reshape(-1, 2, 3).transpose(1, 0, 2)
    parts: list[Any] = [*model.inputs.values(), *(part for part in model.outputs.values() if part.element is None)]
    ground = len(number) if "ground" not in number else number["ground"]
    holder = []
    for part in parts:
        a, b = number[part.relative_to], number[part.body]
        holder.append(b if part.position is not None or b < ground else a)
    return PosedScene(kinematics, lines, begin, end, np.flatnonzero(~straight), np.array(holder, dtype=np.intp))
