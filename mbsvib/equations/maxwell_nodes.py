"""Mechanisms with the nodes of their connections, such as those between spring and damper of Maxwell elements."""

from __future__ import annotations

from typing import TypeVar

from mbsvib.elements.families import FAMILIES
from mbsvib.mechanism.mechanism import Mechanism

NODES = {family.part: family.nodes for family in FAMILIES if family.nodes is not None}
M = TypeVar("M", bound=Mechanism)


def with_maxwell_nodes(model: M) -> M:
    """Return a mechanism with the nodes of its connections as bodies, and the joints in which they slide.

    Without such connections it is the same mechanism.
    """
    added = [NODES[type(part)](part) for part in model.springs.values() if type(part) in NODES]
    if not added:
        return model
    bodies, joints = dict(model.bodies), dict(model.joints)
    for part in added:
        bodies.update(part.bodies)
        joints.update(part.joints)
    return model.with_parts(bodies=bodies, joints=joints)
