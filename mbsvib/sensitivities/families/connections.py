"""Connections: line springs and inerters, bushings, torsion springs, Maxwell elements, and all others.

Coefficients of lines act on the change of their length, which their ends change. Entries of the matrices of bushings
act on strains in their axes; points and axes move as those of connections do. Coefficients of torsion springs act on
the twist about their axis, by the bushing that stands for each.

A Maxwell element lengthens by l between its points and its damper by s, the coordinate of the node between them: its
springs see l and l + s, its damper s. Where a point moves, l changes as that of a line spring does, and s does not.

Any other connection is made of the matrices of its rows, or of the connections that stand for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements import Bushing, Maxwell
from mbsvib.elements.connection import Connection
from mbsvib.elements.families import EXPANSIONS, connection_rows, has_rows
from mbsvib.elements.roles import is_unsymmetric
from mbsvib.elements.torsion_spring import TorsionSpring
from mbsvib.linalg.rotations import quaternion, skew
from mbsvib.linalg.vectors import transformed
from mbsvib.sensitivities.adjoint_fields import Fields
from mbsvib.sensitivities.families.pose_changes import ReferenceTerms, RowTerms, holds_turns
from mbsvib.sensitivities.families.rules import (
    UNKNOWN,
    InternalRule,
    LoadRules,
    PartRules,
    Rule,
    RuleAndData,
    Terms,
    along,
    among_springs,
    coefficient,
    factors,
    form_terms,
    in_axes,
    joins_spinning_body,
    line_end_rates,
    moved_point,
    part_slopes,
    square_terms,
    turned_axes,
)
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.network import Network


def _line(power: str) -> Rule:
    """Coefficients of line springs and inerters."""
    def rule(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
        motion = fields.relative[k, :3] if power == "square" else fields.strain[among_springs(fields, k), :3]
        change = along(data[0], motion)
        return [[((0.5 * getattr(fields, power)) * change, change)]]

    return rule


def _line_end(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    change, tension = transformed(data[1], fields.relative[k]), along(data[0], fields.wrench[k, :3])
    return [[(tension, change[:, i])] for i in range(3)]


def _line_constants(_: Network, parts: Sequence[Any], field: str) -> tuple[Array, ...]:
    """Directions, and how elongations change where one of their ends moves."""
    line = np.array([part.line for part in parts])
    if field not in ("start", "end"):
        return (line,)
    span = np.array([part.end for part in parts]) - np.array([part.start for part in parts])
    return line, line_end_rates(line, span, field == "end")


def _add_tension(terms: RowTerms, _: Network, __: Forces, part: Any, k: int) -> None:
    """Its force is -T e on the second body, with T as given, or k (L - L0)."""
    line, column = np.array(part.line), terms.at.wrench_of(k)
    if part.free_length is None:
        if part.preload is not None:
            terms.put((part.name, "preload", ()), column, -line)
        return
    terms.put((part.name, "stiffness", ()), column, (part.free_length - part.length) * line)
    terms.put((part.name, "free_length", ()), column, part.stiffness * line)
    for i in range(3):
        for field, sign in (("start", 1.0), ("end", -1.0)):
            terms.put((part.name, field, (i,)), column, sign * part.stiffness * line[i] * line)


def _add_tension_there(terms: ReferenceTerms, part: Any, k: int) -> None:
    """Its tension there is T + k (L there - L as described)."""
    if part.free_length is not None:
        return
    described: Any = terms.origin.springs[part.name]
    before, after, column = np.array(described.line), np.array(part.line), terms.at.wrench_of(k)
    terms.forces.put((part.name, "stiffness", ()), column, -(part.length - described.length) * after)
    for field, body, sign in (("start", part.first, -1.0), ("end", part.second, 1.0)):
        for i, way in enumerate(terms.turn(body).T):
            change = sign * part.stiffness * (after @ way - before[i])
            terms.forces.put((part.name, field, (i,)), column, -change * after)


_OF_LINES: dict[str, Rule] = {
    "stiffness": _line("stiff"), "damping": _line("rate"), "inertance": _line("square"),
    "start": _line_end, "end": _line_end,
}  # fmt: skip
SPRING = PartRules(
    "spring", lambda _, __, field: _OF_LINES[field], _line_constants, alters_spin=joins_spinning_body,
    loaded=LoadRules(add_force_terms=_add_tension, add_reference_terms=_add_tension_there),
)  # fmt: skip
INERTER = replace(SPRING, loaded=LoadRules(add_force_terms=_add_tension))


_FULL = tuple((i, j) for i in range(6) for j in range(i, 6))
_DIAGONAL = tuple((i, i) for i in range(6))


def _matrix(power: str, pairs: tuple[tuple[int, int], ...]) -> Rule:
    """Entries of the matrix of a bushing in its axes."""
    def rule(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
        strain = fields.strain[among_springs(fields, k)]
        return square_terms(in_axes(data[0], strain), pairs, getattr(fields, power))

    return rule


def _unsymmetric(power: str) -> Rule:
    """Each entry of an unsymmetric matrix: x_i y_j of the motion x on the left and y on the right."""
    def rule(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
        strain, factor = in_axes(data[0], fields.strain[among_springs(fields, k)]), 0.5 * getattr(fields, power)
        on_left = factor * (1 - fields.side)
        return [[(strain[:, i] * (factor if i == j else on_left), strain[:, j])] for i in range(6) for j in range(6)]

    return rule


def _bushing_rule(_: Network, bushing: Bushing, field: str) -> Rule:
    if field not in ("stiffness", "damping") or not isinstance(getattr(bushing, field)[0], tuple):
        return _OF_BUSHINGS[field]
    return _OF_BUSHINGS[f"{'unsymmetric' if is_unsymmetric(getattr(bushing, field)) else 'full'} {field}"]


def _bushing_constants(_: Network, parts: Sequence[Bushing], field: str) -> tuple[Array, ...]:
    if field in ("stiffness", "damping"):
        return (np.array([part.orientation for part in parts]).transpose(0, 2, 1),)
    return ()


def _bushing_excepted(bushing: Bushing, _: bool, turned: frozenset[str]) -> bool:
    """What the moments of a turned bushing do about axes, and forces without energy, change in ways of their own."""
    return bushing.cross_coupling is not None or (bushing.name in turned and holds_turns(bushing))


def _add_wrench(terms: RowTerms, _: Network, __: Forces, bushing: Bushing, k: int) -> None:
    """Its wrench is its preload, in axes that turn with its orientation."""
    if bushing.preload is None:
        return
    axes, column, wrench = np.array(bushing.orientation), terms.at.wrench_of(k), np.reshape(bushing.rest_wrench, (2, 3))
    for i in range(6):
        terms.put((bushing.name, "preload", (i,)), column + 3 * (i // 3), axes[:, i % 3])
    for i, turned in enumerate(skew(wrench).transpose(1, 0, 2)):
        terms.put((bushing.name, "orientation", (i,)), column, turned.reshape(6))


def _add_wrench_there(terms: ReferenceTerms, bushing: Bushing, k: int) -> None:
    """Its force there is its preload less stiffness times how far it has been moved, in axes of the first body."""
    described: Any = terms.origin.springs[bushing.name]
    if type(described) is not type(bushing):  # another part is made of it, which has rules of its own
        return
    first, second = (terms.turn(body) for body in (bushing.first, bushing.second))
    at = described.position
    gap = np.subtract(terms.pose.point(bushing.second, at), terms.pose.point(bushing.first, at))
    column, axes = terms.at.wrench_of(k), np.array(bushing.orientation)
    stiffness = terms.network.matrices.stiffness[terms.network.spring_number[bushing.name]][:, :3]
    for i in range(3):
        terms.forces.put((bushing.name, "position", (i,)), column, -stiffness @ (second - first)[:, i])
        terms.forces.put((bushing.name, "orientation", (i,)), column, stiffness @ np.cross(first[:, i], gap))
    local = np.concatenate((axes.T @ gap, np.zeros(3)))
    full = isinstance(bushing.stiffness[0], tuple)
    for i, j in _FULL if full else _DIAGONAL:
        force = np.zeros(6)
        force[i] = -local[j]
        force[j] = -local[i]
        in_world = (force.reshape(2, 3) @ axes.T).reshape(6)
        terms.forces.put((bushing.name, "stiffness", (i, j) if full else (i,)), column, in_world)


_OF_BUSHINGS: dict[str, Rule] = {
    "stiffness": _matrix("stiff", _DIAGONAL), "full stiffness": _matrix("stiff", _FULL),
    "damping": _matrix("rate", _DIAGONAL), "full damping": _matrix("rate", _FULL),
    "unsymmetric stiffness": _unsymmetric("stiff"), "unsymmetric damping": _unsymmetric("rate"),
    "position": moved_point(1), "orientation": turned_axes(1),
}  # fmt: skip
BUSHING = PartRules(
    "spring", _bushing_rule, _bushing_constants, alters_spin=joins_spinning_body,
    loaded=LoadRules(_bushing_excepted, _add_wrench, add_reference_terms=_add_wrench_there),
)  # fmt: skip


def _torsion_entry(network: Network, part: TorsionSpring, field: str, _: tuple[int, ...]) -> RuleAndData:
    about, power = np.array((0.0, 0.0, 0.0, *part.axis)), "rate" if field == "damping" else "stiff"
    return coefficient(about, network.spring_number[part.name], power), ()


def _torsion_axis(network: Network, part: TorsionSpring) -> list[InternalRule]:
    """Its axis goes with its first body."""
    number = np.array([len(network.joints) + network.spring_number[part.name]])
    return [InternalRule(turned_axes(1), 3, number)]


def _add_torsion(terms: RowTerms, network: Network, _: Forces, part: TorsionSpring, __: int) -> None:
    column = terms.at.wrench_of(len(network.joints) + network.spring_number[part.name])
    terms.put((part.name, "preload", ()), column + 3, part.axis)


def _add_torsion_there(terms: ReferenceTerms, part: TorsionSpring, _: int) -> None:
    """Its moment there is its preload less stiffness times its angle, about the axis that its first body carries."""
    described, network = terms.origin.springs[part.name], terms.network
    first, second = (terms.turn(body) for body in (part.first, part.second))
    w, vector = quaternion(first.T @ second)
    axis = np.array(described.axis)
    column = terms.at.wrench_of(len(network.joints) + network.spring_number[part.name])
    terms.forces.put((part.name, "stiffness", ()), column + 3, -2.0 * np.arctan2(vector @ axis, w) * (first @ axis))


TORSION = PartRules(
    "torsion", single=_torsion_entry, alters_spin=joins_spinning_body,
    loaded=LoadRules(add_force_terms=_add_torsion, add_reference_terms=_add_torsion_there, internal=("orientation", 3),
                     internal_rules=_torsion_axis, twist_axis=lambda part: part.axis),
)  # fmt: skip


def _maxwell_entry(network: Network, part: Maxwell, field: str, index: tuple[int, ...]) -> RuleAndData:
    lines, joints = network.maxwell_lines[part.name], len(network.joints)
    if field not in ("start", "end"):
        direction = np.concatenate((part.line, np.zeros(3)))
        return coefficient(direction, lines[field], "rate" if field == "damping" else "stiff"), ()
    line = np.array([part.line])
    rates = line_end_rates(line, np.array([np.subtract(part.end, part.start)]), field == "end")
    static, in_series = joints + lines["static_stiffness"], joints + lines["stiffness"]

    def point(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        change = transformed(rates, fields.relative[static : static + 1])
        tension = along(line, (fields.wrench[static, :3] + fields.wrench[in_series, :3])[None])
        return [[(tension, change[:, index[0]])]]

    return point, ()


def _add_maxwell_ends(terms: RowTerms, network: Network, _: Forces, part: Maxwell, __: int) -> None:
    k = len(network.joints) + network.maxwell_lines[part.name]["static_stiffness"]  # between the two bodies
    terms.along(part.name, "start", terms.at.start_of(k))
    terms.along(part.name, "end", terms.at.point_of(k))


MAXWELL = PartRules(
    "maxwell", single=_maxwell_entry,
    loaded=LoadRules(lambda part, moved, _: moved or part.loaded, _add_maxwell_ends),
)  # fmt: skip


def element_matrices(parts: Sequence[Connection], points: Array) -> tuple[Array, Array, Array | None]:
    """Return stiffness, damping and inertance (n, 6, 6) of connections, R^T diag(k) R with their rows R.

    ``points`` (n, 3): where the relative motion of each is taken, world axes. Inertance is None where all are zero.
    """
    number = {name: 0 for part in parts for name in (part.first, part.second)}
    elements = connection_rows(parts, number)
    rows, owner = elements.rows, elements.owner
    six = np.concatenate((rows.force, rows.moment))
    arm = rows.point - points[owner].T
    if arm.any():
        six[3:] += np.cross(arm, rows.force, axis=0)
    squares = (six[:, None] * six).reshape(36, len(owner))

    def of_owners(values: Array) -> Array:
        result = np.zeros((len(parts), 36))
        np.add.at(result, owner, (values * squares).T)
        return result.reshape(len(parts), 6, 6)

    return (of_owners(elements.stiffness), of_owners(elements.damping),
            None if elements.inertance is None else of_owners(elements.inertance))  # fmt: skip


_POWERS = ("stiff", "rate", "square")


def point_of(part: Connection) -> tuple[float, float, float]:
    """Return the point [m] at which the relative motion of a connection is taken."""
    return part.points[0] if part.points else (0.0, 0.0, 0.0)


def _stand_ins(part: Connection, field: str = "") -> list[Connection]:
    """The connections that a part is in the equations; none if ``field`` acts on more than connections."""
    if has_rows(part):
        return [part]
    if type(part) not in EXPANSIONS:
        return []
    made = EXPANSIONS[type(part)](part, {})
    moves = (made.bodies or made.joints) and field in (*part.point_fields, "orientation", "axis")
    return [] if moves or made.mass or made.elastic else list(made.springs.values())


def _element_entry(network: Network, part: Connection, field: str, index: tuple[int, ...]) -> RuleAndData:
    present = _stand_ins(part)
    which = np.array([network.spring_number[spring.name] for spring in present])
    joints, points = len(network.joints), network.point[len(network.joints) + which]

    def numbers(varied: Connection) -> dict[str, Array]:
        matrices = element_matrices(_stand_ins(varied), points)
        return {power: np.zeros((len(which), 6, 6)) if array is None else array
                for power, array in zip(_POWERS, matrices, strict=True)}  # fmt: skip

    span = float(np.ptp(np.array(part.points), axis=0).max(initial=0.0)) if part.points else 0.0
    changes = part_slopes(part, field, index, numbers, span if field in part.point_fields and span else None)
    forms = {power: factors(change) for power, change in changes.items()}

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        result: Terms = []
        for power, of_springs in forms.items():
            weight = 0.5 * getattr(fields, power)
            for k, form in zip(which.tolist(), of_springs, strict=True):
                motion = fields.relative[joints + k] if power == "square" else fields.strain[k]
                result += form_terms(form, motion, weight)
        return [result]

    return rule, ()


ELEMENT = PartRules("element", single=_element_entry, alters_spin=joins_spinning_body, loaded=UNKNOWN,
                    has_rule=lambda part, field: bool(_stand_ins(part, field)))  # fmt: skip
