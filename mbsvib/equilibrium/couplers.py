"""Couplers that are no linear relations of the joint coordinates of another pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.coupler import refuse_curved
from mbsvib.equations.expansion import expanded
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import logarithm

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.elements import Body, Joint
    from mbsvib.mechanism.mechanism import Mechanism

# Rotation vectors shorter than this [rad] are rounding of a pose from Newton's method.
TURNED = 1e-9


def check_couplers(model: Mechanism, moved: Mechanism) -> None:
    """Refuse a pose in which couplers are no longer linear relations of joint coordinates.

    ``moved`` is the model in the new pose. The components of a rotation vector w from the reference pose of a
    homokinetic joint change by e . J(w) omega, with J of ``rotations.inverse_jacobian``; after a finite w that differs
    from the coordinates of the joint in the new pose. Couplers with curvature are known at the reference pose only.
    """
    if not model.couplers:
        return
    before, after = (expanded(mechanism).bodies for mechanism in (model, moved))
    for part in model.couplers.values():
        for name, _ in part.terms:
            owner, _, direction = name.rpartition(".")
            joint = model.joints[owner]
            curved = part.curvatures is not None
            if not curved and (direction[0] != "r" or not joint.bisects):
                continue
            angle, shift = _displacement(joint, before, after)
            if curved and (angle > TURNED or shift):
                moved_by = f"{angle:.3g} rad" if angle > TURNED else f"{shift:.3g} m"
                refuse_curved([part], f"and joint '{owner}' has moved by {moved_by}. Describe the model in the other "
                              f"pose anew, as load_mjcf(..., pose=...) does.")  # fmt: skip
            if not curved and angle > TURNED:
                raise ModelError(
                    f"coupler '{part.name}': '{name}' is a component of the rotation vector of the {joint.kind} joint "
                    f"'{owner}', which has turned by {angle:.3g} rad; the coupler is not a linear relation of its "
                    f"coordinates in another pose. Couple joints with one free rotation, or universal ones.",
                    element=part.name,
                )  # fmt: skip


def _displacement(joint: Joint, before: Mapping[str, Body], after: Mapping[str, Body]) -> tuple[float, float]:
    """Angle [rad] and shift [m] of a joint's second body relative to its first; 0 for a shift that is rounding."""
    turns, ends, size = [], [], 0.0
    for body in (joint.first, joint.second):
        at = np.array(joint.point or before[joint.first if joint.second == "ground" else joint.second].position)
        if body == "ground":
            turns.append(np.eye(3))
            ends.append(at)
            continue
        start, end = np.array(before[body].position), np.array(after[body].position)
        turns.append(np.array(after[body].orientation) @ np.array(before[body].orientation).T)
        ends.append(end + turns[-1] @ (at - start))
        size = max(size, float(np.abs((at, start, end)).max()))
    shift = float(np.linalg.norm(ends[1] - ends[0]))
    return float(np.linalg.norm(logarithm(turns[0].T @ turns[1]))), shift if shift > TURNED * size else 0.0
