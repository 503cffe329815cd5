"""Maxwell elements: springs and damper on changes of length, of which the node between them takes a part.

An element lengthens by l between its points and its damper by s, the coordinate of the node: its springs see l and
l + s, its damper s. Where a point moves, l changes as that of a line spring does, and s does not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.vectors import transformed
from mbsvib.sensitivities.families.rules import PartRules
from mbsvib.sensitivities.families.terms import along, coefficient, line_end_rates

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements import Maxwell
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.families.rules import RuleAndData
    from mbsvib.sensitivities.families.terms import Terms
    from mbsvib.sensitivities.force_layout import RowTerms
    from mbsvib.sensitivities.forces import Forces
    from mbsvib.sensitivities.network import Network


def _single(network: Network, part: Maxwell, field: str, index: tuple[int, ...]) -> RuleAndData:
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


def _add_force_terms(terms: RowTerms, network: Network, _: Forces, part: Maxwell, __: int) -> None:
    k = len(network.joints) + network.maxwell_lines[part.name]["static_stiffness"]  # between the two bodies
    terms.along(part.name, "start", terms.at.start_of(k))
    terms.along(part.name, "end", terms.at.point_of(k))


RULES = PartRules(
    "maxwell", single=_single, is_exception=lambda part, moved, _: moved or part.loaded,
    add_force_terms=_add_force_terms,
)  # fmt: skip
