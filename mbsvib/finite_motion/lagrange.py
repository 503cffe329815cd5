"""The finite motion of a mechanism in one statement: kinematics, energies by part, forces, and Lagrange's equations.

L = T + G - V,   d/dt dL/dq' - dL/dq = -dR/dq' + Q + J^T lambda,   phi(q) = 0,   J = dphi/dq

with the kinetic energy T, the terms G that are linear in the rates (rotors), the potential V, the dissipation function
R, generalized forces Q of loads, inputs and cross-coupled bushings, and the loop closures phi.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca

from mbsvib.finite_motion.connections import Connected
from mbsvib.finite_motion.elastic import ElasticEnergies
from mbsvib.finite_motion.elastic_block import ElasticBlock, node_displacement
from mbsvib.finite_motion.forces import generalized
from mbsvib.finite_motion.frames import Expression, Frame
from mbsvib.finite_motion.kinematics import Kinematics


@dataclass(frozen=True)
class FiniteMotion:
    """Energies and forces of a mechanism as expressions of its tree coordinates ``motion.q`` and rates ``motion.qd``.

    ``kinetic``, ``potential`` and ``dissipation`` hold expressions by the names of parts [J, J, W]; weight is the
    potential of the body, zero as described. ``gyroscopic`` is G [J]. ``loads`` has the power [W] of each load,
    ``inputs`` that of each input of 1 N, 1 N m or 1 m/s^2; base motions that turn the ground are not among them.
    ``connections`` are springs and the like by name; their first-order states are ``yields`` (k,), called
    ``yield_names``, with derivatives ``yield_rates`` (k,). ``bends`` are the energies of beams and superelements,
    ``blocks`` these themselves.
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
    bends: Mapping[str, ElasticEnergies] = field(default_factory=dict)
    blocks: tuple[ElasticBlock, ...] = ()

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
    def cross_forces(self) -> Expression:
        """Generalized forces (n,) of connections with cross-coupling, which have no energy."""
        motion, result = self.motion, ca.SX.zeros(self.motion.q.shape)
        for part in self.connections.values():
            if part.cross_force.nnz():
                result -= ca.jtimes(motion.rate(part.deformation), motion.qd, part.cross_force, True)
        return result

    @cached_property
    def input_forces(self) -> Expression:
        """Generalized forces (n, inputs) of inputs of 1 N, 1 N m or 1 m/s^2."""
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
        return result - ca.gradient(rayleigh, motion.qd) + self.cross_forces

    @cached_property
    def frames(self) -> dict[str, Frame]:
        """Displacements of all bodies by name, ground and nodes of beams and superelements among them."""
        result = dict(self.motion.frames)
        for block in self.blocks:
            b, z = self.motion.elastic[block.name]
            for k, node in enumerate(block.nodes):
                if node not in result:
                    result[node] = result[block.root].then(node_displacement(block, k, ca.vertcat(z, b)))
        return result

    @cached_property
    def jacobian(self) -> Expression:
        """J (rows, n), the derivative of the closures."""
        return ca.jacobian(self.motion.closures, self.motion.q)

    @cached_property
    def closure_bias(self) -> Expression:
        """dJ/dt q' (rows,): accelerations that keep closures are J q'' = -closure_bias."""
        return ca.jtimes(self.jacobian @ self.motion.qd, self.motion.q, self.motion.qd)


def _sum(terms: Mapping[str, Expression]) -> Expression:
    return sum(terms.values(), ca.SX(0.0))
