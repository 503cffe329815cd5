"""Forces in joints, and sums of all forces on a body or on the ground, as outputs: y = Cq q + Cv q' + Ca q'' + D u.

The map of reactions gives the wrenches in joints that balance the changes of spring forces, inputs and inertia forces
on the bodies. In a loaded pose the forces of this pose change as well: those of joints and bushings rotate with their
first body, those of lines with the line, and all lever arms change. Outputs are components in the joint's axes, which
rotate with its first body (the z axis of a rod with the rod): relative to them a force fixed in the world rotates.

Forces that redundant constraints do not determine have least norm in every pose, w . D^2 S = 0. With the pose the
states S of self-stress and the length in D change: S . D^2 dw = -w . (D^2 dS + d(D^2) S).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.base_motion import ground_motion
from mbsvib.equations.force_paths import ForcePaths, carries_nothing, force_paths
from mbsvib.equations.inertia import inertia_tensor
from mbsvib.equations.reactions import Reactions, reactions
from mbsvib.equations.shared_forces import shared_wrenches
from mbsvib.equations.wrench_pairs import unit_wrenches
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.kinematics.mobility import crossed_product
from mbsvib.linalg.products import product_with_zeros
from mbsvib.linalg.rotations import skew

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Body
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.self_stress import SelfStress
    from mbsvib.equations.statics import Statics
    from mbsvib.equations.wrench_pairs import WrenchPairs
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Triplets
    from mbsvib.mechanism.mechanism import Mechanism

@dataclass(frozen=True, slots=True)
class _Motion:
    """Motions (3, bodies + 1, m) of the bodies and the ground: of their centres at ``position``, and ``rotation``."""

    translation: Array
    rotation: Array
    position: Array

    def at(self, body: Any, arm: Array) -> Array:
        """The displacement (3, n, m) of points of bodies at arms (3, n) from their centres of mass."""
        return self.translation[:, body] + crossed_product(self.rotation[:, body], arm[..., None])


def with_joint_forces(draft: Draft) -> Draft:
    """Return equations of motion with the rows of outputs that are forces in joints or sums of forces on a body."""
    model, scene, relative, reduction = draft.model, draft.scene, draft.relative, draft.reduction
    terms, statics = draft.terms, draft.statics
    position = np.concatenate((scene.position, np.zeros((1, 3)))).T
    to_joints = draft.reactions or reactions(force_paths(scene.topology, position), scene.coordinates, scene.cuts,
                                             reduction, draft.phi)  # fmt: skip
    paths = to_joints.paths
    body_motion = np.concatenate((terms.body_motion, np.zeros((1, *terms.body_motion.shape[1:]))))
    motion = _Motion(body_motion[:, :3].transpose(1, 0, 2), body_motion[:, 3:].transpose(1, 0, 2), position)
    elastic, damping, inerters = _spring_wrenches(scene, relative, reduction, position)
    inertia = -_inertia(scene.bodies, body_motion)
    inputs = _input_wrenches(scene, position)
    base = np.zeros_like(inputs)
    for column, source in scene.port.base_motions:
        acceleration = ground_motion(source.wrench, source.position, position.T)
        base[:, :, column] = -_inertia(scene.bodies, acceleration[..., None])[:, :, 0]
    if scene.shared is not None:
        additional = shared_wrenches(scene, relative, reduction, position)
        pairs = zip((elastic, damping, inertia, base), additional, strict=True)
        elastic, damping, inertia, base = (a + b for a, b in pairs)
    change = _PoseForceChange(statics, motion, paths) if statics is not None else None
    if change is not None:
        elastic = elastic + change.on_bodies
    gyroscopic = np.zeros_like(inertia)
    if model.derived(has_antisymmetric_forces):
        coupled = _cross_coupled_wrenches(model, scene, reduction, position)
        elastic, damping = elastic + coupled[0], damping + coupled[1]
        gyroscopic = _rotor_wrenches(model, scene, body_motion)
    on_bodies = {"Cq": elastic, "Cv": damping + gyroscopic, "Ca": inertia + inerters, "D": inputs + base}
    if any(kind == "joint" for _, kind, _, _ in scene.port.wrench_outputs):
        in_joints = {key: to_joints(wrenches) for key, wrenches in on_bodies.items()}
        if statics is not None and change is not None:
            in_joints["Cq"] = _of_least_norm(in_joints["Cq"] + change.in_joints, to_joints, statics, change)
    outputs, rows = {}, {key: getattr(terms, key).copy() for key in on_bodies}
    for row, kind, number, wrench in scene.port.wrench_outputs:
        if kind == "joint":
            axes = np.array(scene.topology.joints[number].axes)
            direction = -np.concatenate((axes @ wrench[:3], axes @ wrench[3:]))
            outputs[list(model.outputs)[row]] = (number, direction)
            zero = carries_nothing(scene.topology.joints[number], direction, model, loaded=change is not None)
            for key, wrenches in in_joints.items():
                rows[key][row] = 0.0 if zero else direction @ wrenches[:, number]
        else:
            _set_sum(rows, row, number, wrench, {"Cv": gyroscopic, "Ca": inertia, "D": base}, position, change)
    names = [joint.name for joint in scene.topology.joints]
    undetermined = tuple([stress.undetermined(names, outputs) for stress in to_joints.stress])
    return replace(draft, terms=replace(terms, **rows), undetermined=undetermined)


def _of_least_norm(changes: Array, to_joints: Reactions, statics: Statics, pose_change: _PoseForceChange) -> Array:
    """Changes (6, joints, m) after which the wrenches in joints have least norm in the changed pose too."""
    for stress in to_joints.stress:
        joints, weight = stress.joints, stress.weight[..., None]
        wrenches, weight_change = statics.joints[:, joints, None], pose_change.of_moment_weight(stress)
        work = np.empty((stress.states.shape[2], changes.shape[2]))
        for k, state in enumerate(stress.states.transpose(2, 0, 1)):
            of_state = pose_change.of_state(joints, state)
            state_change = (to_joints(of_state.on_bodies) + of_state.in_joints)[:, joints]
            moment_work = np.sum(wrenches[3:, :, 0] * state[3:])
            work[k] = (weight * wrenches * state_change).sum(axis=(0, 1)) + moment_work * weight_change
        changes = stress.minimum_norm(changes, work)
    return changes


def _set_sum(
    rows: Mapping[str, Array], row: int, body: int, wrench: Array, momentum: Mapping[str, Array], position: Array,
    change: _PoseForceChange | None,
) -> None:  # fmt: skip
    """Set a row of the sum of all forces on a body: its rate of change of momentum, or minus that of all others."""
    rows["Cq"][row] = 0.0
    for key, wrenches in momentum.items():
        if body < wrenches.shape[1] - 1:
            rows[key][row] = -wrench @ wrenches[:, body]
        else:
            rows[key][row] = wrench @ _about_origin(wrenches, position)
    if change is not None and body == position.shape[1] - 1:
        rows["Cq"][row] = wrench @ change.of_loads


def _rotor_wrenches(model: Mechanism, scene: Scene, motion: Array) -> Array:
    """Gyroscopic wrenches of rotors on their bodies, (6, bodies + 1, m) per unit of q'."""
    from mbsvib.equations.spin_terms import momenta

    result = np.zeros((6, len(motion), motion.shape[2]))
    for body, momentum in momenta(model, scene.bodies):
        result[3:, body] += product_with_zeros(skew(momentum), motion[body, 3:])
    return result


def _cross_coupled_wrenches(model: Mechanism, scene: Scene, reduction: Reduction, position: Array) -> Array:
    """Antisymmetric wrenches of elements on their bodies, (2, 6, bodies + 1, m) per unit of q and of q'."""
    from mbsvib.equations.spin_terms import cross_couplings

    result = np.zeros((2, 6, position.shape[1], len(reduction.independent)))
    for part in cross_couplings(model, scene.bodies, scene.elements):
        force, moment = part.wrenches(scene.coordinates, reduction).reshape(2, 2, 3, -1).swapaxes(0, 1)
        for body, sign in ((part.second, 1.0), (part.first, -1.0)):
            arm = skew(part.point - position[:, body])
            result[:, :, body] += sign * np.concatenate((force, moment + arm @ force), axis=1)
    return result


def _about_origin(wrenches: Array, position: Array) -> Array:
    """The sum of wrenches (6, bodies + 1, n) on all bodies and the ground, moments about the origin."""
    moment = wrenches[3:] + crossed_product(position[..., None], wrenches[:3])
    result: Array = np.concatenate((wrenches[:3], moment)).sum(axis=1)
    return result


def _inertia(bodies: tuple[Body, ...], motion: Array) -> Array:
    """Mass times acceleration, (6, bodies + 1, n), of motions (bodies + 1, 6, n)."""
    result = np.zeros((6, *motion[:, 0].shape))
    for k, body in enumerate(bodies):
        result[:3, k] = body.mass * motion[k, :3]
        result[3:, k] = inertia_tensor(body) @ motion[k, 3:]
    return result


def _spring_wrenches(
    scene: Scene, relative: Triplets, reduction: Reduction, position: Array
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Wrenches of stiffness, damping and inertance on the bodies, (6, bodies + 1, m) per unit of q, q' and q''."""
    springs, locked = scene.springs, scene.locked
    displacements = reduction.apply_exactly(relative.dense(locked, locked + len(springs.owner)))
    on_bodies = unit_wrenches(springs.rows, position)
    result = np.zeros((3, 6, position.shape[1], displacements.shape[1]))
    for order, value in springs.weights:
        result[order] = on_bodies @ (-value[:, None] * displacements)
    return result[0], result[1], result[2]


def _input_wrenches(scene: Scene, position: Array) -> Array:
    """Wrenches of unit inputs on the bodies, (6, bodies + 1, inputs)."""
    port, rows = scene.port, scene.port.rows.take(slice(len(scene.port.force_inputs)))
    result = np.zeros((6, position.shape[1], len(port.input_units)))
    result[:, :, port.force_inputs] = unit_wrenches(rows, position)
    return result


class _PoseForceChange:
    """Changes of the forces of the pose by a motion, because they rotate and because their lever arms change.

    ``on_bodies`` (6, bodies + 1, m) are those on bodies, ``in_joints`` (6, joints, m) those of moments in joints
    relative to the joint's axes, ``of_loads`` (6, m) those of the sum of gravity and loads, moments about the origin.
    """

    def __init__(self, statics: Statics, motion: _Motion, paths: ForcePaths, pairs: WrenchPairs | None = None) -> None:
        pairs, applied = pairs or statics.pairs, statics.applied
        self._statics, self._motion, self._paths, self._pairs = statics, motion, paths, pairs
        count, loads = len(applied.names), applied.loads
        arm_a, arm_b = (arm[..., None] for arm in pairs.arms(motion.position))
        rotation_a, rotation_b = motion.rotation[:, pairs.first], motion.rotation[:, pairs.second]
        f, t = pairs.force[..., None], pairs.torque[..., None]
        end = motion.at(pairs.second, arm_b[..., 0])
        gap = end - motion.at(pairs.first, arm_a[..., 0])
        force, twist = crossed_product(rotation_a, f), 0.5 * crossed_product(rotation_b - rotation_a, t)
        self._add_successive(twist)
        torque = crossed_product(rotation_a, t) + twist
        # tensions of lines keep their size and rotate with the line
        lines = statics.second_order.line_owner[::2]
        line, length = statics.second_order.line[:, ::2, None], statics.second_order.length[::2, None]
        across = gap[:, lines] - line * (line * gap[:, lines]).sum(axis=0)
        force[:, lines] = across * (f[:, lines] * line).sum(axis=0) / length
        torque[:, lines] = 0.0
        follower = applied.follower[:, None]
        for change, vector in ((force, f), (torque, t)):
            change[:, :loads] = np.where(follower, crossed_product(rotation_b[:, :loads], vector[:, :loads]), 0.0)
        # the first body's arm ends at the point that moves with the second body, except for lines and some joints
        gap[:, lines] = 0.0
        gap[:, count:][:, paths.carrier == paths.first] = 0.0
        arm_change_a, arm_change_b = crossed_product(rotation_a, arm_a) + gap, crossed_product(rotation_b, arm_b)
        on_second = torque + crossed_product(arm_change_b, f) + crossed_product(arm_b, force)
        on_first = torque + crossed_product(arm_change_a, f) + crossed_product(arm_a, force)
        first, second = pairs.incidence(motion.position.shape[1] - 1)
        self.on_bodies = second.T @ np.concatenate((force, on_second)) - first.T @ np.concatenate((force, on_first))
        self.in_joints = np.concatenate((np.zeros_like(twist[:, count:]), twist[:, count:]))
        self.in_joints[:, lines[lines >= count] - count] = 0.0
        moment = torque + crossed_product(end, f) + crossed_product(pairs.end[..., None], force)
        self.of_loads = np.concatenate((force[:, :loads].sum(axis=1), moment[:, :loads].sum(axis=1)))
        self.of_loads[3:] += crossed_product(motion.translation, applied.weight[..., None]).sum(axis=1)

    def of_state(self, joints: Index, state: Array) -> _PoseForceChange:
        """Return the changes of a state of self-stress (6, j) in some joints, without all other forces."""
        statics, count = self._statics, len(self._statics.applied.names)
        force, torque = np.zeros((2, *statics.pairs.force.shape))
        force[:, count + joints], torque[:, count + joints] = state[:3], state[3:]
        only_state = replace(statics.pairs, force=force, torque=torque)
        return _PoseForceChange(statics, self._motion, self._paths, only_state)

    def of_moment_weight(self, stress: SelfStress) -> Array:
        """Return the change (m,) of the weight 1 / L^2 of moments."""
        body, point = self._paths.carrier[stress.joints], self._paths.point[:, stress.joints]
        displacement = self._motion.at(body, point - self._motion.position[:, body])
        from_centre = point - point.mean(axis=1, keepdims=True)
        return np.asarray(-2.0 / (len(body) * stress.length**4) * np.einsum("cj,cjm->m", from_centre, displacement))

    def _add_successive(self, twist: Array) -> None:
        """Joints with two successive rotations: the moment on the angle between both axes rotates with both."""
        rows, pairs, rotation = self._statics.second_order, self._pairs, self._motion.rotation
        for pair, first, second, cross in zip(*rows.successive.tolist(), rows.cross.T, strict=True):
            relative = rotation[:, pairs.second[pair]] - rotation[:, pairs.first[pair]]
            e, e2 = rows.rows.moment[:, first], rows.rows.moment[:, second]
            half = 0.5 * float(pairs.torque[:, pair] @ cross)
            twist[:, pair] -= half * (np.outer(e, e2 @ relative) + np.outer(e2, e @ relative))
