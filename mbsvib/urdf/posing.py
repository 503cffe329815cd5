"""The pose of a robot: positions that the user gives, within the limits of the file and with closed loops."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from os import PathLike

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.tables import listed
from mbsvib.errors import AccuracyWarning, LeftOutWarning, ModelError
from mbsvib.urdf.closing import Assembly, Frames, followed, link_frames
from mbsvib.urdf.motion import FREEDOMS
from mbsvib.urdf.reading import Robot

# Joint of the model, and the direction along or about which its spring acts, by the joint of the file.
KINDS = {"revolute": ("revolute", 5), "continuous": ("revolute", 5), "prismatic": ("prismatic", 2)}
# Limits are printed with few digits: a right angle may be 1.57 there.
LIMIT_DIGITS = 1e-3
# Gaps of closed loops that are no rounding [rad, sizes].
ROUNDED = 1e-11


def frames_in_pose(robot: Robot, pose: Mapping[str, float], path: str | PathLike[str]) -> Frames:
    """Return the frames of all links in the pose, with closed loops; named joints beyond their limits are refused."""
    pose = _of_leaders(robot, pose, path)
    positions = _positions(robot, pose)
    for name, words in _beyond(robot, positions).items():
        if name in pose:
            unit = "m" if robot.joints[name].kind == "prismatic" else "rad, not degrees"
            raise ModelError(f"{path}: pose: {words}, the limits of the file [{unit}].", element=name, field="pose")
    if robot.loops or robot.couplings:
        positions, gaps = Assembly(robot, positions, pose).closed(path)
        if gaping := [f"'{name}' ({gap:.1g})" for name, gap in gaps.items() if gap > ROUNDED]:
            warnings.warn(f"{path}: loops that close but for printed digits [rad, sizes]: {listed(gaping)}. Joints are "
                          f"at the mean of both frames; write more digits.", AccuracyWarning, stacklevel=3)  # fmt: skip
    if beyond := list(_beyond(robot, positions).values()):
        warnings.warn(f"{path}: joints beyond the limits of the file: {listed(beyond)}. Give a pose within them.",
                      LeftOutWarning, stacklevel=3)  # fmt: skip
    return link_frames(robot, positions)


def _of_leaders(robot: Robot, pose: Mapping[str, float], path: str | PathLike[str]) -> dict[str, float]:
    """Return a pose in which the joints that are mimicked stand for those that mimic them; refuse contradictions."""
    values = {name: check.number(value, f"joint '{name}'", "pose") for name, value in pose.items()}
    result = {name: value for name, value in values.items() if robot.joints[name].mimic is None}
    for name, value in values.items():
        factor, offset, leader = followed(robot, name)
        if leader != name:
            expected = offset + factor * result.setdefault(leader, (value - offset) / factor)
            if abs(value - expected) > LIMIT_DIGITS * max(1.0, abs(value)):
                raise ModelError(f"{path}: pose: '{name}' at {value:.6g}, but it mimics '{leader}', which is at "
                                 f"{result[leader]:.6g}, and so is at {expected:.6g}. Name one of the two only.",
                                 element=name, field="pose")  # fmt: skip
    return result


def _positions(robot: Robot, pose: Mapping[str, float]) -> dict[str, Array]:
    """Positions (freedoms,) of all joints; a joint that mimics another one follows it."""
    result: dict[str, Array] = {}
    for name, joint in robot.joints.items():
        factor, offset, leader = followed(robot, name)
        q = offset + factor * pose.get(leader, 0.0)
        if q and joint.kind not in KINDS:
            raise ModelError(f"joint '{name}': pose = {q:g}, but a {joint.kind} joint has no position of its own.",
                             element=name, field="pose")  # fmt: skip
        result[name] = np.full(FREEDOMS[joint.kind], q)
    return result


def _beyond(robot: Robot, positions: Mapping[str, Array]) -> dict[str, str]:
    """Joints whose positions are beyond their limits, and what is wrong with them."""
    result = {}
    for name, joint in robot.joints.items():
        if joint.limits is not None and joint.kind in KINDS:
            (low, high), q = joint.limits, float(positions[name][0])
            slack = LIMIT_DIGITS * max([abs(end) for end in joint.limits if np.isfinite(end)], default=0.0)
            if not low - slack <= q <= high + slack:
                result[name] = f"'{name}' at {q:.6g}, beyond {low:g} to {high:g}"
    return result
