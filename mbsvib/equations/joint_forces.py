"""Forces in joints, and all forces on a body or on the ground, as outputs: y = Cq q + Cv q' + Ca q'' + D u.

What a motion adds to the wrenches of springs, loads, inputs and inertia goes through the operator of the reactions. In
a loaded scene the forces of the pose count as well: those of joints and bushings turn with their first body, those of
lines with the line, and the arms of all of them change with the pose. Outputs are components in the joint's axes, as
its first body (a rod: the rod) carries them: a load that stays fixed in the world is seen to turn.

What redundant constraints leave open is of least norm in every pose, w . D^2 S = 0. As the pose changes, so do the
states S of self-stress and the length in D: S . D^2 dw = -w . (D^2 dS + d(D^2) S).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.base_motion import ground_motion
from mbsvib.equations.force_paths import force_paths
from mbsvib.equations.reactions import reactions
from mbsvib.equations.shared_forces import shared_wrenches
from mbsvib.equations.wrench_pairs import WrenchPairs, wrenches_on_bodies
from mbsvib.kinematics.mobility import crossed_product

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Body
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.force_paths import ForcePaths
    from mbsvib.equations.reactions import Reactions
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.self_stress import SelfStress
    from mbsvib.equations.statics import Statics
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Triplets
    from mbsvib.mechanism.mechanism import Mechanism

@dataclass(frozen=True, slots=True)
class _Motion:
    """Motions of the bodies and the ground, (3, bodies + 1, m): ``shift`` of the centres of mass, ``turn``."""

    shift: Array
    turn: Array
    position: Array

    def at(self, body: Any, arm: Array) -> Array:
        """The displacement (3, n, m) of points of bodies at arms (3, n) from their centres of mass."""
        return self.shift[:, body] + crossed_product(self.turn[:, body], arm[..., None])


def with_joint_forces(draft: Draft) -> Draft:
    """Return equations of motion with the rows of outputs that are forces in joints, or all forces on a body.

    Parameters
    ----------
    draft : Draft
        The equations without these rows of Cq, Cv, Ca and D.

    Returns
    -------
    Draft
        The equations with them, and which of these outputs redundant constraints leave ``undetermined``.
    """
    model, scene, relative, reduction = draft.model, draft.scene, draft.relative, draft.reduction
    terms, statics = draft.terms, draft.statics
    position = np.concatenate((scene.position, np.zeros((1, 3)))).T
    ways = force_paths(scene.topology, position)
    to_joints = reactions(ways, scene.coordinates, scene.cuts, reduction, draft.phi)
    still = np.concatenate((terms.body_motion, np.zeros((1, *terms.body_motion.shape[1:]))))
    motion = _Motion(still[:, :3].transpose(1, 0, 2), still[:, 3:].transpose(1, 0, 2), position)
    elastic, damping, inerters = _of_springs(scene, relative, reduction, position)
    inertia = -_inertia(scene.bodies, still)
    sources = _of_inputs(scene, position)
    base = np.zeros_like(sources)
    for column, source in scene.port.base_motions:
        acceleration = ground_motion(source.wrench, source.position, position.T)
        base[:, :, column] = -_inertia(scene.bodies, acceleration[..., None])[:, :, 0]
    if scene.shared is not None:
        more = shared_wrenches(scene, relative, reduction, position)
        elastic, damping, inertia, base = (a + b for a, b in zip((elastic, damping, inertia, base), more, strict=True))
    change = _Change(statics, motion, ways) if statics is not None else None
    if change is not None:
        elastic = elastic + change.on_bodies
    gyroscopic = np.zeros_like(inertia)
    if model.rotors:
        elastic = elastic + _of_rotating_dampers(model, scene, reduction, position)
        gyroscopic = _of_rotors(model, scene, still)
    parts = {"Cq": elastic, "Cv": damping + gyroscopic, "Ca": inertia + inerters, "D": sources + base}
    if any(kind == "joint" for _, kind, _, _ in scene.port.wrench_outputs):
        carried_by = {key: to_joints(part) for key, part in parts.items()}
        if statics is not None and change is not None:
            carried_by["Cq"] = _in_every_pose(carried_by["Cq"] + change.moments, to_joints, statics, change)
    asked, rows = {}, {key: getattr(terms, key).copy() for key in parts}
    for row, kind, place, wrench in scene.port.wrench_outputs:
        if kind == "joint":
            axes = np.array(scene.topology.joints[place].axes)
            pull = -np.concatenate((axes @ wrench[:3], axes @ wrench[3:]))
            asked[list(model.outputs)[row]] = (place, pull)
            for key, part in carried_by.items():
                rows[key][row] = pull @ part[:, place]
        else:
            _sum(rows, row, place, wrench, {"Cv": gyroscopic, "Ca": inertia, "D": base}, position, change)
    names = [joint.name for joint in scene.topology.joints]
    undetermined = tuple([stress.undetermined(names, asked) for stress in to_joints.stress])
    return replace(draft, terms=replace(terms, **rows), undetermined=undetermined)


def _in_every_pose(changed: Array, to_joints: Reactions, statics: Statics, change: _Change) -> Array:
    """Changes of the wrenches in joints (6, joints, m) by which these stay those of least norm as the pose changes."""
    for stress in to_joints.stress:
        at, weight = stress.joints, stress.weight[..., None]
        rest, longer = statics.joints[:, at, None], change.of_moments(stress)
        missing = np.empty((stress.states.shape[2], changed.shape[2]))
        for k, state in enumerate(stress.states.transpose(2, 0, 1)):
            follows = change.of(at, state)
            turned = (to_joints(follows.on_bodies) + follows.moments)[:, at]
            work = np.sum(rest[3:, :, 0] * state[3:])
            missing[k] = (weight * rest * turned).sum(axis=(0, 1)) + work * longer
        changed = stress.minimum_norm(changed, missing)
    return changed


def _sum(
    rows: Mapping[str, Array], row: int, body: int, wrench: Array, momentum: Mapping[str, Array], position: Array,
    change: _Change | None,
) -> None:  # fmt: skip
    """All forces on a body are its change of momentum; what the ground lacks of that, the bodies have."""
    rows["Cq"][row] = 0.0
    for key, part in momentum.items():
        if body < part.shape[1] - 1:
            rows[key][row] = -wrench @ part[:, body]
        else:
            rows[key][row] = wrench @ _about_origin(part, position)
    if change is not None and body == position.shape[1] - 1:
        rows["Cq"][row] = wrench @ change.of_loads


def _of_rotors(model: Mechanism, scene: Scene, motion: Array) -> Array:
    """What turning the axes of rotors does to the bodies that carry them, (6, bodies + 1, m) per unit of q'."""
    from mbsvib.equations.spin_terms import momenta

    result = np.zeros((6, len(motion), motion.shape[2]))
    for body, momentum in momenta(model, scene.bodies):
        result[3:, body] += np.cross(momentum, motion[body, 3:], axis=0)
    return result


def _of_rotating_dampers(model: Mechanism, scene: Scene, reduction: Reduction, position: Array) -> Array:
    """What dampers that turn along with spinning bodies do to these on that account, per unit of q."""
    from mbsvib.equations.spin_terms import rotating_dampers

    result = np.zeros((6, position.shape[1], len(reduction.independent)))
    for damper in rotating_dampers(model, scene.bodies, scene.elements):
        wrench = damper.wrench(scene.coordinates, reduction)
        force, moment = wrench[:3], wrench[3:]
        for body, sign in ((damper.second, 1.0), (damper.first, -1.0)):
            arm = damper.point - position[:, body]
            result[:, body] += sign * np.concatenate((force, moment + np.cross(arm, force, axis=0)))
    return result


def _about_origin(part: Array, position: Array) -> Array:
    """The sum of wrenches (6, bodies + 1, n) on all bodies and the ground, moments about the origin."""
    moment = part[3:] + crossed_product(position[..., None], part[:3])
    result: Array = np.concatenate((part[:3], moment)).sum(axis=1)
    return result


def _inertia(bodies: tuple[Body, ...], motion: Array) -> Array:
    """Mass times acceleration, (6, bodies + 1, n), of motions (bodies + 1, 6, n)."""
    result = np.zeros((6, *motion[:, 0].shape))
    for k, body in enumerate(bodies):
        xx, yy, zz, xy, xz, yz = body.inertia
        axes = np.array(body.orientation)
        tensor = axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axes.T
        result[:3, k] = body.mass * motion[k, :3]
        result[3:, k] = tensor @ motion[k, 3:]
    return result


def _of_springs(
    scene: Scene, relative: Triplets, reduction: Reduction, position: Array
) -> tuple[Array, Array, Array]:  # fmt: skip
    """What stiffness, damping and inertance do to the bodies, (6, bodies + 1, m) per unit of q, of q' and of q''."""
    springs, locked = scene.springs, scene.locked
    rows = springs.rows
    felt = reduction.apply(relative.dense(locked, locked + len(springs.owner)))
    each = WrenchPairs(rows.first, rows.second, rows.point, rows.point, rows.force, rows.moment)
    to_bodies = wrenches_on_bodies(each, position)
    result = np.zeros((3, 6, position.shape[1], felt.shape[1]))
    for order, value in springs.weights:
        result[order] = to_bodies @ (-value[:, None] * felt)
    return result[0], result[1], result[2]


def _of_inputs(scene: Scene, position: Array) -> Array:
    """What the inputs do to the bodies, (6, bodies + 1, inputs)."""
    port, count = scene.port, len(scene.port.force_inputs)
    rows = port.rows
    point, force, moment = (array[:, :count] for array in (rows.point, rows.force, rows.moment))
    each = WrenchPairs(rows.first[:count], rows.second[:count], point, point, force, moment)
    result = np.zeros((6, position.shape[1], len(port.input_units)))
    result[:, :, port.force_inputs] = wrenches_on_bodies(each, position)
    return result


class _Change:
    """What a motion changes in the forces of the pose: ``on_bodies`` (6, bodies + 1, m) as they turn and as their arms
    change, ``moments`` (6, joints, m) of joints against what their axes carry along, ``of_loads`` (6, m) the sum of
    gravity and loads, moments about the origin.
    """

    def __init__(self, statics: Statics, motion: _Motion, ways: ForcePaths) -> None:
        self._given = statics, motion, ways
        pairs, applied = statics.pairs, statics.applied
        a, b = pairs.arms(motion.position)
        turned_a, turned_b = motion.turn[:, pairs.first], motion.turn[:, pairs.second]
        f, t = pairs.force[..., None], pairs.torque[..., None]
        gap = motion.at(pairs.second, b) - motion.at(pairs.first, a)
        turn = turned_b - turned_a
        force, twisted = crossed_product(turned_a, f), 0.5 * crossed_product(turn, t)
        self._two(twisted, statics, motion)
        torque = crossed_product(turned_a, t) + twisted
        lines = statics.second_order.line_owner[::2]
        along, length = statics.second_order.line[:, ::2, None], statics.second_order.length[::2, None]
        across = gap[:, lines] - along * (along * gap[:, lines]).sum(axis=0)
        force[:, lines] = across * (f[:, lines] * along).sum(axis=0) / length
        torque[:, lines] = 0.0
        follows = np.zeros(len(pairs.first), dtype=bool)
        follows[: applied.loads] = applied.follower
        loads = np.arange(applied.loads)
        force[:, loads] = np.where(follows[loads, None], crossed_product(turned_b, f)[:, loads], 0.0)
        torque[:, loads] = np.where(follows[loads, None], crossed_product(turned_b, t)[:, loads], 0.0)
        arms = a[..., None], b[..., None]
        shifted = crossed_product(turned_a, arms[0])
        gap[:, lines] = 0.0
        gap[:, len(applied.names) :][:, ways.carrier == ways.first] = 0.0
        shifted += gap  # the joint's point, mostly on the second body, against the first
        on_second = torque + crossed_product(crossed_product(turned_b, arms[1]), f) + crossed_product(arms[1], force)
        on_first = torque + crossed_product(shifted, f) + crossed_product(arms[0], force)
        first, second = pairs.incidence(motion.position.shape[1] - 1)
        self.on_bodies = second.T @ np.concatenate((force, on_second)) - first.T @ np.concatenate((force, on_first))
        count = len(applied.names)
        self.moments = np.concatenate((np.zeros_like(twisted[:, count:]), twisted[:, count:]))
        self.moments[:, lines[lines >= count] - count] = 0.0
        moved = motion.at(pairs.second, b)
        points = pairs.end[..., None]
        moment = torque + crossed_product(moved, f) + crossed_product(points, force)
        self.of_loads = np.concatenate((force[:, loads].sum(axis=1), moment[:, loads].sum(axis=1)))
        self.of_loads[3:] += crossed_product(motion.shift, applied.weight[..., None]).sum(axis=1)

    def of(self, joints: Index, state: Array) -> _Change:
        """Return the same for a state of self-stress (6, j) in some joints alone."""
        statics, motion, ways = self._given
        count = len(statics.applied.names)
        force, torque = np.zeros((2, *statics.pairs.force.shape))
        force[:, count + joints], torque[:, count + joints] = state[:3], state[3:]
        return _Change(replace(statics, pairs=replace(statics.pairs, force=force, torque=torque)), motion, ways)

    def of_moments(self, stress: SelfStress) -> Array:
        """Return how the weight 1 / L^2 of moments changes, (m,)."""
        _, motion, ways = self._given
        body, point = ways.carrier[stress.joints], ways.point[:, stress.joints]
        moved = motion.at(body, point - motion.position[:, body])
        apart = point - point.mean(axis=1, keepdims=True)
        return np.asarray(-2.0 / (len(body) * stress.length**4) * np.einsum("cj,cjm->m", apart, moved))

    @staticmethod
    def _two(twisted: Array, statics: Statics, motion: _Motion) -> None:
        """Joints with two successive rotations: the moment that holds the angle between them turns with both."""
        felt, pairs = statics.second_order, statics.pairs
        for who, first, second in felt.successive.T.tolist():
            turn = motion.turn[:, pairs.second[who]] - motion.turn[:, pairs.first[who]]
            one, other = felt.rows.moment[:, first], felt.rows.moment[:, second]
            half = 0.5 * float(pairs.torque[:, who] @ felt.cross[:, felt.successive[0].tolist().index(who)])
            twisted[:, who] -= half * (np.outer(one, other @ turn) + np.outer(other, one @ turn))
