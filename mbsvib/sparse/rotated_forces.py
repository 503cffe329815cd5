"""Changes of the forces at the pose by a motion, for outputs that are forces: directions and lever arms change.

The terms are those of the dense path (``equations/joint_forces.py``), each multiplied by the virtual displacement that
releases a joint: vectors for every force, summed to one row over the unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.rows import Rows
from mbsvib.kinematics.mobility import crossed_product as cross
from mbsvib.sparse.rows import relative_rows
from mbsvib.sparse.virtual_motions import all_rotations

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.sparse.layout import Layout
    from mbsvib.sparse.loads import Geometric
    from mbsvib.sparse.tree import Tree
    from mbsvib.sparse.virtual_motions import Motion


@dataclass(frozen=True)
class RotatedForces:
    """Changes of the balanced forces at the pose, in ``geometric``, over the unknowns of the tableau."""

    tree: Tree
    layout: Layout
    geometric: Geometric

    @cached_property
    def _gaps(self) -> csr_matrix:
        """Relative displacement of each pair's bodies at the end of the force, three rows a pair."""
        pairs = self.geometric.pairs
        count = len(pairs.first)
        axes, end = np.tile(np.eye(3), count), pairs.end.repeat(3, axis=1)
        rows = Rows(pairs.first.repeat(3), pairs.second.repeat(3), end, axes, np.zeros_like(axes))
        return relative_rows(self.tree, self.layout, rows)

    @cached_property
    def _arms(self) -> tuple[Array, Array]:
        return self.geometric.pairs.arms(np.concatenate((self.tree.position, np.zeros((1, 3)))).T)

    def of_joints(self, motion: Motion) -> Array:
        """Return the work of the changes of forces by a motion, without the rotations of joint axes, (size,)."""
        applied, pairs, second_order = self.geometric.applied, self.geometric.pairs, self.geometric.second_order
        count, arm_a, arm_b = len(pairs.first), *self._arms
        f, t, along = pairs.force, pairs.torque, pairs.end - pairs.start
        rotation_a, rotation_b, gap = self._virtual(motion, along)
        lines = second_order.line_owner[::2]
        rotates_with_first = np.ones(count)
        rotates_with_first[: applied.loads] = rotates_with_first[lines] = 0.0
        relative = rotation_b - rotation_a
        twist = relative.copy()
        twist[:, len(applied.names) :] -= motion.released_rotations(count - len(applied.names))
        half = 0.5 * cross(t, twist)
        self._add_successive(half, twist)
        lever = cross(f, rotation_a)
        on_gap = -rotates_with_first * lever
        direction = second_order.line[:, ::2]
        tension = (f[:, lines] * direction).sum(axis=0) / second_order.length[::2]
        on_gap[:, lines] += tension * (gap[:, lines] - direction * (direction * gap[:, lines]).sum(axis=0))
        on_a = rotates_with_first * (cross(f, gap) + cross(t, relative) - half) - cross(arm_a, lever)
        on_a[:, lines] += cross(along[:, lines], on_gap[:, lines])
        on_b = rotates_with_first * half + cross(arm_b, cross(f, rotation_b))
        follower = np.zeros(count)
        follower[: applied.loads] = applied.follower
        on_b += follower * (cross(f, gap) + cross(t, relative))
        on_gap[:, self.geometric.carrier == pairs.first] = 0.0
        result: Array = self._gaps.T @ on_gap.T.reshape(-1)
        self._add_moments(result, np.concatenate((pairs.first, pairs.second)), np.concatenate((on_a.T, on_b.T)))
        return result

    def _add_moments(self, row: Array, body: Index, moment: Array) -> None:
        """Add moments (n, 3) on bodies (n,) to a row over the unknowns."""
        moments = np.zeros((len(self.tree.parent) + 1, 3))
        np.add.at(moments, body, moment)
        column = self.layout.displacement[:, 3:]
        row[column[column >= 0]] += moments[:-1][column >= 0]

    def _virtual(self, motion: Motion, along: Array) -> tuple[Array, Array, Array]:
        """Rotations of first and second and the gap between start and end of each force in a motion, (3, pairs)."""
        pairs = self.geometric.pairs
        rotations = all_rotations(motion, self.layout)
        gap: Array = motion.at(pairs.second, pairs.end) - motion.at(pairs.first, pairs.start)
        if motion.tree_motion is not None:
            added = (rotations - motion.rotations)[pairs.first].T
            gap = gap + (self._gaps @ motion.tree_motion).reshape(-1, 3).T + cross(added, along)
        return rotations[pairs.first].T, rotations[pairs.second].T, gap

    def _add_successive(self, half: Array, twist: Array) -> None:
        """Joints with two successive rotations: the moment on the angle between both axes rotates with both."""
        second_order, torque = self.geometric.second_order, self.geometric.pairs.torque
        if not second_order.successive.size:
            return
        pair, first, second = second_order.successive
        first_axis, second_axis = second_order.rows.moment[:, first], second_order.rows.moment[:, second]
        size, relative = 0.5 * (torque[:, pair] * second_order.cross).sum(axis=0), twist[:, pair]
        half[:, pair] -= size * ((first_axis * relative).sum(axis=0) * second_axis
                                 + (second_axis * relative).sum(axis=0) * first_axis)  # fmt: skip

    def on_ground(self, wrench: Array) -> Array:
        """Return the change of the sum of gravity and loads along a wrench (6,) about the origin by a motion, (size,).
        """
        applied, pairs, n = self.geometric.applied, self.geometric.pairs, len(self.tree.parent)
        loads = slice(0, applied.loads)
        second = np.concatenate((pairs.second[loads], np.arange(n)))
        point = np.concatenate((pairs.end[:, loads], self.tree.position.T), axis=1)
        force = cross(np.concatenate((pairs.force[:, loads], applied.weight[:, :-1]), axis=1), wrench[3:, None])
        rows = Rows(np.full(len(second), n), second, point, force, np.zeros_like(force))
        result = np.asarray(relative_rows(self.tree, self.layout, rows).sum(axis=0)).reshape(-1)
        at_end = wrench[:3, None] + cross(wrench[3:, None], pairs.end[:, loads])
        moment = cross(pairs.force[:, loads], at_end) + cross(pairs.torque[:, loads], wrench[3:, None])
        self._add_moments(result, pairs.second[loads], (applied.follower * moment).T)
        return result
