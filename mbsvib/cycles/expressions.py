"""Inverse dynamics as functions of CasADi: loops, generalized forces, momentum, and the motion of all bodies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Bools
from mbsvib.errors import ModelError
from mbsvib.finite_motion.excited import with_interfaces
from mbsvib.finite_motion.forces import angular_momentum
from mbsvib.finite_motion.frames import Expression, rate_in_motion
from mbsvib.finite_motion.statement import FiniteMotion, finite_motion
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
    def closing(self) -> Bools:
        """Which parameters p loops depend on, so that the motion does."""
        return np.array(ca.which_depends(self.closures[0], self.p, 1, False), dtype=bool)

    @property
    def elastic(self) -> tuple[str, ...]:
        """Names of the coordinates of beams and superelements."""
        blocks = self.motion.blocks
        own = {name for block in blocks for name in (*block.mode_names, *block.interface_names)}
        return tuple([name for name in self.motion.motion.names if name in own])

    def rate(self, expression: Expression) -> Expression:
        """Return the time derivative of an expression of q and q'."""
        return rate_in_motion(expression, self.q, self.qd, self.qdd)

    def function(self, *outputs: Expression) -> ca.Function:
        """Return a function of (q, q', q'', p, O)."""
        return ca.Function("f", [self.q, self.qd, self.qdd, self.p, self.about], list(outputs))


def statement(
    model: Mechanism, cut: Sequence[str] | None, parameters: Sequence[str] = (), bases: bool = False
) -> Statement:
    """Return a mechanism in motion.

    F = -d/dt sum of m v,  M_O = -d/dt sum of (r - O) x m v + R I w + h

    ``cut``: joints at which loops are to be cut. ``parameters``: names of numbers that become symbols p. ``bases``: as
    for ``finite_motion``.
    """
    for name in model.hubs:
        raise ModelError(f"hub '{name}': a prescribed motion is one in the world; drive a revolute joint in place of "
                         f"the hub.", element=name, field="hub")  # fmt: skip
    motion = finite_motion(model, parameters, cut=cut, bases=bases)
    if motion.yield_names:
        name = motion.yield_names[0].rpartition(".")[0]
        family = model.springs[name].family
        raise ModelError(f"{family} '{name}': has a state of its own, which a prescribed motion does not determine; "
                         f"make springs and dampers of it for a cycle.", element=name)  # fmt: skip
    kinematics = motion.motion
    q, qd, qdd, numbers = kinematics.q, kinematics.qd, ca.SX.sym("qdd", kinematics.q.shape[0]), kinematics.numbers
    about, momentum, angular = ca.SX.sym("about", 3), ca.SX.zeros(3), ca.SX.zeros(3)
    for part in motion.bends.values():
        momentum += part.momentum
        angular += part.angular_momentum - ca.cross(about, part.momentum)
    for body in with_interfaces(model, motion.blocks).bodies.values():
        r = kinematics.point(body.name, numbers.vector(body, "position"))
        v = numbers.scalar(body, "mass") * kinematics.rate(r)
        momentum += v
        angular += ca.cross(r - about, v) + angular_momentum(body, model.rotors, kinematics)
    phi_rate = kinematics.rate(kinematics.closures)
    phi_acceleration, force, moment = (
        rate_in_motion(item, q, qd, qdd) for item in (phi_rate, -momentum, -angular))  # fmt: skip
    return Statement(model, numbers.names, motion, q, qd, qdd, numbers.symbols, about,
                     (kinematics.closures, phi_rate, phi_acceleration),
                     ca.jtimes(motion.momenta, qd, qdd) - motion.forces, force, moment)  # fmt: skip
