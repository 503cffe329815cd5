"""Positions of the joints of a file in which its loops are closed; nearly all files are open in their zero pose.

The gap of a loop is what its two frames differ by in the locked directions of its kind, in the axes of the first frame:
d = A1^T (p2 - p1), and of the relative rotation R = A1^T A2 its rotation vector, or the vector s that turns the common
axis by the shortest way, or the cosine of the angle of two axes. Derivatives are exact.
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.errors import ModelError
from mbsvib.linalg.rotations import inverse_jacobian, logarithm, skew
from mbsvib.urdf.least_norm import PRINTED, close
from mbsvib.urdf.loops import Loop
from mbsvib.urdf.motion import FREEDOMS, SLIDES, Hinge, moved, rates
from mbsvib.urdf.reading import Robot

Frames = dict[str, tuple[Array, Array]]

# Axes that differ by less have no direction in which to turn [rad].
IN_LINE = 1e-14
# A coordinate acts on a gap where its slope is above this share of the largest.
ACTS = 1e-6


def followed(robot: Robot, name: str) -> tuple[float, float, str]:
    """Return factor, offset and name of the joint that a joint mimics in the end, itself if none."""
    factor, offset = 1.0, 0.0
    while (mimic := robot.joints[name].mimic) is not None:
        factor, offset, name = factor * mimic.factor, offset + factor * mimic.offset, mimic.joint
    return factor, offset, name


class Assembly:
    """A robot whose loops are to be closed; ``held`` are joints whose positions are given."""

    def __init__(self, robot: Robot, positions: Mapping[str, Array], held: Mapping[str, float]) -> None:
        self.robot, self.held = robot, held
        self.joint_of = {joint.child: joint for joint in robot.joints.values()}
        self.column: dict[str, int] = {}
        count = 0
        for name, joint in robot.joints.items():
            self.column[name] = count
            count += FREEDOMS[joint.kind]
        frames = link_frames(robot, positions)
        points = np.array([frames[link][0] + frames[link][1] @ at for loop in robot.loops
                           for link, (at, _) in zip(loop.links, loop.frames, strict=True)]
                          + [frame[0] for frame in frames.values()])  # fmt: skip
        self.size = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
        self.scale = np.ones(count)
        for name, joint in robot.joints.items():
            start = self.column[name]
            self.scale[start : start + SLIDES.get(joint.kind, 0)] = self.size
        self.start = np.concatenate([positions[name] for name in robot.joints] or [np.zeros(0)])
        self.follow = self._following()

    def _following(self) -> Array:
        """dq / dx (n, n): joints that mimic others have columns of zeros, and rows of those that they follow."""
        result = np.eye(len(self.scale))
        for name, joint in self.robot.joints.items():
            factor, _, leader = followed(self.robot, name)
            if leader != name and FREEDOMS[joint.kind]:
                result[self.column[name]] = 0.0
                result[self.column[name], self.column[leader]] = factor
        return result

    def closed(self, path: str | PathLike[str]) -> tuple[dict[str, Array], dict[str, float]]:
        """Return positions that close all loops, and the gaps of those that printed digits leave open [rad, sizes]."""
        free = np.abs(self.follow).max(axis=0, initial=0.0) > 0.0
        for name in self.held:
            free[self.column[name]] = False
        x = close(self._evaluate, self.start / self.scale, free)
        positions = self._positions(x)
        gap, slopes = self._evaluate(x)
        worst = {name: float(np.abs(gap[rows]).max(initial=0.0)) for name, rows in self._rows().items()}
        name = max(worst, key=lambda loop: worst[loop])
        if worst[name] > PRINTED:
            raise self._open(path, name, positions, slopes[self._rows()[name]])
        return positions, {name: value for name, value in worst.items() if value > 0.0}

    def _positions(self, x: Array) -> dict[str, Array]:
        q = self.start + self.follow @ (x * self.scale - self.start)
        return {name: q[self.column[name] : self.column[name] + FREEDOMS[joint.kind]]
                for name, joint in self.robot.joints.items()}  # fmt: skip

    def _rows(self) -> dict[str, slice]:
        rows: dict[str, slice] = {}
        count = 0
        for name, size in [(loop.name, ROWS[loop.kind]) for loop in self.robot.loops] + [
                (part.name, 1) for part in self.robot.couplings]:  # fmt: skip
            rows[name] = slice(count, count + size)
            count += size
        return rows

    def _evaluate(self, x: Array) -> tuple[Array, Array]:
        """The gaps of all loops and couplings, and their Jacobian, in units of 1 rad and the size."""
        positions = self._positions(x)
        frames = link_frames(self.robot, positions)
        gaps, slopes = [np.zeros(0)], [np.zeros((0, len(x)))]
        for loop in self.robot.loops:
            (p1, a1), (p2, a2) = ends(loop, frames)
            (v1, w1), (v2, w2) = (self._twist(link, point, positions, frames)
                                  for link, point in zip(loop.links, (p1, p2), strict=True))  # fmt: skip
            rows, values = _locked(loop, a1.T @ a2)
            between = p2 - p1
            gap = np.concatenate((rows @ a1.T @ between / self.size, values[:, 0]))
            along = a1.T @ (v2 - v1 + skew(between) @ w1)
            gaps.append(gap)
            slopes.append(np.vstack((rows @ along / self.size, values[:, 1:] @ a1.T @ (w2 - w1))))
        for part in self.robot.couplings:
            row, shift = np.zeros((1, len(x))), 0.0
            for name, ratio in coupled(self.robot, part.links, part.ratio).items():
                row[0, self.column[name]] = ratio
                shift += ratio * float(positions[name][0])
            unit = max(np.abs(row[0] * self.scale))
            gaps.append(np.array((shift / unit,)))
            slopes.append(row / unit)
        return np.concatenate(gaps), np.vstack(slopes) @ self.follow * self.scale

    def _twist(self, link: str, point: Array, positions: Mapping[str, Array], frames: Frames) -> tuple[Array, Array]:
        """Velocity of a point of a link and angular velocity (3, n) per unit rate of all coordinates."""
        velocity, spin = np.zeros((3, len(self.scale))), np.zeros((3, len(self.scale)))
        while (joint := self.joint_of.get(link)) is not None:
            if FREEDOMS[joint.kind]:
                axes = frames[joint.parent][1] @ joint.axes
                linear, angular = rates(joint, positions[joint.name])
                columns = slice(self.column[joint.name], self.column[joint.name] + linear.shape[1])
                spin[:, columns] = axes @ angular
                velocity[:, columns] = axes @ linear - skew(point - frames[link][0]) @ spin[:, columns]
            link = joint.parent
        return velocity, spin

    def _open(self, path: str | PathLike[str], name: str, positions: dict[str, Array], slopes: Array) -> ModelError:
        loop = next((loop for loop in self.robot.loops if loop.name == name), None)
        if loop is None:
            what = f"coupling '{name}' is not kept"
        else:
            (p1, a1), (p2, a2) = ends(loop, link_frames(self.robot, positions))
            rows, turned = _locked(loop, a1.T @ a2)[0], _locked(loop, a1.T @ a2)[1][:, 0]
            apart = float(np.linalg.norm(rows @ a1.T @ (p2 - p1)))
            what = f"loop '{name}' stays open by {apart:.3g} m and {np.linalg.norm(turned):.3g} rad"
        limit = ACTS * np.abs(slopes).max(initial=0.0)
        by = [repr(joint) for joint in self.held if np.abs(slopes[:, self.column[joint]]).max() > limit]
        if by:
            way = f"The pose of {', '.join(by)} holds it open; change it, or leave one of them to follow."
        else:
            way = "No positions of its joints near the pose close it; check its frames, or give a pose nearby."
        return ModelError(f"{path}: {what}. {way}", element=name, field="pose")


# Locked directions of each kind.
ROWS = {"fixed": 6, "spherical": 3, "revolute": 5, "prismatic": 5, "universal": 4, "planar": 3}


def _locked(loop: Loop, turn: Array) -> tuple[Array, Array]:
    """Locked translations (rows, 3) of a loop; its angular gaps with their slopes to a small turn (rows, 1 + 3).

    All are in the axes of the first frame, ``turn`` is the relative rotation there.
    """
    along, none = loop.axis, np.zeros((0, 4))
    across = np.array(check.frame_along(tuple(along.tolist()))).T[:2]
    if loop.kind == "spherical":
        return np.eye(3), none
    if loop.kind == "universal":
        second = turn @ loop.axis2
        return np.eye(3), np.concatenate(((along @ second,), np.cross(second, along)))[None]
    if loop.kind in ("fixed", "prismatic"):
        w = logarithm(turn)
        return (np.eye(3) if loop.kind == "fixed" else across), np.column_stack((w, inverse_jacobian(w)))
    moves = np.eye(3) if loop.kind == "revolute" else along[None]
    return moves, across @ _swing(along, turn @ along)


def _swing(a: Array, b: Array) -> Array:
    """s = t n with t the angle from a to b about n = a x b / |a x b|, and its slopes to turns of b, as (3, 1 + 3).

    ds = n (n . w) + (t / sin t) (a x n) (b x n) . w
    """
    normal = np.cross(a, b)
    sine, cosine = float(np.linalg.norm(normal)), float(a @ b)
    if sine < IN_LINE:
        normal, sine = np.array(check.frame_along(tuple(a.tolist())))[:, 0], 0.0
    else:
        normal = normal / sine
    angle = float(np.arctan2(sine, cosine))
    stretch = angle / sine if sine else 1.0
    slopes = np.outer(normal, normal) + stretch * np.outer(np.cross(a, normal), np.cross(b, normal))
    return np.column_stack((angle * normal, slopes))


def ends(loop: Loop, frames: Frames) -> list[tuple[Array, Array]]:
    """Return position and axes of both frames of a loop in the world."""
    return [(frames[link][0] + frames[link][1] @ at, frames[link][1] @ axes)
            for link, (at, axes) in zip(loop.links, loop.frames, strict=True)]  # fmt: skip


def coupled(robot: Robot, links: tuple[str, str], ratio: float) -> dict[str, float]:
    """Return the coefficients of the joints that a coupling ties: from where the ways to both links part."""
    joint_of = {joint.child: joint for joint in robot.joints.values()}
    ways: list[list[Hinge]] = []
    for end in links:
        link, way = end, []
        while link in joint_of:
            way.append(joint_of[link])
            link = way[-1].parent
        ways.append(way)
    result: dict[str, float] = {}
    for way, other, factor in ((ways[0], ways[1], ratio), (ways[1], ways[0], -1.0)):
        for joint in way:
            if joint not in other and FREEDOMS[joint.kind]:
                result[joint.name] = factor
    return result


def link_frames(robot: Robot, positions: Mapping[str, Array]) -> Frames:
    """Return the world position and axes of each link's frame, parents before children."""
    children: dict[str, list[Hinge]] = {}
    for joint in robot.joints.values():
        children.setdefault(joint.parent, []).append(joint)
    frames = {robot.root: (np.zeros(3), np.eye(3))}
    stack = [robot.root]
    while stack:
        link = stack.pop()
        origin, axes = frames[link]
        for joint in reversed(children.get(link, [])):
            at, joint_axes = moved(joint, positions[joint.name])
            frames[joint.child] = (origin + axes @ at, axes @ joint_axes)
            stack.append(joint.child)
    return frames
