"""Stiffness of couplers whose relation is not linear: its second derivatives times the force at rest in the coupler.

With the relation g(q) = sum of c_i q_i + sum of h_k q_k^2 / 2 = 0 and its multiplier lambda, balance is
V' = lambda g', and the second variation of V - lambda g along motions with g' dq = 0 is the stiffness

    K - lambda sum of h_k r_k r_k^T

with r_k the row of the coordinate q_k in minimal coordinates.

Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), section 6.6; Luenberger & Ye, Linear
and Nonlinear Programming (2008), section 11.4.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.coupler import Coupling
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.scene import Scene
    from mbsvib.kinematics.loops import Reduction


def curvature_stiffness(scene: Scene, reduction: Reduction, multipliers: Array) -> tuple[Array, Array, Index]:
    """Return rows (..., k, m) in minimal coordinates, their stiffness (..., k) and the joint (k,) that each belongs to.

    ``multipliers`` (..., locked rows): forces at rest in the locked rows, those of couplers last.
    """
    from mbsvib.kinematics.couplers import couplings

    joints = {joint.name: k for k, joint in enumerate(scene.topology.joints)}
    parts, stiffness, owner = [], [], []
    first = multipliers.shape[-1] - len(scene.couplers)
    for i, coupler in enumerate(scene.couplers):
        for name, second_derivative in coupler.curvatures or ():
            if any(group.surplus and first + i in group.rows for group in reduction.groups):
                raise ModelError(f"coupler '{coupler.name}': redundant constraints share its force at rest, so that "
                                 f"the stiffness of its curvature is not determined. Leave one of them out.",
                                 element=coupler.name, field="curvature")  # fmt: skip
            parts.append(Coupling(coupler.name, ((name, 1.0),)))
            stiffness.append(-multipliers[..., first + i] * second_derivative)
            owner.append(joints[name.rpartition(".")[0]])
    rows = couplings(parts, scene.topology, scene.bodies, scene.topology.body_numbers, scene.coordinates)
    values = np.stack(stiffness, axis=-1)
    return reduction.apply(rows.dense(scene.coordinates)), values, np.array(owner, dtype=np.intp)
