"""The scene of a mechanism in other poses, one or many: directions and points of rows go with the bodies they are on.

Rows of elements along a line go from a point of the first body to one of the second; those of other elements turn with
the first body, at a point of the second. Points of ports go with their bodies, while their directions stay. Forces
follow from the pose (``posed_forces``), and with them the rows of bushings.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.element_rows import ElementRows
from mbsvib.elements.rows import Rows
from mbsvib.equations.inertia import SpatialInertia
from mbsvib.equations.posed_forces import posed_forces
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.kinematics.characteristic_length import size_of
from mbsvib.kinematics.pose import Pose, start
from mbsvib.kinematics.pose_kinematics import pose_kinematics
from mbsvib.linalg.rotations import components_first, components_last

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from mbsvib.common.arrays import Array, Bools, Index
    from mbsvib.equations.ports import Ports
    from mbsvib.equations.posed_forces import PosedForces
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.wrenches import AppliedWrenches
    from mbsvib.kinematics.loops import Cuts
    from mbsvib.kinematics.pose_kinematics import PoseKinematics
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.mechanism import Mechanism


@dataclass(frozen=True)
class PosedScene:
    """How the arrays of a mechanism follow from poses.

    ``kinematics`` are those of its tree. ``straight`` (elements,) are those that act along lines, with their ``start``
    and ``end`` (elements, 3) [m]. ``holder`` (ports,) are the bodies of the ports' points.
    ``forces`` are those of loads and connections, None where none are asked for. ``held`` are the bodies with which
    bodies within beams and superelements go.
    """

    kinematics: PoseKinematics
    straight: Bools
    start: Array
    end: Array
    holder: Index
    forces: PosedForces | None = None
    held: Mapping[str, str] = field(default_factory=dict)

    def whole(self, pose: Pose) -> Pose:
        """Return a pose of all bodies, from one of those that are not ``held``."""
        described = self.kinematics.described
        if len(pose.number) == len(described.number):
            return pose
        carrier = np.array([pose.number[self.held.get(name, name)] for name in described.number], dtype=np.intp)
        rotations = pose.rotations.take(carrier, axis=-3)
        return Pose(described.number, described.origin, pose.points(carrier, described.origin), rotations)

    def at(
        self, scene: Scene, pose: Pose, relaxed: bool = False, rows: tuple[Twists, Cuts | None] | None = None,
        forces: PosedForces | None = None,
    ) -> Scene:  # fmt: skip
        """Return the arrays in a pose, or in poses (v): vectors become (3, v, n) then, all others (v, ...).

        ``rows``: the joint coordinates and locked rows there, where known. ``forces``: those of variants.
        """
        coordinates, cuts = rows or self.kinematics.at(pose)
        rotations = pose.rotations[..., :-1, :, :]
        inertia = SpatialInertia(scene.inertia.linear, scene.inertia.angular @ rotations.swapaxes(-1, -2))
        springs, forces = self._rows(scene, pose), self.forces if forces is None else forces
        loads: tuple[AppliedWrenches, dict[str, Any]] | None = None
        if forces is not None:
            applied, stiffness, damping = forces.at(pose, relaxed)
            loads, bushings = (applied, {}), forces.bushings
            if bushings.bent.any() and not relaxed:
                straight = (~np.isin(springs.owner, bushings.owner[bushings.bent])).nonzero()[0]
                springs = ElementRows.join([springs.take(straight), bushings.rows(pose, stiffness, damping)])
        return replace(
            scene, position=pose.centre[..., :-1, :], coordinates=coordinates, cuts=cuts, inertia=inertia,
            springs=springs, port=self._ports(scene.port, pose), loads=loads,
            shared=None if scene.shared is None else scene.shared.in_pose(pose),
        )  # fmt: skip

    def _ports(self, port: Ports, pose: Pose) -> Ports:
        """The ports as their points go with bodies."""
        at, forces = pose.points(self.holder, port.rows.point.T), len(port.force_inputs)
        place = {output: forces + k for k, output in enumerate(port.motion_outputs.tolist())}
        inertial = tuple([(i, output, at[..., place[i], :]) for i, output, _ in port.inertial_outputs])
        return replace(port, rows=replace(port.rows, point=np.ascontiguousarray(components_first(at))),
                       inertial_outputs=inertial)  # fmt: skip

    def _rows(self, scene: Scene, pose: Pose) -> ElementRows:
        """The rows of connections as they go with their bodies."""
        springs, rows, lead = scene.springs, scene.springs.rows, pose.centre.shape[:-2]
        described = [components_last(array) for array in (rows.force, rows.moment, rows.point)]
        force, moment, point = (np.array(np.broadcast_to(array, (*lead, *array.shape[-2:])), pose.centre.dtype)
                                for array in described)
        straight = self.straight[springs.owner]
        lines, others = straight.nonzero()[0], (~straight).nonzero()[0]
        first, second, owner = rows.first, rows.second, springs.owner[lines]
        point[..., lines, :] = begin = pose.points(first[lines], self.start[owner])
        line = pose.points(second[lines], self.end[owner]) - begin
        force[..., lines, :] = line / np.sqrt((line * line).sum(axis=-1, keepdims=True))
        for array in (force, moment):
            array[..., others, :] = pose.vectors(first[others], array[..., others, :])
        point[..., others, :] = pose.points(second[others], described[2][..., others, :])
        vectors = [np.ascontiguousarray(components_first(array)) for array in (point, force, moment)]
        return replace(springs, rows=Rows(first, second, *vectors))

    def joint_axes(self, pose: Pose) -> dict[str, Array]:
        """Return the axes (..., 3, 3) of all joints in a pose, by name."""
        kinematics = self.kinematics
        joints = kinematics.topology.joints
        frames = kinematics.frames(pose).take(kinematics.frame[: len(joints)], axis=-3)
        axes = frames @ np.array([joint.axes for joint in joints]).reshape(-1, 3, 3)
        return {joint.name: axes[..., k, :, :] for k, joint in enumerate(joints)}


def posed_scene(
    user_model: Mechanism, model: Mechanism, scene: Scene, relaxed: bool, varying: Iterable[str]
) -> PosedScene | None:
    """Return how the arrays of a mechanism follow from poses; None where they have parts of which this is not stated.

    These are bodies that spin themselves, unsymmetric stiffness, nodes of Maxwell elements, strains, joints of chosen
    directions with two rotations, and what ``follows_poses`` tells. Beams and superelements go along without bending.
    ``varying``: elements whose forces vary. If ``relaxed``, forces stay in other poses.
    """
    joints, couplers = scene.topology.joints, scene.couplers
    spins = any(rotor.inertia is None for rotor in model.rotors.values())
    replaced = any(model.outputs[name] is not part for name, part in user_model.outputs.items())
    turning = any(joint.successive and joint.free is not None for joint in joints)
    held = _held(user_model, model)
    if (spins or has_antisymmetric_forces(model.with_parts(rotors={})) or replaced or turning or held is None
            or not follows_poses(user_model, scene)):  # fmt: skip
        return None
    kinematics = pose_kinematics(scene.topology, start(model), scene.coordinates, scene.cuts, couplers, size_of(model))
    loaded = scene.loads is not None or not relaxed or bool(tuple(varying))
    return replace(of_parts(model, scene, kinematics, user_model if loaded else None, varying), held=held)


def _held(user_model: Mechanism, model: Mechanism) -> dict[str, str] | None:
    """The bodies with which those within beams and superelements go; None if there are others that are not described.
    """
    result = {}
    for name in model.bodies:
        if name not in user_model.bodies:
            part = user_model.composed.get(name.partition(".")[0])
            if part is None:
                return None
            result[name] = "ground" if name in part.carriers else part.root
    return result


def follows_poses(model: Mechanism, scene: Scene) -> bool:
    """Return whether loops and couplers of a mechanism follow from poses.

    They do not where two successive rotations about axes without a fixed angle between them are cut or coupled, and
    where couplers are curved or couple components of rotation vectors, which differ in each pose.
    """
    coupled = {name.rpartition(".")[0] for part in model.couplers.values() for name, _ in part.terms}
    bent = any(joint.successive and joint.free is not None for joint in scene.topology.joints
               if joint.name in coupled or joint.name in scene.topology.cut_joints)  # fmt: skip
    return not bent and not any(part.curvatures for part in model.couplers.values()) and not any(
        model.joints[name].bisects for name in coupled)  # fmt: skip


def of_parts(
    model: Mechanism, scene: Scene, kinematics: PoseKinematics, described: Mechanism | None = None,
    varying: Iterable[str] = (),
) -> PosedScene:  # fmt: skip
    """Return how the arrays of a mechanism follow from poses; with the forces of ``described``, where given, for which
    ``model`` has bushings instead of torsion springs. ``varying``: elements whose forces vary.
    """
    number = scene.topology.body_numbers
    straight = np.array([part.acts_along_line for part in scene.elements], dtype=bool)
    ends: Any = np.array([(part.points[0], part.points[-1]) if part.acts_along_line else np.zeros((2, 3))
                          for part in scene.elements]).reshape(-1, 2, 3)  # fmt: skip
    parts: list[Any] = [*(part for part in model.inputs.values()
                          if part.element is None and not part.moves_ground),
                        *(part for part in model.outputs.values() if part.element is None)]  # fmt: skip
    ground = len(number) if "ground" not in number else number["ground"]
    holder = []
    for part in parts:
        a, b = number[part.relative_to], number[part.body]
        holder.append(b if part.position is not None or b < ground else a)
    forces = None if described is None else posed_forces(described, model, varying)
    return PosedScene(kinematics, straight, ends[:, 0], ends[:, 1], np.array(holder, dtype=np.intp), forces)
