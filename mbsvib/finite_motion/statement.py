"""The finite motion of a mechanism in one statement: kinematics, energies by part, forces, and Lagrange's equations.

L = T + G - V,   d/dt dL/dq' - dL/dq = -dR/dq' + Q + J^T lambda,   phi(q) = 0,   J = dphi/dq

with the kinetic energy T, the terms G that are linear in the rates (rotors), the potential V, the dissipation function
R, generalized forces Q of loads and inputs, and the loop closures phi.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.elements.ports import Input
from mbsvib.errors import ModelError
from mbsvib.finite_motion.connections import connected
from mbsvib.finite_motion.forces import generalized, input_power, load_power
from mbsvib.finite_motion.kinematics import kinematics
from mbsvib.finite_motion.numbers import Numbers

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.elements import Body
    from mbsvib.elements.rotor import Rotor
    from mbsvib.finite_motion.connections import Connected
    from mbsvib.finite_motion.kinematics import Kinematics
    from mbsvib.finite_motion.rotations import Expression
    from mbsvib.mechanism.mechanism import Mechanism


@dataclass(frozen=True)
class FiniteMotion:
    """Energies and forces of a mechanism as expressions of its tree coordinates ``motion.q`` and rates ``motion.qd``.

    ``kinetic``, ``potential`` and ``dissipation`` hold expressions by the names of parts [J, J, W]; weight is the
    potential of the body, zero as described. ``gyroscopic`` is G [J]. ``loads`` has the power [W] of each load,
    ``inputs`` that of each force input of 1 N or 1 N m (base
    motions are not among them). ``connections`` are springs and the like by name; their first-order
    states are ``yields`` (k,), called ``yield_names``, with derivatives ``yield_rates`` (k,).
    """

    motion: Kinematics
    kinetic: Mapping[str, Expression]
    gyroscopic: Expression
    potential: Mapping[str, Expression]
    dissipation: Mapping[str, Expression]
    loads: Mapping[str, Expression]
    inputs: Mapping[str, Expression]
    connections: Mapping[str, Connected]
    yields: Expression
    yield_names: tuple[str, ...]
    yield_rates: Expression

    @cached_property
    def total_kinetic(self) -> Expression:
        """T [J]."""
        return _sum(self.kinetic)

    @cached_property
    def total_potential(self) -> Expression:
        """V [J]."""
        return _sum(self.potential)

    @cached_property
    def momenta(self) -> Expression:
        """Generalized momenta dT/dq' + dG/dq' (n,)."""
        return ca.gradient(self.total_kinetic + self.gyroscopic, self.motion.qd)

    @cached_property
    def mass(self) -> Expression:
        """The mass matrix d2T/dq'2 (n, n) of the tree coordinates."""
        return ca.jacobian(ca.gradient(self.total_kinetic, self.motion.qd), self.motion.qd)

    @cached_property
    def load_forces(self) -> Expression:
        """Generalized forces (n,) of all loads."""
        return generalized(self.motion, _sum(self.loads)) if self.loads else ca.SX.zeros(self.motion.q.shape)

    @cached_property
    def input_forces(self) -> Expression:
        """Generalized forces (n, inputs) of inputs of 1 N or 1 N m."""
        columns = [generalized(self.motion, power) for power in self.inputs.values()]
        return ca.horzcat(*columns) if columns else ca.SX.zeros(self.motion.q.shape[0], 0)

    @cached_property
    def forces(self) -> Expression:
        """f (n,) with mass @ q'' = f + input_forces @ u + J^T lambda; all forces but those of inputs and closures.

        f = dL/dq - (d/dt dL/dq' - mass @ q'') - dR/dq' + Q
        """
        motion = self.motion
        lagrangian = self.total_kinetic + self.gyroscopic - self.total_potential
        result = ca.gradient(lagrangian, motion.q) - ca.jtimes(self.momenta, motion.q, motion.qd) + self.load_forces
        rayleigh = _sum(self.dissipation)
        return result - ca.gradient(rayleigh, motion.qd)

    @cached_property
    def jacobian(self) -> Expression:
        """J (rows, n), the derivative of the closures."""
        return ca.jacobian(self.motion.closures, self.motion.q)

    @cached_property
    def closure_bias(self) -> Expression:
        """dJ/dt q' (rows,): accelerations that keep closures are J q'' = -closure_bias."""
        return ca.jtimes(self.jacobian @ self.motion.qd, self.motion.q, self.motion.qd)


def finite_motion(
    model: Mechanism, parameters: Sequence[str] = (), *, cut: Sequence[str] | None = None, bases: bool = False,
    without: Sequence[str] = (),
) -> FiniteMotion:  # fmt: skip
    """Return the finite motion of a rigid mechanism as expressions of CasADi.

    Parameters
    ----------
    model : Mechanism
        The mechanism; the coordinates are displacements from its pose.
    parameters : sequence of str
        Names of numbers that become symbols, ``motion.numbers.symbols``, so that all expressions can be differentiated
        to them: masses, centres, inertias, positions of joints, numbers of springs and loads, gravity.
    cut : sequence of str, optional
        Joints at which loops are to be cut.
    bases : bool
        Whether joints with three free rotations get a rotation on top of which theirs come.
    without : sequence of str
        Names of loads to leave out.

    Returns
    -------
    FiniteMotion
        Kinematics, energies and forces.

    Raises
    ------
    ModelError
        If a part has no statement in finite motion, by its name, or a parameter cannot be a symbol.
    """
    for part in model.composed.values():
        kind = type(part).__name__.lower()
        raise ModelError(f"{kind} '{part.name}': bends, and has no statement in the finite motion of rigid bodies; "
                         f"leave it out, or make rigid bodies and springs of it.", element=part.name)  # fmt: skip
    numbers = Numbers(model, parameters)
    motion = kinematics(model, numbers, cut, bases)
    parts = {name: connected(part, motion) for name, part in model.springs.items()}
    fall = numbers.gravity(model)
    kinetic = {name: body_energy(body, motion) for name, body in model.bodies.items()}
    kinetic |= {name: part.kinetic for name, part in parts.items() if not part.kinetic.is_zero()}
    potential = {name: _weight(body, motion, fall) for name, body in model.bodies.items()}
    potential |= {name: part.potential for name, part in parts.items()}
    loads = {name: load_power(part, model, motion) for name, part in model.loads.items() if name not in without}
    inputs = {name: input_power(part, model, motion) for name, part in model.inputs.items()
              if isinstance(part, Input)}  # fmt: skip
    yields = {name: part for name, part in parts.items() if part.yields.numel()}
    gyroscopic = sum((rotor_term(part, motion) for part in model.rotors.values()), ca.SX(0.0))
    numbers.check_taken()
    return FiniteMotion(
        motion, kinetic, gyroscopic, potential, {name: part.dissipation for name, part in parts.items()}, loads, inputs,
        parts, ca.vertcat(*(part.yields for part in yields.values())), tuple([f"{name}.z" for name in yields]),
        ca.vertcat(*(part.yield_rates for part in yields.values())),
    )  # fmt: skip


def body_energy(body: Body, motion: Kinematics) -> Expression:
    """Return the kinetic energy [J] of a body.

    T = 1/2 m v . v + 1/2 w . I w
    """
    numbers = motion.numbers
    v = motion.rate(motion.point(body.name, numbers.vector(body, "position")))
    w = motion.angular_velocity(body.name)
    own = ca.SX(np.array(body.orientation)).T @ w
    entries = numbers.vector(body, "inertia")
    xx, yy, zz, xy, xz, yz = (entries[i] for i in range(6))
    tensor = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    return 0.5 * numbers.scalar(body, "mass") * ca.dot(v, v) + 0.5 * ca.dot(own, tensor @ own)


def rotor_term(rotor: Rotor, motion: Kinematics) -> Expression:
    """Return what a rotor of constant angular momentum h along an axis of its body adds to the Lagrangian [J], h . w.

    Raises
    ------
    ModelError
        If the body itself is the rotor: its spin is then a motion of its own.
    """
    if rotor.inertia is None:
        raise ModelError(
            f"rotor '{rotor.name}': body '{rotor.body}' itself spins, which is a motion of its joint in finite motion; "
            f"give the inertia of what spins on the body, or start with a rate of its joint.",
            element=rotor.name, field="inertia",
        )  # fmt: skip
    numbers = motion.numbers
    momentum = numbers.scalar(rotor, "inertia") * numbers.scalar(rotor, "speed")
    return momentum * ca.dot(ca.SX(np.array(rotor.axis)), motion.angular_velocity(rotor.body))


def _weight(body: Body, motion: Kinematics, fall: Expression) -> Expression:
    centre = motion.numbers.vector(body, "position")
    return -motion.numbers.scalar(body, "mass") * ca.dot(fall, motion.point(body.name, centre) - centre)


def _sum(terms: Mapping[str, Expression]) -> Expression:
    return sum(terms.values(), ca.SX(0.0))
