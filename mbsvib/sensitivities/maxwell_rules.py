"""Maxwell elements: how their numbers enter the equations.

The element lengthens by l between its points and its damper by s, the coordinate of the node: its springs see l and
l + s, its damper s. Where a point moves, l changes as that of a line spring does, and s does not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.sensitivities.network_parts import line_name
from mbsvib.sensitivities.rule_terms import along, moved_end

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements import Maxwell
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.rule_terms import Rule, Terms


def maxwell_rule(network: Network, part: Maxwell, field: str, index: tuple[int, ...]) -> Rule:
    """Return the rule by which a number of a Maxwell element enters the equations."""
    place = {spring.name: k for k, spring in enumerate(network.springs)}
    static, spring, _ = (place[line_name(part, each)] for each in ("static_stiffness", "stiffness", "damping"))
    line, joints = np.array([part.line]), len(network.joints)
    span = np.array([np.subtract(part.end, part.start)])

    def coefficient(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        own = place[line_name(part, field)]
        seen = along(line, fields.strain[own : own + 1, :3])
        return [[(0.5 * (fields.rate if field == "damping" else fields.stiff) * seen, seen)]]

    def point(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        own = slice(joints + static, joints + static + 1)
        change = moved_end(line, span, fields.relative[own], field == "end")
        beside = joints + spring
        tension = along(line, fields.wrench[own, :3] + fields.wrench[beside : beside + 1, :3])
        return [[(tension, change[:, index[0]])]]

    return point if field in ("start", "end") else coefficient
