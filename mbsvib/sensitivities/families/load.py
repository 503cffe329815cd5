"""Loads and gravity: what they change of the forces at the pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.sensitivities.families.rules import PartRules

if TYPE_CHECKING:
    from mbsvib.elements.load import Load
    from mbsvib.sensitivities.force_layout import RowTerms
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network


def _add_force_terms(terms: RowTerms, _: Network, __: Forces, load: Load, k: int) -> None:
    terms.along(load.name, "force", terms.at.wrench_of(k))
    terms.along(load.name, "torque", terms.at.wrench_of(k) + 3)
    if load.position is None:
        terms.along(load.body, "position", terms.at.point_of(k))


LOAD = PartRules("load", add_force_terms=_add_force_terms)
GRAVITY = PartRules("gravity")
