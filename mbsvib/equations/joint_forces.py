"""Forces in joints, and sums of all forces on a body or on the ground, as outputs: y = Cq q + Cv q' + Ca q'' + D u.

Wrenches in joints are rows of the equations along virtual motions of the joints (``equations.virtual_motions``).
Outputs are components in the joint's axes, which rotate with its first body (the z axis of a rod with the rod).

Forces that redundant constraints do not determine have least norm in every pose, w . D^2 S = 0. With the pose the
states S of self-stress and the length in D change: S . D^2 dw = -w . (D^2 dS + d(D^2) S).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.elements.rows import Rows
from mbsvib.equations.draft import Draft
from mbsvib.equations.load_stiffness import all_pairs
from mbsvib.equations.loaded import spin_of
from mbsvib.equations.matrices import Terms
from mbsvib.equations.ports import inertia_of_ground_motion
from mbsvib.equations.scene import Scene
from mbsvib.equations.self_stress import SelfStress, moment_weight_rows
from mbsvib.equations.spin_terms import Spin
from mbsvib.equations.statics import Reactions
from mbsvib.equations.virtual_motions import VirtualWork, carrier_of, carries_nothing, joint_points, virtual_motions
from mbsvib.kinematics.relative_motion import Twists, body_motion, relative_motion
from mbsvib.linalg.products import concatenated, product_with_zeros, widened
from mbsvib.linalg.rotations import components_first, skew


def with_joint_forces(draft: Draft) -> Draft:
    """Return equations of motion with the rows of outputs that are forces in joints or sums of forces on a body."""
    model, scene, terms, loaded = draft.model, draft.scene, draft.terms, draft.loaded
    outputs = [item for item in scene.port.wrench_outputs if item[1] == "joint"]
    spin = spin_of(draft)
    if len(outputs) < len(scene.port.wrench_outputs):
        terms = with_sums(draft, spin[0])
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
        rows[key] = widened(getattr(terms, key), wrenches)
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
    """Rows (..., v, m) and (..., v, inputs) of wrenches in joints, in their axes; of least norm in redundant loops."""
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
        halves = wrenches.swapaxes(-2, -3)
        turned = [concatenated([self.frames[k].swapaxes(-1, -2) @ halves[..., i, half, :] for half in (
            slice(3), slice(3, 6))], -2) for i, k in enumerate(self.stress.joints.tolist())]  # fmt: skip
        return np.asarray(concatenated([array[..., None, :] for array in turned], -2))

    def minimum_norm(self, values: Array, added: Array | float) -> Array:
        """Wrenches (..., v, k) of all joints without their part along the states."""
        rows, count = self.rows, len(self.stress.joints)
        whole = replace(self.stress, joints=np.arange(count), states=self.in_axes(self.stress.states))
        own = values[..., rows, :]
        after = whole.minimum_norm(own.reshape(*own.shape[:-2], count, 6, -1).swapaxes(-2, -3), added)
        after = after.swapaxes(-2, -3)
        after = after.reshape(*after.shape[:-3], len(rows), -1)
        result = widened(values, after)
        result[..., rows, :] = after
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
    number, point = scene.topology.body_numbers, reactions.motions.point[..., 6 * stress.joints]
    carrier = np.array([carrier_of(scene.topology.joints[k], number) for k in stress.joints.tolist()])
    weight_change = _sums(draft, moment_weight_rows(point, carrier, len(scene.bodies), stress.length), 1)
    silent = replace(loaded, pairs=replace(loaded.pairs, wrench=0.0 * loaded.pairs.wrench,
                                           hessian=0.0 * loaded.pairs.hessian, torsion=None))  # fmt: skip
    result = []
    for k in range(stress.states.shape[-1]):
        changes = work.of_forces(silent, *all_pairs(scene, silent, stress.multipliers[..., k]))[..., local.rows, :]
        moments = (wrench[..., 3:, :] * stress.states[..., 3:, :, k]).sum(axis=(-1, -2))
        result.append(weighted @ changes + moments[..., None, None] * weight_change)
    return np.asarray(concatenated(result, -2))


def _sums(draft: Draft, rows: Rows, count: int) -> Array:
    """The sums (..., count, m) of relative displacements, of as many rows each."""
    relative = relative_motion(draft.scene.coordinates, rows)
    values = draft.reduction.apply(relative.dense(0, len(rows.first)))
    *lead, total, m = values.shape
    return np.asarray(values.reshape(*lead, count, total // count, m).sum(axis=-2))


def with_sums(draft: Draft, momenta: Sequence[tuple[int, Array]]) -> Terms:
    """Return terms with the rows of sums of all forces on a body: its rate of change of momentum, W_v^T W q'', along
    virtual motions v of the body alone. On the ground acts the opposite of what all others need to move with it.
    """
    scene, terms = draft.scene, draft.terms
    asked = [(row, body, wrench) for row, kind, body, wrench in scene.port.wrench_outputs if kind == "body"]
    on_ground = np.array([body == len(scene.bodies) for _, body, _ in asked])
    virtual = _moved_alone(scene, [(body, wrench) for _, body, wrench in asked])
    motion = body_motion(virtual, scene.position)
    factor = scene.inertia.factor(motion)
    if scene.shared is not None and scene.shared.mass is not None:
        base = relative_motion(virtual, scene.shared.mass.rows)
        factor = scene.shared.inertia_rows(factor, base.dense(0, base.shape[0]))

    def with_ground(wrench: Any, origin: Any) -> Array:
        return inertia_of_ground_motion(wrench, origin, scene.position, scene.inertia, scene.shared)

    for k in on_ground.nonzero()[0].tolist():
        factor[..., k] = -with_ground(asked[k][2], np.zeros(3))
    back = factor.swapaxes(-1, -2)
    through = np.zeros((*back.shape[:-1], len(scene.port.input_units)), back.dtype)
    for column, source in scene.port.base_motions:
        through[..., column] = (back @ with_ground(source.wrench, source.position)[..., None])[..., 0]
    spin: Any = np.zeros((len(asked), terms.body_motion.shape[-1]))
    for body, momentum in momenta:
        own, of_body = motion[..., body, 3:, :].swapaxes(-1, -2), terms.body_motion[..., body, 3:, :]
        spin = spin - own @ product_with_zeros(skew(momentum), of_body)
    loads: Any = np.zeros(spin.shape[-2:])
    if scene.loads is not None and on_ground.any():
        centres, applied = components_first(scene.position), scene.loads[0]
        rows = [applied.on_ground(centres, wrench) for (_, body, wrench) in asked if body == len(scene.bodies)]
        sums = _sums(draft, Rows.join(rows), len(rows))
        loads = widened(loads, sums)
        loads[..., on_ground, :] = sums
    inertia = back @ terms.inertia_factor[..., : factor.shape[-2], :]
    result: dict[str, Any] = {}
    for key, values in (("Cq", loads), ("Cv", spin), ("Ca", inertia), ("D", through)):
        result[key] = widened(getattr(terms, key), values)
        result[key][..., [row for row, _, _ in asked], :] = values
    return replace(terms, **result)


def _moved_alone(scene: Scene, asked: Sequence[tuple[int, Array]]) -> Twists:
    """Virtual motions (k,) of bodies about their centres; for the ground, of all others, backwards about the origin."""
    ground, count = len(scene.bodies), len(asked)
    bodies, six = np.array([body for body, _ in asked]), np.array([wrench for _, wrench in asked]).T
    path = np.zeros((ground + 1, count), np.int8)
    path[bodies, np.arange(count)] = 1
    path[:, bodies == ground] -= 1
    point = np.ascontiguousarray(components_first(scene.centres[..., bodies, :]))
    return Twists(("",) * count, six[:3], six[3:], point, path, np.zeros(count, dtype=bool))
