"""Beams and superelements of a mechanism.

They are linear in the frame of the body that carries them; ``elements.elastic_part`` has their forces there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from mbsvib.elements.beam import Beam
    from mbsvib.elements.superelement import Superelement
    from mbsvib.mechanism.mechanism import Mechanism

    Flexible = Beam | Superelement


def flexible(model: Mechanism) -> list[Flexible]:
    """Return the beams and superelements of a mechanism."""
    return cast("list[Flexible]", list(model.composed.values()))


def attachment_points(part: Flexible) -> dict[str, Any]:
    """Return the bodies that a beam or superelement connects, nodes and ground included, with a point of each.

    Parameters
    ----------
    part : Beam or Superelement
        The part.

    Returns
    -------
    dict of str to tuple
        Points [m] by body.
    """
    points = dict(part.node_bodies)
    return points if part.root in points else points | {part.root: part.points[0]}
