"""Any other connection: what it is made of are the matrices of its rows, or of the connections that stand for it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.families import EXPANSIONS, has_rows
from mbsvib.sensitivities.element_matrices import element_matrices
from mbsvib.sensitivities.families.part_slopes import part_slopes
from mbsvib.sensitivities.families.rules import PartRules, joins_spinning_body
from mbsvib.sensitivities.families.terms import factors, form_terms

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.connection import Connection
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.families.rules import RuleAndData
    from mbsvib.sensitivities.families.terms import Terms
    from mbsvib.sensitivities.network import Network

_POWERS = ("stiff", "rate", "square")


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


def _single(network: Network, part: Connection, field: str, index: tuple[int, ...]) -> RuleAndData:
    present = _stand_ins(part)
    which = np.array([network.spring_number[spring.name] for spring in present])
    joints, points = len(network.joints), network.point[len(network.joints) + which]

    def numbers(varied: Connection) -> dict[str, Array]:
        matrices = element_matrices(_stand_ins(varied), points)
        return {power: np.zeros((len(which), 6, 6)) if array is None else array
                for power, array in zip(_POWERS, matrices, strict=True)}  # fmt: skip

    span = float(np.ptp(np.array(part.points), axis=0).max(initial=0.0)) if part.points else 0.0
    changes = part_slopes(part, field, index, numbers, span if field in part.point_fields and span else None)
    forms = {power: factors(change) for power, change in changes.items()}

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        result: Terms = []
        for power, of_springs in forms.items():
            weight = 0.5 * getattr(fields, power)
            for k, form in zip(which.tolist(), of_springs, strict=True):
                motion = fields.relative[joints + k] if power == "square" else fields.strain[k]
                result += form_terms(form, motion, weight)
        return [result]

    return rule, ()


RULES = PartRules("element", single=_single, alters_spin=joins_spinning_body, is_exception=lambda *_: True,
                  has_rule=lambda part, field: bool(_stand_ins(part, field)))  # fmt: skip
