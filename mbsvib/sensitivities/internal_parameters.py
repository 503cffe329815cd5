"""Numbers of plain parts that are no parameters of the model, but change as the pose moves: axes of torsion springs and
of rotors, which go with the bodies that carry them, and the place and orientation of beams and superelements that
keep their shape.

They have rows of their own behind the parameters of a loaded network, with rules like those of parameters.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.beam import Beam
from mbsvib.elements.rotor import Rotor
from mbsvib.elements.superelement import Superelement
from mbsvib.elements.torsion_spring import TorsionSpring
from mbsvib.sensitivities import beam_rules, superelement_rules
from mbsvib.sensitivities.beam_rules import changed_beam, motion_slopes
from mbsvib.sensitivities.made_part_rules import rotor_axis_rule
from mbsvib.sensitivities.parameter_group import ParameterGroup
from mbsvib.sensitivities.part_rules import rule
from mbsvib.sensitivities.superelement_rules import superelement_motion

if TYPE_CHECKING:
    from mbsvib.sensitivities.network import Network

AXIS, MOTION = "axis", "motion"
_FIELDS: dict[type, tuple[str, int]] = {TorsionSpring: ("orientation", 3), Rotor: (AXIS, 3), Beam: (MOTION, 6),
                                       Superelement: (MOTION, 6)}  # fmt: skip
_ONE = np.zeros(1, dtype=np.intp)


def internal_parameters(network: Network) -> tuple[tuple[str, str, tuple[int, ...]], ...]:
    """Return part, field and index of all such numbers of a network."""
    return tuple((part.name, field, (i,)) for part in network.parts if type(part) in _FIELDS
                 for field, count in (_FIELDS[type(part)],) for i in range(count))  # fmt: skip


def internal_groups(network: Network, first: int, gravity: int | None) -> list[ParameterGroup]:
    """Return the groups of these numbers, and of gravity where it stiffens beams or turns superelements.

    ``first``: the row of the first of these numbers; ``gravity``: that of gravity along x, None without gravity.
    """
    springs = {spring.name: k for k, spring in enumerate(network.springs)}
    result, row = [], first
    for part in network.parts:
        if isinstance(part, TorsionSpring):
            k = springs[part.name]
            part_rule, number = rule(network.springs[k], "orientation"), np.array([len(network.joints) + k])
        elif isinstance(part, Rotor):
            part_rule, number = rotor_axis_rule(network, part), _ONE
        elif isinstance(part, (Beam, Superelement)):
            for i in range(6):
                part_rule, data = (changed_beam(network, part, motion_slopes(part, i)) if isinstance(part, Beam) else
                             superelement_motion(network, part, i))  # fmt: skip
                result.append(ParameterGroup("beam", MOTION, _ONE, part_rule, data, np.array([[row]]), 0))
                row += 1
            continue
        else:
            continue
        kind = "spring" if isinstance(part, TorsionSpring) else "rotor"
        result.append(ParameterGroup(kind, _FIELDS[type(part)][0], number, part_rule, (), row + np.arange(3)[None], 3))
        row += 3
    for kind_of_part, rules in ((Beam, beam_rules), (Superelement, superelement_rules)):
        if gravity is not None and any(isinstance(part, kind_of_part) for part in network.parts):
            own = rules.gravity_rule(network)
            result.append(ParameterGroup("gravity", "", _ONE, own, (), gravity + np.arange(3)[None], 3))
    return result


