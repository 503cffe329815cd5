"""What each family of parts says of its parameters, kin families in one file.

``rules_of`` finds the record of a part. A connection without one has the rules of its rows.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from mbsvib.elements import Body, Bushing, Joint, Load, Maxwell, Spring
from mbsvib.elements.beam import Beam
from mbsvib.elements.connection import Connection
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.hub import Hub
from mbsvib.elements.inerter import Inerter
from mbsvib.elements.load import Gravity
from mbsvib.elements.part import Part
from mbsvib.elements.rotor import Rotor
from mbsvib.elements.superelement import Superelement
from mbsvib.elements.torsion_spring import TorsionSpring
from mbsvib.sensitivities.families import bodies, connections, elastic, joints
from mbsvib.sensitivities.families.rules import UNKNOWN, PartRules

_UNKNOWN = PartRules("", loaded=UNKNOWN)
_RULES = {
    Body: bodies.BODY, Rotor: bodies.ROTOR, Load: bodies.LOAD, Gravity: bodies.GRAVITY, Joint: joints.JOINT,
    Coupling: joints.COUPLER, Spring: connections.SPRING, Inerter: connections.INERTER, Bushing: connections.BUSHING,
    Maxwell: connections.MAXWELL, TorsionSpring: connections.TORSION, Connection: connections.ELEMENT,
    Beam: elastic.BEAM, Superelement: elastic.SUPERELEMENT, Hub: _UNKNOWN,
}  # fmt: skip


def rules_of(part: Part) -> PartRules:
    """Return the record of a part: that of its class, or of the nearest class that this is made of."""
    kind: Any = type(part)
    return _of_class(kind)


@cache
def _of_class(kind: Any) -> PartRules:
    return next((_RULES[base] for base in kind.__mro__ if base in _RULES), _UNKNOWN)
