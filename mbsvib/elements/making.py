"""Parts made again with other words, through the checks that every part goes through."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from mbsvib.elements import (
    beam,
    body,
    bushing,
    joint,
    load,
    maxwell,
    ports,
    rotor,
    spring,
    superelement,
)
from mbsvib.elements.beam import Beam
from mbsvib.elements.body import Body
from mbsvib.elements.bushing import Bushing
from mbsvib.elements.coupler import Coupling
from mbsvib.elements.joint import Joint
from mbsvib.elements.load import Load
from mbsvib.elements.maxwell import Maxwell
from mbsvib.elements.part import Part, defaults
from mbsvib.elements.ports import BaseMotion, ForceOutput, Input, Output
from mbsvib.elements.rotor import Rotor
from mbsvib.elements.spring import Spring
from mbsvib.elements.superelement import Superelement

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

P = TypeVar("P", bound=Part)


def _superelement(M: Any, C: Any, K: Any, **words: Any) -> Superelement:
    return superelement.make(mass=M, damping=C, stiffness=K, **words)


MAKERS: dict[type, Callable[..., Part]] = {
    Body: body.make,
    Beam: beam.make,
    Superelement: _superelement,
    Joint: joint.make,
    Bushing: bushing.make,
    Spring: spring.make,
    Maxwell: maxwell.make,
    Rotor: rotor.make,
    Load: load.make,
    Input: ports.make_input,
    BaseMotion: ports.make_base_motion,
    Output: ports.make_output,
    ForceOutput: ports.make_force_output,
}


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
    result: P = MAKERS[type(part)](**defaults(type(part)) | dict(words))  # type: ignore[assignment]
    return result
