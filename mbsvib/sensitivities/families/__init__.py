"""What each family of parts says of its parameters, one file a family.

``rules_of`` finds the record of a part. A connection without one has the rules of ``element``: those of its rows.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from mbsvib.elements import Body, Bushing, Joint, Load, Maxwell, Spring
from mbsvib.elements.beam import Beam
from mbsvib.elements.connection import Connection
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.hub import Hub
from mbsvib.elements.inerter import Inerter
from mbsvib.elements.load import Gravity
from mbsvib.elements.rotor import Rotor
from mbsvib.elements.superelement import Superelement
from mbsvib.elements.torsion_spring import TorsionSpring
from mbsvib.sensitivities.families import (
    body,
    bushing,
    coupler,
    elastic,
    element,
    joint,
    line,
    load,
    maxwell,
    rotor,
    torsion_spring,
)
from mbsvib.sensitivities.families.rules import PartRules

if TYPE_CHECKING:
    from mbsvib.elements.part import Part

_UNKNOWN = PartRules("", is_exception=lambda *_: True)
_RULES = {
    Body: body.RULES, Joint: joint.RULES, Spring: line.SPRING, Inerter: line.INERTER, Bushing: bushing.RULES,
    Maxwell: maxwell.RULES, TorsionSpring: torsion_spring.RULES, Coupling: coupler.RULES, Rotor: rotor.RULES,
    Load: load.LOAD, Gravity: load.GRAVITY, Beam: elastic.BEAM, Superelement: elastic.SUPERELEMENT,
    Connection: element.RULES, Hub: _UNKNOWN,
}  # fmt: skip


def rules_of(part: Part) -> PartRules:
    """Return the record of a part: that of its class, or of the nearest class that this is made of."""
    kind: Any = type(part)
    return _of_class(kind)


@cache
def _of_class(kind: Any) -> PartRules:
    return next((_RULES[base] for base in kind.__mro__ if base in _RULES), _UNKNOWN)
