"""Line springs and inerters: their coefficients act on the change of their length, which their ends change."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.vectors import transformed
from mbsvib.sensitivities.families.rules import PartRules, joins_spinning_body
from mbsvib.sensitivities.families.terms import along, among_springs, line_end_rates

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.families.pose_changes import ReferenceTerms
    from mbsvib.sensitivities.families.terms import Rule, Terms
    from mbsvib.sensitivities.force_layout import RowTerms
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


def _constants(_: Network, parts: Sequence[Any], field: str) -> tuple[Array, ...]:
    """Directions, and how elongations change where one of their ends moves."""
    line = np.array([part.line for part in parts])
    if field not in ("start", "end"):
        return (line,)
    span = np.array([part.end for part in parts]) - np.array([part.start for part in parts])
    return line, line_end_rates(line, span, field == "end")


def _add_force_terms(terms: RowTerms, _: Network, __: Forces, part: Any, k: int) -> None:
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


def _add_reference_terms(terms: ReferenceTerms, part: Any, k: int) -> None:
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


_OF_FIELDS: dict[str, Rule] = {
    "stiffness": _line("stiff"), "damping": _line("rate"), "inertance": _line("square"),
    "start": _line_end, "end": _line_end,
}  # fmt: skip
SPRING = PartRules(
    "spring", lambda _, __, field: _OF_FIELDS[field], _constants, alters_spin=joins_spinning_body,
    add_force_terms=_add_force_terms,
    add_reference_terms=_add_reference_terms,
)  # fmt: skip
INERTER = replace(SPRING, add_reference_terms=lambda *_: None)
