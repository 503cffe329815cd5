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

from mbsvib.equations.base_motion import ground_motion
from mbsvib.equations.force_paths import carries_nothing, force_paths
from mbsvib.equations.load_stiffness import all_pairs, leading
from mbsvib.equations.reactions import reactions
from mbsvib.equations.shared_forces import shared_inertia
from mbsvib.equations.virtual_motions import VirtualWork, virtual_motions
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.kinematics.mobility import crossed_product
from mbsvib.linalg.products import concatenated, product_with_zeros
from mbsvib.linalg.rotations import skew
from mbsvib.mechanism.topology import FLOATS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.load_stiffness import LoadedPairs
    from mbsvib.equations.reactions import Reactions
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.self_stress import SelfStress
    from mbsvib.equations.spin_terms import CrossCoupling
    from mbsvib.equations.statics import Statics
    from mbsvib.equations.terms import Terms
    from mbsvib.equations.virtual_motions import Kept
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.kinematics.relative_motion import Triplets
    from mbsvib.mechanism.mechanism import Mechanism

    Spin = tuple[Sequence[tuple[int, Array]], Sequence[CrossCoupling]]


def with_joint_forces(draft: Draft) -> Draft:
    """Return equations of motion with the rows of outputs that are forces in joints or sums of forces on a body."""
    model, scene, terms = draft.model, draft.scene, draft.terms
    rows = {key: getattr(terms, key).copy() for key in ("Cq", "Cv", "Ca", "D")}
    outputs: dict[str, tuple[int, Array]] = {}
    stress: tuple[SelfStress, ...] = ()
    if any(kind == "joint" for _, kind, _, _ in scene.port.wrench_outputs):
        to_joints = draft.reactions or _reactions(draft)
        stress = to_joints.stress
        wrenches = _in_joints(draft, to_joints)
        for row, kind, number, wrench in scene.port.wrench_outputs:
            if kind == "joint":
                joint = scene.topology.joints[number]
                axes = np.array(joint.axes)
                direction = -np.concatenate((axes @ wrench[:3], axes @ wrench[3:]))
                outputs[list(model.outputs)[row]] = (number, direction)
                zero = carries_nothing(joint, direction, model, loaded=draft.statics is not None)
                for key, values in wrenches.items():
                    rows[key][row] = 0.0 if zero else -wrench @ values[number]
    terms = replace(terms, **rows)
    if any(kind == "body" for _, kind, _, _ in scene.port.wrench_outputs):
        position = np.concatenate((scene.position, np.zeros((1, 3)))).T
        inertia, base = shared_inertia(scene, draft.relative, draft.reduction, position)
        terms = with_sums(scene, terms, _spin(model, scene)[0], (inertia.swapaxes(0, 1), base.swapaxes(0, 1)))
    names = [joint.name for joint in scene.topology.joints]
    undetermined = tuple([part.undetermined(names, outputs) for part in stress])
    return replace(draft, terms=terms, undetermined=undetermined)


def with_forces_in_joints(
    model: Mechanism, scene: Scene, loops: tuple[Triplets, Array, Reduction, Kept], terms: Terms,
    loaded: tuple[LoadedPairs, Array] | None, spin: Spin, axes: Mapping[str, Array], stress: Sequence[SelfStress] = (),
) -> Terms:  # fmt: skip
    """Return the terms of variants with the rows of outputs that are forces in joints.

    ``loops``: relative displacements, Phi, minimal coordinates, kept rows and dependent coordinates. ``loaded``: pairs
    and multipliers of forces at the pose. ``axes`` (variants, 3, 3): of joints by name, where variants differ in them.
    ``stress``: states of self-stress of redundant loops, which are the same in all variants.
    """
    phi, reduction, kept = loops[1:]
    outputs = [item for item in scene.port.wrench_outputs if item[1] == "joint"]
    if len(outputs) < len(scene.port.wrench_outputs):
        terms = with_sums(scene, terms, spin[0])
    if not outputs:
        return terms
    wanted = {number for _, _, number, _ in outputs}
    stress = [part for part in stress if wanted & set(part.joints.tolist())]
    asked = sorted(wanted.union(*(part.joints.tolist() for part in stress)))
    points = _points(scene, asked)
    work = VirtualWork(scene, reduction, phi, kept, virtual_motions(scene, asked, axes, points))
    rows = work.at_rest(*spin)
    q = rows.q if loaded is None else rows.q + work.of_forces(loaded[0], *all_pairs(scene, *loaded))
    result: dict[str, Any] = {}
    place = {number: slice(6 * k, 6 * k + 6) for k, number in enumerate(asked)}
    local = [_Local(part, place, {k: np.array(scene.topology.joints[k].axes) for k in part.joints.tolist()})
             for part in stress]  # fmt: skip
    for key, values in (("Cq", q), ("Cv", rows.v), ("Ca", rows.a), ("D", rows.u)):
        for part in local:
            values = part.minimum_norm(values, 0.0)
        matrix = getattr(terms, key)
        lead = np.broadcast_shapes(matrix.shape[:-2], values.shape[:-2])
        kind = np.result_type(matrix, values)
        result[key] = np.broadcast_to(matrix, (*lead, *matrix.shape[-2:])).astype(kind)
        for row, _, number, wrench in outputs:
            joint = scene.topology.joints[number]
            frame = np.array(joint.axes)
            direction = np.concatenate((frame @ wrench[:3], frame @ wrench[3:]))
            zero = carries_nothing(joint, direction, model, loaded=loaded is not None)
            result[key][..., row, :] = 0.0 if zero else -(wrench @ values[..., place[number], :])
    return replace(terms, **result)


def _points(scene: Scene, joints: Sequence[int]) -> dict[int, Array]:
    """Points (..., 3) of joints, where they move with the joint or with a body in variants."""
    result, start = {}, 0
    twists, topology = leading(scene.coordinates.point), scene.topology
    number = topology.body_numbers
    for k in sorted(branch.joint for branch in topology.branches if branch.joint != FLOATS):
        count = len(topology.joints[k].freedom)
        if k in joints and count:
            result[k] = twists[..., start]
        start += count
    for k in joints:
        joint = topology.joints[k]
        if k in topology.cut and scene.cuts is not None:
            rows = np.flatnonzero(scene.cuts.joint[: scene.locked] == topology.cut.index(k))
            if len(rows):
                result[k] = leading(scene.cuts.rows.point)[..., rows[0]]
        if k not in result or joint.point is None:
            body = joint.first if joint.second == "ground" else joint.second
            result[k] = np.array(joint.point) if joint.point is not None else scene.position[..., number[body], :]
    return result


def _reactions(draft: Draft) -> Reactions:
    scene = draft.scene
    position = np.concatenate((scene.position, np.zeros((1, 3)))).T
    return reactions(force_paths(scene.topology, position), scene.coordinates, scene.cuts, draft.reduction, draft.phi)


def _in_joints(draft: Draft, to_joints: Reactions) -> dict[str, dict[int, Array]]:
    """Wrenches (6, m) and (6, inputs) in joints by number, in their axes; those of least norm in redundant loops."""
    scene, statics = draft.scene, draft.statics
    asked = {number for _, kind, number, _ in scene.port.wrench_outputs if kind == "joint"}
    stress = [part for part in to_joints.stress if asked & set(part.joints.tolist())]
    joints = sorted(asked.union(*(part.joints.tolist() for part in stress)))
    motions = virtual_motions(scene, joints, {}, {number: to_joints.paths.point[:, number] for number in joints})
    work = VirtualWork(scene, draft.reduction, draft.phi, kept_rows(draft), motions)
    rows = work.at_rest(*_spin(draft.model, scene))
    result = {"Cq": rows.q, "Cv": rows.v, "Ca": rows.a, "D": rows.u}
    place = {number: slice(6 * k, 6 * k + 6) for k, number in enumerate(joints)}
    frames = {number: np.array(scene.topology.joints[number].axes) for number in joints}
    if statics is not None and draft.loaded is not None:
        multipliers = -statics.multipliers[:, 0]
        for part in stress:
            multipliers = multipliers + _least(part, to_joints, statics)
        result["Cq"] = result["Cq"] + work.of_forces(draft.loaded, *all_pairs(scene, draft.loaded, multipliers))
    for part in stress:
        local = _Local(part, place, frames)
        changes = np.zeros((part.states.shape[2], draft.terms.M.shape[0]))
        if statics is not None and draft.loaded is not None:
            changes = _work_of_states(draft, part, local, work, to_joints)
        result = {key: local.minimum_norm(values, changes if key == "Cq" else 0.0) for key, values in result.items()}
    return {key: {number: values[place[number]] for number in joints} for key, values in result.items()}


def kept_rows(draft: Draft) -> list[tuple[Index, Index]]:
    """Return the independent rows and the dependent coordinates of each group of loops."""
    scene, reduction = draft.scene, draft.reduction
    if scene.cuts is None:
        return []
    names, depends = scene.cuts.names, np.ones(len(scene.coordinates.names), dtype=bool)
    depends[reduction.independent] = False
    return [(np.array([row for row in group.rows.tolist() if names[row] not in group.redundant], dtype=np.intp),
             group.columns[depends[group.columns]]) for group in reduction.groups]  # fmt: skip


def _spin(model: Mechanism, scene: Scene) -> Spin:
    """Angular momenta of rotors and cross-coupled elements."""
    if not model.derived(has_antisymmetric_forces):
        return [], []
    from mbsvib.equations.spin_terms import cross_couplings, momenta

    return momenta(model, scene.bodies), cross_couplings(model, scene.bodies, scene.elements)


def _least(stress: SelfStress, to_joints: Reactions, statics: Statics) -> Array:
    """Change (locked rows,) of multipliers after which the wrenches in joints have least norm."""
    tree = statics.tree_wrenches + (to_joints.multiplier_wrenches @ statics.multipliers).reshape(
        statics.tree_wrenches.shape)  # fmt: skip
    amount = np.einsum("cjr,cj->r", stress.weight[..., None] * stress.states, tree[:, stress.joints, 0])
    assert stress.multipliers is not None
    return np.asarray(stress.multipliers @ amount)


@dataclass(frozen=True, slots=True)
class _Local:
    """A group of joints with states of self-stress: their places among virtual motions, and states (6 j, r) in the axes
    of the joints.
    """

    stress: SelfStress
    place: Mapping[int, slice]
    frames: Mapping[int, Array]

    @property
    def rows(self) -> Index:
        """Numbers (6 j,) of the virtual motions of the joints."""
        return np.concatenate([np.arange(self.place[k].start, self.place[k].stop) for k in self.stress.joints.tolist()])

    @property
    def weight(self) -> Array:
        """Weights (6 j,) of squared forces and moments."""
        return np.tile(self.stress.weight[:, 0], len(self.stress.joints))

    def in_axes(self, wrenches: Array) -> Array:
        """Wrenches (6, j, ...) of its joints in world axes as (6 j, ...) in those of the joints."""
        return np.concatenate([np.concatenate((self.frames[k].T @ wrenches[:3, i], self.frames[k].T @ wrenches[3:, i]))
                               for i, k in enumerate(self.stress.joints.tolist())])  # fmt: skip

    def minimum_norm(self, values: Array, added: Array | float) -> Array:
        """Wrenches (..., v, k) of all joints without their part along the states."""
        rows, states = self.rows, self.in_axes(self.stress.states)
        own = np.moveaxis(values[..., rows, :], -2, 0)
        before = own.reshape(len(self.stress.joints), 6, -1).transpose(1, 0, 2)
        whole = replace(self.stress, joints=np.arange(len(self.stress.joints)),
                        states=states.reshape(len(self.stress.joints), 6, -1).transpose(1, 0, 2))  # fmt: skip
        after = whole.minimum_norm(before, None if isinstance(added, float) else added)
        result = values.copy()
        result[..., rows, :] = np.moveaxis(after.transpose(1, 0, 2).reshape(own.shape), 0, -2)
        return result


def _work_of_states(
    draft: Draft, stress: SelfStress, local: _Local, work: VirtualWork, to_joints: Reactions
) -> Array:
    """w . (D^2 dS + d(D^2) S) (r, m) of the forces w at the pose, by the change of the states with it."""
    statics, scene, loaded = draft.statics, draft.scene, draft.loaded
    assert statics is not None
    assert loaded is not None
    assert stress.multipliers is not None
    wrench = local.in_axes(statics.joints[:, stress.joints])
    weight_change = _moment_weight(draft, stress, to_joints)
    result = np.empty((stress.states.shape[2], draft.terms.M.shape[0]))
    silent = replace(loaded, pairs=replace(loaded.pairs, wrench=0.0 * loaded.pairs.wrench,
                                           hessian=0.0 * loaded.pairs.hessian, torsion=None))  # fmt: skip
    for k in range(len(result)):
        changes = work.of_forces(silent, *all_pairs(scene, silent, -stress.multipliers[:, k]))[local.rows]
        moments = np.sum(statics.joints[3:, stress.joints] * stress.states[3:, :, k])
        result[k] = (local.weight * wrench) @ changes + moments * weight_change
    return result


def _moment_weight(draft: Draft, stress: SelfStress, to_joints: Reactions) -> Array:
    """The change (m,) of the weight 1 / L^2 of moments."""
    body, point = to_joints.paths.carrier[stress.joints], to_joints.paths.point[:, stress.joints]
    motion = np.concatenate((draft.terms.body_motion, np.zeros((1, *draft.terms.body_motion.shape[1:]))))[body]
    arm = point - to_joints.paths.position[:, body]
    displacement = motion[:, :3].transpose(1, 0, 2) + crossed_product(motion[:, 3:].transpose(1, 0, 2), arm[..., None])
    from_centre = point - point.mean(axis=1, keepdims=True)
    return np.asarray(-2.0 / (len(body) * stress.length**4) * np.einsum("cj,cjm->m", from_centre, displacement))


def with_sums(
    scene: Scene, terms: Terms, momenta: Sequence[tuple[int, Array]],
    shared: tuple[Array, Array] | None = None,
) -> Terms:  # fmt: skip
    """Return terms with the rows of sums of all forces on a body: its rate of change of momentum, or minus that of all
    others. Arrays may have an axis of variants in front.

    ``shared``: wrenches (bodies + 1, 6, m) and (bodies + 1, 6, inputs) of masses that several bodies share.
    """
    asked = [(row, body, wrench) for row, kind, body, wrench in scene.port.wrench_outputs if kind == "body"]
    rows = {"Ca": _momentum(scene, terms.body_motion), "D": _of_base_motions(scene),
            "Cv": _of_rotors(terms.body_motion, momenta)}  # fmt: skip
    if shared is not None:
        rows["Ca"], rows["D"] = rows["Ca"] - shared[0], rows["D"] - shared[1]
    moved = None if scene.loads is None else _of_loads(scene, terms.body_motion)
    result: dict[str, Any] = {}
    for key in ("Cq", "Cv", "Ca", "D"):
        matrix = getattr(terms, key)
        values = {row: np.zeros(matrix.shape[-1]) for row, _, _ in asked}
        for row, body, wrench in asked if key in rows else ():
            on_body = rows[key]
            of_body = on_body[..., body, :, :] if body < on_body.shape[-3] - 1 else -_about_origin(scene, on_body)
            values[row] = wrench @ of_body
        if key == "Cq" and moved is not None:
            values |= {row: wrench @ moved for row, body, wrench in asked if body == len(scene.bodies)}
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
