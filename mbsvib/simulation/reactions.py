"""Forces in joints, and on the ground, in a run: what Lagrange's equations lack along a joint that is released.

Let s be displacements that a joint does not allow. With s = s' = s'' = 0 the joint carries R along them,

    R = M_s q'' - f_s - J_s^T lambda,   J^T lambda = M q'' - f - B u

with the closures' J and J_s = dphi/ds. Joints of the tree and joints that are cut are alike; couplers are closures, so
that what they transmit in a joint is part of R. Redundant closures leave lambda open, not the forces that are told.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.elements.ports import ForceOutput
from mbsvib.equilibrium.pose_kinematics import size_of
from mbsvib.finite_motion.evaluation import matrices
from mbsvib.finite_motion.statement import released
from mbsvib.linalg.rank import DETERMINED, REDUNDANT_LOOPS
from mbsvib.mechanism.mechanism import GROUND

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.finite_motion.lagrange import FiniteMotion
    from mbsvib.mechanism.mechanism import Mechanism


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
        lacking, jacobian = matrices(self.function, *[np.atleast_2d(array).T for array in arguments])
        told = self._carried(lacking[:, :, 0], jacobian) @ self.directions.T - self.at_rest
        return dict(zip(self.names, told.T, strict=True))

    def _carried(self, lacking: Array, jacobian: Array) -> Array:
        """R (samples, 6 joints)."""
        n = len(self.scale)
        result = lacking[:, n:]
        if jacobian.shape[1]:
            scaled = self.rows[:, None] * jacobian * np.append(self.scale, np.ones(jacobian.shape[2] - n))
            to_closures = np.linalg.pinv(scaled[:, :, :n].transpose(0, 2, 1), rcond=REDUNDANT_LOOPS)
            closures = to_closures @ (lacking[:, :n] * self.scale)[:, :, None]
            result = result - (scaled[:, :, n:].transpose(0, 2, 1) @ closures)[:, :, 0]
        return result

    def open_shares(self, arguments: Sequence[Array]) -> Array:
        """Return the part (outputs,) of each output that redundant closures leave open, against a unit force."""
        _, jacobian = matrices(self.function, *[np.atleast_2d(array).T for array in arguments])
        n = len(self.scale)
        scaled = self.rows[:, None] * jacobian[0] * np.append(self.scale, np.ones(jacobian.shape[2] - n))
        left, sizes, _ = np.linalg.svd(scaled[:, :n])
        stresses = left[:, int(np.sum(sizes > REDUNDANT_LOOPS * sizes.max(initial=0.0))) :]
        return np.asarray(np.linalg.norm(self.directions @ scaled[:, n:].T @ stresses, axis=1))


def reaction_outputs(
    model: Mechanism, statement: FiniteMotion, asked: Mapping[str, ForceOutput], without: Sequence[str]
) -> tuple[ReactionOutputs, tuple[str, ...]]:
    """Return outputs that are forces in joints or on the ground, and those that redundant closures leave open.

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    statement : FiniteMotion
        Its finite motion.
    asked : mapping of str to ForceOutput
        The outputs, of joints and of ``"ground"``.
    without : sequence of str
        Names of loads that do not act in the run; in the pose as described they do.

    Returns
    -------
    ReactionOutputs
        Those that are determined.
    tuple of str
        The others.
    """
    motion = statement.motion
    joints = tuple(dict.fromkeys(part.element for part in asked.values()))
    directions = np.zeros((len(asked), 6 * len(joints)))
    for i, part in enumerate(asked.values()):
        k = 6 * joints.index(part.element)
        directions[i, k : k + 6] = [-value for value in part.wrench]
    size = size_of(model)
    scale, rows = np.where(motion.turns, 1.0, size), np.where(motion.closure_turns, 1.0, 1.0 / size)
    held = ReactionOutputs(tuple(asked), _function(model, statement, joints, ()), directions, np.zeros(len(asked)),
                           scale, rows)  # fmt: skip
    n = len(motion.names)
    at = [np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(statement.yields.shape[0]),
          np.tile(np.eye(3).reshape(-1), len(motion.based)), np.zeros(len(statement.inputs))]  # fmt: skip
    here = [array[:, None] for array in at]
    told = np.flatnonzero(held.open_shares(here) <= DETERMINED)
    at_rest = np.array(list(held.values(here).values()))[:, 0]
    function = _function(model, statement, joints, without) if without else held.function
    names = [held.names[i] for i in told]
    open_ones = tuple([name for name in asked if name not in names])
    return ReactionOutputs(tuple(names), function, directions[told], at_rest[told], scale, rows), open_ones


def _function(model: Mechanism, statement: FiniteMotion, joints: Sequence[str], without: Sequence[str]) -> Any:
    """What the equations lack and the derivative of the closures, with the released displacements at rest."""
    free = released(model, statement, joints, without)
    motion, n, more = free.motion, len(statement.motion.names), 6 * len(joints)
    q, qd, qdd = (ca.SX.sym(name, n) for name in ("q", "qd", "qdd"))
    u, none = ca.SX.sym("u", len(free.inputs)), ca.SX.zeros(more)
    lacking = ca.jtimes(free.momenta, motion.qd, ca.vertcat(qdd, none)) - free.forces
    if free.inputs:
        lacking -= free.input_forces @ u
    outputs = ca.substitute([ca.densify(lacking), ca.densify(free.jacobian)], [motion.q, motion.qd],
                            [ca.vertcat(q, none), ca.vertcat(qd, none)])  # fmt: skip
    return ca.Function("reactions", [q, qd, qdd, free.yields, motion.bases, u], outputs, {"cse": True})


def is_reaction(model: Mechanism, part: Any) -> bool:
    """Return whether an output is a force in a joint, or the sum of those on the ground."""
    return isinstance(part, ForceOutput) and (part.element in model.joints or part.element == GROUND)
