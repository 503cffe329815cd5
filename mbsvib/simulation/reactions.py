"""Outputs of a run that are forces in joints or on the ground (see ``finite_motion.reactions``).

Those that depend on what redundant closures do not determine are refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements.ports import ForceOutput
from mbsvib.finite_motion.evaluation import matrices
from mbsvib.finite_motion.lagrange import FiniteMotion
from mbsvib.finite_motion.reactions import multipliers, opened
from mbsvib.kinematics.pose import size_of
from mbsvib.linalg.rank import DETERMINED
from mbsvib.mechanism.mechanism import GROUND, Mechanism


@dataclass(frozen=True)
class ReactionOutputs:
    """Outputs that are forces in joints or on the ground.

    ``function`` makes of (q, q', q'', y, bases, u) what the equations lack without closures (n + 6 joints,), and the
    derivative of the closures (rows, n + 6 joints). ``directions`` (outputs, 6 joints) pick the outputs, ``at_rest``
    (outputs,) are their values in the pose as described. ``scale`` (n,) and ``rows`` make coordinates and closures of
    like size.
    """

    names: tuple[str, ...]
    function: Any
    directions: Array
    at_rest: Array
    scale: Array
    rows: Array

    def values(self, arguments: Sequence[Array]) -> dict[str, Array]:
        """Return the outputs by name, (samples,) each; the arguments (k, samples) are those of the function."""
        unbalanced, jacobian = matrices(self.function, *[np.atleast_2d(array).T for array in arguments])
        values = self._wrenches(unbalanced[:, :, 0], jacobian) @ self.directions.T - self.at_rest
        return dict(zip(self.names, values.T, strict=True))

    def _wrenches(self, unbalanced: Array, jacobian: Array) -> Array:
        """R (samples, 6 joints)."""
        n = len(self.scale)
        along, virtual = self._scaled(jacobian)
        acting, _ = multipliers(along, unbalanced[:, :n] * self.scale)
        return np.asarray(unbalanced[:, n:] - (virtual.transpose(0, 2, 1) @ acting[:, :, None])[:, :, 0])

    def _scaled(self, jacobian: Array) -> tuple[Array, Array]:
        """J (samples, rows, n) and J_s (samples, rows, 6 joints) with rows and coordinates of like size."""
        n = len(self.scale)
        rows = self.rows[:, None] * jacobian
        return rows[:, :, :n] * self.scale, rows[:, :, n:]

    def undetermined_shares(self, arguments: Sequence[Array]) -> Array:
        """Return the part (outputs,) of each output that redundant closures do not determine, against a unit force."""
        _, jacobian = matrices(self.function, *[np.atleast_2d(array).T for array in arguments])
        along, virtual = self._scaled(jacobian)
        _, idle = multipliers(along[:1], np.zeros((1, len(self.scale))))
        return np.asarray(np.linalg.norm(self.directions @ virtual[0].T @ idle[0], axis=1))


def reaction_outputs(
    model: Mechanism, statement: FiniteMotion, forces: Mapping[str, ForceOutput], without: Sequence[str]
) -> tuple[ReactionOutputs, tuple[str, ...]]:
    """Return outputs that are forces in joints or on the ground, and those that redundant closures do not
    determine.

    ``forces``: the outputs, of joints and of ``"ground"``. ``without``: names of loads that do not act in the run; in
    the pose as described they do. Returns those that are determined; the others.
    """
    motion = statement.motion
    joints = tuple(dict.fromkeys(part.element for part in forces.values()))
    directions = np.zeros((len(forces), 6 * len(joints)))
    for i, part in enumerate(forces.values()):
        k = 6 * joints.index(part.element)
        directions[i, k : k + 6] = [-value for value in part.wrench]
    scale, closure_scale = motion.scales(size_of(model))
    rows = 1.0 / closure_scale
    in_pose = ReactionOutputs(tuple(forces), _function(model, statement, joints, ()), directions, np.zeros(len(forces)),
                           scale, rows)  # fmt: skip
    n = len(motion.names)
    at = [np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(statement.yields.shape[0]),
          motion.no_turns, np.zeros(len(statement.inputs))]  # fmt: skip
    arguments = [array[:, None] for array in at]
    determined = np.flatnonzero(in_pose.undetermined_shares(arguments) <= DETERMINED)
    at_rest = np.array(list(in_pose.values(arguments).values()))[:, 0]
    function = _function(model, statement, joints, without) if without else in_pose.function
    names = tuple([in_pose.names[i] for i in determined])
    result = ReactionOutputs(names, function, directions[determined], at_rest[determined], scale, rows)
    return result, tuple([name for name in forces if name not in names])


def _function(model: Mechanism, statement: FiniteMotion, joints: Sequence[str], without: Sequence[str]) -> Any:
    """What the equations lack and the derivative of the closures, with the released displacements at rest."""
    motion = statement.motion
    qdd, u = ca.SX.sym("qdd", len(motion.names)), ca.SX.sym("u", len(statement.inputs))
    return ca.Function("reactions", [motion.q, motion.qd, qdd, statement.yields, motion.bases, u],
                       opened(model, statement, joints, qdd, u, without), {"cse": True})  # fmt: skip


def is_reaction(model: Mechanism, part: Any) -> bool:
    """Return whether an output is a force in a joint, or the sum of those on the ground."""
    return part.element in model.joints or part.element == GROUND
