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
from mbsvib.sparse.virtual_motions import all_turns

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array
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
        """Return the work of the changes of forces by a motion, without the rotations of joint axes, (size,).

        Parameters
        ----------
        motion : Virtual or Yielding
            The motion that releases joints.

        Returns
        -------
        array
            The row over the unknowns.
        """
        applied, pairs, second_order = self.geometric.applied, self.geometric.pairs, self.geometric.second_order
        count, arm_a, arm_b = len(pairs.first), *self._arms
        f, t, along = pairs.force, pairs.torque, pairs.end - pairs.start
        turn_a, turn_b, gap = self._virtual(motion, along)
        lines = second_order.line_owner[::2]
        solid = np.ones(count)
        solid[: applied.loads] = solid[lines] = 0.0
        apart = turn_b - turn_a
        twisting = apart.copy()
        twisting[:, len(applied.names) :] -= motion.opened(count - len(applied.names))
        half = 0.5 * cross(t, twisting)
        self._two(half, twisting)
        lever = cross(f, turn_a)
        on_gap = -solid * lever
        direction = second_order.line[:, ::2]
        pull = (f[:, lines] * direction).sum(axis=0) / second_order.length[::2]
        on_gap[:, lines] += pull * (gap[:, lines] - direction * (direction * gap[:, lines]).sum(axis=0))
        on_a = solid * (cross(f, gap) + cross(t, apart) - half) - cross(arm_a, lever)
        on_a[:, lines] += cross(along[:, lines], on_gap[:, lines])
        on_b = solid * half + cross(arm_b, cross(f, turn_b))
        follower = np.zeros(count)
        follower[: applied.loads] = applied.follower
        on_b += follower * (cross(f, gap) + cross(t, apart))
        on_gap[:, self.geometric.carrier == pairs.first] = 0.0
        result: Array = self._gaps.T @ on_gap.T.reshape(-1)
        turns = np.zeros((len(self.tree.parent) + 1, 3))
        np.add.at(turns, pairs.first, on_a.T)
        np.add.at(turns, pairs.second, on_b.T)
        column = self.layout.displacement[:, 3:]
        result[column[column >= 0]] += turns[:-1][column >= 0]
        return result

    def _virtual(self, motion: Motion, along: Array) -> tuple[Array, Array, Array]:
        """Rotations of first and second and the gap between start and end of each force in a motion, (3, pairs)."""
        pairs = self.geometric.pairs
        turns = all_turns(motion, self.layout)
        gap: Array = motion.at(pairs.second, pairs.end) - motion.at(pairs.first, pairs.start)
        if motion.follows is not None:
            swing = (turns - motion.turns)[pairs.first].T
            gap = gap + (self._gaps @ motion.follows).reshape(-1, 3).T + cross(swing, along)
        return turns[pairs.first].T, turns[pairs.second].T, gap

    def _two(self, half: Array, twisting: Array) -> None:
        """Joints with two successive rotations: the moment that holds the angle between them turns with both."""
        second_order, torque = self.geometric.second_order, self.geometric.pairs.torque
        if not second_order.successive.size:
            return
        who, first, second = second_order.successive
        first_axis, second_axis = second_order.rows.moment[:, first], second_order.rows.moment[:, second]
        size, turn = 0.5 * (torque[:, who] * second_order.cross).sum(axis=0), twisting[:, who]
        half[:, who] -= size * ((first_axis * turn).sum(axis=0) * second_axis
                                + (second_axis * turn).sum(axis=0) * first_axis)  # fmt: skip

    def on_ground(self, wrench: Array) -> Array:
        """Return the change of the sum of gravity and loads by a motion, moments about the origin, as a row (size,).

        Parameters
        ----------
        wrench : array, shape (6,)
            Direction of the output.

        Returns
        -------
        array
            The row over the unknowns.
        """
        applied, pairs, n = self.geometric.applied, self.geometric.pairs, len(self.tree.parent)
        loads = slice(0, applied.loads)
        second = np.concatenate((pairs.second[loads], np.arange(n)))
        point = np.concatenate((pairs.end[:, loads], self.tree.position.T), axis=1)
        force = cross(np.concatenate((pairs.force[:, loads], applied.weight[:, :-1]), axis=1), wrench[3:, None])
        rows = Rows(np.full(len(second), n), second, point, force, np.zeros_like(force))
        result = np.asarray(relative_rows(self.tree, self.layout, rows).sum(axis=0)).reshape(-1)
        at = wrench[:3, None] + cross(wrench[3:, None], pairs.end[:, loads])
        rotated = cross(pairs.force[:, loads], at) + cross(pairs.torque[:, loads], wrench[3:, None])
        turns = np.zeros((n + 1, 3))
        np.add.at(turns, pairs.second[loads], (applied.follower * rotated).T)
        column = self.layout.displacement[:, 3:]
        result[column[column >= 0]] += turns[:-1][column >= 0]
        return result
