"""The scene of a mechanism in other poses, one or many: directions and points of rows go with the bodies they are on.

Rows of elements along a line go from a point of the first body to one of the second; those of other elements turn with
the first body, at a point of the second. Points of ports go with their bodies, directions with the first. Forces
follow from the pose, and with them the rows of bushings.

Points of loads go with their bodies, follower loads turn with them. A tension changes by the stiffness at rest times
the change of length. The wrench of a bushing, or torsion spring, is the first derivative of its potential
(``elements.bushing``), its stiffness the second.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.common.fast_init import changed
from mbsvib.elements import bushing, torsion_spring
from mbsvib.elements.bushing import rows_of_matrices
from mbsvib.elements.deformations import twist
from mbsvib.elements.pose import Pose
from mbsvib.elements.rows import ElementRows, Rows
from mbsvib.elements.spring import ROUNDING
from mbsvib.equations.inertia import SpatialInertia
from mbsvib.equations.ports import Ports, port_bodies
from mbsvib.equations.scene import Scene
from mbsvib.equations.wrenches import AppliedWrenches, WrenchPairs, applied_wrenches, has_antisymmetric_forces
from mbsvib.kinematics.loops import Cuts
from mbsvib.kinematics.pose import size_of, start
from mbsvib.kinematics.pose_kinematics import PoseKinematics, pose_kinematics
from mbsvib.kinematics.relative_motion import Twists
from mbsvib.linalg.rotations import components_first, components_last, logarithm
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from mbsvib.equations.batch_values import Values


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
        return changed(
            scene, position=pose.centre[..., :-1, :], coordinates=coordinates, cuts=cuts, inertia=inertia,
            springs=springs, port=self._ports(scene.port, pose), loads=loads,
            shared=None if scene.shared is None else scene.shared.in_pose(pose),
        )  # fmt: skip

    def _ports(self, port: Ports, pose: Pose) -> Ports:
        """The ports as their points go with bodies, and their directions with the first."""
        rows, forces = port.rows, len(port.force_inputs)
        at = pose.points(self.holder, rows.point.T)
        place = {output: forces + k for k, output in enumerate(port.motion_outputs.tolist())}
        inertial = tuple([(i, output, at[..., place[i], :]) for i, output, _ in port.inertial_outputs])
        point, force, moment = (np.ascontiguousarray(components_first(array)) for array in (
            at, *(pose.vectors(rows.first, components_last(array)) for array in (rows.force, rows.moment))))
        rows = Rows(rows.first, rows.second, point, force, moment)
        return changed(port, rows=rows, inertial_outputs=inertial)

    def _rows(self, scene: Scene, pose: Pose) -> ElementRows:
        """The rows of connections as they go with their bodies."""
        springs, rows, lead = scene.springs, scene.springs.rows, pose.centre.shape[:-2]
        straight = self.straight.take(springs.owner)
        lines, others = straight.nonzero()[0], (~straight).nonzero()[0]
        first, second, owner = rows.first, rows.second, springs.owner.take(lines)
        begin = pose.points(first.take(lines), self.start.take(owner, axis=0))
        line = pose.points(second.take(lines), self.end.take(owner, axis=0)) - begin
        along = line / np.sqrt(np.add.reduce(line * line, axis=-1, keepdims=True))
        if not len(others):
            return changed(springs, rows=Rows(first, second, components_first(begin), components_first(along),
                                              rows.moment))  # fmt: skip
        described = [components_last(array) for array in (rows.force, rows.moment, rows.point)]
        force, moment, point = (np.array(np.broadcast_to(array, (*lead, *array.shape[-2:])), pose.centre.dtype)
                                for array in described)
        point[..., lines, :], force[..., lines, :] = begin, along
        for array in (force, moment):
            array[..., others, :] = pose.vectors(first[others], array[..., others, :])
        point[..., others, :] = pose.points(second[others], described[2][..., others, :])
        vectors = [np.ascontiguousarray(components_first(array)) for array in (point, force, moment)]
        return replace(springs, rows=Rows(first, second, *vectors))

    @cached_property
    def axes(self) -> Array:
        """The axes (joints, 3, 3) of joints as described."""
        return np.array([joint.axes for joint in self.kinematics.topology.joints]).reshape(-1, 3, 3)

    def joint_axes(self, pose: Pose) -> dict[str, Array]:
        """Return the axes (..., 3, 3) of all joints in a pose, by name."""
        kinematics = self.kinematics
        joints = kinematics.topology.joints
        frames = kinematics.frames(pose).take(kinematics.frame[: len(joints)], axis=-3)
        axes = frames @ self.axes
        return {joint.name: axes[..., k, :, :] for k, joint in enumerate(joints)}


def posed_scene(
    user_model: Mechanism, model: Mechanism, scene: Scene, relaxed: bool, varying: Iterable[str]
) -> PosedScene | None:
    """Return how the arrays of a mechanism follow from poses; None where they have parts of which this is not stated.

    These are bodies that spin themselves, unsymmetric stiffness, nodes of Maxwell elements, strains, joints of chosen
    directions with two rotations, and what ``follows_poses`` tells. Beams and superelements go along without bending.
    ``varying``: elements whose forces vary. If ``relaxed``, forces stay in other poses.
    """
    joints = scene.topology.joints
    spins = any(rotor.inertia is None for rotor in model.rotors.values())
    replaced = any(model.outputs[name] is not part for name, part in user_model.outputs.items())
    turning = any(joint.successive and joint.free is not None for joint in joints)
    held = _held(user_model, model)
    if (spins or has_antisymmetric_forces(model.with_parts(rotors={})) or replaced or turning or held is None
            or not follows_poses(user_model, scene)):  # fmt: skip
        return None
    kinematics = pose_kinematics(scene.topology, start(model), scene.coordinates, scene.cuts, size_of(model))
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
    """Return whether elements, loops and couplers of a mechanism follow from poses.

    They do not where the coefficients of an element do not determine its force elsewhere, where two successive
    rotations about axes without a fixed angle between them are cut or coupled, and where couplers are curved or act on
    homokinetic joints.
    """
    families = {type(part) for part in model.springs.values()}
    if not all(family.law is not None and family.law.follows_coefficients for family in families):
        return False
    coupled = _coupled(model)
    bent = any(joint.successive and joint.free is not None for joint in scene.topology.joints
               if joint.name in coupled or joint.name in scene.topology.cut_joints)  # fmt: skip
    return not bent and not any(part.curvatures for part in model.couplers.values()) and not any(
        model.joints[name].bisects for name in coupled)  # fmt: skip


def keeps_couplers(model: Mechanism) -> bool:
    """Return whether couplers act on coordinates that stay coordinates in poses that are not next to the described one.

    Components of rotation vectors do not.
    """
    return not any(model.joints[name].turns_by_vector for name in _coupled(model))


def _coupled(model: Mechanism) -> set[str]:
    return {name.rpartition(".")[0] for part in model.couplers.values() for name, _ in part.terms}


def of_parts(
    model: Mechanism, scene: Scene, kinematics: PoseKinematics, described: Mechanism | None = None,
    varying: Iterable[str] = (),
) -> PosedScene:  # fmt: skip
    """Return how the arrays of a mechanism follow from poses; with the forces of ``described``, where given, for which
    ``model`` has bushings instead of torsion springs. ``varying``: elements whose forces vary.
    """
    straight = np.array([part.acts_along_line for part in scene.elements], dtype=bool)
    ends: Any = np.array([(part.points[0], part.points[-1]) if part.acts_along_line else np.zeros((2, 3))
                          for part in scene.elements]).reshape(-1, 2, 3)  # fmt: skip
    holder = np.array([body for _, body in port_bodies(model, scene.topology.body_numbers)], dtype=np.intp)
    forces = None if described is None else posed_forces(described, model, varying)
    return PosedScene(kinematics, straight, ends[:, 0], ends[:, 1], holder, forces)


@dataclass(frozen=True)
class Bushings:
    """Bushings and torsion springs (b,) as described: their ``parts``, numbers ``owner`` among the connections, bodies
    ``first`` and ``second``, points ``at`` (b, 3) [m], ``axes`` (b, 3, 3), and which ``twists`` (b,) about z alone.

    ``stiffness`` and ``damping`` (..., b, 6, 6) are in these axes. Those that are ``bent`` (b,) have another stiffness
    in other poses.
    """

    parts: tuple[Any, ...]
    owner: Index
    first: Index
    second: Index
    at: Array
    axes: Array
    twists: Bools
    bent: Bools
    stiffness: Array
    damping: Array

    def about(self, pose: Pose, preload: Array) -> tuple[Array, Array, Array]:
        """Return stiffness, damping and preload about a pose, from the preload (..., b, 6), all in their own axes."""
        first, second = (pose.rotations.take(body, axis=-3) @ self.axes for body in (self.first, self.second))
        back = first.swapaxes(-1, -2)
        relative = back @ second
        apart = pose.points(self.second, self.at) - pose.points(self.first, self.at)
        rho = logarithm(relative)
        k, c, wrench, has_moment = bushing.about(self.stiffness, self.damping, preload,
                                                 (back @ apart[..., None])[..., 0], rho)  # fmt: skip
        bushing.check_angles(self.parts, rho, has_moment & ~self.twists)
        if self.twists.any():
            at = self.twists.nonzero()[0]
            stiffness, damping = (np.broadcast_to(array, k.shape)[..., at, 5, 5] for array in (
                self.stiffness, self.damping))  # fmt: skip
            moment = np.broadcast_to(preload, wrench.shape)[..., at, 5]
            parts = [self.parts[i] for i in at.tolist()]
            k[..., at, :, :], c[..., at, :, :], wrench[..., at, :] = torsion_spring.about(
                parts, stiffness, damping, moment, relative[..., at, :, :])  # fmt: skip
        return k, c, wrench

    def rows(self, pose: Pose, stiffness: Array, damping: Array) -> ElementRows:
        """Return the rows of those that are bent: eigenvectors of their stiffness, then of damping (..., b, 6, 6)."""
        at = self.bent.nonzero()[0]
        axes = pose.rotations.take(self.first[at], axis=-3) @ self.axes[at]
        point = pose.points(self.second[at], self.at[at])
        return rows_of_matrices([array[at] for array in (self.first, self.second, self.owner)], point, axes,
                                [array[..., at, :, :] for array in (stiffness, damping)])  # fmt: skip


@dataclass(frozen=True)
class PosedForces:
    """The ``applied`` wrenches as described, of all elements that have some in other poses, and how they follow.

    Of the elements along lines, ``stiffness`` (..., l) is that at rest and ``lines`` (l, 3) from start to end [m];
    ``bushings`` are the others.
    """

    applied: AppliedWrenches
    stiffness: Array
    lines: Array
    bushings: Bushings

    def of_variants(self, applied: AppliedWrenches, values: Values) -> PosedForces:
        """Return the forces of variants with these ``applied`` wrenches as described, at points that do not vary."""
        pairs = self.applied.pairs
        applied = replace(applied, pairs=replace(applied.pairs, start=pairs.start, end=pairs.end))
        names = applied.names[applied.loads :]
        stiffness, bushings = self.stiffness, self.bushings
        for k, name in enumerate(names[: applied.lines]):
            if "stiffness" in values.fields.get(name, {}):
                stiffness = np.array(np.broadcast_to(stiffness, (values.count, applied.lines)), values.numbers.dtype)
                stiffness[:, k] = values.fields[name]["stiffness"]
        changes: dict[str, Any] = {}
        for k, name in enumerate(names[applied.lines :]):
            for key in ("stiffness", "damping"):
                if key in values.fields.get(name, {}):
                    matrix = changes.get(key, getattr(bushings, key))
                    changes[key] = matrix = np.array(
                        np.broadcast_to(matrix, (values.count, *matrix.shape[-3:])), values.numbers.dtype)
                    array = np.moveaxis(values.fields[name][key], -1, 0)
                    matrix[:, k] = array if array.ndim == 3 else array[..., None] * np.eye(6)
        return replace(self, applied=applied, stiffness=stiffness, bushings=replace(bushings, **changes))

    def at(self, pose: Pose, relaxed: bool = False) -> tuple[AppliedWrenches, Array, Array]:
        """Return the wrenches in a pose, or in many, and stiffness and damping (..., b, 6, 6) of the bushings there.

        If ``relaxed``, elements keep the forces that they have as described.
        """
        applied, bushings = self.applied, self.bushings
        pairs, n, end = applied.pairs, applied.loads, applied.loads + applied.lines
        start, stop = pose.points(pairs.first, pairs.start.T), pose.points(pairs.second, pairs.end.T)
        start[..., :n, :], start[..., end:, :] = stop[..., :n, :], stop[..., end:, :]
        lead = pose.centre.shape[:-2]
        shape = (*lead, len(applied.names), 3)
        force, torque = (np.array(np.broadcast_to(components_last(array), shape), pose.centre.dtype)
                         for array in (pairs.force, pairs.torque))  # fmt: skip
        follows = applied.follower.nonzero()[0]
        for array in (force, torque):
            if len(follows):
                turned = pose.rotations.take(pairs.second[follows], axis=-3) @ array[..., follows, :, None]
                array[..., follows, :] = turned[..., 0]
        if applied.lines:
            force[..., n:end, :] = self._tensions(force[..., n:end, :], stop[..., n:end, :] - start[..., n:end, :],
                                                  relaxed)  # fmt: skip
        k, c = bushings.stiffness, bushings.damping
        if len(bushings.parts):
            axes = pose.rotations.take(bushings.first, axis=-3) @ bushings.axes
            local = [(bushings.axes.swapaxes(-1, -2) @ array[..., end:, :, None])[..., 0] for array in (force, torque)]
            wrench = np.concatenate(local, axis=-1)
            if not relaxed:
                k, c, wrench = bushings.about(pose, wrench)
            for array, half in ((force, wrench[..., :3]), (torque, wrench[..., 3:])):
                array[..., end:, :] = (axes @ half[..., None])[..., 0]
        vectors = [np.ascontiguousarray(components_first(array)) for array in (start, stop, force, torque)]
        return replace(applied, pairs=WrenchPairs(pairs.first, pairs.second, *vectors)), k, c

    def _tensions(self, force: Array, line: Array, relaxed: bool) -> Array:
        """Forces (..., l, 3) on the second bodies, from those as described, for lines (..., l, 3) in the pose."""
        before = np.sqrt(np.square(self.lines).sum(axis=-1))
        tension = -(force * self.lines).sum(axis=-1) / before
        length = np.sqrt(np.square(line).sum(axis=-1))
        if not relaxed:
            tension = tension + self.stiffness * (length - before)
            none = np.abs(tension) < ROUNDING * np.abs(self.stiffness) * before
            tension = np.where(none, tension - tension.real, tension)
        return np.asarray(-(tension / length)[..., None] * line)


def posed_forces(described: Mechanism, model: Mechanism, also: Iterable[str] = ()) -> PosedForces | None:
    """Return the forces of a mechanism in other poses, None without any; ``model`` has bushings for torsion springs.

    ``also``: elements that may have forces in variants.
    """
    number = {name: k for k, name in enumerate((*model.bodies, "ground"))}
    order = {name: k for k, name in enumerate(model.springs)}
    at_rest = {name: _stiffness_at_rest(part) for name, part in model.springs.items()}
    acting = {name for name, part in model.springs.items() if np.any(at_rest[name]) or (
        not part.acts_along_line and np.any(part.damping))}  # fmt: skip
    applied = applied_wrenches(model, number, acting.union(also))
    if not applied.names and not applied.weight.any():
        return None
    names = applied.names[applied.loads :]
    lines, others = names[: applied.lines], names[applied.lines :]
    parts = [model.springs[name] for name in others]
    ends: Any = np.array([model.springs[name].points for name in lines]).reshape(-1, 2, 3)
    k, c = (np.array([bushing.matrix6(getattr(part, key)) for part in parts]).reshape(-1, 6, 6)
            for key in ("stiffness", "damping"))  # fmt: skip
    twists = np.array([_law(described.springs.get(name)) is twist for name in others], dtype=bool)
    preload = np.array([part.preload or bushing.ZERO for part in parts]).reshape(-1, 6)
    first, second, owner = (np.array(values, dtype=np.intp) for values in (
        [number[part.first] for part in parts], [number[part.second] for part in parts],
        [order[name] for name in others]))  # fmt: skip
    return PosedForces(applied, np.array([at_rest[name] for name in lines]), ends[:, 1] - ends[:, 0], Bushings(
        tuple(parts), owner, first, second, np.array([part.position for part in parts]).reshape(-1, 3),
        np.array([part.orientation for part in parts]).reshape(-1, 3, 3), twists,
        twists | k[:, 3:].any(axis=(1, 2)) | c[:, 3:].any(axis=(1, 2)) | preload[:, 3:].any(axis=1), k, c))  # fmt: skip


def _law(part: Any) -> Any:
    return None if part is None or part.law is None else part.law.deformation


def _stiffness_at_rest(part: Any) -> Any:
    return 0.0 if part.law is None or part.law.stiffness is None else getattr(part, part.law.stiffness)
