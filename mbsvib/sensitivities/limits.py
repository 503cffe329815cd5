"""Which parameters act as one part's rule tells, in mechanisms with loads, couplers, spin or beams.

There, too, stiffness, damping and inertia enter by the motions alone: the pose balances as before, as preloads are
forces at the pose. What moves the equilibrium or changes forces in joints acts on the matrices as wholes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mbsvib.beams.beam import Beam
from mbsvib.parts import Load
from mbsvib.parts.coupler import Coupling
from mbsvib.parts.load import Gravity
from mbsvib.parts.rotor import Rotor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.parts._part import Part
    from mbsvib.system import System

_STIFFNESS, _DAMPING = ("spring", "stiffness"), ("spring", "damping")
_MASS, _INERTIA = ("body", "mass"), ("body", "inertia")
GEOMETRY = frozenset({"start", "end", "length"})


@dataclass(frozen=True, slots=True)
class Limit:
    """Only the ``fields`` (kind of part, field) act by rules of their own, because of what the part ``who`` does."""

    who: str
    fields: frozenset[tuple[str, str]]


def limits(system: System) -> tuple[Limit, ...]:
    """Return what limits the parameters that act by rules of their own, nothing for most systems.

    Parameters
    ----------
    system : System
        The equations of motion.

    Returns
    -------
    tuple of Limit
        All of them hold.
    """
    parts, came = system.provenance.parts, system.provenance
    result = []
    beam = next((part for part in parts if isinstance(part, Beam)), None)
    if beam is not None:
        fields = {_STIFFNESS, _DAMPING, _MASS, _INERTIA}
        fields |= {("beam", field) for part in parts if isinstance(part, Beam) for field, _, _ in part.numbers()
                   if field not in GEOMETRY and field != "damping_ratio"}  # fmt: skip
        result.append(Limit(beam.name, frozenset(fields)))
    coupler = next((part for part in parts if isinstance(part, Coupling)), None)
    if coupler is not None:
        result.append(Limit(coupler.name, frozenset((_STIFFNESS, _DAMPING, _MASS, _INERTIA))))
    if came.statics is not None:
        who = _loading(parts, system.name)
        falls = any(isinstance(part, Gravity) for part in parts)
        allowed = (_STIFFNESS, _DAMPING, _INERTIA) if falls else (_STIFFNESS, _DAMPING, _INERTIA, _MASS)
        result.append(Limit(who, frozenset((_DAMPING, _INERTIA) if came.settled else allowed)))
    rotor = next((part for part in parts if isinstance(part, Rotor)), None)
    if rotor is not None or system.gyroscopic is not None:
        who = system.name if rotor is None else rotor.name
        still = system.circulatory is None  # dampers that turn with a rotor are stiffness, too
        result.append(Limit(who, frozenset((_STIFFNESS, _DAMPING) if still else (_STIFFNESS,))))
    return tuple(result)


def _loading(parts: Sequence[Part], otherwise: str) -> str:
    """The first part that loads a mechanism."""
    for part in parts:
        loaded = getattr(part, "preload", None) is not None or getattr(part, "free_length", None) is not None
        if loaded or isinstance(part, (Load, Gravity)):
            return part.name
    return otherwise
