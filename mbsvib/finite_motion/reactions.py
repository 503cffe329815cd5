"""Forces in joints, and on the ground, in a motion: Lagrange's equations along virtual displacements.

Let s be virtual displacements that a joint does not allow. With s = s' = s'' = 0 the joint carries R along them,

    R = M_s q'' - f_s - J_s^T lambda,   J^T lambda = M q'' - f - B u

with the closures' J and J_s = dphi/ds. Joints of the tree and joints that are cut are alike; couplers are closures, so
that what they transmit in a joint is part of R. Redundant closures do not determine lambda.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.finite_motion.frames import Expression
from mbsvib.finite_motion.lagrange import FiniteMotion
from mbsvib.finite_motion.statement import with_virtual_displacements
from mbsvib.linalg.rank import REDUNDANT_LOOPS
from mbsvib.mechanism.mechanism import Mechanism


def opened(
    model: Mechanism, statement: FiniteMotion, joints: Sequence[str], qdd: Expression, u: Expression,
    without: Sequence[str] = (),
) -> tuple[Expression, Expression]:  # fmt: skip
    """Return what the equations lack without closures (n + 6 joints,), along the coordinates and along the virtual
    displacements of joints, and the derivative of the closures (rows, n + 6 joints) to both.

    All are expressions of the symbols of the statement, of its accelerations ``qdd`` (n,) and inputs ``u``.
    ``without``: names of loads that do not act.
    """
    extended = with_virtual_displacements(model, statement, joints, without)
    motion, own, none = extended.motion, statement.motion, ca.SX.zeros(6 * len(joints))
    unbalanced = ca.jtimes(extended.momenta, motion.qd, ca.vertcat(qdd, none)) - extended.forces
    if u.numel():
        unbalanced -= extended.input_forces @ u
    symbols = [motion.q, motion.qd, motion.bases, motion.numbers.symbols, extended.yields]
    values = [ca.vertcat(own.q, none), ca.vertcat(own.qd, none), own.bases, own.numbers.symbols, statement.yields]
    result = ca.substitute([ca.densify(unbalanced), ca.densify(extended.jacobian)], symbols, values)
    return result[0], result[1]


def multipliers(jacobian: Array, right: Array) -> tuple[Array, Array]:
    """Return the multipliers lambda (samples, rows) of least norm, and all those that do nothing (samples, rows, rows).

    The latter are orthonormal columns, some of them 0. ``jacobian`` J (samples, rows, n) in units of like size;
    ``right`` (samples, n): J^T lambda.
    """
    left, sizes, motions = np.linalg.svd(jacobian)
    retained = sizes > REDUNDANT_LOOPS * np.maximum(1.0, sizes.max(axis=-1, initial=0.0, keepdims=True))
    count = sizes.shape[-1]
    shares = (motions[:, :count] @ right[:, :, None])[:, :, 0]
    shares = np.divide(shares, sizes, out=np.zeros_like(sizes), where=retained)
    idle = left.copy()
    idle[:, :, :count] *= ~retained[:, None, :]
    return (left[:, :, :count] @ shares[:, :, None])[:, :, 0], idle
