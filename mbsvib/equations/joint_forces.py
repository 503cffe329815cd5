"""Forces in joints, and sums of all forces on a body or on the ground, as outputs: y = Cq q + Cv q' + Ca q'' + D u.

Wrenches in joints are rows of the equations along virtual motions of the joints (``equations.virtual_motions``).
Outputs are components in the joint's axes, which rotate with its first body (the z axis of a rod with the rod).

Forces that redundant constraints do not determine have least norm in every pose, w . D^2 S = 0. With the pose the
states S of self-stress and the length in D change: S . D^2 dw = -w . (D^2 dS + d(D^2) S).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.load_stiffness import all_pairs
from mbsvib.equations.loaded import spin_of
from mbsvib.equations.ports import ground_motion
from mbsvib.equations.statics import Reactions
from mbsvib.equations.virtual_motions import VirtualWork, carrier_of, carries_nothing, joint_points, virtual_motions
from mbsvib.equations.wrenches import leading
from mbsvib.linalg.products import concatenated, product_with_zeros
from mbsvib.linalg.rotations import components_last, skew

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.matrices import Terms
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.self_stress import SelfStress
    from mbsvib.equations.spin_terms import Spin
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Triplets
    from mbsvib.kinematics.shared_rows import Composite


def with_joint_forces(draft: Draft) -> Draft:
    """Return equations of motion with the rows of outputs that are forces in joints or sums of forces on a body."""
    model, scene, terms, loaded = draft.model, draft.scene, draft.terms, draft.loaded
    outputs = [item for item in scene.port.wrench_outputs if item[1] == "joint"]
    spin = spin_of(draft)
    if len(outputs) < len(scene.port.wrench_outputs):
        terms = with_sums(scene, terms, spin[0], shared_inertia(scene, draft.relative, draft.reduction))
    if not outputs:
        return replace(draft, terms=terms)
    fixed = draft.varied.points
    reactions = draft.reactions or Reactions(scene, draft.reduction, draft.phi, draft.kept, fixed)
    wanted = {number for _, _, number, _ in outputs}
    stress = [part for part in reactions.stress if wanted & set(part.joints.tolist())]
    asked = sorted(wanted.union(*(part.joints.tolist() for part in stress)))
    motions = virtual_motions(scene, asked, draft.varied.axes, joint_points(scene, asked, fixed))
    values = _wrenches(draft, reactions, stress, VirtualWork(scene, draft.reduction, draft.phi, draft.kept, motions),
                       spin)  # fmt: skip
    directions: dict[str, tuple[int, Array]] = {}
    rows: dict[str, Any] = {}
    for key, wrenches in values.items():
        matrix = getattr(terms, key)
        lead = np.broadcast_shapes(matrix.shape[:-2], wrenches.shape[:-2])
        kind = np.result_type(matrix, wrenches)
        rows[key] = np.broadcast_to(matrix, (*lead, *matrix.shape[-2:])).astype(kind)
        for row, _, number, wrench in outputs:
            joint, at = scene.topology.joints[number], 6 * asked.index(number)
            axes = np.array(joint.axes)
            direction = np.concatenate((axes @ wrench[:3], axes @ wrench[3:]))
            directions[list(model.outputs)[row]] = number, direction
            zero = carries_nothing(joint, direction, model, loaded=loaded is not None)
            rows[key][..., row, :] = 0.0 if zero else -(wrench @ wrenches[..., at : at + 6, :])
    undetermined = draft.undetermined
    if draft.variants is None:
        names = [joint.name for joint in scene.topology.joints]
        undetermined = tuple([part.undetermined(names, directions) for part in reactions.stress])
    return replace(draft, terms=replace(terms, **rows), undetermined=undetermined)


def _wrenches(
    draft: Draft, reactions: Reactions, stress: Sequence[SelfStress], work: VirtualWork, spin: Spin
) -> dict[str, Array]:
    """Rows (..., v, m) and (..., v, inputs) of wrenches in joints, in their axes; those of least norm in redundant
    loops.
    """
    scene, loaded, multipliers = draft.scene, draft.loaded, draft.multipliers
    rows = work.at_rest(*spin)
    result = {"Cq": rows.q, "Cv": rows.v, "Ca": rows.a, "D": rows.u}
    if loaded is not None:
        assert multipliers is not None
        for part in stress:
            assert part.multipliers is not None
            amount = part.amount(reactions.with_loops(loaded, multipliers))
            multipliers = multipliers - (part.multipliers @ amount)[..., 0]
        result["Cq"] = result["Cq"] + work.of_forces(loaded, *all_pairs(scene, loaded, multipliers))
    for part in stress:
        local = _Local(part, work.joints, {
            k: np.asarray(draft.varied.axes.get(joint.name, joint.axes))
            for k, joint in enumerate(scene.topology.joints) if k in part.joints})  # fmt: skip
        changes = 0.0 if loaded is None else _work_of_states(draft, part, local, work, reactions)
        result = {key: local.minimum_norm(values, changes if key == "Cq" else 0.0) for key, values in result.items()}
    return result


@dataclass(frozen=True, slots=True)
class _Local:
    """A group of joints with states of self-stress among the ``asked`` joints with virtual motions; ``frames``
    (..., 3, 3) are the axes of its joints by number.
    """

    stress: SelfStress
    asked: tuple[int, ...]
    frames: Mapping[int, Array]

    @property
    def rows(self) -> Index:
        """Numbers (6 j,) of the virtual motions of the joints."""
        first: Any = np.array([6 * self.asked.index(k) for k in self.stress.joints.tolist()])
        return np.asarray((first[:, None] + np.arange(6)).reshape(-1))

    def in_axes(self, wrenches: Array) -> Array:
        """Wrenches (..., 6, j, n) of its joints in world axes as those in the axes of the joints."""
        halves = np.moveaxis(wrenches, -2, -3)
        turned = [concatenated([self.frames[k].swapaxes(-1, -2) @ halves[..., i, half, :] for half in (
            slice(3), slice(3, 6))], -2) for i, k in enumerate(self.stress.joints.tolist())]  # fmt: skip
        return np.moveaxis(concatenated([array[..., None, :, :] for array in turned], -3), -3, -2)

    def minimum_norm(self, values: Array, added: Array | float) -> Array:
        """Wrenches (..., v, k) of all joints without their part along the states."""
        rows, count = self.rows, len(self.stress.joints)
        whole = replace(self.stress, joints=np.arange(count), states=self.in_axes(self.stress.states))
        own = values[..., rows, :]
        after = whole.minimum_norm(own.reshape(*own.shape[:-2], count, 6, -1).swapaxes(-2, -3), added)
        after = after.swapaxes(-2, -3)
        result = np.array(np.broadcast_to(values, (*after.shape[:-3], *values.shape[-2:])), after.dtype)
        result[..., rows, :] = after.reshape(*after.shape[:-3], len(rows), -1)
        return result


def _work_of_states(
    draft: Draft, stress: SelfStress, local: _Local, work: VirtualWork, reactions: Reactions
) -> Array:
    """w . (D^2 dS + d(D^2) S) (..., r, m) of the forces w at the pose, by the change of the states with it."""
    scene, loaded = draft.scene, draft.loaded
    assert loaded is not None
    assert draft.multipliers is not None
    assert stress.multipliers is not None
    wrench = reactions.wrenches(loaded, draft.multipliers)[..., stress.joints]
    weighted = (stress.weight * local.in_axes(wrench[..., None])[..., 0]).swapaxes(-1, -2)
    weighted = weighted.reshape(*weighted.shape[:-2], 1, -1)
    weight_change = _moment_weight(draft, stress, reactions)
    silent = replace(loaded, pairs=replace(loaded.pairs, wrench=0.0 * loaded.pairs.wrench,
                                           hessian=0.0 * loaded.pairs.hessian, torsion=None))  # fmt: skip
    result = []
    for k in range(stress.states.shape[-1]):
        changes = work.of_forces(silent, *all_pairs(scene, silent, stress.multipliers[..., k]))[..., local.rows, :]
        moments = (wrench[..., 3:, :] * stress.states[..., 3:, :, k]).sum(axis=(-1, -2))
        result.append(weighted @ changes + (moments[..., None] * weight_change)[..., None, :])
    return np.asarray(concatenated(result, -2))


def _moment_weight(draft: Draft, stress: SelfStress, reactions: Reactions) -> Array:
    """The change (..., m) of the weight 1 / L^2 of moments."""
    scene, number = draft.scene, draft.scene.topology.body_numbers
    body = [carrier_of(scene.topology.joints[k], number) for k in stress.joints.tolist()]
    motion, position = (np.concatenate((array, np.zeros((*array.shape[:-count], 1, *array.shape[1 - count :]))), -count)
                        for array, count in ((draft.terms.body_motion, 3), (scene.position, 2)))  # fmt: skip
    point = reactions.motions.point[..., 6 * stress.joints].swapaxes(-1, -2)
    turned = skew(point - position[..., body, :]) @ motion[..., body, 3:, :]
    from_centre = point - point.mean(axis=-2, keepdims=True)
    along = np.einsum("...jc,...jcm->...m", from_centre, motion[..., body, :3, :] - turned)
    return np.asarray(-2.0 / (len(body) * np.asarray(stress.length)[..., None] ** 4) * along)


def with_sums(
    scene: Scene, terms: Terms, momenta: Sequence[tuple[int, Array]],
    shared: tuple[Array, Array] | None = None,
) -> Terms:  # fmt: skip
    """Return terms with the rows of sums of all forces on a body: its rate of change of momentum, or minus that of all
    others. Arrays may have an axis of variants in front.

    ``shared``: wrenches (bodies + 1, 6, m) and (bodies + 1, 6, inputs) of masses that several bodies share.
    """
    asked = [(row, body, wrench) for row, kind, body, wrench in scene.port.wrench_outputs if kind == "body"]
    ground = [item for item in asked if item[1] == len(scene.bodies)]
    rows = {"Ca": _momentum(scene, terms.body_motion), "D": _of_base_motions(scene),
            "Cv": _of_rotors(terms.body_motion, momenta)}  # fmt: skip
    if shared is not None:
        rows["Ca"], rows["D"] = rows["Ca"] - shared[0], rows["D"] - shared[1]
    moved = None if scene.loads is None else _of_loads(scene, terms.body_motion)
    result: dict[str, Any] = {}
    for key in ("Cq", "Cv", "Ca", "D"):
        matrix = getattr(terms, key)
        values = {row: np.zeros(matrix.shape[-1]) for row, _, _ in asked}
        if key in rows:
            on_body = rows[key]
            if ground:  # what acts on it is opposite to what all others need
                others = _about_origin(scene, on_body)[..., None, :, :]
                on_body = np.concatenate((on_body[..., :-1, :, :], -others), axis=-3)
            values = {row: wrench @ on_body[..., body, :, :] for row, body, wrench in asked}
        elif moved is not None:
            values |= {row: wrench @ moved for row, _, wrench in ground}
        lead = np.broadcast_shapes(matrix.shape[:-2], *(value.shape[:-1] for value in values.values()))
        kind = np.result_type(matrix, *values.values())
        result[key] = np.broadcast_to(matrix, (*lead, *matrix.shape[-2:])).astype(kind)
        for row, value in values.items():
            result[key][..., row, :] = value
    return replace(terms, **result)


def _momentum(scene: Scene, motion: Array) -> Array:
    """Mass times acceleration (..., bodies + 1, 6, n) of motions (..., bodies, 6, n), zero for the ground."""
    linear, angular = scene.inertia.linear, scene.inertia.angular
    force = np.square(linear)[..., None, None] * motion[..., :3, :]
    moment = (angular.swapaxes(-1, -2) @ angular) @ motion[..., 3:, :]
    both = concatenated((force, moment), -2)
    return np.concatenate((both, np.zeros((*both.shape[:-3], 1, *both.shape[-2:]))), axis=-3)


def _of_base_motions(scene: Scene) -> Array:
    """Mass times acceleration (..., bodies + 1, 6, inputs) of the bodies with the ground."""
    columns = np.zeros((*scene.position.shape[:-1], 6, len(scene.port.input_units)), scene.position.dtype)
    for column, source in scene.port.base_motions:
        columns[..., column] = ground_motion(source.wrench, source.position, scene.position)
    return _momentum(scene, columns)


def _of_rotors(motion: Array, momenta: Sequence[tuple[int, Array]]) -> Array:
    """Minus the gyroscopic wrenches (..., bodies + 1, 6, m) of rotors per unit of q'."""
    lead = np.broadcast_shapes(motion.shape[:-3], *(momentum.shape[:-1] for _, momentum in momenta))
    kind = np.result_type(motion, *(momentum for _, momentum in momenta))
    result = np.zeros((*lead, motion.shape[-3] + 1, 6, motion.shape[-1]), kind)
    for body, momentum in momenta:
        result[..., body, 3:, :] -= product_with_zeros(skew(momentum), motion[..., body, 3:, :])
    return result


def _about_origin(scene: Scene, wrenches: Array) -> Array:
    """The sum (..., 6, n) of wrenches (..., bodies + 1, 6, n), moments about the origin."""
    bodies = wrenches[..., :-1, :, :]
    moment = wrenches[..., 3:, :].sum(axis=-3) + (skew(scene.position) @ bodies[..., :3, :]).sum(axis=-3)
    return np.asarray(concatenated((wrenches[..., :3, :].sum(axis=-3), moment), -2))


def _of_loads(scene: Scene, motion: Array) -> Array:
    """Changes (..., 6, m) of the sum of gravity and loads, moments about the origin."""
    assert scene.loads is not None
    applied, loads = scene.loads[0], slice(scene.loads[0].loads)
    body = applied.pairs.second[loads]
    end, f, t = (np.moveaxis(leading(vectors)[..., loads], -1, -2) for vectors in (
        applied.pairs.end, applied.pairs.force, applied.pairs.torque))  # fmt: skip
    moved, turned = motion[..., body, :3, :], motion[..., body, 3:, :]
    turns = np.where(applied.follower[:, None, None], turned, 0.0)
    force, torque = -skew(f) @ turns, -skew(t) @ turns
    shift = moved - skew(end - scene.position[..., body, :]) @ turned
    moment = torque - skew(f) @ shift + skew(end) @ force
    weight = np.moveaxis(leading(applied.weight)[..., :-1], -1, -2)
    of_weight = (-skew(weight) @ motion[..., :3, :]).sum(axis=-3)
    return np.asarray(concatenated((force.sum(axis=-3), moment.sum(axis=-3) + of_weight), -2))


def shared_inertia(scene: Scene, relative: Triplets, reduction: Reduction) -> tuple[Array, Array] | None:
    """Return the wrenches of shared mass rows on bodies, per unit of q'' (..., bodies + 1, 6, m) and of inputs
    (..., bodies + 1, 6, inputs), None without such rows. Moments are about the centres of mass, the origin for ground.
    """
    mass = None if scene.shared is None else scene.shared.mass
    if mass is None:
        return None
    position = np.concatenate((scene.position, np.zeros((*scene.position.shape[:-2], 1, 3))), axis=-2)
    start = scene.locked + len(scene.springs.owner) + len(scene.port.rows.first)
    base_rows = reduction.apply(relative.dense(start, start + len(mass.rows.first)))
    inertia = -_of_masses(mass, mass.of(base_rows), position)
    base = np.zeros((*inertia.shape[:-1], len(scene.port.input_units)), inertia.dtype)
    for column, source in scene.port.base_motions:
        wrench = np.array(source.wrench)
        ground_motion = mass.of_ground_motion(wrench[:3], wrench[3:], np.array(source.position))
        base[..., column] -= _of_masses(mass, ground_motion, position)[..., 0]
    return inertia, base


def _of_masses(composite: Composite, forces: Array, position: Array) -> Array:
    """Wrenches (..., bodies + 1, 6, n) of forces (..., rows, n) along mass rows, none on internal coordinates; those on
    the ground are at its nodes.
    """
    rows, ground = composite.rows, position.shape[-2] - 1
    along = composite.back(forces) * composite.moves_with_ground[:, None]
    point, force, moment = (components_last(array) for array in (rows.point, rows.force, rows.moment))
    result: Array | float = 0.0
    for body, sign in ((rows.second, np.ones(len(rows.first))), (rows.first, -1.0 * (rows.first != ground))):
        wrench = concatenated((force, moment + np.cross(point - position[..., body, :], force)), -1)
        each = wrench[..., None] * along[..., None, :]
        on_body = (np.eye(ground + 1)[body] * sign[:, None]).T
        flat = on_body @ each.reshape(*each.shape[:-2], -1)
        result = result + flat.reshape(*flat.shape[:-1], *each.shape[-2:])
    return np.asarray(result)
