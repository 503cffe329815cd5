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

from mbsvib.common.arrays import Array, Index
from mbsvib.elements import Bushing, Maxwell
from mbsvib.elements.connection import Connection
from mbsvib.elements.families import EXPANSIONS, connection_rows, has_rows
from mbsvib.elements.roles import is_unsymmetric
from mbsvib.elements.torsion_spring import TorsionSpring
from mbsvib.linalg.rotations import quaternion, skew
from mbsvib.sensitivities.families.pose_changes import ReferenceTerms, RowTerms, holds_turns
from mbsvib.sensitivities.families.rules import (
    UNKNOWN,
    LoadRules,
    PartRules,
    joins_spinning_body,
    line_turn_rates,
    part_slopes,
)
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.local_forms import (
    NONE,
    ONE,
    SHIFTED,
    TURNED,
    UNIT,
    Entries,
    Local,
    LocalForm,
    displaced,
    entries,
    factored,
    moved_connection,
    single_entries,
    six_axes,
    square,
)
from mbsvib.sensitivities.network import Network

# Fields of coefficients, and the matrix of each.
_POWERS = {"stiffness": "stiff", "damping": "rate", "inertance": "square", "static_stiffness": "stiff"}


def _coefficients(network: Network, number: Index, field: str, change: Entries, axes: Array | None) -> LocalForm:
    """The form of changes of matrices of connections; springs see their strain, inerters motions."""
    if field == "inertance":
        return square("relative", number, "square", change, axes)
    return square("strain", number - len(network.joints), _POWERS[field], change, axes)


def _line_forms(network: Network, parts: Sequence[Any], number: Index, field: str) -> list[LocalForm]:
    """Coefficients act on changes of length; ends shift lines, and turn them about their starts."""
    if field not in ("start", "end"):
        lines = np.array([(*part.line, 0.0, 0.0, 0.0) for part in parts])[:, None]
        return [_coefficients(network, number, field, ONE, lines)]
    return [moved_connection(number, entries(displaced(*_end_rates(parts, field))))]


def _end_rates(parts: Sequence[Any], field: str) -> tuple[Array, Array]:
    """How the starts of lines shift, and how lines turn, as their ends or starts move."""
    turn = line_turn_rates(np.array([np.subtract(part.end, part.start) for part in parts]))
    return (NONE, turn) if field == "end" else (UNIT, -turn)


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


SPRING = PartRules(
    "spring", _line_forms, alters_spin=joins_spinning_body,
    loaded=LoadRules(add_force_terms=_add_tension, add_reference_terms=_add_tension_there),
)
INERTER = replace(SPRING, loaded=LoadRules(add_force_terms=_add_tension))


_FULL = tuple((i, j) for i in range(6) for j in range(i, 6))
_DIAGONAL = single_entries([(i, i) for i in range(6)])
_SYMMETRIC = single_entries(_FULL)
_UNSYMMETRIC = single_entries([(i, j) for i in range(6) for j in range(6)], symmetric=False)


def _bushing_forms(network: Network, parts: Sequence[Bushing], number: Index, field: str) -> list[LocalForm]:
    """Entries of matrices act on strains in their axes."""
    if field in ("position", "orientation"):
        return [moved_connection(number, SHIFTED if field == "position" else TURNED)]
    value, axes = getattr(parts[0], field), six_axes(np.array([part.orientation for part in parts]))
    if is_unsymmetric(value):  # x_i y_j of the motion x on the left and y on the right
        strain = number - len(network.joints)
        return [LocalForm(Local("strain", strain, f"left {_POWERS[field]}", axes), Local("strain", strain, "", axes),
                          *_UNSYMMETRIC)]  # fmt: skip
    return [_coefficients(network, number, field, _SYMMETRIC if isinstance(value[0], tuple) else _DIAGONAL, axes)]


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
    for i, j in _FULL if full else [(i, i) for i in range(6)]:
        force = np.zeros(6)
        force[i] = -local[j]
        force[j] = -local[i]
        in_world = (force.reshape(2, 3) @ axes.T).reshape(6)
        terms.forces.put((bushing.name, "stiffness", (i, j) if full else (i,)), column, in_world)


BUSHING = PartRules(
    "spring", _bushing_forms, alters_spin=joins_spinning_body,
    loaded=LoadRules(_bushing_excepted, _add_wrench, add_reference_terms=_add_wrench_there),
)


def _torsion_entry(network: Network, part: TorsionSpring, field: str, _: tuple[int, ...]) -> list[LocalForm]:
    about = np.array([[(0.0, 0.0, 0.0, *part.axis)]])
    return [_coefficients(network, _number(network, part.name), field, ONE, about)]


def _number(network: Network, spring: str) -> Index:
    """The number (1,) of a spring among all connections."""
    return np.array([len(network.joints) + network.spring_number[spring]])


def _torsion_axis(network: Network, part: TorsionSpring) -> list[list[LocalForm]]:
    """Its axis goes with its first body."""
    return [[moved_connection(_number(network, part.name), TURNED)]]


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
                     internal_forms=_torsion_axis, twist_axis=lambda part: part.axis),
)  # fmt: skip


def _maxwell_entry(network: Network, part: Maxwell, field: str, index: tuple[int, ...]) -> list[LocalForm]:
    numbers = {key: np.array([len(network.joints) + k]) for key, k in network.maxwell_lines[part.name].items()}
    if field not in ("start", "end"):
        return _line_forms(network, [part], numbers[field], field)
    change = entries(displaced(*_end_rates([part], field))[:, index[0], None])
    return [LocalForm(Local("wrench", numbers[key]), Local("relative", numbers["static_stiffness"]), *change)
            for key in ("static_stiffness", "stiffness")]  # fmt: skip


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


def _element_entry(network: Network, part: Connection, field: str, index: tuple[int, ...]) -> list[LocalForm]:
    number = np.concatenate([_number(network, spring.name) for spring in _stand_ins(part)])

    def numbers(varied: Connection) -> dict[str, Array]:
        matrices = element_matrices(_stand_ins(varied), network.point[number])
        return {key: np.zeros((len(number), 6, 6)) if array is None else array
                for key, array in zip(_POWERS, matrices, strict=False)}  # fmt: skip

    span = float(np.ptp(np.array(part.points), axis=0).max(initial=0.0)) if part.points else 0.0
    changes = part_slopes(part, field, index, numbers, span if field in part.point_fields and span else None)
    return [_coefficients(network, number, key, *factored(change)) for key, change in changes.items() if change.any()]


ELEMENT = PartRules("element", single=_element_entry, alters_spin=joins_spinning_body, loaded=UNKNOWN,
                    has_rule=lambda part, field: bool(_stand_ins(part, field)))  # fmt: skip
