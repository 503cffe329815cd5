"""The mechanism as a network: bodies, connections between them, and the joints of the tree that carry both.

A connection (joint or spring-damper) has a point and relates two bodies; its relative motion there is a six-vector.
Everything that a parameter can change is local to a body or to a connection. A Maxwell element is a node and three
lines: the static spring, the spring, the damper.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Maxwell, Spring
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.load import Gravity
from mbsvib.elements.maxwell import Node
from mbsvib.kinematics.relative_motion import body_motion

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Body, Joint, Load
    from mbsvib.elements.connection import Connection
    from mbsvib.elements.part import Part
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.sensitivities.element_reactions import ElementReactions
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network_kinematics import Constraints
    from mbsvib.sensitivities.shared_wrenches import SharedForces, Spin

    Limit = frozenset[tuple[str, str]]  # kinds of parts with their fields

# The fields of a Maxwell element whose values are coefficients of a line each.
LINES = ("static_stiffness", "stiffness", "damping")


@dataclass(frozen=True)
class Network:
    """Bodies (b), joints (j), bushings, line springs and inerters (s) of a system in numbers, world axes.

    ``relative`` (6 (j + s), n) leads from joint coordinates to the motion of each connection's second body against its
    first at ``point`` (j + s, 3). ``spring_incidence`` (b, s) and ``closing`` (b, j) hold +1 for the second and -1 for
    the first body of each spring-damper and of each joint. ``tree`` lists body and parent (ground: b) from ground
    outwards; joint j carries ``sign[j]`` times what acts on ``behind[j]`` and outwards, none where the sign is 0. Sums
    of wrenches are taken about ``origin``. ``displacements`` (6 b, m) is the bodies' motion, ``moves`` numbers its rows
    that are not zero, ``floating`` (f,) the bodies that hang on nothing. ``limits`` say which parameters act by rules
    of their own. A ``bare`` network has no parts, as no parameter has a rule. ``forces`` are those at the pose of a
    loaded scene whose derivatives through the equilibrium are known, ``shared`` what more than two bodies share,
    ``spin`` what rotors and cross-coupling add and ``inertance`` (s, 6, 6) what inerters. ``loads`` are those of the
    model and the weights of beams and superelements, ``reactions`` the elements of these whose forces statics gives,
    ``carriers`` the springs whose forces add up to that of a part.
    """

    parts: tuple[Part, ...]
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    springs: tuple[Connection, ...]
    coordinates: Twists | None
    reduction: Array | None
    mass: Array
    inertia: Array
    position: Array
    axes: Array
    point: Array
    relative: Any
    stiffness: Array
    damping: Array
    tree: tuple[tuple[int, int], ...]
    behind: Index
    sign: Array
    spring_incidence: Any
    closing: Any
    constraints: Constraints | None
    origin: Array
    displacements: Array
    moves: Index
    floating: Index
    limits: tuple[Limit, ...]
    bare: bool = False
    forces: Forces | None = None
    shared: SharedForces | None = None
    spin: Spin | None = None
    inertance: Array | None = None
    loads: tuple[Load, ...] = ()
    reactions: ElementReactions | None = None
    carriers: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def partial(self) -> bool:
        """Whether masses and dampers of the network may not be all that the system has."""
        return self.bare or bool(self.limits) or any(
            part is not None for part in (self.shared, self.spin, self.inertance))  # fmt: skip

    @cached_property
    def swing(self) -> Array:
        """How bodies (b, 6, d) move along with dependent coordinates."""
        assert self.constraints is not None
        assert self.coordinates is not None
        return body_motion(self.coordinates, self.position)[:, :, self.constraints.dependent]

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
        return {body: k for k, body in enumerate(self.floating.tolist())}

    @cached_property
    def coupler_row(self) -> dict[str, int]:
        """The row of each coupler in what closes loops, by its name."""
        names = [part.name for part in self.parts if isinstance(part, Coupling)]
        rows = 0 if self.constraints is None else self.constraints.pull.shape[0]
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
        return gravity_of(self.parts)

    @cached_property
    def damped(self) -> bool:
        """Whether any damper acts."""
        return bool(self.damping.any())


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


def gravity_of(parts: Sequence[Part]) -> Array:
    """Return the acceleration of free fall (3,), zero without gravity."""
    return next((np.array(part.acceleration) for part in parts if isinstance(part, Gravity)), np.zeros(3))
