"""Couplers in finite motion: displacements of the coupled joint coordinates from the reference pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.elements.coupler import refuse_curved
from mbsvib.equations.expansion import expanded
from mbsvib.errors import ModelError
from mbsvib.kinematics.relative_motion import Twists, relative_motion
from mbsvib.linalg.rotations import logarithm

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Body, Joint
    from mbsvib.equilibrium.pose import Pose
    from mbsvib.kinematics.couplings import Couplings
    from mbsvib.mechanism.mechanism import Mechanism

# Rotation vectors shorter than this [rad] are rounding of a pose from Newton's method.
TURNED = 1e-9


def coupled_coordinates(couplings: Couplings, coordinates: Twists) -> Array:
    """Return the coupled coordinates (terms, n) per unit joint coordinate."""
    measured = relative_motion(coordinates, couplings.measured).dense(0, len(couplings.measured.first))
    result = np.zeros((len(couplings.column), len(coordinates.names)))
    tree = couplings.column >= 0
    result[np.flatnonzero(tree), couplings.column[tree]] = 1.0
    result[~tree] = measured
    return result


def coupler_travel(model: Mechanism, pose: Pose, near: Array | None) -> Array:
    """Return the displacements of coupled coordinates in a pose, one for each term of each coupler.

    ``near`` (terms,): approximate displacements, from which full turns are counted. Returns (terms,): distances [m] and
    angles [rad].
    """
    names = [name.rpartition(".") for part in model.couplers.values() for name, _ in part.terms]
    values = np.array([joint_travel(model.joints[owner], direction, pose) for owner, _, direction in names])
    if near is None:
        return values
    full_turns = 2.0 * np.pi * np.round((near - values) / (2.0 * np.pi))
    return np.where([direction[0] == "r" for *_, direction in names], values + full_turns, values)


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


def joint_travel(joint: Joint, direction: str, pose: Pose) -> float:
    """Return the displacement of one coordinate of a joint [m, rad], angles within half a turn."""
    k = DIRECTIONS.index(direction)
    first, second = pose.rotated(joint.first, joint.axes), pose.rotated(joint.second, joint.axes)
    if k < 3:
        at = joint.point or pose.origin[min(pose.number[joint.first], pose.number[joint.second])].tolist()
        return float(first[:, k] @ np.subtract(pose.point(joint.second, at), pose.point(joint.first, at)))
    relative, axes = first.T @ second, joint.rotation_axes
    if len(axes) == 1:
        i, j = (k - 2) % 3, (k - 1) % 3
        return float(np.arctan2(relative[j, i] - relative[i, j], relative[i, i] + relative[j, j]))
    if joint.successive:
        e1, e2 = (np.array(joint.axes).T @ axis for axis in axes)
        # relative = exp(a e1) exp(b e2): the angle a turns e2 about e1, the angle -b turns e1 about e2
        about_first = direction == next(name for name, _ in joint.freedom if name[0] == "r")
        axis, arm, turned = (e1, e2, relative @ e2) if about_first else (e2, e1, relative.T @ e1)
        angle = np.arctan2(axis @ np.cross(arm, turned), arm @ turned - (axis @ arm) * (axis @ turned))
        return float(angle if about_first else -angle)
    return float(logarithm(relative)[k - 3])
