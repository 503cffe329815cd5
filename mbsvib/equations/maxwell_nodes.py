"""Mechanisms with the massless nodes of their Maxwell elements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from mbsvib.elements import Maxwell
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.elements.part import Part

M = TypeVar("M", bound=Mechanism)


def with_maxwell_nodes(model: M) -> M:
    """Return a mechanism with the nodes of its Maxwell elements as bodies, and the joints in which they slide.

    Parameters
    ----------
    model : Mechanism
        The mechanism.

    Returns
    -------
    Mechanism
        The same mechanism if it has no Maxwell element.
    """
    springs: Iterable[Part] = model.springs.values()
    elements = [part for part in springs if isinstance(part, Maxwell)]
    if not elements:
        return model
    from mbsvib.elements.maxwell_rows import node_body, node_joint

    bodies: dict[str, Any] = dict(model.bodies) | {part.node: node_body(part) for part in elements}
    joints: dict[str, Any] = dict(model.joints) | {part.name: node_joint(part) for part in elements}
    return model.with_parts(bodies=bodies, joints=joints)
