"""Alignment: axes of joints in loops that are meant to be parallel, on one line or through one point are taken as such.

Axes of a loop that are parallel but for a small angle lock it, exactly. Within a tolerance they are turned to the mean
direction of their cluster, moved to the mean line, or moved to one common point, but only in loops that gain degrees of
freedom by it, and as few of these changes as that takes. Bodies do not move. Eigenvalues are then those of a mechanism
that differs by these angles and shifts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import ceil, log10
from typing import TypeVar

import numpy as np

from mbsvib.common.arguments import number
from mbsvib.common.arrays import Array
from mbsvib.elements import Joint
from mbsvib.elements.joint import moved_joint
from mbsvib.equations.expansion import expanded
from mbsvib.equations.loop_geometry import Loops, directions, in_line, loops_of
from mbsvib.equations.scene import twists_and_cuts
from mbsvib.errors import ModelError
from mbsvib.kinematics.loops import loop_groups, measures
from mbsvib.linalg.groups import part_numbers
from mbsvib.linalg.rank import RANK_FACTOR, RANK_GAP
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import span

# The largest tolerance [rad]: three degrees; larger angles are seen in a drawing, and are meant.
LARGEST = 0.05
# Angles and shifts that a tolerance of the same printed value is to cover exceed it by their rounding.
SLACK = 1.0 + 1e-6
# Loops with more coordinates than this need dense factors of some seconds each: they are refused.
MOST_COORDINATES = 1500

M = TypeVar("M", bound="Mechanism")
Joints = dict[str, "Joint"]


@dataclass(frozen=True, slots=True)
class Alignment:
    """How a joint was aligned: turned by ``angle`` [rad], moved by ``shift`` [m]."""

    joint: str
    """Name of the joint."""
    angle: float
    shift: float

    @property
    def named(self) -> str:
        """The joint, with its angle and shift."""
        parts = [f"{self.angle:.3g} rad"] if self.angle else []
        return f"joint '{self.joint}' by {' and '.join(parts + ([f'{self.shift:.3g} m'] if self.shift else []))}"

    @property
    def explained(self) -> str:
        """The same as a sentence."""
        parts = [f"turned by {self.angle:.3g} rad"] if self.angle else []
        return f"{self.joint}: {' and '.join(parts + ([f'moved by {self.shift:.3g} m'] if self.shift else []))}"

    def size(self, length: float) -> float:
        """Return the tolerance that covers it, in loops of a ``length`` [m]."""
        return max(self.angle, self.shift / length)


def advice(size: float) -> str:
    """Return the words that tell a user of the tolerance for angles and shares of lengths up to ``size``."""
    tolerance = min(LARGEST, 10.0 ** ceil(log10(2.0 * size)))
    return f"Or take such axes as meant to be aligned: linearize(align={tolerance:.3g})."


def aligned(model: M, tolerance: float) -> M:
    """Return a mechanism with its loops aligned, named in its ``alignments``; without changes it is the same object.

    ``tolerance``, between 0 and 0.05: the largest angle of axes from their mean [rad], and the largest distance of axes
    from a common line or point as a share of the largest distance between joints of the loops. A group of loops that is
    too large is refused.
    """
    tolerance = number(tolerance, "linearize", "align", "an angle [rad] above 0, at most 0.05 (three degrees)")
    if not 0.0 < tolerance <= LARGEST:
        raise ModelError(f"linearize: align = {tolerance:g}; expected an angle [rad] above 0, at most {LARGEST} (three "
                         f"degrees): larger angles are geometry.", element="linearize", field="align")  # fmt: skip
    result: list[tuple[Joint, Alignment]] = []
    for loops, noise in _groups(expanded(model)):
        result += aligned_loops(loops, set(model.joints), tolerance, RANK_FACTOR * noise)
    if not result:
        return model
    changed = model.with_changed({joint.name: joint for joint, _ in result})
    changed.__setstate__({"_alignments": (*model.alignments, *[change for _, change in result])})
    return changed


def _groups(model: Mechanism) -> Iterator[tuple[Loops, float]]:
    """Groups of loops by themselves, with the rounding of the entries of their rows."""
    topology, bodies = span(model), list(model.bodies.values())
    coordinates, cuts = twists_and_cuts(topology, bodies, tuple(model.couplers.values()))
    if cuts is None:
        return
    count = len(cuts.rows.first)
    for rows, columns in loop_groups(coordinates, cuts):
        if len(columns) > MOST_COORDINATES:
            raise ModelError(f"linearize: align: loops of {len(columns)} coordinates hang together; up to "
                             f"{MOST_COORDINATES} can be aligned. Align their joints in the model.",
                             element="linearize", field="align")  # fmt: skip
        points = np.concatenate((cuts.rows.point[:, rows[rows < count]], coordinates.point[:, columns]), axis=1)
        spare = partial(cuts.spare_length, coordinates.point, coordinates.pitch, rows)
        length, noise = measures(points, max(len(rows), len(columns)), spare)
        names = [coordinates.names[k] for k in columns.tolist()]
        yield loops_of(model, [cuts.joints[k] for k in set(cuts.joint[rows].tolist())], names, length), noise


def aligned_loops(loops: Loops, allowed: set[str], tolerance: float, limit: float) -> list[tuple[Joint, Alignment]]:
    """Return the joints of a group of loops as aligned, and what was changed: nothing unless this gives freedom.

    ``allowed``: joints that may be changed; ``limit``: singular values of the scaled rows up to this are zero.
    """
    before = {name: joint for name, joint in loops.model.joints.items()
              if name in allowed and joint.freedom and not joint.is_rod}  # fmt: skip
    points = np.array([joint.position for joint in before.values() if joint.position is not None]).reshape(-1, 3)
    size = max((float(np.linalg.norm(points - point, axis=1).max()) for point in points), default=0.0)
    freedom, best, chosen = loops.freedom(limit), loops.freedom(limit), None
    reach = tolerance * size * SLACK
    for stages in ((_parallel,), (_parallel, _coaxial), (_concurrent,), (_parallel, _coaxial, _concurrent)):
        steps, after = [], before
        for stage in stages:
            for step in stage(after, tolerance * SLACK, reach):
                steps.append(step)
                after = after | step(after)
        gained = loops.with_joints(after.values()).freedom(limit) if steps else freedom
        if gained > best:
            best, chosen = gained, steps
    if chosen is None:
        return []
    for step in list(chosen):  # what gives nothing back is undone
        others = [one for one in chosen if one is not step]
        if loops.with_joints(_after(before, others).values()).freedom(limit) == best:
            chosen = others
    after = _after(before, chosen)
    moved = [name for name, joint in after.items() if joint is not before[name]
             and _change(before[name], joint).size(size or 1.0) > RANK_GAP * limit]  # fmt: skip
    for names in (*_parallel_joints([before[name] for name in moved], limit), *([name] for name in moved)):
        fewer = after | {name: before[name] for name in names}
        if loops.with_joints(fewer.values()).freedom(limit) == best:
            after = fewer
    changes = [(joint, _change(before[name], joint)) for name, joint in after.items() if joint is not before[name]]
    return [(joint, change) for joint, change in changes if change.angle or change.shift]


def _parallel_joints(joints: list[Joint], limit: float) -> list[list[str]]:
    """Names of joints whose axes are parallel as they are, so that some of them alone would lock the others."""
    owners = [(joint.name, direction) for joint in joints for direction in directions(joint)]
    axes = np.array([direction for _, direction in owners]).reshape(-1, 3)
    near = np.linalg.norm(np.cross(axes[:, None], axes[None]), axis=2) <= limit
    return [[owners[k][0] for k in group] for group in _connected(near) if len(group) > 1]


def _after(joints: Joints, steps: list[Callable[[Joints], Joints]]) -> Joints:
    for step in steps:
        joints = joints | step(joints)
    return joints


def _change(before: Joint, after: Joint) -> Alignment:
    shift = 0.0
    if before.position is not None and after.position is not None:
        shift = float(np.linalg.norm(np.subtract(after.position, before.position)))
    pairs = zip(directions(before), directions(after), strict=True)
    return Alignment(before.name, max((_angle(a, b) for a, b in pairs), default=0.0), shift)


def _angle(a: Array, b: Array) -> float:
    return float(np.arcsin(min(1.0, float(np.linalg.norm(np.cross(a, b))))))


def _parallel(joints: Joints, tolerance: float, _reach: float) -> Iterator[Callable[[Joints], Joints]]:
    """Turn axes to the mean direction of their cluster, and those that are nearly normal to it to its normal plane."""
    owners = [(joint.name, direction) for joint in joints.values() for direction in directions(joint)]
    references: list[Array] = []
    means = _clusters(np.array([direction for _, direction in owners]).reshape(-1, 3), tolerance)
    for _, mean in sorted(means, key=lambda pair: (-len(pair[0]), min(pair[0]))):
        reference = mean
        for other in references:  # larger clusters first: those normal to them are so exactly
            if abs(reference @ other) < tolerance:
                reference = reference - (reference @ other) * other
                reference /= np.linalg.norm(reference)
        references.append(reference)
        reach = tolerance + float(np.linalg.norm(np.cross(mean, reference)))

        def step(now: Joints, reference: Array = reference, reach: float = reach) -> Joints:
            return {name: after for name, joint in now.items()
                    for after, angle in (in_line(joint, reference, reach),) if angle}  # fmt: skip

        yield step


def _clusters(vectors: Array, tolerance: float) -> list[tuple[list[int], Array]]:
    """Members and mean of clusters of directions without sign, each within a tolerance of the mean."""
    sines = np.linalg.norm(np.cross(vectors[:, None], vectors[None]), axis=2)
    result = []
    for members in _connected(sines <= 2.0 * tolerance):
        while True:
            some = vectors[members]
            mean = np.linalg.svd(some)[2][0]
            off = np.linalg.norm(np.cross(some, mean), axis=1)
            if off.max() <= tolerance:
                break
            members = [k for k in members if k != members[int(off.argmax())]]
        result.append((members, mean))
    return result


def _connected(near: Array) -> list[list[int]]:
    label = part_numbers(near)
    return [np.flatnonzero(label == k).tolist() for k in range(label.max(initial=-1) + 1)]


def _line(joint: Joint) -> Array | None:
    """The direction of the only axis about which a joint turns, if it slides along nothing but it; else None."""
    axes, slides = joint.rotation_axes, [six[:3] for name, six in joint.freedom if name[0] != "r"]
    if len(axes) != 1 or joint.position is None or any(abs(np.dot(axes[0], slide)) < 1.0 - LARGEST for slide in slides):
        return None
    return np.array(axes[0])


def _is_ball(joint: Joint) -> bool:
    return len(joint.rotation_axes) == 3 and len(joint.freedom) == 3 and joint.position is not None


def _shifted(joint: Joint, shift: Array) -> Joint:
    """The joint with its point moved."""
    x, y, z = (np.array(joint.position) + shift).tolist()
    return moved_joint(joint, (x, y, z), axes=joint.axes)


def _coaxial(joints: Joints, tolerance: float, reach: float) -> Iterator[Callable[[Joints], Joints]]:
    """Move parallel axes that are nearly on one line to their mean line, and ball joints beside it onto it; ball joints
    that are nearly on a line parallel to them to their own.
    """
    lines = [(name, line) for name, joint in joints.items() for line in (_line(joint),) if line is not None]
    balls = [name for name, joint in joints.items() if _is_ball(joint)]
    for members, mean in _clusters(np.array([line for _, line in lines]).reshape(-1, 3), tolerance):
        names = [lines[k][0] for k in members] + balls
        points = np.array([joints[name].position for name in names])
        across = points - np.outer(points @ mean, mean)
        for group in _connected(np.linalg.norm(across[:, None] - across[None], axis=2) <= 2.0 * reach):
            shifts = across[group].mean(axis=0) - across[group]
            if np.linalg.norm(shifts, axis=1).max() <= reach:
                yield _shift({names[k]: shift for k, shift in zip(group, shifts, strict=True)})


def _shift(shifts: dict[str, Array]) -> Callable[[Joints], Joints]:
    return lambda now: {name: _shifted(now[name], shift) for name, shift in shifts.items() if shift.any()}


def _concurrent(joints: Joints, tolerance: float, reach: float) -> Iterator[Callable[[Joints], Joints]]:
    """Move axes that nearly pass through one point so that they do: through the point of least squares."""
    known = [(name, line) for name, joint in joints.items() for line in (_line(joint),) if line is not None]
    names, axes = [name for name, _ in known], np.array([line for _, line in known]).reshape(-1, 3)
    points = np.array([joints[name].position for name in names]).reshape(-1, 3)
    left = list(range(len(names)))
    while len(left) > 2:
        best: list[int] = []
        for i, j in ((i, j) for i in left for j in left if i < j):
            if np.linalg.norm(np.cross(axes[i], axes[j])) > LARGEST:
                off = _offsets(_meeting(points[[i, j]], axes[[i, j]]), points[left], axes[left])
                near = [k for k, one in zip(left, np.linalg.norm(off, axis=1), strict=True) if one <= 2.0 * reach]
                best = near if len(near) > len(best) else best
        if len(best) < 3:
            return
        shifts = _offsets(_meeting(points[best], axes[best]), points[best], axes[best])
        if np.linalg.norm(shifts, axis=1).max() <= reach:
            yield _shift({names[k]: shift for k, shift in zip(best, shifts, strict=True)})
        left = [k for k in left if k not in best]


def _meeting(points: Array, axes: Array) -> Array:
    """The point with the least sum of squared distances from lines."""
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    result: Array = np.linalg.solve(across.sum(axis=0), np.einsum("nij,nj->i", across, points))
    return result


def _offsets(point: Array, points: Array, axes: Array) -> Array:
    """Vectors from lines to a point."""
    off = point - points
    result: Array = off - np.einsum("ni,ni->n", off, axes)[:, None] * axes
    return result
