"""Torsion springs: how their numbers enter the equations, by the twist about the axis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.sensitivities.rule_terms import along

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.torsion_spring import TorsionSpring
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.rule_terms import Rule, Terms


def torsion_rule(network: Network, part: TorsionSpring, field: str, _: tuple[int, ...] = ()) -> Rule:
    """Return the rule by which stiffness or damping of a torsion spring enters the equations."""
    own = next(k for k, spring in enumerate(network.springs) if spring.name == part.name)
    axis = np.array([part.axis])

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        seen = along(axis, fields.strain[own : own + 1, 3:])
        return [[(0.5 * (fields.rate if field == "damping" else fields.stiff) * seen, seen)]]

    return rule
