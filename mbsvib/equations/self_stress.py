"""Self-stress: wrenches in joints that are in equilibrium without loads, and the wrenches of least norm.

With redundant constraints the model does not determine the wrenches w in its joints: with S the states of self-stress,
w + S z balances the bodies as w does. The solution with the least sum over joints is taken, of

    |force|^2 + |moment / L|^2:    w - S (S^T D^2 S)^-1 S^T D^2 w,    D = diag(1, 1 / L),

moments about the joint's own point. L is the root mean square distance of these points from their mean, over all joints
of loops that have joints or couplers in common. All joints of loops that can transmit a force are included, cut or not,
so that the result does not depend on the frame, the tree, the order and the coordinates. Joints with the stiffness k
along and k L^2 about all their locked directions would have these forces.

Source: Pellegrino & Calladine, Int. J. Solids Struct. 22 (1986) 409, for states of self-stress.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.common.tables import listed
from mbsvib.core.geometric_stiffness import motion_order
from mbsvib.elements.rows import Rows
from mbsvib.equations.scene import Scene
from mbsvib.equations.virtual_motions import beyond
from mbsvib.equations.wrenches import trailing
from mbsvib.errors import UndeterminedForceWarning
from mbsvib.kinematics.loops import Cuts, Reduction
from mbsvib.kinematics.pose import length_of
from mbsvib.linalg.groups import connected_parts
from mbsvib.linalg.products import concatenated, widened
from mbsvib.linalg.rank import DETERMINED, STRESS_IN_COUPLERS, ZERO_FORM

JointOutputs = Mapping[str, tuple[int, Array]]


@dataclass(frozen=True, slots=True)
class Undetermined:
    """Wrenches that redundant constraints do not determine: in ``joints``, with their length L [m], and the ``outputs``
    that depend on them.
    """

    joints: tuple[str, ...]
    length: float
    outputs: tuple[str, ...] = ()

    def among(self, outputs: Collection[str]) -> Undetermined:
        """Return them with those of their outputs that are among some."""
        return replace(self, outputs=tuple([name for name in self.outputs if name in outputs]))

    def explained(self) -> list[str]:
        """Return lines that describe the solution."""
        lines = [
            f"  the model does not determine all forces in {listed(self.joints)}, as constraints are redundant: the "
            f"minimum-norm solution was taken",
            f"    (minimum of the sum of |force|^2 + |moment / L|^2 over these joints, moments about their points, "
            f"L = {self.length:.6g} m); motions do not depend on it",
        ]  # fmt: skip
        if self.outputs:
            lines.append(f"    outputs that depend on it: {listed(self.outputs)}")
        return lines


@dataclass(frozen=True, slots=True)
class SelfStress:
    """States of self-stress in the ``joints`` (j,) of loops that have joints in common, with their ``length`` L (...)
    [m].

    ``states`` (..., 6, j, r) [N, N m] are orthonormal with moments over L; ``multipliers`` (..., locked rows, r) are
    those of the constraints in each, None if they are not known.
    """

    joints: Index
    length: float | Array
    states: Array
    multipliers: Array | None = None

    @property
    def weight(self) -> Array:
        """D^2 (..., 6, 1): the weights of squared forces and moments."""
        return weight_of(self.length)

    def amount(self, wrench: Array, added: Array | float = 0.0) -> Array:
        """Return the amount (..., r, columns) of each state in wrenches (..., 6, joints, columns) that do this work in
        addition.
        """
        weighted = self.weight[..., None] * self.states
        part = np.einsum("...cjr,...cjn->...rn", weighted, wrench[..., self.joints, :]) + added
        gram = np.einsum("...cjr,...cjs->...rs", weighted, self.states)  # one, but for imaginary parts
        return np.asarray(part - (gram - gram.real) @ part)

    def minimum_norm(self, wrench: Array, added: Array | float = 0.0) -> Array:
        """Return wrenches in all joints without their part along the states, both (..., 6, joints, columns).

        ``wrench`` (..., 6, joints, columns): wrenches that balance the bodies, at the joints' points. ``added``
        (..., r, columns): amount of each state to remove in addition, for forces that change with the pose. Returns
        (..., 6, joints, columns): wrenches with the same effect on the bodies.
        """
        before, unit = wrench[..., self.joints, :], np.sqrt(self.weight)[..., None]
        amount = self.amount(wrench, added)
        after = before - np.einsum("...cjr,...rn->...cjn", self.states, amount)
        size = np.sqrt(np.square(np.abs(unit * before)).sum(axis=(-3, -2)) + np.square(np.abs(amount)).sum(axis=-2))
        after.real[np.abs(unit * after) <= ZERO_FORM * size[..., None, None, :]] = 0.0
        result = widened(wrench, after)
        result[..., self.joints, :] = after
        return result

    def undetermined(self, names: Sequence[str], requested: JointOutputs) -> Undetermined:
        """Return the joints and outputs that the states leave undetermined.

        ``requested`` has outputs by name: the number of the joint, and the direction (6,) of the output, world axes.
        """
        unit = self.states * np.sqrt(self.weight)[..., None]
        index_of = {joint: i for i, joint in enumerate(self.joints.tolist())}
        outputs = []
        for name, (joint, direction) in requested.items():
            if joint in index_of:
                along = direction / np.sqrt(self.weight[:, 0])
                if np.linalg.norm(along @ unit[:, index_of[joint]]) > DETERMINED * np.linalg.norm(along):
                    outputs.append(name)
        stressed = np.sqrt(np.square(unit).sum(axis=(0, 2))) > DETERMINED
        return Undetermined(tuple([names[k] for k in self.joints[stressed].tolist()]), float(self.length),
                            tuple(outputs))  # fmt: skip


def weight_of(length: float | Array) -> Array:
    """Return the weights (..., 6, 1) of squared forces and moments, 1 and 1 / L^2 of a ``length`` L (...) [m]."""
    moments = np.asarray(length)[..., None, None] ** -2.0
    return np.repeat(np.concatenate((np.ones_like(moments), moments), axis=-2), 3, axis=-2)


def moment_weight_rows(point: Array, carrier: Index, ground: int, length: float | Array) -> Rows:
    """Return rows that add up to the change of the weight 1 / L^2 of moments with the pose, L a ``length`` (...) [m].

    ``point`` (..., 3, j): points of the joints, which move with the bodies ``carrier`` (j,).
    """
    from_centre = point - point.mean(axis=-1, keepdims=True)
    force = trailing(from_centre * (-2.0 / (len(carrier) * np.asarray(length)[..., None, None] ** 4)))
    return Rows(np.full(len(carrier), ground), carrier, trailing(point), force, np.zeros_like(force))


def warn(model: str, undetermined: Sequence[Undetermined]) -> None:
    """Warn of undetermined outputs, at the line that called ``linearize``."""
    for forces in undetermined:
        if forces.outputs:
            warnings.warn(
                f"model '{model}' does not determine the outputs {listed(forces.outputs)}: constraints of the joints "
                f"{listed(forces.joints)} are redundant. Of all forces in equilibrium those of least norm are "
                f"returned, see explain(). To obtain others, replace one of these joints by a bushing, or by a joint "
                f"that frees directions that the others lock.",
                UndeterminedForceWarning, stacklevel=4,
            )  # fmt: skip


def self_stress(
    joints: Index, length: float | Array, wrenches: Array, multipliers: Array | None = None
) -> SelfStress | None:
    """Return orthonormal states of self-stress with the span of given ones.

    ``joints`` (j,): numbers of the joints. ``length`` (...): their length L [m]. ``wrenches`` (..., 6, j, r): wrenches
    in them without resultant on any body, of size one with moments over the length. ``multipliers`` (..., locked rows,
    r): those of the constraints in them. None if all are zero. A state that is zero in some variants is zero there.
    """
    scale = np.sqrt(weight_of(length))[..., None]
    flat = (wrenches * scale).reshape(*wrenches.shape[:-3], 6 * len(joints), wrenches.shape[-1])
    left, sizes, right = np.linalg.svd(flat.real, full_matrices=False)
    nonzero = sizes > STRESS_IN_COUPLERS
    used = np.asarray(nonzero.reshape(-1, nonzero.shape[-1]).any(axis=0))
    if not used.any():
        return None
    turn = np.where(nonzero, 1.0 / np.where(nonzero, sizes, 1.0), 0.0)[..., None, :] * right.swapaxes(-1, -2)
    states = np.where(nonzero[..., None, :], left, 0.0)[..., used] + (flat - flat.real) @ turn[..., used]
    states.real[np.abs(states) <= ZERO_FORM] = 0.0
    of_rows = None if multipliers is None else multipliers @ turn[..., used]
    return SelfStress(joints, length, states.reshape(*flat.shape[:-2], 6, len(joints), -1) / scale, of_rows)


def of_loops(
    scene: Scene, reduction: Reduction, phi: Array, kept: Sequence[tuple[Index, Index]], wrenches: Array, point: Array
) -> list[SelfStress]:
    """Return the states of self-stress of a mechanism, by loops that have joints or couplers in common.

    ``phi`` (..., locked rows, n): locked rows per unit joint coordinate; ``kept``: independent rows and dependent
    coordinates of each group of loops. ``wrenches`` (..., 6, joints, locked rows): those in all joints per unit of each
    multiplier; ``point`` (..., joints, 3): points of the joints [m].
    """
    cuts, joints, count = scene.cuts, scene.topology.joints, phi.shape[-2]
    assert cuts is not None
    in_loop, transmits = _joints_of_loops(scene, cuts, wrenches)
    loop, joint = np.nonzero(in_loop)
    loop_part, joint_part = connected_parts(loop, joint, (len(in_loop), in_loop.shape[1]))
    number = scene.topology.body_numbers
    result = []
    for part in np.unique(loop_part[:count]):
        members = np.flatnonzero((joint_part == part) & transmits)
        ends = ([number[getattr(joints[k], end)] for k in members.tolist()] for end in ("first", "second"))
        length = length_of(point[..., members, :], *(scene.centres[..., bodies, :] for bodies in ends))
        each = np.asarray(length)[..., None]
        combinations = [_combinations(phi, each * cuts.row_scale(each), group.rows, *own)
                        for group, own in zip(reduction.groups, kept, strict=True)
                        if group.surplus and loop_part[group.rows[0]] == part]  # fmt: skip
        if combinations:
            multipliers = concatenated(combinations, -1)
            stress = self_stress(members, length, wrenches[..., members, :] @ multipliers[..., None, :, :], multipliers)
            if stress is not None:
                result.append(stress)
    return result


def _combinations(phi: Array, scale: Array, rows: Index, kept: Index, dependent: Index) -> Array:
    """Combinations (..., locked rows, surplus) of the rows of a group of loops without work on any coordinate: one of
    size one for each redundant row, which the ``kept`` rows balance. ``scale`` (..., locked rows): units of the rows.
    """
    redundant = np.setdiff1d(rows, kept)
    scaled = scale[..., None] * phi[..., dependent]
    balancing = -np.linalg.solve(scaled[..., kept, :].swapaxes(-1, -2), scaled[..., redundant, :].swapaxes(-1, -2))
    result = np.zeros((*balancing.shape[:-2], phi.shape[-2], len(redundant)), balancing.dtype)
    result[..., kept, :] = balancing
    result[..., redundant, np.arange(len(redundant))] = 1.0
    result *= scale[..., None]
    return np.asarray(result / np.sqrt(np.square(result.real / scale.real[..., None]).sum(axis=-2, keepdims=True)))


def _joints_of_loops(scene: Scene, cuts: Cuts, wrenches: Array) -> tuple[Bools, Bools]:
    """Return a mask (rows, joints) of the joints in each loop, loops of cut joints without locked directions last, and
    a mask of the joints that can transmit a force: those with locked directions, or that a coupler measures.
    """
    joints, number = scene.topology.joints, scene.topology.body_numbers
    in_loop: Bools = np.array(wrenches.any(axis=(*range(wrenches.ndim - 3), -3)).T)
    transmits = np.array([bool(joint.locked) for joint in joints])
    if cuts.couplings is not None:
        first, touched, column = len(cuts.rows.first), cuts.couplings.touched, cuts.couplings.column
        joint_of = motion_order(scene.topology).joint
        coupler, coordinate = np.nonzero(touched & (joint_of >= 0))
        in_loop[first + coupler, joint_of[coordinate]] = True
        transmits[joint_of[column[column >= 0]]] = True
        transmits[[joints.index(joint) for joint, _ in scene.measured]] = True
    unlocked = [k for k in scene.topology.cut if not joints[k].locked]
    path_sign = beyond(scene)
    in_unlocked = np.array([path_sign[number[joints[k].first]] != path_sign[number[joints[k].second]]
                            for k in unlocked]).reshape(-1, len(joints))  # fmt: skip
    in_unlocked[np.arange(len(unlocked)), unlocked] = True
    return np.concatenate((in_loop, in_unlocked)), transmits
