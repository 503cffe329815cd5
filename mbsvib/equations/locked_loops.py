"""Loops that lock because the axis of a joint is a little out of line with those of others.

Constraints that are redundant where axes are parallel, or normal to each other, become independent by any small angle,
and take a degree of freedom away. A loop with a small pivot is tried again with its axes in line: where this frees a
motion, the joint, the angle and the motion are named.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from operator import attrgetter

import numpy as np

from mbsvib.elements import Joint
from mbsvib.elements import joint as _joint
from mbsvib.elements.joint_kinds import KINDS
from mbsvib.equations.alignment import advice, aligned_loops
from mbsvib.equations.loop_geometry import LISTED, Loops, different, directions, in_line, loops_of
from mbsvib.errors import NearSingularWarning, counted
from mbsvib.kinematics.loops import LoopGroup
from mbsvib.linalg.rank import NEAR_SINGULAR, NEARLY_LOCKED, NEARLY_REDUNDANT, RANK_FACTOR, RANK_GAP
from mbsvib.mechanism.mechanism import Mechanism

# Groups of loops with more coordinates are not tried again, nor more groups: each takes some milliseconds.
MOST_COORDINATES, MOST_GROUPS = 200, 16
# Shifts of axes, in parts of the loops' size, up to which they are suspected without being asked for.
SUSPECTED = 0.02
# Kinds that free what an angle locks, those that free least first.
FREER = ("cylindrical", "spherical", "point_on_line")


def check_loops(model: Mechanism | None, groups: Sequence[LoopGroup], names: Sequence[str], stacklevel: int) -> None:
    """Warn of loops that lock a motion by a small angle, and of poses that are nearly singular otherwise.

    ``names`` are those of all joint coordinates. Without a ``model`` axes are not looked at.
    """
    small = [group for group in groups if group.retained < NEARLY_LOCKED]
    for k, group in enumerate(sorted(small, key=attrgetter("retained"))):
        text = None
        if model is not None and k < MOST_GROUPS:
            text = _by_an_angle(model, group, [names[column] for column in group.columns.tolist()])
        locked = group.retained < NEARLY_REDUNDANT and group.rank == len(group.columns)
        if text is None and model is not None and k < MOST_GROUPS and (locked or group.retained < NEAR_SINGULAR):
            text = _by_points(model, group, [names[column] for column in group.columns.tolist()])
        if text is None and group.retained < NEAR_SINGULAR:
            text = near_singular(group)
        if text is None and locked:
            text = (
                f"loops closed by {', '.join(group.joints[:LISTED])} lock all their joints by constraints that are "
                f"nearly redundant (smallest pivot {group.retained:.1e}). If they are to move, correct the points "
                f"or axes of their joints."
            )
        if text is not None:
            warnings.warn(text, NearSingularWarning, stacklevel=stacklevel)


def near_singular(group: LoopGroup) -> str:
    """Return the words for a nearly singular pose."""
    return (
        f"loops closed by {', '.join(group.joints[:LISTED])}: nearly singular pose (smallest pivot "
        f"{group.retained:.1e}); the minimal coordinates lose as many digits. Pin other coordinates with independent=, "
        f"move the pose, or give joints that are meant to be in line all their digits."
    )


def _by_an_angle(model: Mechanism, group: LoopGroup, names: Sequence[str]) -> str | None:
    """The words for loops that would be free with their axes in line; None where these would not be."""
    loops = loops_of(model, group.joints, names, group.length)
    joints = list(loops.model.joints.values())
    if not len(joints) > 1 or len(names) > MOST_COORDINATES:
        return None
    limit = max(RANK_FACTOR * group.noise, group.retained / RANK_GAP)
    freedom = len(group.columns) - group.rank
    best = _aligned(loops, joints, limit, freedom) if loops.freedom(limit) == freedom else None
    if best is None:
        return None
    aligned = loops.with_joints([joint for joint, _ in best])
    freed = aligned.freedom(limit) - freedom
    axes = ", ".join(f"'{joint.name}' by {angle:.3g} rad ({np.degrees(angle):.3g} deg)" for joint, angle in best)
    motion = ", ".join(loops.locked_motion(aligned, limit))
    kind = _freer_kind(loops, [model.joints[joint.name] for joint, _ in best] + joints, freedom + freed,
                       RANK_FACTOR * group.noise)  # fmt: skip
    return (
        f"axes out of line in the loops closed by {', '.join(group.joints[:LISTED])} lock the motion of {motion}: "
        f"joint {axes}. With axes in line the loops have {counted(freed, 'more degree')} of freedom. Correct the axis, "
        f"with all its digits{'' if kind is None else f', or {kind}'}. {advice(max(angle for _, angle in best))}"
    )


def _by_points(model: Mechanism, group: LoopGroup, names: Sequence[str]) -> str | None:
    """The words for loops that axes on one line, or through one point, would free; None where they would not."""
    loops = loops_of(model, group.joints, names, group.length)
    if len(names) > MOST_COORDINATES:
        return None
    limit = RANK_FACTOR * group.noise
    known = aligned_loops(loops, set(loops.model.joints), SUSPECTED, limit)
    if not known:
        return None
    freed = loops.with_joints([joint for joint, _ in known]).freedom(limit) - loops.freedom(limit)
    farthest = max((change for _, change in known), key=lambda change: change.size(group.length))
    return (
        f"loops closed by {', '.join(group.joints[:LISTED])} lock {counted(freed, 'motion')} by axes that nearly are "
        f"on one line, parallel or through one point: {', '.join(change.named for _, change in known[:LISTED])}. "
        f"Correct the points and axes, with all their digits. {advice(farthest.size(group.length))}"
    )


def _aligned(loops: Loops, joints: list[Joint], limit: float, freedom: int) -> list[tuple[Joint, float]] | None:
    """The joints in line and the angles by which they were not: the fewest that free the loops; None if none do."""
    best: list[tuple[Joint, float]] | None = None
    for reference in different([direction for joint in joints for direction in directions(joint)]):
        turned = [(after, angle) for joint in joints for after, angle in (in_line(joint, reference),) if angle > 0.0]
        if turned and (best is None or len(turned) < len(best)) and loops.with_joints(
                [joint for joint, _ in turned]).freedom(limit) > freedom:  # fmt: skip
            best = turned
    for one in sorted(best or (), key=lambda pair: -pair[1]):
        if loops.with_joints([one[0]]).freedom(limit) > freedom:
            return [one]
    return best


def _freer_kind(loops: Loops, joints: Sequence[Joint], freedom: int, limit: float) -> str | None:
    """The words for a joint of another kind with which the loops move as they would with axes in line."""
    for joint in joints:
        free = {name for name, _ in joint.freedom}
        for kind in FREER if joint.free is None and joint.pitch is None else ():
            if free < set(KINDS[kind].free) and joint.point is not None:
                other = _joint.make(joint.name, kind, joint.first, joint.second, joint.point, joint.axes, None, None,
                                    None, None)  # fmt: skip
                if loops.with_joints([other]).freedom(limit) == freedom:
                    return f"make joint '{joint.name}' {kind}"
    return None
