"""The table of all families of parts.

A new family needs one file with its part and ``make``, a row here, and its ``add_...`` call in ``api``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from mbsvib.common.arguments import Vector
from mbsvib.elements import (
    beam,
    beam_expansion,
    body,
    bushing,
    dynamic_bushing,
    dynamic_spring,
    dynamic_torsion,
    flexure,
    hub,
    inerter,
    joint,
    load,
    maxwell,
    motion_input,
    ports,
    rolling,
    rotor,
    spring,
    strain_output,
    superelement,
    superelement_expansion,
    torsion_spring,
)
from mbsvib.elements.by_law import expand as by_law_expand
from mbsvib.elements.connection import Connection
from mbsvib.elements.coupler import Coupler, Coupling, Gear, Rack, Worm
from mbsvib.elements.elastic_part import ElasticPart
from mbsvib.elements.part import MAKERS, Part, defaults
from mbsvib.elements.rows import ElementRows
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.errors import ModelError

P = TypeVar("P", bound=Part)


# Sections of which parts may be replaced in the equations.
EXPANDED = ("beams", "superelements", "springs", "inputs", "outputs")


@dataclass(frozen=True, slots=True)
class Family:
    """A family of parts.

    ``word`` is the name of its call, ``add_WORD``, and its type in the ``section`` of model files. ``make`` checks the
    arguments of the call and returns the part. ``rows`` returns the relative displacements on which connections act,
    ``nodes`` the bodies and joints that a connection needs for its rows. ``expand`` returns the parts that replace a
    part in the equations, which follow from the ``law`` of one that states an energy, or of an output. ``elastic``
    returns one that bends in the frame of one of its bodies as an elastic part, with its weight under gravity.
    """

    part: type[Part]
    word: str
    section: str
    make: Callable[..., Part] | None
    rows: Callable[..., ElementRows] | None = None
    expand: Callable[..., ExpandedPart] | None = None
    nodes: Callable[..., ExpandedPart] | None = None
    elastic: Callable[..., ElasticPart] | None = None

    def __post_init__(self) -> None:
        if issubclass(self.part, Connection) and self.rows is None and self.expansion is None:
            raise ModelError(f"family '{self.word}': nothing says what it is in the equations; give rows, expand, or a "
                             f"law with an energy.", element=self.word)  # fmt: skip
        if self.expand is not None and self.section not in EXPANDED:
            raise ModelError(f"family '{self.word}': parts of the section '{self.section}' are not expanded; expected "
                             f"one of {', '.join(EXPANDED)}.", element=self.word)  # fmt: skip

    @property
    def expansion(self) -> Callable[..., ExpandedPart] | None:
        """What returns the parts that replace one of the family; None: it stands for itself."""
        law = getattr(self.part, "law", None)
        by_law = law is not None and (law.energy is not None or issubclass(self.part, ports.Signal))
        return by_law_expand if by_law and self.expand is None else self.expand


def _superelement(M: Any, C: Any, K: Any, **kwargs: Any) -> superelement.Superelement:
    return superelement.make(mass=M, damping=C, stiffness=K, **kwargs)


# In the order of model files; parts of the first family of a section are written without a type.
FAMILIES = (
    Family(body.Body, "body", "bodies", body.make),
    Family(hub.Hub, "hub", "bodies", hub.make),
    Family(beam.Beam, "beam", "beams", beam.make, expand=beam_expansion.expand,
           elastic=beam_expansion.elastic_part),
    Family(flexure.Flexure, "flexure", "beams", flexure.make, expand=beam_expansion.expand,
           elastic=beam_expansion.elastic_part),
    Family(superelement.Superelement, "superelement", "superelements", _superelement,
           expand=superelement_expansion.expand, elastic=superelement_expansion.elastic_part),
    Family(joint.Joint, "joint", "joints", joint.make),
    Family(spring.Spring, "spring", "springs", dynamic_spring.make, rows=spring.rows),
    Family(dynamic_spring.DynamicSpring, "spring", "springs", dynamic_spring.make,
           expand=dynamic_spring.DynamicSpring.replacement),
    Family(bushing.Bushing, "bushing", "springs", dynamic_bushing.make, rows=bushing.rows),
    Family(dynamic_bushing.DynamicBushing, "bushing", "springs", dynamic_bushing.make,
           expand=dynamic_bushing.DynamicBushing.replacement),
    Family(maxwell.Maxwell, "maxwell", "springs", maxwell.make, rows=maxwell.rows, nodes=maxwell.nodes),
    Family(inerter.Inerter, "inerter", "springs", inerter.make, rows=inerter.rows),
    Family(torsion_spring.TorsionSpring, "torsion_spring", "springs", dynamic_torsion.make,
           expand=torsion_spring.expand),
    Family(dynamic_torsion.DynamicTorsionSpring, "torsion_spring", "springs", dynamic_torsion.make,
           expand=dynamic_torsion.DynamicTorsionSpring.replacement),
    Family(Coupler, "coupler", "couplers", None),
    Family(Gear, "gear", "couplers", None),
    Family(Worm, "worm", "couplers", None),
    Family(Rack, "rack", "couplers", None),
    Family(rotor.Rotor, "rotor", "rotors", rotor.make),
    Family(rolling.Rolling, "rolling", "rolling", rolling.make),
    Family(load.Load, "load", "loads", load.make),
    Family(ports.Input, "input", "inputs", ports.make_input),
    Family(ports.BaseMotion, "base_motion", "inputs", ports.make_base_motion),
    Family(motion_input.MotionInput, "motion_input", "inputs", motion_input.make, expand=motion_input.expand),
    Family(ports.Output, "output", "outputs", ports.make_output),
    Family(ports.ForceOutput, "force_output", "outputs", ports.make_force_output),
    Family(strain_output.StrainOutput, "strain_output", "outputs", strain_output.make, expand=strain_output.expand),
)  # fmt: skip
# What follows from the table, by class.
MAKERS.update({family.part: family.make for family in FAMILIES if family.make is not None})
ELASTIC = {family.part: family.elastic for family in FAMILIES if family.elastic is not None}
EXPANSIONS = {family.part: family.expansion for family in FAMILIES if family.expansion is not None}
NODES = {family.part: family.nodes for family in FAMILIES if family.nodes is not None}
_ROWS = {family.part: family.rows for family in FAMILIES if family.rows is not None}


def has_rows(part: Part) -> bool:
    """Tell whether a part is a connection with rows of its own."""
    return type(part) in _ROWS


def elastic_parts(parts: Iterable[Part], gravity: Vector | None) -> list[ElasticPart]:
    """Return beams, flexures and superelements as elastic parts, with their weight under ``gravity`` [m/s^2]."""
    return [ELASTIC[type(part)](part, gravity) for part in parts]


def connection_rows(parts: Iterable[Connection], number: Mapping[str, int]) -> ElementRows:
    """Return the rows of all connections of an expanded model, family by family; ``owner`` numbers the ``parts``.

    ``number``: that of each body, ground included.
    """
    families: dict[type, list[tuple[int, Connection]]] = {}
    for i, part in enumerate(parts):
        families.setdefault(type(part), []).append((i, part))
    for family in families.keys() - _ROWS.keys():
        part = families[family][0][1]
        raise ModelError(f"{part.family} '{part.name}': its family is not in FAMILIES of elements/families.py, so that "
                         f"it is nothing in the equations.", element=part.name)  # fmt: skip
    return ElementRows.join([_ROWS[family](members, number) for family, members in families.items()]
                            or [spring.rows([], number)])  # fmt: skip


def rebuild_with(part: P, kwargs: Mapping[str, Any]) -> P:
    """Return a part made with other arguments, unless one is refused; a coupler is returned unchanged.

    ``kwargs``: all arguments of the call that adds such a part, except those at their default.
    """
    if isinstance(part, Coupling):
        return part
    result: P = MAKERS.get(type(part), type(part))(**defaults(type(part)) | dict(kwargs))
    return result
