"""The table of all families of parts: what the program has to know of each beside its own file.

A new family is one file with its part and ``make``, a row here, and its ``add_...`` call in ``api``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from mbsvib.elements import (
    beam,
    beam_expansion,
    body,
    bushing,
    bushing_rows,
    inerter,
    joint,
    load,
    maxwell,
    maxwell_rows,
    ports,
    rotor,
    spring,
    strain_output,
    superelement,
    superelement_expansion,
    torsion_spring,
)
from mbsvib.elements.coupler import Coupler, Coupling, Gear, Rack, Worm
from mbsvib.elements.element_rows import ElementRows
from mbsvib.elements.part import Part, defaults

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from mbsvib.elements.connection import Connection
    from mbsvib.elements.shared_rows import PlainParts

P = TypeVar("P", bound=Part)


@dataclass(frozen=True, slots=True)
class Family:
    """A family of parts.

    ``word`` names its call, ``add_WORD``, and its type in model files, where it stands in ``section``. ``make`` checks
    the words of the call and returns the part. ``rows`` returns the relative displacements on which connections act;
    ``plain`` returns the other parts that stand for one in the equations.
    """

    part: type[Part]
    word: str
    section: str
    make: Callable[..., Part] | None
    rows: Callable[..., ElementRows] | None = None
    plain: Callable[..., PlainParts] | None = None


def _superelement(M: Any, C: Any, K: Any, **words: Any) -> superelement.Superelement:
    return superelement.make(mass=M, damping=C, stiffness=K, **words)


# In the order of model files; the first family of a section goes there without its type.
FAMILIES = (
    Family(body.Body, "body", "bodies", body.make),
    Family(beam.Beam, "beam", "beams", beam.make, plain=beam_expansion.plain),
    Family(superelement.Superelement, "superelement", "superelements", _superelement,
           plain=superelement_expansion.plain),
    Family(joint.Joint, "joint", "joints", joint.make),
    Family(spring.Spring, "spring", "springs", spring.make, rows=spring.rows),
    Family(bushing.Bushing, "bushing", "springs", bushing.make, rows=bushing_rows.rows),
    Family(maxwell.Maxwell, "maxwell", "springs", maxwell.make, rows=maxwell_rows.rows),
    Family(inerter.Inerter, "inerter", "springs", inerter.make, rows=inerter.rows),
    Family(torsion_spring.TorsionSpring, "torsion_spring", "springs", torsion_spring.make, plain=torsion_spring.plain),
    Family(Coupler, "coupler", "couplers", None),
    Family(Gear, "gear", "couplers", None),
    Family(Worm, "worm", "couplers", None),
    Family(Rack, "rack", "couplers", None),
    Family(rotor.Rotor, "rotor", "rotors", rotor.make),
    Family(load.Load, "load", "loads", load.make),
    Family(ports.Input, "input", "inputs", ports.make_input),
    Family(ports.BaseMotion, "base_motion", "inputs", ports.make_base_motion),
    Family(ports.Output, "output", "outputs", ports.make_output),
    Family(ports.ForceOutput, "force_output", "outputs", ports.make_force_output),
    Family(strain_output.StrainOutput, "strain_output", "outputs", strain_output.make, plain=strain_output.plain),
)  # fmt: skip
_MAKERS = {family.part: family.make for family in FAMILIES if family.make is not None}
_ROWS = {family.part: family.rows for family in FAMILIES if family.rows is not None}


def connection_rows(parts: Iterable[Connection], number: Mapping[str, int]) -> ElementRows:
    """Return the rows of all connections.

    Parameters
    ----------
    parts : iterable of Connection
        The model's connections, all of them plain.
    number : mapping
        Number of each body, ground included.

    Returns
    -------
    ElementRows
        Rows family by family; ``owner`` counts in the order of ``parts``.
    """
    families: dict[type, list[tuple[int, Connection]]] = {}
    for i, part in enumerate(parts):
        families.setdefault(type(part), []).append((i, part))
    return ElementRows.join([_ROWS[family](some, number) for family, some in families.items()]
                            or [spring.rows([], number)])  # fmt: skip


def remade(part: P, words: Mapping[str, Any]) -> P:
    """Return a part with other words.

    Parameters
    ----------
    part : Part
        A part of a mechanism.
    words : mapping
        All words of the call that adds such a part, but those at their default; those of a coupler stay as they are.

    Returns
    -------
    Part
        The part with these words.

    Raises
    ------
    ModelError
        If a word is refused.
    """
    if isinstance(part, Coupling):
        return part
    result: P = _MAKERS[type(part)](**defaults(type(part)) | dict(words))  # type: ignore[assignment]
    return result
