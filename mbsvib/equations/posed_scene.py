"""The scene of a mechanism in other poses, one or many: directions and points of rows go with the bodies they are on.

Rows of elements along a line go from a point of the first body to one of the second; those of other elements turn with
the first body, at a point of the second. Points of ports go with their bodies, while their directions stay. Forces
follow from the pose (``posed_forces``), and with them the rows of bushings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.element_rows import ElementRows
from mbsvib.elements.rows import Rows
from mbsvib.equations.inertia import SpatialInertia
from mbsvib.equations.posed_forces import posed_forces
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.kinematics.characteristic_length import size_of
from mbsvib.kinematics.pose import start
from mbsvib.kinematics.pose_kinematics import pose_kinematics
from mbsvib.linalg.rotations import components_first

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.equations import Equations
    from mbsvib.equations.posed_forces import PosedForces
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.kinematics.pose import Pose
    from mbsvib.kinematics.pose_kinematics import PoseKinematics
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.mechanism import Mechanism


@dataclass(frozen=True)
class PosedScene:
    """How the arrays of a mechanism follow from poses.

    ``kinematics`` are those of its tree. ``lines`` (k,) are the columns of elements along lines, with their ``start``
    and ``end`` (k, 3) [m]; ``others`` those of other elements. ``holder`` (ports,) are the bodies of the ports' points.
    ``forces`` are those of loads and connections, None where none are asked for.
    """

    kinematics: PoseKinematics
    lines: Index
    start: Array
    end: Array
    others: Index
    holder: Index
    forces: PosedForces | None = None

    def at(
        self, scene: Scene, pose: Pose, relaxed: bool = False, rows: tuple[Twists, Cuts | None] | None = None
    ) -> Scene:
        """Return the arrays in a pose, or in poses (v): vectors become (3, v, n) then, all others (v, ...).

        ``rows``: the joint coordinates and locked rows there, where known.
        """
        coordinates, cuts = rows or self.kinematics.at(pose)
        rotations = pose.rotations[..., :-1, :, :]
        inertia = SpatialInertia(scene.inertia.linear, scene.inertia.angular @ rotations.swapaxes(-1, -2))
        port = scene.port.rows
        at = np.ascontiguousarray(components_first(pose.points(self.holder, port.point.T)))
        springs, loads = self._rows(scene, pose), scene.loads
        if self.forces is not None:
            applied, stiffness, damping = self.forces.at(pose, relaxed)
            loads, bushings = (applied, {}), self.forces.bushings
            if bushings.bent.any() and not relaxed:
                straight = (~np.isin(springs.owner, bushings.owner[bushings.bent])).nonzero()[0]
                springs = ElementRows.join([springs.take(straight), bushings.rows(pose, stiffness, damping)])
        return replace(
            scene, position=pose.centre[..., :-1, :], coordinates=coordinates, cuts=cuts, inertia=inertia,
            springs=springs, port=replace(scene.port, rows=replace(port, point=at)), loads=loads,
        )  # fmt: skip

    def _rows(self, scene: Scene, pose: Pose) -> ElementRows:
        """The rows of connections as they go with their bodies."""
        springs, rows = scene.springs, scene.springs.rows
        lead, lines, others = pose.centre.shape[:-2], self.lines, self.others
        force, moment, point = (
            np.broadcast_to(array.reshape(3, *[1] * len(lead), -1), (3, *lead, array.shape[-1])).copy()
            for array in (rows.force, rows.moment, rows.point))
        first, second = rows.first, rows.second
        begin = pose.points(first[lines], self.start)
        line = pose.points(second[lines], self.end) - begin
        line /= np.sqrt((line * line).sum(axis=-1, keepdims=True))
        force[..., lines], point[..., lines] = components_first(line), components_first(begin)
        for array, described in ((force, rows.force), (moment, rows.moment)):
            array[..., others] = components_first(pose.vectors(first[others], described[:, others].T))
        point[..., others] = components_first(pose.points(second[others], rows.point[:, others].T))
        return replace(springs, rows=Rows(first, second, point, force, moment))

    def joint_axes(self, pose: Pose) -> dict[str, Array]:
        """Return the axes (..., 3, 3) of all joints in a pose, by name."""
        kinematics = self.kinematics
        joints = kinematics.topology.joints
        frames = kinematics.frames(pose).take(kinematics.frame[: len(joints)], axis=-3)
        axes = frames @ np.array([joint.axes for joint in joints]).reshape(-1, 3, 3)
        return {joint.name: axes[..., k, :, :] for k, joint in enumerate(joints)}


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
    kinematics = pose_kinematics(scene.topology, start(model), scene.coordinates, scene.cuts, (), size_of(model))
    return of_parts(model, scene, kinematics)


def of_parts(
    model: Mechanism, scene: Scene, kinematics: PoseKinematics, described: Mechanism | None = None
) -> PosedScene:
    """Return how the arrays of a mechanism follow from poses; with the forces of ``described``, where given, for which
    ``model`` has bushings instead of torsion springs.
    """
    number = scene.topology.body_numbers
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
    forces = None if described is None else posed_forces(described, model)
    return PosedScene(kinematics, lines, begin, end, np.flatnonzero(~straight), np.array(holder, dtype=np.intp), forces)
