"""Wrenches in joints at the pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations


def joint_wrenches(system: Equations) -> dict[str, Array]:
    """Return the wrench (6,) [N, N m] in each joint at the pose, at its point on the second body, world axes."""
    system.provenance.check_mechanism(system.name, "reactions")
    joints, statics = system.provenance.topology.joints, system.provenance.statics
    if statics is None:
        return {joint.name: np.zeros(6) for joint in joints}
    return {joint.name: statics.joints[:, k].copy() for k, joint in enumerate(joints)}
