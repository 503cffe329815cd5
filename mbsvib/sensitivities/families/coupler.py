"""Couplers tie coordinates by sum of c q = 0 with a force mu.

Where a coefficient changes by dc, dependent coordinates follow, and x^T T y changes by -dc (mu_x q_y + q_x mu_y).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.kinematics.couplers import measure
from mbsvib.sensitivities.families.rules import PartRules

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.coupler import Coupling
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.families.rules import RuleAndData
    from mbsvib.sensitivities.families.terms import Terms
    from mbsvib.sensitivities.network import Network


def _single(network: Network, coupler: Coupling, field: str, index: tuple[int, ...]) -> RuleAndData:
    row, reads = network.coupler_row[coupler.name], []
    for name, rate in _rates(coupler, field, index):
        owner, _, direction = name.rpartition(".")
        k = network.joint_number[owner]
        force, moment, _ = measure(network.joints[k], direction)
        if rate:
            reads.append((k, np.concatenate((force, moment)), rate))

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        return [[(-rate * fields.tied[row : row + 1], np.tensordot(six, fields.relative[k], axes=1)[None])
                 for k, six, rate in reads]]  # fmt: skip

    return rule, ()


def _rates(coupler: Coupling, field: str, index: tuple[int, ...]) -> list[tuple[str, float]]:
    """How fast coefficients change, which are linear in all numbers of couplers."""
    numbers = {item.name: item.value for item in coupler.parameter_fields()}
    value = numbers[field]
    twice: Any = 2.0 * value if not index else tuple(2.0 * v if i == index[0] else v for i, v in enumerate(value))
    size = value if not index else value[index[0]]
    changed = coupler.with_values(numbers | {field: twice})
    return [(name, (b - a) / size) for (name, a), (_, b) in zip(coupler.terms, changed.terms, strict=True)]


RULES = PartRules("coupler", single=_single, is_exception=lambda part, moved, _: moved or part.curvatures is not None)
