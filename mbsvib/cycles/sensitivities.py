"""Exact derivatives of a cycle to masses, centres, inertias, lengths and all other numbers of finite motion.

The driven coordinates stay as they are. The others, their rates and accelerations, and the ways B = dq/dq_i follow from
the loops, phi = 0, phi' = 0, phi'' = 0 and J B = 0, which are differentiated as implicit functions:

d z / dp = -F_z^+ F_p,  d y / dp = y_p + y_z dz / dp
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.common import arguments as check
from mbsvib.cycles.expressions import evaluated
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.cycles.expressions import Statement
    from mbsvib.cycles.result import CycleData

# What the derivatives of the loops leave over, as a share of them: rounding, unless a parameter takes the loops apart.
ASSEMBLED = 1e-8


@dataclass(frozen=True, eq=False)
class CycleSensitivities:
    """Derivatives to ``parameters`` (k) of the samples of a cycle: ``torques`` (k, n) by drive, ``shaking_force`` and
    ``shaking_moment`` (k, n, 3).
    """

    cycle: CycleData = field(repr=False)
    parameters: tuple[str, ...]
    torques: Mapping[str, Array] = field(repr=False)
    shaking_force: Array = field(repr=False)
    shaking_moment: Array = field(repr=False)

    @property
    def torque(self) -> Any:
        """That of the only drive (k, n), else those of all drives by name."""
        return next(iter(self.torques.values())) if len(self.torques) == 1 else self.torques

    def values(self, quantity: str, drive: str | None = None) -> Array:
        """Return the derivatives (k, n, 3) or (k, n, 1) of what ``CycleData.values`` returns."""
        self.cycle.values(quantity, drive)  # refuses what it does not know
        if quantity == "torque":
            return self.torques[self.cycle.drives[0] if drive is None else drive][:, :, None]
        return self.shaking_force if quantity == "force" else self.shaking_moment

    def square(self, quantity: str, drive: str | None = None) -> Array:
        """Return the derivatives (k,) of the mean square of a quantity, smooth where that is zero."""
        values = self.cycle.values(quantity, drive)
        result: Array = 2.0 * np.einsum("nc,knc->k", values, self.values(quantity, drive)) / len(values)
        return result

    def rms(self, quantity: str, drive: str | None = None) -> Array:
        """Return the derivatives (k,) of the root mean square of a quantity.

        Parameters
        ----------
        quantity : str
            "force", "moment" or "torque".
        drive : str, optional
            Which drive's torque; default: the only one.

        Returns
        -------
        array, shape (k,)
            Derivatives; not a number where the value is zero, which has none.

        Raises
        ------
        ModelError
            If there is no such quantity or drive.
        """
        value = self.cycle.rms(quantity, drive)
        return self.square(quantity, drive) / (2.0 * value) if value else np.full(len(self.parameters), np.nan)

    def peak(self, quantity: str, drive: str | None = None) -> Array:
        """Return the derivatives (k,) of the largest absolute value of a quantity, at the sample where it is.

        Parameters
        ----------
        quantity : str
            "force", "moment" or "torque".
        drive : str, optional
            Which drive's torque; default: the only one.

        Returns
        -------
        array, shape (k,)
            Derivatives; not a number where the value is zero, which has none.

        Raises
        ------
        ModelError
            If there is no such quantity or drive.
        """
        values = self.cycle.values(quantity, drive)
        sizes = np.linalg.norm(values, axis=1)
        i = int(sizes.argmax())
        if not sizes[i]:
            return np.full(len(self.parameters), np.nan)
        return np.asarray(self.values(quantity, drive)[:, i] @ values[i] / sizes[i])


def sensitivities(cycle: CycleData, parameters: Any = None) -> CycleSensitivities:
    """Return exact derivatives of a cycle; see ``Cycle.sensitivities``.

    Parameters
    ----------
    cycle : Cycle
        The cycle.
    parameters : str or sequence of str, optional
        Names or patterns.

    Returns
    -------
    CycleSensitivities
        The derivatives.

    Raises
    ------
    ModelError
        If a parameter is unknown or has no derivative here, or takes the loops apart.
    """
    names = _names(cycle, parameters)
    expressions = cycle.machine.with_symbols(names)
    slopes = _differentiated(cycle, expressions)[:, :, [expressions.names.index(name) for name in names]]
    drives = len(cycle.drives)
    torque = slopes[:, :drives].transpose(2, 1, 0)
    force, moment = (slopes[:, drives + k : drives + k + 3].transpose(2, 0, 1) for k in (0, 3))
    for array in (torque, force, moment):
        array.flags.writeable = False
    return CycleSensitivities(cycle, names, {name: torque[:, i] for i, name in enumerate(cycle.drives)}, force, moment)


def _names(cycle: CycleData, parameters: Any) -> tuple[str, ...]:
    known = cycle.machine.model.parameters
    if parameters is None:
        fields = ("mass", "position", "inertia")
        return tuple([name for name in known if known.entry(name).part in cycle.machine.model.bodies
                      and known.entry(name).field in fields])  # fmt: skip
    given = [parameters] if isinstance(parameters, str) else parameters
    if not hasattr(given, "__iter__"):
        raise check.refuse("cycle", "parameters", parameters, "names or patterns of parameters")
    return tuple(dict.fromkeys(name for pattern in given for name in known.matching(pattern)))


def _differentiated(cycle: CycleData, expressions: Statement) -> Array:
    """Derivatives (samples, drives + 6, parameters) of torques, shaking force and moment."""
    plant, motion = cycle.machine, cycle.machine.solved
    driven = tuple(motion.driven.tolist())
    function, shapes = _slopes(expressions, driven)
    ways = motion.ways.transpose(0, 2, 1).reshape(len(motion.q), -1)
    found = evaluated(function, motion.q, motion.qd, motion.qdd, ways, plant.values(expressions), plant.about)
    f_z, f_p, y_z, y_p = (each.reshape(len(motion.q), *shape) for each, shape in zip(found, shapes, strict=True))
    if not f_z.shape[2] or not f_p.shape[2]:
        return np.array(y_p)
    # rows and columns in units in which all are of like size
    row = np.tile(np.where(expressions.motion.motion.closure_turns, 1.0, plant.size), 3 + len(driven))
    f_z, f_p = f_z / row[:, None], f_p / row[:, None]
    scale = np.linalg.norm(f_z, axis=1, keepdims=True)
    moved = -np.linalg.pinv(f_z / scale) @ f_p
    _check_assembled(f_p, f_p + f_z / scale @ moved, expressions.names)
    return np.array(y_p + y_z @ (moved / scale.transpose(0, 2, 1)))


def _slopes(expressions: Statement, driven: tuple[int, ...]) -> tuple[ca.Function, list[tuple[int, int]]]:
    """Function of (q, q', q'', B, p, O) for F_z, F_p, y_z and y_p, compiled once, and the shapes of these."""
    n = expressions.q.shape[0]
    depends = [i for i in range(n) if i not in driven]
    columns = ca.SX.sym("ways", n * len(driven))
    ways = ca.reshape(columns, n, len(driven))
    phi, phi_rate, phi_acceleration = expressions.closures
    rows, unknowns = (3 + len(driven)) * phi.numel(), (3 + len(driven)) * len(depends)
    shapes = [(rows, unknowns), (rows, len(expressions.names)), (len(driven) + 6, unknowns),
              (len(driven) + 6, len(expressions.names))]  # fmt: skip
    key = ("slopes", driven)
    if key not in expressions.functions:
        tied = ca.vec(ca.jacobian(phi, expressions.q) @ ways)
        loops = ca.vertcat(phi, phi_rate, phi_acceleration, tied)
        free = ca.vertcat(expressions.q[depends], expressions.qd[depends], expressions.qdd[depends],
                          ca.vec(ways[depends, :]))  # fmt: skip
        results = ca.vertcat(ways.T @ expressions.required, expressions.force, expressions.moment)
        slopes = [ca.densify(ca.jacobian(each, to)) for each in (loops, results) for to in (free, expressions.p)]
        expressions.functions[key] = ca.Function(
            "f", [expressions.q, expressions.qd, expressions.qdd, columns, expressions.p, expressions.about], slopes)
    return expressions.functions[key], shapes


def _check_assembled(before: Array, left: Array, names: Sequence[str]) -> None:
    """Refuse parameters that loops do not allow to change by themselves."""
    for k, name in enumerate(names):
        if np.abs(left[:, :, k]).max() > ASSEMBLED * max(1.0, float(np.abs(before[:, :, k]).max())):
            raise ModelError(f"cycle: a change of '{name}' takes the loops apart, as redundant constraints no longer "
                             f"agree; there is no derivative to it.", element=name, field="parameters")  # fmt: skip


