"""Torsion springs: coefficients on the twist about their axis, by the bushing that stands for each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rotations import quaternion
from mbsvib.sensitivities.families.rules import InternalRule, PartRules, joins_spinning_body
from mbsvib.sensitivities.families.terms import coefficient, turned_axes

if TYPE_CHECKING:
    from mbsvib.elements.torsion_spring import TorsionSpring
    from mbsvib.sensitivities.families.pose_changes import ReferenceTerms
    from mbsvib.sensitivities.families.rules import RuleAndData
    from mbsvib.sensitivities.force_layout import RowTerms
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network


def _single(network: Network, part: TorsionSpring, field: str, _: tuple[int, ...]) -> RuleAndData:
    about, power = np.array((0.0, 0.0, 0.0, *part.axis)), "rate" if field == "damping" else "stiff"
    return coefficient(about, network.spring_number[part.name], power), ()


def _internal_rules(network: Network, part: TorsionSpring) -> list[InternalRule]:
    """Its axis goes with its first body."""
    number = np.array([len(network.joints) + network.spring_number[part.name]])
    return [InternalRule(turned_axes(1), 3, number)]


def _add_force_terms(terms: RowTerms, network: Network, _: Forces, part: TorsionSpring, __: int) -> None:
    column = terms.at.wrench_of(len(network.joints) + network.spring_number[part.name])
    terms.put((part.name, "preload", ()), column + 3, part.axis)


def _add_reference_terms(terms: ReferenceTerms, part: TorsionSpring, _: int) -> None:
    """Its moment there is its preload less stiffness times its angle, about the axis that its first body carries."""
    described, network = terms.origin.springs[part.name], terms.network
    first, second = (terms.turn(body) for body in (part.first, part.second))
    w, vector = quaternion(first.T @ second)
    axis = np.array(described.axis)
    column = terms.at.wrench_of(len(network.joints) + network.spring_number[part.name])
    terms.forces.put((part.name, "stiffness", ()), column + 3, -2.0 * np.arctan2(vector @ axis, w) * (first @ axis))


RULES = PartRules(
    "torsion", single=_single, alters_spin=joins_spinning_body,
    internal=("orientation", 3), internal_rules=_internal_rules,
    add_force_terms=_add_force_terms, add_reference_terms=_add_reference_terms, twist_axis=lambda part: part.axis,
)  # fmt: skip
