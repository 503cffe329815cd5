"""Bodies: mass and inertia on their motions; where a body moves, its weight and inertia act elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.sensitivities.families.rules import PartRules
from mbsvib.sensitivities.families.terms import cross_terms, in_axes, square_terms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.families.terms import Rule, Terms
    from mbsvib.sensitivities.force_layout import RowTerms
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


def _rule(network: Network, body: Body, field: str) -> Rule:
    floats = network.body_number[body.name] in network.floating_number
    return _moved_floating if floats and field == "position" else _OF_FIELDS[field]


def _constants(network: Network, parts: Sequence[Body], field: str) -> tuple[Array, ...]:
    """Axes for the inertia; the numbers of bodies that float among these."""
    if field == "position":
        return (np.array([network.floating_number.get(network.body_number[part.name], 0) for part in parts]),)
    return (np.array([part.orientation for part in parts]).transpose(0, 2, 1),) if field == "inertia" else ()


def _add_force_terms(terms: RowTerms, _: Network, forces: Forces, body: Body, k: int) -> None:
    terms.put((body.name, "mass", ()), terms.at.wrench_of(k), forces.gravity)
    for i in range(3):
        terms.put(("gravity", "", (i,)), terms.at.wrench_of(k) + i, (body.mass,))


_OF_FIELDS: dict[str, Rule] = {
    "mass": _mass, "inertia": _inertia, "position": _moved_body, "orientation": _turned_body,
}  # fmt: skip
RULES = PartRules(
    "body", _rule, _constants, floats=True,
    alters_spin=lambda spin, body, field: body.name in spin.bodies and field != "mass",
    add_force_terms=_add_force_terms,
)  # fmt: skip
