"""Bodies, what spins in them, and the loads on them.

Mass and inertia act on the motions of bodies; where a body moves, its weight and inertia act elsewhere. The angular
momentum h of a rotor adds x^T C y = h . (x x y), antisymmetric, of rotations of its body.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements import Body
from mbsvib.elements.load import Load
from mbsvib.elements.rotor import Rotor
from mbsvib.sensitivities.adjoint_fields import Fields
from mbsvib.sensitivities.families.pose_changes import PoseRates, RowTerms
from mbsvib.sensitivities.families.rules import (
    InternalRule,
    LoadRules,
    PartRules,
    Rule,
    RuleAndData,
    Terms,
    cross_terms,
    in_axes,
    square_terms,
)
from mbsvib.sensitivities.forces import Forces
from mbsvib.sensitivities.network import Network

_TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def _mass(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    x = fields.body[k]
    return [[((0.5 * fields.square) * x[:, i], x[:, i]) for i in range(3)]]


def _inertia(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    return square_terms(in_axes(data[0], fields.body[k, 3:]), _TENSOR, fields.square)


def _moved_body(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    return cross_terms(fields.body_wrench[k, :3], fields.body[k, 3:])


def _moved_floating(fields: Fields, k: Any, data: tuple[Array, ...]) -> list[Terms]:
    """A body that floats: its coordinates are those of its centre of mass, so that all that hangs on it follows."""
    support = cross_terms(fields.support[data[0], :3], -fields.body[k, 3:])
    return [a + b for a, b in zip(_moved_body(fields, k, ()), support, strict=True)]


def _turned_body(fields: Fields, k: Any, _: tuple[Array, ...]) -> list[Terms]:
    return cross_terms(fields.body_wrench[k, 3:], fields.body[k, 3:])


def _body_rule(network: Network, body: Body, field: str) -> Rule:
    floats = network.body_number[body.name] in network.floating_number
    return _moved_floating if floats and field == "position" else _OF_FIELDS[field]


def _body_constants(network: Network, parts: Sequence[Body], field: str) -> tuple[Array, ...]:
    """Axes for the inertia; the numbers of bodies that float among these."""
    if field == "position":
        return (np.array([network.floating_number.get(network.body_number[part.name], 0) for part in parts]),)
    return (np.array([part.orientation for part in parts]).transpose(0, 2, 1),) if field == "inertia" else ()


def _add_weight(terms: RowTerms, _: Network, forces: Forces, body: Body, k: int) -> None:
    terms.put((body.name, "mass", ()), terms.at.wrench_of(k), forces.gravity)
    for i in range(3):
        terms.put(("gravity", "", (i,)), terms.at.wrench_of(k) + i, (body.mass,))


_OF_FIELDS: dict[str, Rule] = {
    "mass": _mass, "inertia": _inertia, "position": _moved_body, "orientation": _turned_body,
}  # fmt: skip
BODY = PartRules(
    "body", _body_rule, _body_constants, floats=True,
    alters_spin=lambda spin, body, field: body.name in spin.bodies and field != "mass",
    loaded=LoadRules(add_force_terms=_add_weight),
)  # fmt: skip


# The field of the axis, which is no parameter.
AXIS = "axis"


def _rotor_entry(network: Network, rotor: Rotor, field: str, _: tuple[int, ...]) -> RuleAndData:
    body, per_speed = _momentum(network, rotor)
    return _momentum_rule(body, [per_speed if field == "speed" else per_speed * (rotor.speed / (rotor.inertia or 1.0))]
                          ), ()  # fmt: skip


def _rotor_axis(network: Network, rotor: Rotor) -> list[InternalRule]:
    """Its axis goes with its body."""
    body, per_speed = _momentum(network, rotor)
    rule = _momentum_rule(body, list(np.cross(np.eye(3), rotor.speed * per_speed)))
    return [InternalRule(rule, 3, np.zeros(1, dtype=np.intp))]


def _momentum(network: Network, rotor: Rotor) -> tuple[int, Array]:
    """The number of its body, and its momentum per unit of speed."""
    assert network.matrices.spin is not None
    return network.matrices.spin.rotor[rotor.name]


def _momentum_rule(body: int, changes: list[Array]) -> Rule:
    """The rule of changes (3,) of the angular momentum of a body."""
    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        turn = fields.body[body : body + 1, 3:]
        return [[(-fields.side * value * fields.rate * turn[:, i], turn[:, j])
                 for value, (i, j) in zip(change.tolist(), ((1, 2), (2, 0), (0, 1)), strict=True) if value]
                for change in changes]  # fmt: skip

    return rule


def _follow(rates: PoseRates, rotor: Rotor, _: int) -> None:
    if rates.network.matrices.spin is not None:
        rates.put(rotor.name, AXIS, rates.motion[_momentum(rates.network, rotor)[0], 3:])


ROTOR = PartRules(
    "rotor", single=_rotor_entry,
    alters_spin=lambda spin, rotor, _: rotor.inertia is None and spin.coupling is not None,
    # bearings may leave the axis of a body that spins itself
    loaded=LoadRules(lambda rotor, *_: rotor.inertia is None, follow=_follow, internal=(AXIS, 3),
                     internal_rules=_rotor_axis),
)  # fmt: skip


def _add_load(terms: RowTerms, _: Network, __: Forces, load: Load, k: int) -> None:
    terms.along(load.name, "force", terms.at.wrench_of(k))
    terms.along(load.name, "torque", terms.at.wrench_of(k) + 3)
    if load.position is None:
        terms.along(load.body, "position", terms.at.point_of(k))


LOAD = PartRules("load", loaded=LoadRules(add_force_terms=_add_load))
GRAVITY = PartRules("gravity")
