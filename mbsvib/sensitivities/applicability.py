"""Which parameters act as one part's rule tells, in mechanisms with loads.

There, too, stiffness, damping and inertia enter by the motions alone: the pose balances as before, as preloads are
forces at the pose. What moves the equilibrium or changes forces in joints goes through ``balance``, where all parts
are known there, or acts on the matrices as wholes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.elements.connection import Connection
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.hub import Hub
from mbsvib.elements.load import Gravity
from mbsvib.elements.motion_input import DrivenCoordinate
from mbsvib.elements.part import Composed
from mbsvib.elements.rotor import Rotor
from mbsvib.elements.superelement import Superelement
from mbsvib.equations.wrenches import is_loaded as carries_loads
from mbsvib.sensitivities.displaced_bodies import turned
from mbsvib.sensitivities.families import rules_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.elements.part import Part
    from mbsvib.equations.equations import Equations
    from mbsvib.sensitivities.network import Limit

_STIFFNESS = {("spring", "stiffness"), ("torsion", "stiffness")}
_DAMPING = {("spring", "damping"), ("torsion", "damping")}
_INERTIA, _MASS = {("body", "inertia"), ("spring", "inertance")}, {("body", "mass")}


def limits(system: Equations) -> tuple[Limit, ...]:
    """Return what limits the parameters that act by rules of their own, nothing for most systems.

    They are kinds of parts with their fields; only what is in all of these sets has a rule.
    """
    provenance = system.provenance
    parts, result = provenance.parts, []
    if is_loaded(system):
        falls = _has(parts, Gravity)
        if provenance.moved_to_equilibrium:
            result.append(_INERTIA if _turned(system) else _DAMPING | _INERTIA)
        else:
            result.append(_STIFFNESS | _DAMPING | _INERTIA | (set() if falls else _MASS))
    coupled = any(isinstance(part, Connection) and part.cross_coupling is not None for part in parts)
    if (_has(parts, Rotor) or coupled) and (is_loaded(system) or provenance.origin is None):
        # dampers that turn with a rotor are stiffness, too
        result.append(_STIFFNESS | _DAMPING if system.circulatory is None else _STIFFNESS)
    # masses and places of parts on hubs act on forces at rest as well; what drives move is no coordinate
    if _has(parts, Hub) or _has(provenance.ports, DrivenCoordinate):
        result.append(set())
    separation = provenance.separation
    if separation is not None and separation.transform is not None and system.circulatory is not None:
        # motions without mass follow others by K, from the left in other ways than from the right
        result.append(_DAMPING | _INERTIA | _MASS)
    return tuple(map(frozenset, result))


def is_loaded(system: Equations) -> bool:
    """Tell whether loads act at the pose of a system; of one in some modes, its model says so."""
    provenance = system.provenance
    return provenance.statics is not None or (provenance.origin is not None and carries_loads(provenance.origin))


def may_move(system: Equations) -> bool:
    """Tell whether parameters may move the pose: forces act on it, or are zero and may be changed."""
    provenance = system.provenance
    return provenance.statics is not None or _has(provenance.parts, Gravity) or any(
        getattr(part, "preload", None) is not None or getattr(part, "free_length", None) is not None
        for part in provenance.parts)  # fmt: skip


def follows(system: Equations) -> bool:
    """Tell whether derivatives through the equilibrium of a loaded scene are known of all its parts.

    True where all motions without mass have dampers, and each part has rules for what forces at the pose do.
    """
    provenance = system.provenance
    turned_bushings = _turned(system)
    return (
        may_move(system) and provenance.removed is None
        and (provenance.statics is not None or not (is_loaded(system) or _has(provenance.parts, Composed)))
        and (provenance.separation is None or provenance.separation.transform is None)
        and not any(group.surplus for group in provenance.reduction.groups if _has(provenance.parts, Coupling))
        and not (_has(provenance.parts, Superelement) and any(
            isinstance(part, Gravity) and not any(part.acceleration) for part in provenance.parts))
        and not any(rules_of(part).is_exception(part, provenance.moved_to_equilibrium, turned_bushings)
                    for part in provenance.parts)
    )  # fmt: skip


def _has(parts: Iterable[Part], kind: type[Part]) -> bool:
    return any(isinstance(part, kind) for part in parts)


def _turned(system: Equations) -> frozenset[str]:
    """Bushings that turned on the way to an equilibrium that was found elsewhere."""
    provenance = system.provenance
    if not provenance.moved_to_equilibrium or provenance.origin is None:
        return frozenset()
    return turned(provenance.origin, provenance.parts)
