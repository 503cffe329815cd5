"""Bushings: entries of their matrices act on strains in their axes; points and axes move as those of connections do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.roles import is_unsymmetric
from mbsvib.linalg.rotations import skew
from mbsvib.sensitivities.displaced_bodies import holds_turns
from mbsvib.sensitivities.families.rules import PartRules, joins_spinning_body
from mbsvib.sensitivities.families.terms import among_springs, in_axes, moved_point, square_terms, turned_axes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Bushing
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.families.pose_changes import ReferenceTerms
    from mbsvib.sensitivities.families.terms import Rule, Terms
    from mbsvib.sensitivities.force_layout import RowTerms
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network

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


def _rule(_: Network, bushing: Bushing, field: str) -> Rule:
    if field not in ("stiffness", "damping") or not isinstance(getattr(bushing, field)[0], tuple):
        return _OF_FIELDS[field]
    return _OF_FIELDS[f"{'unsymmetric' if is_unsymmetric(getattr(bushing, field)) else 'full'} {field}"]


def _constants(_: Network, parts: Sequence[Bushing], field: str) -> tuple[Array, ...]:
    if field in ("stiffness", "damping"):
        return (np.array([part.orientation for part in parts]).transpose(0, 2, 1),)
    return ()


def _is_exception(bushing: Bushing, _: bool, turned: frozenset[str]) -> bool:
    """What the moments of a turned bushing do about axes, and forces without energy, change in ways of their own."""
    return bushing.cross_coupling is not None or (bushing.name in turned and holds_turns(bushing))


def _add_force_terms(terms: RowTerms, _: Network, __: Forces, bushing: Bushing, k: int) -> None:
    """Its wrench is its preload, in axes that turn with its orientation."""
    if bushing.preload is None:
        return
    axes, column, wrench = np.array(bushing.orientation), terms.at.wrench_of(k), np.reshape(bushing.rest_wrench, (2, 3))
    for i in range(6):
        terms.put((bushing.name, "preload", (i,)), column + 3 * (i // 3), axes[:, i % 3])
    for i, turned in enumerate(skew(wrench).transpose(1, 0, 2)):
        terms.put((bushing.name, "orientation", (i,)), column, turned.reshape(6))


def _add_reference_terms(terms: ReferenceTerms, bushing: Bushing, k: int) -> None:
    """Its force there is its preload less stiffness times how far it has been moved, in axes of the first body."""
    described: Any = terms.origin.springs[bushing.name]
    if type(described) is not type(bushing):  # another part is made of it, which has rules of its own
        return
    first, second = (terms.turn(body) for body in (bushing.first, bushing.second))
    at = described.position
    gap = np.subtract(terms.pose.point(bushing.second, at), terms.pose.point(bushing.first, at))
    column, axes = terms.at.wrench_of(k), np.array(bushing.orientation)
    stiffness = terms.network.stiffness[terms.network.spring_number[bushing.name]][:, :3]
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


_OF_FIELDS: dict[str, Rule] = {
    "stiffness": _matrix("stiff", _DIAGONAL), "full stiffness": _matrix("stiff", _FULL),
    "damping": _matrix("rate", _DIAGONAL), "full damping": _matrix("rate", _FULL),
    "unsymmetric stiffness": _unsymmetric("stiff"), "unsymmetric damping": _unsymmetric("rate"),
    "position": moved_point(1), "orientation": turned_axes(1),
}  # fmt: skip
RULES = PartRules(
    "spring", _rule, _constants, alters_spin=joins_spinning_body,
    is_exception=_is_exception, add_force_terms=_add_force_terms,
    add_reference_terms=_add_reference_terms,
)  # fmt: skip
