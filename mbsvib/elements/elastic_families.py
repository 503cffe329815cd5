"""The families of parts that are elastic in the frame of one of their bodies: beams, flexures and superelements.

A new family needs its expansion (``elements.families``), its elastic part, in a row here, ``without_forces`` and
``node_weights``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsvib.elements import beam_expansion, superelement_expansion
from mbsvib.elements.beam import Beam
from mbsvib.elements.flexure import Flexure
from mbsvib.elements.superelement import Superelement

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from mbsvib.common.arguments import Vector
    from mbsvib.elements.elastic_part import ElasticPart
    from mbsvib.elements.part import Composed

ELASTIC: dict[type[Composed], Callable[..., ElasticPart]] = {
    Beam: beam_expansion.elastic_part, Flexure: beam_expansion.elastic_part,
    Superelement: superelement_expansion.elastic_part,
}  # fmt: skip


def elastic_parts(parts: Iterable[Composed], gravity: Vector | None) -> list[ElasticPart]:
    """Return parts as elastic parts, with their weight under ``gravity`` [m/s^2]."""
    return [ELASTIC[type(part)](part, gravity) for part in parts]
