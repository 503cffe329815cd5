"""Couplers: how their coefficients enter the equations.

A coupler ties coordinates by sum of c q = 0 with a force mu; where a coefficient changes by dc, dependent coordinates
follow, and x^T T y changes by -dc (mu_x q_y + q_x mu_y).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements.coupler import Coupling
from mbsvib.kinematics.couplers import measure

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.rule_terms import Rule, Terms


def coupler_rule(network: Network, coupler: Coupling, field: str, index: tuple[int, ...]) -> Rule:
    """Return the rule by which a number of a coupler enters the equations."""
    assert network.constraints is not None
    names = [part.name for part in network.parts if isinstance(part, Coupling)]
    row = network.constraints.pull.shape[0] - len(names) + names.index(coupler.name)
    place = {joint.name: k for k, joint in enumerate(network.joints)}
    reads = []
    for name, rate in _rates(coupler, field, index):
        owner, _, direction = name.rpartition(".")
        force, moment, _ = measure(network.joints[place[owner]], direction)
        if rate:
            reads.append((place[owner], np.concatenate((force, moment)), rate))

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        return [[(-rate * fields.tied[row : row + 1], np.tensordot(six, fields.relative[k], axes=1)[None])
                 for k, six, rate in reads]]  # fmt: skip

    return rule


def _rates(coupler: Coupling, field: str, index: tuple[int, ...]) -> list[tuple[str, float]]:
    """How fast coefficients change, which are linear in all numbers of couplers."""
    numbers = {item.name: item.value for item in coupler.parameter_fields()}
    value = numbers[field]
    twice: Any = 2.0 * value if not index else tuple(2.0 * v if i == index[0] else v for i, v in enumerate(value))
    size = value if not index else value[index[0]]
    changed = coupler.with_values(numbers | {field: twice})
    return [(name, (b - a) / size) for (name, a), (_, b) in zip(coupler.terms, changed.terms, strict=True)]
