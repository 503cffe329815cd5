"""Wrenches in joints at the pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations


def joint_wrenches(system: Equations) -> dict[str, Array]:
    """Return the wrench in each joint at the pose, on its second body, world axes.

    Parameters
    ----------
    system : Equations
        The equations of motion.

    Returns
    -------
    dict of str to array, shape (6,)
        Force [N] and moment [N m] at the joint's point.
    """
    system.provenance.check_mechanism(system.name, "reactions")
    joints, statics = system.provenance.topology.joints, system.provenance.statics
    if statics is None:
        return {joint.name: np.zeros(6) for joint in joints}
    return {joint.name: statics.joints[:, k].copy() for k, joint in enumerate(joints)}
