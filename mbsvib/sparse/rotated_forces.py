"""Changes of the forces at the pose by a motion, for outputs that are forces: directions and lever arms change.

They are the second derivatives of ``core.shift_forms`` by the virtual displacement that releases a joint, and by the
unknowns: vectors for every force, summed to one row.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.core.shift_forms import duals, own_curvatures, twists_of
from mbsvib.elements.rows import Rows
from mbsvib.kinematics.mobility import crossed_product as cross
from mbsvib.sparse.rows import relative_rows
from mbsvib.sparse.virtual_motions import all_rotations

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Joint
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

    def of_joints(self, motion: Motion) -> Array:
        """Return the work of the changes of forces by a motion, without the rotations of joint axes, (size,).

        A released joint moves before its own coordinates do, and turns their axes.
        """
        pairs, count = self.geometric.pairs, len(self.geometric.applied.names)
        f, m = pairs.force, pairs.torque
        turn_a, turn_b, gap = self._virtual(motion)
        delta, released = turn_b - turn_a, np.zeros((6, len(pairs.first)))
        released[:, count:] = motion.released_in(self.geometric.joints.shape[1])
        # moments in joints are about points of their carriers, mostly the second bodies, which slide
        slides = self.geometric.carrier != pairs.first
        on_gap = -cross(f, turn_a + np.where(slides, 0.0, released[3:]))
        on_delta = -0.5 * cross(m, turn_a + released[3:])
        on_a, on_b = cross(f, gap) + 0.5 * cross(m, delta), np.zeros_like(f)
        centre = np.concatenate((self.tree.position, np.zeros((1, 3)))).T
        for on_body, body, turn, sign in ((on_a, pairs.first, turn_a, 1.0), (on_b, pairs.second, turn_b, -1.0)):
            arm = pairs.end - centre[:, body]
            form = (f * arm).sum(axis=0) * turn
            form -= 0.5 * (f * (arm * turn).sum(axis=0) + arm * (f * turn).sum(axis=0))
            on_body += sign * form
        xi = np.concatenate((delta, gap)).T
        own = np.zeros_like(xi)
        own[:count] = -(self.geometric.hessian.swapaxes(1, 2) @ xi[:count, :, None])[:, :, 0]
        for alike, numbers, curvature in self._curvatures:
            at = count + numbers
            dual = duals(twists_of(alike))[:, :, : curvature.shape[-1]]
            value = np.einsum("in,nifg->nfg", np.concatenate((m, f))[:, at], curvature)
            step = (xi - np.roll(released, 3, axis=0).T)[at, :, None]
            own[at] -= (dual @ (value @ (dual.swapaxes(1, 2) @ step)))[:, :, 0]
        on_delta, on_gap = on_delta + own[:, :3].T, on_gap + own[:, 3:].T
        result: Array = self._gaps.T @ on_gap.T.reshape(-1)
        self._add_moments(result, np.concatenate((pairs.first, pairs.second)),
                          np.concatenate(((on_a - on_delta).T, (on_b + on_delta).T)))  # fmt: skip
        return result

    @cached_property
    def _curvatures(self) -> list[tuple[list[Joint], Index, Array]]:
        return own_curvatures(self.geometric.parts)

    def _add_moments(self, row: Array, body: Index, moment: Array) -> None:
        """Add moments (n, 3) on bodies (n,) to a row over the unknowns."""
        moments = np.zeros((len(self.tree.parent) + 1, 3))
        np.add.at(moments, body, moment)
        column = self.layout.displacement[:, 3:]
        row[column[column >= 0]] += moments[:-1][column >= 0]

    def _virtual(self, motion: Motion) -> tuple[Array, Array, Array]:
        """Rotations of first and second bodies and the gap between them at each force in a motion, (3, pairs)."""
        pairs = self.geometric.pairs
        rotations = all_rotations(motion, self.layout)
        gap: Array = motion.at(pairs.second, pairs.end) - motion.at(pairs.first, pairs.end)
        if motion.tree_motion is not None:
            gap = gap + (self._gaps @ motion.tree_motion).reshape(-1, 3).T
        return rotations[pairs.first].T, rotations[pairs.second].T, gap

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
