"""Rotors: the angular momentum h of one adds x^T C y = h . (x x y), antisymmetric, of rotations of its body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.sensitivities.families.rules import InternalRule, PartRules

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.rotor import Rotor
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.families.pose_changes import PoseRates
    from mbsvib.sensitivities.families.rules import RuleAndData
    from mbsvib.sensitivities.families.terms import Rule, Terms
    from mbsvib.sensitivities.network import Network

# The field of the axis, which is no parameter.
AXIS = "axis"


def _single(network: Network, rotor: Rotor, field: str, _: tuple[int, ...]) -> RuleAndData:
    body, per_speed = _momentum(network, rotor)
    return _momentum_rule(body, [per_speed if field == "speed" else per_speed * (rotor.speed / (rotor.inertia or 1.0))]
                          ), ()  # fmt: skip


def _internal_rules(network: Network, rotor: Rotor) -> list[InternalRule]:
    """Its axis goes with its body."""
    body, per_speed = _momentum(network, rotor)
    rule = _momentum_rule(body, list(np.cross(np.eye(3), rotor.speed * per_speed)))
    return [InternalRule(rule, 3, np.zeros(1, dtype=np.intp))]


def _momentum(network: Network, rotor: Rotor) -> tuple[int, Array]:
    """The number of its body, and its momentum per unit of speed."""
    assert network.spin is not None
    return network.spin.rotor[rotor.name]


def _momentum_rule(body: int, changes: list[Array]) -> Rule:
    """The rule of changes (3,) of the angular momentum of a body."""
    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        turn = fields.body[body : body + 1, 3:]
        return [[(-fields.side * value * fields.rate * turn[:, i], turn[:, j])
                 for value, (i, j) in zip(change.tolist(), ((1, 2), (2, 0), (0, 1)), strict=True) if value]
                for change in changes]  # fmt: skip

    return rule


def _follow(rates: PoseRates, rotor: Rotor, _: int) -> None:
    if rates.network.spin is not None:
        rates.put(rotor.name, AXIS, rates.motion[_momentum(rates.network, rotor)[0], 3:])


RULES = PartRules(
    "rotor", single=_single, alters_spin=lambda spin, rotor, _: rotor.inertia is None and spin.coupling is not None,
    internal=(AXIS, 3), internal_rules=_internal_rules, follow=_follow,
    # bearings may leave the axis of a body that spins itself
    is_exception=lambda rotor, *_: rotor.inertia is None,
)  # fmt: skip
