"""What acts on bodies beside masses and spring-dampers: rows that more than two bodies share, and spin.

Beam elements have mass, reduced models stiffness, damping and mass on all of their nodes: F = R^T w R d, with d the
displacements of the nodes. A rotor of the angular momentum h adds -h x theta' to the moment on its body, a damper that
turns along with spinning bodies -C_d W x d to its own force, an element with cross-coupling the antisymmetric parts of
its matrices; all are antisymmetric, so that the left side of a form has them with the other sign.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from mbsvib.elements.rotor import Rotor
from mbsvib.elements.rows import Rows
from mbsvib.equations.spin_terms import cross_couplings, momenta
from mbsvib.equations.steady_spin import spin_velocities
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.kinematics.shared_rows import shared_rows
from mbsvib.linalg.vectors import cross, transformed, wide

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body, Bushing, Spring
    from mbsvib.kinematics.shared_rows import Shared
    from mbsvib.linalg.vectors import Field
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.sensitivities.network_kinematics import Kinematics


@dataclass(frozen=True, slots=True)
class SharedForces:
    """Rows that more than two bodies share: ``shared`` over their nodes, whose displacements are ``base`` (n, joint
    coordinates) and whose forces act ``on_bodies`` (6 b, n).
    """

    shared: Shared
    base: Any
    on_bodies: csr_array

    def wrench(self, nodes: Field, powers: tuple[Field, Field, Field]) -> Field:
        """Return the wrenches (b, 6, ...) at the centres of mass for displacements of the nodes (n, ...); ``powers``
        are factors of stiffness, damping and inertia.
        """
        stiff, rate, square = powers
        rows, weighted = self.rows(nodes), []
        count = 0 if self.shared.mass is None else self.shared.mass.count
        if self.shared.mass is not None:
            weighted.append((self.shared.mass, rows[:count] * square))
        if (elastic := self.shared.elastic) is not None:
            elastic_rows = rows[count:]
            weighted.append((elastic.composite, wide(elastic.stiffness, elastic_rows) * stiff * elastic_rows
                             + wide(elastic.damping, elastic_rows) * rate * elastic_rows))  # fmt: skip
        forces = []
        for composite, part in weighted:
            flat = part.reshape(len(part), prod(part.shape[1:]))
            if flat.dtype.kind == "c":
                forces.append(composite.back(flat.real) + 1j * composite.back(flat.imag))
            else:
                forces.append(composite.back(flat))
        tail = weighted[0][1].shape[1:]
        return np.asarray(self.on_bodies @ np.concatenate(forces)).reshape(self.on_bodies.shape[0] // 6, 6, *tail)

    def rows(self, nodes: Field) -> Field:
        """Return the shared rows (rows, ...), those of mass first, for displacements of the nodes (n, ...)."""
        flat = nodes.reshape(len(nodes), prod(nodes.shape[1:]))
        parts, start = [], 0
        for composite in (self.shared.mass, None if self.shared.elastic is None else self.shared.elastic.composite):
            if composite is not None:
                stop = start + len(composite.rows.first)
                parts.append(composite.of(flat[start:stop]))
                start = stop
        result = np.concatenate(parts)
        return result.reshape(len(result), *nodes.shape[1:])


def shared_forces(
    plain: Mechanism, bodies: Sequence[Body], number: dict[str, int], kinematics: Kinematics
) -> SharedForces | None:
    """Return what more than two bodies of a mechanism in plain parts share, None where nothing is."""
    if plain.expansion is None:
        return None
    shared = shared_rows(plain.expansion, number, 0)
    if not shared.base:
        return None
    rows = Rows.join(shared.base)
    position = np.concatenate((np.array([body.position for body in bodies]).reshape(-1, 3), np.zeros((1, 3))))
    row, column, value = [], [], []
    for which, sign in ((rows.second, 1.0), (rows.first, -1.0)):
        arm = rows.point - position[which].T
        wrench = sign * np.concatenate((rows.force, rows.moment + np.cross(arm, rows.force, axis=0)))
        direction, at = np.nonzero(wrench * (which < len(bodies)))
        row.append(6 * which[at] + direction)
        column.append(at)
        value.append(wrench[direction, at])
    onto = csr_array((np.concatenate(value), (np.concatenate(row), np.concatenate(column))),
                     shape=(6 * len(bodies), len(rows.first)))  # fmt: skip
    return SharedForces(shared, kinematics.relative(rows), onto)


@dataclass(frozen=True, slots=True)
class Spin:
    """Steady spin: angular ``momentum`` (b, 3) [kg m^2/s] that rotors add to bodies, of each ``rotor`` the number of
    its body and its share per unit of speed; the antisymmetric ``coupling`` (2, s, 6, 6) in the stiffness and the
    damping of connections, None without any, and the ``bodies`` that themselves spin, by name.
    """

    momentum: Array
    rotor: dict[str, tuple[int, Array]]
    coupling: Array | None
    bodies: frozenset[str]

    def on_bodies(self, body: Field, rate: Field, side: int) -> Field:
        """Return the moments (b, 3, ...) of rotors: -h x theta', with the other sign on the left."""
        return np.asarray(-side * cross(wide(self.momentum, body), body[:, 3:]) * rate)

    def in_springs(self, strained: Field, stiff: Field, rate: Field, side: int) -> Field:
        """Return the antisymmetric wrenches (s, 6, ...) of connections, with the other sign on the left."""
        assert self.coupling is not None
        stiffness, damping = self.coupling
        return np.asarray(side * (transformed(stiffness, strained) * stiff + transformed(damping, strained) * rate))


def spin(plain: Mechanism, bodies: Sequence[Body], springs: Sequence[Bushing | Spring]) -> Spin | None:
    """Return what rotors and cross-coupling add to the forces of a mechanism in plain parts, None without both."""
    if not plain.derived(has_antisymmetric_forces):
        return None
    rotors: list[Rotor] = list(plain.rotors.values())
    momentum, of = np.zeros((len(bodies), 3)), {}
    unit = plain.with_parts(rotors={rotor.name: replace(rotor, speed=1.0) for rotor in rotors})
    for rotor, (i, per_speed) in zip(rotors, momenta(unit, bodies), strict=True):
        momentum[i] += rotor.speed * per_speed
        of[rotor.name] = i, per_speed
    number_of, coupling = {spring.name: k for k, spring in enumerate(springs)}, np.zeros((2, len(springs), 6, 6))
    for part in cross_couplings(plain, bodies, springs):
        for k, matrix in enumerate((part.stiffness, part.damping)):
            coupling[k, number_of[part.name]] = 0.5 * (matrix - matrix.T)
    return Spin(momentum, of, coupling if coupling.any() else None, frozenset(spin_velocities(plain)))
