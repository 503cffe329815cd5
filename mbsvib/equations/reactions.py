"""Reactions: the wrenches in all joints, by their work along virtual motions that release them.

With the potentials V of all applied forces and Phi the locked rows of the cut joints, over the joint coordinates and
over virtual motions v of the joints, balance and the wrenches w on the second bodies are

    Phi^T lambda = -dV/dq  in the dependent coordinates,    w . v = (dV/dv + Phi_v^T lambda) . v

With redundant constraints lambda is not unique; the wrenches of least norm that balance the bodies are taken
(``self_stress``). The second-order terms do not depend on this choice.

Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), section 6.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.core.geometric_stiffness import TwistsAt
from mbsvib.equations.self_stress import SelfStress, of_loops
from mbsvib.equations.virtual_motions import VirtualMotions, joint_points, opened, virtual_motions

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.equations.load_stiffness import LoadedPairs
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.virtual_motions import Kept
    from mbsvib.kinematics.loops import Reduction


@dataclass(frozen=True)
class Reactions:
    """The wrenches in all joints of a ``scene``, with the locked rows ``phi`` (..., locked rows, n) and the ``kept``
    rows and dependent coordinates of its loops; ``fixed`` are the points of joints as in ``joint_points``. Forces are
    at the joints' points and moments about them, in world axes, as they act on the second bodies; first bodies take
    the opposite.
    """

    scene: Scene
    reduction: Reduction
    phi: Array
    kept: Kept
    fixed: Mapping[int, Array]

    @cached_property
    def motions(self) -> VirtualMotions:
        """Six virtual motions of each joint, in world axes."""
        joints = self.scene.topology.joints
        world = {joint.name: np.eye(3) for joint in joints}
        every = range(len(joints))
        return virtual_motions(self.scene, every, world, joint_points(self.scene, every, self.fixed))

    @cached_property
    def of_rows(self) -> Array:
        """The wrenches (..., 6, joints, locked rows) in all joints per unit of each multiplier."""
        phi_v = opened(self.scene, self.motions)
        *lead, rows, _ = phi_v.shape
        return np.moveaxis(phi_v.reshape(*lead, rows, len(self.scene.topology.joints), 6), (-3, -1), (-1, -3))

    @cached_property
    def stress(self) -> tuple[SelfStress, ...]:
        """States of self-stress of redundant constraints."""
        if not any(group.surplus for group in self.reduction.groups):
            return ()
        point = self.motions.point[..., ::6].swapaxes(-1, -2)
        return tuple(of_loops(self.scene, self.reduction, self.phi, self.kept, self.of_rows, point))

    def wrenches(self, loaded: LoadedPairs, multipliers: Array) -> Array:
        """Return the wrenches (..., 6, joints) of applied pairs and ``multipliers`` (..., locked rows): those of least
        norm.
        """
        result = self.with_loops(loaded, multipliers)
        for stress in self.stress:
            result = stress.minimum_norm(result)
        return result[..., 0]

    def with_loops(self, loaded: LoadedPairs, multipliers: Array) -> Array:
        """Return the wrenches (..., 6, joints, 1) of applied pairs and of these ``multipliers`` (..., locked rows)."""
        pairs, motions = loaded.pairs, self.motions
        virtual = TwistsAt(motions.six[..., :3, :], motions.six[..., 3:, :], motions.point, motions.twists.path)
        along = virtual.motion(pairs.first, pairs.second, pairs.point)
        gradient = np.einsum("...ip,...ipk->...k", pairs.wrench, along)
        wrench = gradient.reshape(*gradient.shape[:-1], -1, 6).swapaxes(-1, -2)[..., None]
        return np.asarray(wrench + self.of_rows @ multipliers[..., None, :, None])


def loop_multipliers(reduction: Reduction, kept: Kept, phi: Array, gradient: Array) -> Array:
    """Return lambda (..., locked rows) with Phi^T lambda = -dV/dq in the dependent coordinates.

    ``phi`` (..., locked rows, n); ``gradient`` (..., n): dV/dq. Redundant rows have none; the stiffness of loads does
    not depend on this choice.
    """
    lead = np.broadcast_shapes(phi.shape[:-2], gradient.shape[:-1])
    result = np.zeros((*lead, phi.shape[-2]), np.result_type(phi, gradient))
    for group, (rows, dependent) in zip(reduction.groups, kept, strict=True):
        if len(dependent):
            right = -gradient[..., dependent, None]
            try:
                solution = np.linalg.solve(phi[..., rows[:, None], dependent].swapaxes(-1, -2), right)
            except np.linalg.LinAlgError:  # a variant whose rank was decided anew
                rows = group.rows
                solution = np.linalg.pinv(phi[..., rows[:, None], dependent].swapaxes(-1, -2)) @ right
            result[..., rows] = solution[..., 0]
    return result
