"""Inverse dynamics as functions of CasADi: loops, generalized forces, momentum, and the motion of all bodies."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.errors import ModelError
from mbsvib.finite_motion.rotations import Expression
from mbsvib.finite_motion.statement import finite_motion

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body
    from mbsvib.finite_motion.statement import FiniteMotion
    from mbsvib.mechanism.mechanism import Mechanism


@dataclass(frozen=True)
class Statement:
    """A mechanism in motion as expressions of q, q', q'' (n,), parameters p and the point O (3,) of moments.

    ``closures`` are phi, phi' and phi'' (3 rows,), ``required`` (n,) the generalized forces M q'' - f that joints and
    drives must supply, ``force`` and ``moment`` (3,) the shaking force and moment about O. ``names`` are those of p;
    other numbers are those of ``model``. ``functions`` keeps what was compiled of it.
    """

    model: Mechanism
    names: tuple[str, ...]
    motion: FiniteMotion
    q: Expression
    qd: Expression
    qdd: Expression
    p: Expression
    about: Expression
    closures: tuple[Expression, Expression, Expression]
    required: Expression
    force: Expression
    moment: Expression
    functions: dict[Any, ca.Function] = field(default_factory=dict, repr=False)

    def compiled(self, key: Any, outputs: Callable[[], Sequence[Expression]]) -> ca.Function:
        """Return a function of (q, q', q'', p, O), compiled when it is asked for first."""
        if key not in self.functions:
            self.functions[key] = self.function(*outputs())
        return self.functions[key]

    @cached_property
    def closing(self) -> NDArray[np.bool_]:
        """Which parameters p loops depend on, so that the motion does."""
        return np.array(ca.which_depends(self.closures[0], self.p, 1, False), dtype=bool)

    def rate(self, expression: Expression) -> Expression:
        """Return the time derivative of an expression of q and q'."""
        return ca.jtimes(expression, self.q, self.qd) + ca.jtimes(expression, self.qd, self.qdd)

    def function(self, *outputs: Expression) -> ca.Function:
        """Return a function of (q, q', q'', p, O)."""
        return ca.Function("f", [self.q, self.qd, self.qdd, self.p, self.about], list(outputs))


def statement(
    model: Mechanism, cut: Sequence[str] | None, parameters: Sequence[str] = (), bases: bool = False
) -> Statement:
    """Return a mechanism in motion.

    F = -d/dt sum of m v,  M_O = -d/dt sum of (r - O) x m v + R I w + h

    Parameters
    ----------
    model : Mechanism
        The mechanism.
    cut : sequence of str, optional
        Joints at which loops are to be cut.
    parameters : sequence of str
        Names of numbers that become symbols p.
    bases : bool
        As for ``finite_motion``.

    Returns
    -------
    Statement
        The expressions.

    Raises
    ------
    ModelError
        If a part has no statement in finite motion, or a state of its own.
    """
    for part in model.composed.values():
        raise ModelError(f"{type(part).__name__.lower()} '{part.name}': bends, which a prescribed motion does not "
                         f"determine; make rigid bodies and springs of it for a cycle, or simulate.",
                         element=part.name)  # fmt: skip
    motion = finite_motion(model, parameters, cut=cut, bases=bases)
    if motion.yield_names:
        name = motion.yield_names[0].rpartition(".")[0]
        raise ModelError(f"maxwell '{name}': has a state of its own, which a prescribed motion does not determine; "
                         f"make springs and dampers of it for a cycle.", element=name)  # fmt: skip
    kinematics = motion.motion
    q, qd = kinematics.q, kinematics.qd
    qdd, about = ca.SX.sym("qdd", q.shape[0]), ca.SX.sym("about", 3)
    numbers = kinematics.numbers

    def rate(expression: Expression) -> Expression:
        return ca.jtimes(expression, q, qd) + ca.jtimes(expression, qd, qdd)

    momentum, angular = ca.SX.zeros(3), ca.SX.zeros(3)
    for body in model.bodies.values():
        r = kinematics.point(body.name, numbers.vector(body, "position"))
        v = numbers.scalar(body, "mass") * ca.jtimes(r, q, qd)
        momentum += v
        angular += ca.cross(r - about, v) + kinematics.frames[body.name].vector(_spin(body, motion))
    for rotor in model.rotors.values():
        h = numbers.scalar(rotor, "inertia") * numbers.scalar(rotor, "speed") * ca.SX(np.array(rotor.axis))
        angular += kinematics.frames[rotor.body].vector(h)
    phi = kinematics.closures
    phi_rate = ca.jtimes(phi, q, qd)
    required = ca.jtimes(motion.momenta, qd, qdd) - motion.forces
    return Statement(model, numbers.names, motion, q, qd, qdd, numbers.symbols, about, (phi, phi_rate, rate(phi_rate)),
                     required, -rate(momentum), -rate(angular))  # fmt: skip


def _spin(body: Body, motion: FiniteMotion) -> Expression:
    """Angular momentum (3,) of a body about its centre of mass, in axes that turn with it."""
    axes, entries = ca.SX(np.array(body.orientation)), motion.motion.numbers.vector(body, "inertia")
    xx, yy, zz, xy, xz, yz = (entries[i] for i in range(6))
    tensor = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    return axes @ (tensor @ (axes.T @ motion.motion.angular_velocity(body.name)))


class Called:
    """A function of its first argument alone, evaluated in place: calls take microseconds where it is short.

    Parameters
    ----------
    function : casadi.Function
        Any function whose outputs are dense.
    *arguments : array, shape (k,)
        All its arguments; values of the first do not count.
    """

    def __init__(self, function: ca.Function, *arguments: Array) -> None:
        # the buffer must live as long as what evaluates it, and arrays as long as the buffer
        buffer: Any
        buffer, self._evaluate = function.buffer()
        self._arguments = [np.array(array, dtype=float) for array in arguments]
        self._outputs = [np.zeros(function.size_out(i), order="F") for i in range(function.n_out())]
        for i, array in enumerate(self._arguments):
            buffer.set_arg(i, array.data)
        for i, array in enumerate(self._outputs):
            buffer.set_res(i, array.reshape(-1, order="F").data)
        self._buffer = buffer

    def __call__(self, first: Array) -> list[Array]:
        """Return the outputs (rows, columns)."""
        self._arguments[0][:] = first
        self._evaluate()
        return [array.copy() for array in self._outputs]


def evaluated(function: ca.Function, *arguments: Array) -> list[Array]:
    """Return the outputs of a function at every sample, columns without their second axis.

    Parameters
    ----------
    function : casadi.Function
        Any function.
    *arguments : array, shape (samples, k) or (k,)
        Its arguments; those of one axis are the same at every sample.

    Returns
    -------
    list of array, shape (samples, rows, columns) or (samples, rows)
        Its outputs.
    """
    return [array[:, :, 0] if array.shape[2] == 1 else array for array in matrices(function, *arguments)]


def matrices(function: ca.Function, *arguments: Array) -> list[Array]:
    """Return the outputs of a function at every sample, all as matrices.

    Parameters
    ----------
    function : casadi.Function
        Any function.
    *arguments : array, shape (samples, k) or (k,)
        Its arguments; those of one axis are the same at every sample.

    Returns
    -------
    list of array, shape (samples, rows, columns)
        Its outputs.
    """
    samples = max(len(array) for array in arguments if array.ndim == 2)
    columns: list[Any] = [array.T if array.ndim == 2 else np.repeat(array[:, None], samples, axis=1)
                          for array in arguments]  # fmt: skip
    outputs = function.map(samples).call([ca.DM(column) for column in columns])
    shapes = [function.size_out(i) for i in range(len(outputs))]
    return [np.array(output).reshape(rows, samples, width).transpose(1, 0, 2)
            for output, (rows, width) in zip(outputs, shapes, strict=True)]  # fmt: skip
