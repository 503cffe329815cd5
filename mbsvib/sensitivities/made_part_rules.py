"""The rules of parts that are made of bodies and connections, or act on these, one number at a time.

A coupler ties coordinates by sum of c q = 0 with a force mu; where a coefficient changes by dc, dependent coordinates
follow, and x^T T y changes by -dc (mu_x q_y + q_x mu_y).

A Maxwell element lengthens by l between its points and its damper by s, the coordinate of the node: its springs see l
and l + s, its damper s. Where a point moves, l changes as that of a line spring does, and s does not.

The angular momentum h of a rotor adds x^T C y = h . (x x y), antisymmetric, of the rotations x and y of its body. A
torsion spring acts on the twist about its axis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.coupler import Coupling
from mbsvib.kinematics.couplers import measure
from mbsvib.sensitivities.network import line_name
from mbsvib.sensitivities.part_rules import along, moved_end

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements import Maxwell
    from mbsvib.elements.rotor import Rotor
    from mbsvib.elements.torsion_spring import TorsionSpring
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.part_rules import Rule, Terms


def coupler_rule(network: Network, coupler: Coupling, field: str, index: tuple[int, ...]) -> Rule:
    """Return the rule by which a number of a coupler enters the equations."""
    assert network.constraints is not None
    names = [part.name for part in network.parts if isinstance(part, Coupling)]
    row = network.constraints.pull.shape[0] - len(names) + names.index(coupler.name)
    number_of = {joint.name: k for k, joint in enumerate(network.joints)}
    reads = []
    for name, rate in _rates(coupler, field, index):
        owner, _, direction = name.rpartition(".")
        force, moment, _ = measure(network.joints[number_of[owner]], direction)
        if rate:
            reads.append((number_of[owner], np.concatenate((force, moment)), rate))

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        return [[(-rate * fields.tied[row : row + 1], np.tensordot(six, fields.relative[k], axes=1)[None])
                 for k, six, rate in reads]]  # fmt: skip

    return rule


def _rates(coupler: Coupling, field: str, index: tuple[int, ...]) -> list[tuple[str, float]]:
    """How fast coefficients change, which are linear in all numbers of couplers."""
    numbers = {item.name: item.value for item in coupler.parameter_fields()}
    value = numbers[field]
    twice: Any = 2.0 * value if not index else tuple(2.0 * v if i == index[0] else v for i, v in enumerate(value))
    size = value if not index else value[index[0]]
    changed = coupler.with_values(numbers | {field: twice})
    return [(name, (b - a) / size) for (name, a), (_, b) in zip(coupler.terms, changed.terms, strict=True)]


def maxwell_rule(network: Network, part: Maxwell, field: str, index: tuple[int, ...]) -> Rule:
    """Return the rule by which a number of a Maxwell element enters the equations."""
    number_of = {spring.name: k for k, spring in enumerate(network.springs)}
    static, spring, _ = (number_of[line_name(part, name)] for name in ("static_stiffness", "stiffness", "damping"))
    line, joints = np.array([part.line]), len(network.joints)
    span = np.array([np.subtract(part.end, part.start)])

    def coefficient(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        row = number_of[line_name(part, field)]
        deformation = along(line, fields.strain[row : row + 1, :3])
        return [[(0.5 * (fields.rate if field == "damping" else fields.stiff) * deformation, deformation)]]

    def point(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        row = slice(joints + static, joints + static + 1)
        change = moved_end(line, span, fields.relative[row], field == "end")
        in_series = joints + spring
        tension = along(line, fields.wrench[row, :3] + fields.wrench[in_series : in_series + 1, :3])
        return [[(tension, change[:, index[0]])]]

    return point if field in ("start", "end") else coefficient


def rotor_rule(network: Network, rotor: Rotor, field: str, _: tuple[int, ...] = ()) -> Rule:
    """Return the rule by which a number of a rotor enters the equations."""
    assert network.spin is not None
    body, per_speed = network.spin.rotor[rotor.name]
    h = per_speed if field == "speed" else per_speed * (rotor.speed / (rotor.inertia or 1.0))

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        return [_spin_terms(fields, body, h)]

    return rule


def rotor_axis_rule(network: Network, rotor: Rotor) -> Rule:
    """Return the rule by which turns of a rotor's axis, about x, y and z, enter the equations."""
    assert network.spin is not None
    body, per_speed = network.spin.rotor[rotor.name]
    changes = np.cross(np.eye(3), rotor.speed * per_speed)

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        return [_spin_terms(fields, body, change) for change in changes]

    return rule


def _spin_terms(fields: Fields, body: int, momentum: Array) -> Terms:
    """Terms of x^T C y = h . (x x y) for an angular momentum (3,)."""
    turn = fields.body[body : body + 1, 3:]
    return [(-fields.side * value * fields.rate * turn[:, i], turn[:, j])
            for value, (i, j) in zip(momentum.tolist(), ((1, 2), (2, 0), (0, 1)), strict=True) if value]  # fmt: skip


def torsion_rule(network: Network, part: TorsionSpring, field: str, _: tuple[int, ...] = ()) -> Rule:
    """Return the rule by which stiffness or damping of a torsion spring enters the equations."""
    row = next(k for k, spring in enumerate(network.springs) if spring.name == part.name)
    axis = np.array([part.axis])

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        deformation = along(axis, fields.strain[row : row + 1, 3:])
        return [[(0.5 * (fields.rate if field == "damping" else fields.stiff) * deformation, deformation)]]

    return rule
