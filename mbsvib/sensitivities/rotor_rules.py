"""Rotors: how speed and inertia enter the equations.

The angular momentum h adds x^T C y = h . (x x y), antisymmetric, of the rotations x and y of the body.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.rotor import Rotor
    from mbsvib.sensitivities.adjoint_fields import Fields
    from mbsvib.sensitivities.network import Network
    from mbsvib.sensitivities.rule_terms import Rule, Terms


def rotor_rule(network: Network, rotor: Rotor, field: str, _: tuple[int, ...] = ()) -> Rule:
    """Return the rule by which a number of a rotor enters the equations."""
    assert network.spin is not None
    body, per_speed = network.spin.rotor[rotor.name]
    h = per_speed if field == "speed" else per_speed * (rotor.speed / (rotor.inertia or 1.0))

    def rule(fields: Fields, _: Any, __: tuple[Array, ...]) -> list[Terms]:
        turn = fields.body[body : body + 1, 3:]
        return [[(-fields.side * value * fields.rate * turn[:, i], turn[:, j])
                 for value, (i, j) in zip(h.tolist(), ((1, 2), (2, 0), (0, 1)), strict=True) if value]]  # fmt: skip

    return rule
