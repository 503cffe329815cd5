"""Bodies in a pose of equilibrium that was found elsewhere, against where they are described."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Bushing
from mbsvib.kinematics.pose import IDENTITY, start
from mbsvib.linalg.rank import ZERO_TURN

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mbsvib.elements.part import Part
    from mbsvib.kinematics.pose import Pose
    from mbsvib.mechanism.mechanism import Mechanism


def displaced(origin: Mechanism, parts: Iterable[Part]) -> Pose:
    """Return the pose in which bodies among some parts are, against where a mechanism describes them."""
    known: dict[str, Any] = {part.name: part for part in parts if part.name in origin.bodies}
    bodies = [known.get(name, body) for name, body in origin.bodies.items()]
    described, there = (np.array([body.orientation for body in group] + [IDENTITY])
                        for group in (origin.bodies.values(), bodies))  # fmt: skip
    return replace(start(origin), centre=np.array([*(body.position for body in bodies), (0.0, 0.0, 0.0)]),
                   rotations=there @ described.swapaxes(1, 2))  # fmt: skip


def turned(origin: Mechanism, parts: Iterable[Part]) -> frozenset[str]:
    """Return the bushings whose bodies turned against each other: what they do about axes changes in ways of its own.
    """
    known = {part.name: part for part in parts}
    pose = displaced(origin, known.values())
    return frozenset(part.name for part in known.values() if isinstance(part, Bushing)
                     and np.abs(pose.rotations[pose.number[part.first]] - pose.rotations[pose.number[part.second]]
                                ).max() > ZERO_TURN)  # fmt: skip


def holds_turns(bushing: Bushing) -> bool:
    """Tell whether a bushing carries moments, or forces by rotations."""
    blocks = [np.array(value) for value in (bushing.stiffness, bushing.damping, bushing.preload or np.zeros(6))]
    return any(value[3:].any() or (value.ndim == 2 and value[:, 3:].any()) for value in blocks)
