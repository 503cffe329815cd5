"""Loops that lock because the axis of a joint is a little out of line with those of others.

Constraints that are redundant where axes are parallel, or normal to each other, become independent by any small angle,
and take a degree of freedom away. A loop with a small pivot is tried again with its axes in line: where this frees a
motion, the joint, the angle and the motion are named.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import joint as _joint
from mbsvib.elements.joint_kinds import KINDS
from mbsvib.equations.scene import cut_rows
from mbsvib.errors import NearSingularWarning, counted
from mbsvib.kinematics.couplers import with_couplers
from mbsvib.kinematics.relative_motion import relative_motion, twists
from mbsvib.linalg.rank import (
    ALIGNED,
    ALMOST_ALIGNED,
    NEAR_SINGULAR,
    NEARLY_LOCKED,
    NEARLY_REDUNDANT,
    RANK_FACTOR,
    RANK_GAP,
)  # fmt: skip
from mbsvib.linalg.rotations import exponential
from mbsvib.mechanism.topology import span

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from mbsvib.common.arrays import Array
    from mbsvib.elements import Joint
    from mbsvib.kinematics.loop_group import LoopGroup
    from mbsvib.mechanism.mechanism import Mechanism

# Groups of loops with more coordinates are not tried again, nor more groups: each takes some milliseconds.
MOST_COORDINATES, MOST_GROUPS = 200, 16
# Names of coordinates in a message.
LISTED = 6
# Kinds that free what an angle locks, those that free least first.
FREER = ("cylindrical", "spherical", "point_on_line")


@dataclass(frozen=True, slots=True)
class Loops:
    """A group of loops of a ``model`` without other parts; ``length`` [m] is its unit of length."""

    model: Mechanism
    length: float

    def with_joints(self, joints: Iterable[Joint]) -> Loops:
        """Return the same with other joints in place of those of the same name."""
        return replace(self, model=self.model.with_parts(
            joints=dict(self.model.joints) | {joint.name: joint for joint in joints}))  # fmt: skip

    def closure(self) -> tuple[Array, tuple[str, ...], int]:
        """Return the scaled Phi, the names of its coordinates, and how many of these are of floating bodies."""
        model, topology, bodies = self.model, span(self.model), list(self.model.bodies.values())
        number = topology.body_numbers
        coordinates, cuts = twists(topology, bodies), cut_rows(topology, bodies, number)
        if model.couplers:
            cuts = with_couplers(cuts, tuple(model.couplers.values()), topology, bodies, number, coordinates)
        floating, n = 6 * len(topology.floating), len(coordinates.names)
        if cuts is None:
            return np.zeros((0, n)), coordinates.names, floating
        phi = relative_motion(coordinates, cuts.rows).dense(0, len(cuts.rows.first))
        if cuts.couplings is not None:
            phi = np.concatenate((phi, cuts.couplings.dense(coordinates)))
        scale = np.where(coordinates.turns, 1.0, self.length)
        return phi * cuts.row_scale(self.length)[:, None] * scale, coordinates.names, floating

    def freedom(self, limit: float) -> int:
        """Return the number of degrees of freedom, with singular values up to a limit as zero."""
        phi, names, floating = self.closure()
        return len(names) - floating - int(np.count_nonzero(np.linalg.svd(phi, compute_uv=False) > limit))

    def locked_motion(self, aligned: Loops, limit: float) -> list[str]:
        """Return the coordinates that move most in what the loops lock and others, in line, do not."""
        phi, names, _ = aligned.closure()
        _, values, rows = np.linalg.svd(phi)
        free = rows[int(np.count_nonzero(values > limit)) :]
        motion = np.abs(np.linalg.svd(self.closure()[0] @ free.T)[2][0] @ free)
        return [names[k] for k in np.argsort(-motion, kind="stable")[:LISTED] if motion[k] > ALMOST_ALIGNED]


def check_loops(model: Mechanism | None, groups: Sequence[LoopGroup], names: Sequence[str], stacklevel: int) -> None:
    """Warn of loops that lock a motion by a small angle, and of poses that are nearly singular otherwise.

    ``names`` are those of all joint coordinates. Without a ``model`` axes are not looked at.
    """
    small = [group for group in groups if group.retained < NEARLY_LOCKED]
    for k, group in enumerate(sorted(small, key=attrgetter("retained"))):
        text = None
        if model is not None and k < MOST_GROUPS:
            text = _by_an_angle(model, group, [names[column] for column in group.columns.tolist()])
        if text is None and group.retained < NEAR_SINGULAR:
            text = near_singular(group)
        if text is None and group.retained < NEARLY_REDUNDANT and group.rank == len(group.columns):
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
    couplers = {part.name: part for part in model.couplers.values() if part.name in group.joints}
    names = [*names, *(name for part in couplers.values() for name, _ in part.terms)]
    members = {*group.joints, *(name.rpartition(".")[0] for name in names)}
    joints = [joint for joint in model.joints.values() if joint.name in members or not joint.freedom]
    if not len(joints) > 1 or len(names) > MOST_COORDINATES:
        return None
    bodies = {body for joint in joints for body in (joint.first, joint.second)}
    loops = Loops(model.with_parts(
        bodies={name: body for name, body in model.bodies.items() if name in bodies},
        joints={joint.name: joint for joint in joints}, springs={}, composed={}, loads={}, inputs={}, outputs={},
        gravity=None, couplers=couplers, expansion=None), group.length)  # fmt: skip
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
        f"with all its digits{'' if kind is None else f', or {kind}'}."
    )


def _aligned(loops: Loops, joints: list[Joint], limit: float, freedom: int) -> list[tuple[Joint, float]] | None:
    """The joints in line and the angles by which they were not: the fewest that free the loops; None if none do."""
    best: list[tuple[Joint, float]] | None = None
    for reference in _different([direction for joint in joints for direction in _directions(joint)]):
        turned = [(after, angle) for joint in joints for after, angle in (_in_line(joint, reference),) if angle > 0.0]
        if turned and (best is None or len(turned) < len(best)) and loops.with_joints(
                [joint for joint, _ in turned]).freedom(limit) > freedom:  # fmt: skip
            best = turned
    for one in sorted(best or (), key=lambda pair: -pair[1]):
        if loops.with_joints([one[0]]).freedom(limit) > freedom:
            return [one]
    return best


def _different(directions: list[Array]) -> list[Array]:
    """Directions of which no two are parallel."""
    result: list[Array] = []
    for direction in directions:
        if not any(np.linalg.norm(np.cross(direction, other)) < ALIGNED for other in result):
            result.append(direction)
    return result


def _directions(joint: Joint) -> list[Array]:
    """The axes that matter for what a joint locks: of one rotation or translation, or normal to two."""
    if joint.is_rod:
        return []
    result: list[Array] = []
    turns = [np.array(axis) for axis in joint.rotation_axes]
    slides = [np.array(six[:3]) for name, six in joint.freedom if name[0] != "r"]
    for some, successive in ((turns, joint.successive), (slides, False)):
        if len(some) == 2:
            result += some if successive else [np.cross(some[0], some[1])]
        elif len(some) == 1:
            result += some
    return _different(result)


def _in_line(joint: Joint, reference: Array) -> tuple[Joint, float]:
    """The joint turned so that its axes are along or across a direction, where they nearly are; and the angle [rad]."""
    largest = 0.0
    for k in range(len(_directions(joint))):
        direction = _directions(joint)[k]
        along = float(direction @ reference)
        across = direction - along * reference
        off = float(np.linalg.norm(across))
        if off < ALMOST_ALIGNED:
            target = np.copysign(1.0, along) * reference
        elif abs(along) < ALMOST_ALIGNED:
            target, off = across / off, abs(along)
        else:
            continue
        normal = np.cross(direction, target)
        sine = float(np.linalg.norm(normal))
        if off > ALIGNED and sine > 0.0:
            joint = _turned(joint, exponential(normal / sine * np.arcsin(min(1.0, sine))))
            largest = max(largest, float(np.arcsin(min(1.0, sine))))
    return joint, largest


def _turned(joint: Joint, rotation: Array) -> Joint:
    """The joint with all its axes turned about its point."""
    if joint.successive and joint.free is None:
        first, second = (tuple((rotation @ np.array(axis)).tolist()) for axis in joint.rotation_axes)
        return _joint.moved_joint(joint, joint.position, axis=first, axis2=second)
    x, y, z = (rotation @ np.array(joint.axes)).tolist()
    return _joint.moved_joint(joint, joint.position, axes=(tuple(x), tuple(y), tuple(z)))


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
