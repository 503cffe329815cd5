"""The mechanism as a network: bodies, connections between them, and the joints of the tree that carry both.

A connection (joint or spring-damper) has a point and relates two bodies; its relative motion there is a six-vector.
Everything that a parameter can change is local to a body or to a connection. A Maxwell element is a node and three
lines: the static spring, the spring, the damper.

Beam elements have mass, reduced models stiffness, damping and mass on all of their nodes: F = R^T w R d, with d the
displacements of the nodes. A rotor of the angular momentum h adds -h x theta' to the moment on its body, a damper that
turns along with spinning bodies -C_d W x d to its own force, an element with cross-coupling the antisymmetric parts of
its matrices; all are antisymmetric, so that the left side of a form has them with the other sign.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from mbsvib.common.arrays import Array, Index
from mbsvib.elements import Body, Bushing, Joint, Load, Maxwell, Spring
from mbsvib.elements.connection import Connection
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.load import Gravity
from mbsvib.elements.maxwell import Node
from mbsvib.elements.part import Part
from mbsvib.elements.rotor import Rotor
from mbsvib.elements.rows import Rows
from mbsvib.equations.spin_terms import cross_couplings, momenta
from mbsvib.equations.steady_spin import spin_velocities
from mbsvib.equations.wrenches import has_antisymmetric_forces
from mbsvib.kinematics.relative_motion import Twists, body_motion
from mbsvib.kinematics.shared_rows import Shared, shared_rows
from mbsvib.linalg.vectors import Field, cross, transformed, wide
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.network_kinematics import Constraints, ElementReactions, Kinematics

Limit = frozenset[tuple[str, str]]  # kinds of parts with their fields


# The fields of a Maxwell element whose values are coefficients of a line each.
LINES = ("static_stiffness", "stiffness", "damping")


@dataclass(frozen=True)
class Coordinates:
    """Coordinates of a network, joint coordinates unless they are amplitudes of modes.

    ``twists`` are those of joint coordinates, None where these are too many to hold all their paths; ``reduction``
    (n, m) leads to the coordinates from minimal ones, None: they are the same. ``relative`` (6 (j + s), n) leads from
    the coordinates to the motion of each connection's second body against its first at its point, ``displacements``
    (6 b, m) from minimal ones to the motion of the bodies.
    """

    twists: Twists | None
    reduction: Array | None
    relative: Any
    displacements: Array

    @cached_property
    def moves(self) -> Index:
        """Numbers of the rows of the bodies' motion that are not zero."""
        return np.flatnonzero(self.displacements.any(axis=1))

    def of_connections(self) -> Array:
        """Return the relative motions (j + s, 6, m) of connections along minimal coordinates."""
        relative = self.relative if self.reduction is None else self.relative @ self.reduction
        m = self.displacements.shape[1]
        return np.asarray(relative @ np.eye(m)).reshape(relative.shape[0] // 6, 6, m)


@dataclass(frozen=True, slots=True)
class Tree:
    """The joints that carry bodies.

    ``branches`` lists body and parent (ground: b) from ground outwards; joint j carries ``sign[j]`` times what acts on
    ``behind[j]`` and outwards, none where the sign is 0. ``springs`` (b, s) and ``joints`` (b, j) hold +1 for the
    second and -1 for the first body of each spring-damper and of each joint. ``floating`` (f,) are the bodies that hang
    on nothing, ``constraints`` close loops and couple coordinates. Sums of wrenches are taken about ``origin``.
    """

    branches: tuple[tuple[int, int], ...]
    behind: Index
    sign: Index
    springs: Any
    joints: Any
    floating: Index
    constraints: Constraints | None
    origin: Array


@dataclass(frozen=True, slots=True)
class Coefficients:
    """Coefficients of a network, world axes: ``mass`` (b,) and ``inertia`` (b, 3, 3) of bodies, ``stiffness``,
    ``damping`` and ``inertance`` (s, 6, 6) of springs, the latter None without inerters; ``shared`` is what more than
    two bodies share, ``spin`` what rotors and cross-coupling add.
    """

    mass: Array
    inertia: Array
    stiffness: Array
    damping: Array
    inertance: Array | None = None
    shared: SharedForces | None = None
    spin: Spin | None = None

    @property
    def damped(self) -> bool:
        """Whether any damper acts."""
        return bool(self.damping.any())


@dataclass(frozen=True)
class Network:
    """Bodies (b), joints (j), bushings, line springs and inerters (s) of a system in numbers, world axes.

    Bodies have their centres of mass at ``position`` (b, 3), connections relate two bodies at ``point`` (j + s, 3).
    ``limits`` say which parameters act by rules of their own. A ``bare`` network has no parts, as no parameter has a
    rule. ``forces`` are those at the pose of a loaded scene whose derivatives through the equilibrium are known.
    ``loads`` are those of the model and the weights of beams and superelements, ``reactions`` the elements of these
    whose forces statics gives, ``carriers`` the springs whose forces add up to that of a part.
    """

    parts: tuple[Part, ...]
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    springs: tuple[Connection, ...]
    position: Array
    point: Array
    coordinates: Coordinates
    tree: Tree
    matrices: Coefficients
    limits: tuple[Limit, ...]
    bare: bool = False
    forces: Forces | None = None
    loads: tuple[Load, ...] = ()
    reactions: ElementReactions | None = None
    carriers: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @cached_property
    def swing(self) -> Array:
        """How bodies (b, 6, d) move along with dependent coordinates."""
        assert self.tree.constraints is not None
        assert self.coordinates.twists is not None
        return body_motion(self.coordinates.twists, self.position)[:, :, self.tree.constraints.dependent]

    @cached_property
    def named(self) -> dict[str, tuple[int, Any]]:
        """Number and part of each name: of bodies, joints, springs, and of parts that are made of these."""
        result: dict[str, tuple[int, Any]] = {part.name: (0, part) for part in (() if self.bare else self.parts)}
        for shift, members in ((0, self.bodies), (0, self.joints), (len(self.joints), self.springs)):
            for k, part in enumerate(members, shift):
                if part.name not in result or type(result[part.name][1]) is type(part):
                    result[part.name] = k, part
        return result

    @cached_property
    def body_number(self) -> dict[str, int]:
        """Number of each body by its name, -1 of ground."""
        return {body.name: k for k, body in enumerate(self.bodies)} | {"ground": -1}

    @cached_property
    def joint_number(self) -> dict[str, int]:
        """Number of each joint by its name."""
        return {joint.name: k for k, joint in enumerate(self.joints)}

    @cached_property
    def spring_number(self) -> dict[str, int]:
        """Number of each spring by its name."""
        return {spring.name: k for k, spring in enumerate(self.springs)}

    @cached_property
    def floating_number(self) -> dict[int, int]:
        """Number of each floating body among these, by its number among all."""
        return {body: k for k, body in enumerate(self.tree.floating.tolist())}

    @cached_property
    def coupler_row(self) -> dict[str, int]:
        """The row of each coupler in what closes loops, by its name."""
        names = [part.name for part in self.parts if isinstance(part, Coupling)]
        ties = self.tree.constraints
        rows = 0 if ties is None else ties.pull.shape[0]
        return {name: rows - len(names) + k for k, name in enumerate(names)}

    @cached_property
    def maxwell_elements(self) -> dict[str, Maxwell]:
        """The Maxwell elements by their names."""
        return {part.name: part for part in self.parts if isinstance(part, Maxwell)}

    @cached_property
    def maxwell_lines(self) -> dict[str, dict[str, int]]:
        """Numbers of the springs that coefficients of each Maxwell element make, by the fields of these."""
        return {name: {field: self.spring_number[line_name(part, field)] for field in LINES}
                for name, part in self.maxwell_elements.items()}  # fmt: skip

    @cached_property
    def carriers_of_force(self) -> list[tuple[Part, int]]:
        """The parts that act at the pose, with the number of the force of each: joints, springs, bodies by their
        weight, and loads; then those that are made of these, numbered 0.
        """
        acting: list[Part] = [*self.joints, *self.springs, *self.bodies, *self.loads]
        known = {(type(part), part.name) for part in acting}
        made = [(part, 0) for part in self.parts if (type(part), part.name) not in known]
        return [(part, k) for k, part in enumerate(acting)] + made

    @property
    def gravity(self) -> Array:
        """Acceleration of free fall (3,), zero without gravity."""
        return next((np.array(part.acceleration) for part in self.parts if isinstance(part, Gravity)), np.zeros(3))


def maxwell_parts(parts: Sequence[Part]) -> tuple[list[Body], list[Spring]]:
    """Return the nodes and the lines of all Maxwell elements."""
    elements = [part for part in parts if isinstance(part, Maxwell)]
    nodes: list[Body] = [Node(part.node, 0.0, (0.0,) * 6, part.end) for part in elements]
    return nodes, [line for part in elements for line in _lines(part)]


def _lines(part: Maxwell) -> tuple[Spring, Spring, Spring]:
    length = float(np.linalg.norm(np.subtract(part.end, part.start)))

    def line(which: str, first: str, second: str, stiffness: float, damping: float) -> Spring:
        return Spring(line_name(part, which), first, second, part.start, part.end, stiffness, damping, None, None,
                      part.line, length)  # fmt: skip

    static, in_series, damper = LINES
    return (line(static, part.first, part.second, part.static_stiffness, 0.0),
            line(in_series, part.first, part.node, part.stiffness, 0.0),
            line(damper, part.second, part.node, 0.0, part.damping))  # fmt: skip


def line_name(part: Maxwell, field: str) -> str:
    """Return the name of the line that one of the numbers of a Maxwell element makes."""
    return f"{part.node}.{field}"


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
