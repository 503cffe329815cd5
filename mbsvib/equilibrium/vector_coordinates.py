"""Joint coordinates whose finite values are not sums of their steps: rotation vectors, and arcs of rods.

A step of the coordinates of such a joint changes their values v by dv = J dq, where J depends on v. A joint of which
loops tie some coordinates is held at the values of the others by steps of v; where all of a joint are tied, or none,
there is nothing to hold.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.rotations import LEAST, inverse_jacobian, logarithm

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Joint
    from mbsvib.kinematics.pose import Pose
    from mbsvib.kinematics.relative_motion import Twists
    from mbsvib.mechanism.mechanism import Mechanism

FULL_TURN = 2.0 * np.pi


@dataclass(frozen=True, slots=True)
class Block:
    """Coordinates of a ``joint`` that are one vector: their numbers ``columns`` (k,) and directions ``axes`` (3, k).

    They are components of a rotation vector if ``turns``; else of an arc on the sphere about the first end of a rod.
    """

    joint: Joint
    columns: Index
    axes: Array
    turns: bool

    def values(self, pose: Pose, near: Array) -> Array:
        """Return the values (k,) [rad, m] in a pose, of a rotation vector those next to ``near`` (k,), nan: any."""
        if not self.turns:
            start, tangent, _, angle = self._arc(pose)
            return np.asarray(self.axes.T @ tangent * angle * np.linalg.norm(start))
        w = self._vector(pose)
        angle = float(np.linalg.norm(w))
        further = w * (1.0 - FULL_TURN / max(angle, LEAST))  # the same rotation
        return np.asarray(min((self.axes.T @ w, self.axes.T @ further), key=lambda x: np.nanmax(np.abs(x - near))))

    def rates(self, pose: Pose, coordinates: Twists, values: Array) -> Array:
        """Return J (k, k) at ``values`` (k,): how fast the values change per unit rate of the coordinates."""
        twists = coordinates.angular if self.turns else coordinates.linear
        relative = pose.rotations[pose.number[self.joint.first]].T @ twists[:, self.columns]
        if self.turns:
            return np.asarray(self.axes.T @ inverse_jacobian(self.axes @ values) @ relative)
        start, tangent, end, angle = self._arc(pose)
        normal = np.cross(start, tangent) / np.linalg.norm(start)
        along, across = np.cross(normal, end) @ relative / np.linalg.norm(end), normal @ relative
        return np.asarray(np.outer(self.axes.T @ tangent, along)
                          + np.outer(self.axes.T @ normal, across / np.sinc(angle / np.pi)))  # fmt: skip

    def _vector(self, pose: Pose) -> Array:
        first, second = (pose.rotations[pose.number[body]] for body in (self.joint.first, self.joint.second))
        return logarithm(first.T @ second)

    def _arc(self, pose: Pose) -> tuple[Array, Array, Array, float]:
        """The rod before, the unit tangent of its arc there, and the rod in the pose, all in axes of the first body;
        and the angle between both.
        """
        first, second = pose.number[self.joint.first], pose.number[self.joint.second]
        ends = np.array((self.joint.position, self.joint.end))
        a, b = pose.points(np.array((first, second)), ends)
        start, end = ends[1] - ends[0], pose.rotations[first].T @ (b - a)
        ahead = end - start * (start @ end) / (start @ start)
        if np.linalg.norm(ahead) <= LEAST:
            ahead = self.axes[:, 0]
        angle = np.arctan2(np.linalg.norm(np.cross(start, end)), start @ end)
        return start, ahead / np.linalg.norm(ahead), end, float(angle)


@dataclass(frozen=True, slots=True)
class Held:
    """Coordinates that are held while others of the same vectors follow.

    ``target`` (n,) [m, rad]: the values of those that are held, nan for those that follow.
    """

    blocks: tuple[Block, ...]
    target: Array

    def at(self, target: Array) -> Held:
        """Return the same with other values (n,)."""
        return replace(self, target=np.where(np.isnan(self.target), np.nan, target))

    def lag(self, pose: Pose) -> Array:
        """Return what held coordinates lack of their target (n,), 0 for all others."""
        result = np.zeros(len(self.target))
        for block in self.blocks:
            target = self.target[block.columns]
            result[block.columns] = np.nan_to_num(target - block.values(pose, target))
        return result

    def steps(self, pose: Pose, coordinates: Twists, changes: Array) -> Array:
        """Return the steps of the coordinates (n,) or (n, r) that change their values by ``changes``: J^-1 dv."""
        result = changes.copy() if self.blocks else changes
        for block in self.blocks:
            values = block.values(pose, self.target[block.columns])
            rates = block.rates(pose, coordinates, values)
            result[block.columns] = np.linalg.solve(rates, changes[block.columns])
        return result


def held_vectors(model: Mechanism, coordinates: Twists, moves: Array) -> Held:
    """Return the joints that have to be held at some of their coordinates, at 0.

    ``moves`` (n,): which joint coordinates follow; all others are held.
    """
    index_of = {name: k for k, name in enumerate(coordinates.names)}
    blocks = [block for joint in model.joints.values() for block in _blocks(joint, index_of)]
    partly = [block for block in blocks if moves[block.columns].any() and not moves[block.columns].all()]
    return Held(tuple(partly), np.where(moves, np.nan, 0.0))


def _blocks(joint: Joint, index_of: dict[str, int]) -> list[Block]:
    """The vectors of a joint of the tree."""
    named = [(index_of.get(f"{joint.name}.{name}"), name[0] == "r", six) for name, six in joint.freedom]
    vectors = [turns for turns in (True, False) if (joint.turns_by_vector if turns else joint.is_rod)]
    result = []
    for turns in vectors:
        some = [(k, six[3:] if turns else six[:3]) for k, is_turn, six in named if k is not None and is_turn == turns]
        if some:
            columns, axes = zip(*some, strict=True)
            result.append(Block(joint, np.array(columns, dtype=np.intp), np.array(axes).T, turns))
    return result
