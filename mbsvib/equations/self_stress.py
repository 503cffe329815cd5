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
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import UndeterminedForceWarning
from mbsvib.kinematics.characteristic_length import length_of
from mbsvib.linalg.groups import connected_parts
from mbsvib.linalg.rank import DETERMINED, STRESS_IN_COUPLERS, ZERO_FORM

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.force_paths import ForcePaths
    from mbsvib.kinematics.loops import Cuts, Reduction

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
        from mbsvib.common.tables import listed

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
    """States of self-stress in the ``joints`` (j,) of loops that have joints in common, with their ``length`` L [m].

    ``states`` (6, j, r) [N, N m] are orthonormal with moments over L; ``multipliers`` (locked rows, r) are those of the
    constraints in each, None if they are not known.
    """

    joints: Index
    length: float
    states: Array
    multipliers: Array | None = None

    @property
    def weight(self) -> Array:
        """D^2 (6, 1): the weights of squared forces and moments."""
        return np.repeat((1.0, self.length**-2), 3)[:, None]

    def minimum_norm(self, wrench: Array, added_amount: Array | None = None) -> Array:
        """Return wrenches in all joints without their part along the states, both (6, joints, columns).

        ``wrench`` (6, joints, columns): wrenches that balance the bodies, at the joints' points. ``added_amount`` (r,
        columns): amount of each state to remove in addition, for forces that change with the pose. Returns (6, joints,
        columns): wrenches with the same effect on the bodies.
        """
        before, unit = wrench[:, self.joints], np.sqrt(self.weight)[..., None]
        amount = np.einsum("cjr,cjn->rn", self.weight[..., None] * self.states, before)
        if added_amount is not None:
            amount += added_amount
        after = before - np.einsum("cjr,rn->cjn", self.states, amount)
        size = np.sqrt(np.square(np.abs(unit * before)).sum(axis=(0, 1)) + np.square(np.abs(amount)).sum(axis=0))
        after.real[np.abs(unit * after) <= ZERO_FORM * size] = 0.0
        result = wrench.copy()
        result[:, self.joints] = after
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
        return Undetermined(tuple([names[k] for k in self.joints[stressed].tolist()]), self.length, tuple(outputs))


def warn(model: str, undetermined: Sequence[Undetermined]) -> None:
    """Warn of undetermined outputs, at the line that called ``linearize``."""
    for forces in undetermined:
        if forces.outputs:
            from mbsvib.common.tables import listed

            warnings.warn(
                f"model '{model}' does not determine the outputs {listed(forces.outputs)}: constraints of the joints "
                f"{listed(forces.joints)} are redundant. Of all forces in equilibrium those of least norm are "
                f"returned, see explain(). To obtain others, replace one of these joints by a bushing, or by a joint "
                f"that frees directions that the others lock.",
                UndeterminedForceWarning, stacklevel=4,
            )  # fmt: skip


def self_stress(
    joints: Index, length: float, wrenches: Array, multipliers: Array | None = None
) -> SelfStress | None:
    """Return orthonormal states of self-stress with the span of given ones.

    ``joints`` (j,): numbers of the joints. ``length``: their length L [m]. ``wrenches`` (6, j, r): wrenches in them
    without resultant on any body, of size one with moments over the length. ``multipliers`` (locked rows, r): those of
    the constraints in them. None if all are zero.
    """
    scale = np.repeat((1.0, 1.0 / length), 3)[:, None, None]
    flat = (wrenches * scale).reshape(6 * len(joints), wrenches.shape[2])
    left, sizes, right = np.linalg.svd(flat, full_matrices=False)
    nonzero = sizes > STRESS_IN_COUPLERS
    states = left[:, nonzero]
    if not states.size:
        return None
    states[np.abs(states) <= ZERO_FORM] = 0.0
    of_rows = None if multipliers is None else multipliers @ (right[nonzero].T / sizes[nonzero])
    return SelfStress(joints, length, states.reshape(6, len(joints), -1) / scale, of_rows)


def of_loops(
    paths: ForcePaths, cuts: Cuts | None, reduction: Reduction, phi: Array, multiplier_wrenches: Array
) -> list[SelfStress]:
    """Return the states of self-stress of a mechanism, by loops that have joints or couplers in common.

    ``phi`` (locked rows, n): locked rows per unit joint coordinate. ``multiplier_wrenches`` (6 joints, locked rows):
    wrenches in all joints per unit of each multiplier.
    """
    if cuts is None or not any(group.surplus for group in reduction.groups):
        return []
    wrenches = multiplier_wrenches.reshape(6, -1, multiplier_wrenches.shape[1])
    in_loop, transmits = _joints_of_loops(paths, cuts, wrenches)
    dependent = np.ones(phi.shape[1], dtype=bool)
    dependent[reduction.independent] = False
    result = []
    loop, joint = np.nonzero(in_loop)
    loop_part, joint_part = connected_parts(loop, joint, (len(in_loop), in_loop.shape[1]))
    for part in np.unique(loop_part[: len(phi)]):
        rows = np.flatnonzero(loop_part[: len(phi)] == part)
        joints = np.flatnonzero((joint_part == part) & transmits)
        columns = np.flatnonzero(phi[rows].any(axis=0) & dependent)
        ends = (paths.first[joints], paths.second[joints])
        length = length_of(paths.point[:, joints].T, *(paths.position[:, bodies].T for bodies in ends))
        scale = length * cuts.row_scale(length)[rows, None]
        # combinations of the rows without work on any coordinate
        combinations = np.linalg.qr(scale * phi[np.ix_(rows, columns)], mode="complete")[0][:, len(columns) :]
        multipliers = np.zeros((len(phi), combinations.shape[1]))
        multipliers[rows] = scale * combinations
        stress = self_stress(joints, length, wrenches[:, joints][:, :, rows] @ multipliers[rows], multipliers)
        if stress is not None:
            result.append(stress)
    return result


def _joints_of_loops(paths: ForcePaths, cuts: Cuts, wrenches: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return a mask (rows, joints) of the joints in each loop, loops of cut joints without locked directions last, and
    a mask of the joints that can transmit a force: those with locked directions, or that a coupler measures.
    """
    joints = paths.topology.joints
    in_loop: NDArray[np.bool_] = np.array(wrenches.any(axis=0).T)
    transmits = np.array([bool(joint.locked) for joint in joints])
    if cuts.couplings is not None:
        first, touched, column = len(cuts.rows.first), cuts.couplings.touched, cuts.couplings.column
        coupler, coordinate = np.nonzero(touched & (paths.joint_of >= 0))
        in_loop[first + coupler, paths.joint_of[coordinate]] = True
        transmits[paths.joint_of[column[column >= 0]]] = True
        transmits[paths.measured(cuts.couplings.measured)] = True
    cut = np.array(paths.topology.cut, dtype=np.intp)
    unlocked = cut[[not joints[k].locked for k in cut.tolist()]]
    in_unlocked = paths.path_sign[paths.first[unlocked]] != paths.path_sign[paths.second[unlocked]]
    in_unlocked[np.arange(len(unlocked)), unlocked] = True
    return np.concatenate((in_loop, in_unlocked)), transmits
