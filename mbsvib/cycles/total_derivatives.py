"""Total derivatives of drive torques, shaking force and moment through the loops.

z are the dependent coordinates, their rates and accelerations, and the kinematic coefficients B = dq/dq_i. They follow
from the loops, phi = 0, phi' = 0, phi'' = 0 and J B = 0, together F(z, p) = 0, and are differentiated as implicit
functions:

d z / dp = -F_z^+ F_p,  d y / dp = y_p + y_z dz / dp

p are parameters, or the values, rates and accelerations of the drives themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.errors import ModelError
from mbsvib.finite_motion.evaluation import matrices
from mbsvib.finite_motion.frames import Expression

if TYPE_CHECKING:
    from mbsvib.cycles.expressions import Statement
    from mbsvib.cycles.machine import Machine

# What the derivatives of the loops leave over, as a share of them: rounding, unless a parameter takes the loops apart.
ASSEMBLED = 1e-8


@dataclass(frozen=True)
class Derivatives:
    """Derivatives to p: ``results`` (samples, drives + 6, p) of torques, shaking force and moment, ``state`` (samples,
    3 n, p) of all coordinates, their rates and accelerations.
    """

    results: Array
    state: Array


def total_derivatives(plant: Machine, to: str, names: Sequence[str]) -> Derivatives:
    """Return the derivatives at all samples.

    ``to``: "parameters" of the equations, or "drives": values, rates and accelerations of the driven coordinates.
    """
    motion, expressions = plant.solved, plant.statement
    driven = tuple(motion.driven.tolist())
    function = _slopes(expressions, driven, to)
    coefficients = motion.coefficients.transpose(0, 2, 1).reshape(len(motion.q), -1)
    p = plant.values(expressions)
    derivatives = matrices(function, motion.q, motion.qd, motion.qdd, coefficients, p, plant.about)
    f_z, f_p, y_z, y_p = derivatives
    # rows and columns in units in which all are of like size
    row = np.tile(expressions.motion.motion.scales(plant.size)[1], 3 + len(driven))
    f_z, f_p = f_z / row[:, None], f_p / row[:, None]
    scale = np.linalg.norm(f_z, axis=1, keepdims=True)
    d_scaled = -np.linalg.pinv(f_z / scale) @ f_p
    _check_assembled(f_p * plant.size, (f_p + f_z / scale @ d_scaled) * plant.size, names)
    d_dependent = d_scaled / scale.transpose(0, 2, 1)
    n = motion.q.shape[1]
    state = np.zeros((len(motion.q), 3, n, len(names)))
    depends = np.setdiff1d(np.arange(n), motion.driven)
    state[:, :, depends] = d_dependent[:, : 3 * len(depends)].reshape(len(state), 3, len(depends), len(names))
    if to == "drives":
        state[:, :, motion.driven] = np.eye(3 * len(driven)).reshape(3, len(driven), -1)
    return Derivatives(y_p + y_z @ d_dependent, state.reshape(len(state), 3 * n, len(names)))


def _slopes(expressions: Statement, driven: tuple[int, ...], to: str) -> ca.Function:
    """Function of (q, q', q'', B, p, O) for F_z, F_p, y_z and y_p, compiled once."""
    variables = expressions.p if to == "parameters" else _drives(expressions, driven)
    n = expressions.q.shape[0]
    depends = [i for i in range(n) if i not in driven]
    columns = ca.SX.sym("ways", n * len(driven))
    coefficients = ca.reshape(columns, n, len(driven))
    phi, phi_rate, phi_acceleration = expressions.closures
    key = (to, driven)
    if key not in expressions.functions:
        tied = ca.vec(ca.jacobian(phi, expressions.q) @ coefficients)
        loops = ca.vertcat(phi, phi_rate, phi_acceleration, tied)
        free = ca.vertcat(expressions.q[depends, :], expressions.qd[depends, :], expressions.qdd[depends, :],
                          ca.vec(coefficients[depends, :]))  # fmt: skip
        results = ca.vertcat(coefficients.T @ expressions.required, expressions.force, expressions.moment)
        slopes = [ca.densify(ca.jacobian(numerator, by)) for numerator in (loops, results) for by in (free, variables)]
        expressions.functions[key] = ca.Function(
            "f", [expressions.q, expressions.qd, expressions.qdd, columns, expressions.p, expressions.about], slopes)
    return expressions.functions[key]


def _drives(expressions: Statement, driven: tuple[int, ...]) -> Expression:
    """Values, rates and accelerations of the driven coordinates."""
    which = list(driven)
    return ca.vertcat(expressions.q[which], expressions.qd[which], expressions.qdd[which])


def _check_assembled(before: Array, residuals: Array, names: Sequence[str]) -> None:
    """Refuse parameters that loops do not allow to change by themselves; arrays are per size of the mechanism."""
    for k, name in enumerate(names):
        if np.abs(residuals[:, :, k]).max(initial=0.0) > ASSEMBLED * np.abs(before[:, :, k]).max(initial=1.0):
            raise ModelError(f"cycle: a change of '{name}' takes the loops apart, as redundant constraints no longer "
                             f"agree; there is no derivative to it.", element=name, field="parameters")  # fmt: skip
