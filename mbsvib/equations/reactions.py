"""Reactions: from wrenches on the bodies to the wrench in every joint.

A joint of the tree transmits the sum of all forces on the bodies behind it, including forces of cut joints. With Phi
the locked rows of the cut joints and B' the motion of the bodies, both per joint coordinate,

    Phi^T lambda = -B'^T W

in the dependent coordinates. With redundant constraints lambda is not unique; the wrenches of least norm that balance
the bodies are taken (``self_stress``). The second-order terms do not depend on this choice.

Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), section 6.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from mbsvib.equations.force_paths import ForcePaths
from mbsvib.equations.self_stress import SelfStress, of_loops

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.kinematics.loops import Cuts, Reduction
    from mbsvib.kinematics.relative_motion import Twists


@dataclass(frozen=True)
class Reactions:
    """The map from body wrenches to joint wrenches: by the ``paths`` of the tree, and in loops by locked rows ``phi``.

    ``multiplier_wrenches`` (6 joints, locked rows) are the wrenches in all joints per unit of each multiplier.
    """

    paths: ForcePaths
    coordinates: Twists
    cuts: Cuts | None
    reduction: Reduction
    phi: Array
    multiplier_wrenches: Array

    @cached_property
    def stress(self) -> tuple[SelfStress, ...]:
        """States of self-stress of redundant constraints."""
        return tuple(of_loops(self.paths, self.cuts, self.reduction, self.phi, self.multiplier_wrenches))

    def with_loops(self, tree: Array, multipliers: Array | None = None) -> Array:
        """Return the wrenches in all joints for those of the open tree, both (6, joints, columns).

        Forces at the joints' points and moments about them, as they act on the joints' second bodies; first bodies take
        the opposite. ``multipliers``: those of ``tree``, if they are known.
        """
        if not self.multiplier_wrenches.shape[1]:
            return tree
        of_rows = self.multipliers(tree) if multipliers is None else multipliers
        return self.minimum_norm(tree + (self.multiplier_wrenches @ of_rows).reshape(tree.shape))

    def minimum_norm(self, wrench: Array) -> Array:
        """Return the wrenches of least norm with the same effect on the bodies, both (6, joints, columns)."""
        for stress in self.stress:
            wrench = stress.minimum_norm(wrench)
        return wrench

    def multipliers(self, tree: Array) -> Array:
        """Return lambda (locked rows, columns) for wrenches in the joints of the open tree (6, joints, columns); not
        unique where constraints are redundant.
        """
        assert self.cuts is not None
        twists, joint_of = np.concatenate((self.coordinates.linear, self.coordinates.angular)), self.paths.joint_of
        # unbalanced forces along the free directions of joints of the open tree; the last ones, of floating bodies, are
        # never dependent
        unbalanced = np.add.reduce(twists[:, :, None] * tree.take(joint_of, axis=1))
        return loop_multipliers(self.cuts, self.reduction, self.phi, unbalanced)


def loop_multipliers(cuts: Cuts, reduction: Reduction, phi: Array, forces: Array) -> Array:
    """Return lambda (locked rows, columns) with Phi^T lambda = forces (n, columns) in the dependent coordinates; not
    unique where constraints are redundant.
    """
    result = np.zeros((len(cuts.names), forces.shape[1]))
    dependent = np.ones(len(forces), dtype=bool)
    dependent[reduction.independent] = False
    for group in reduction.groups:
        columns = group.columns[dependent[group.columns]]
        if not len(columns):
            continue
        matrix = phi.take(group.rows, axis=0).take(columns, axis=1).T
        if matrix.shape[0] == matrix.shape[1]:
            result[group.rows] = lapack.dgesv(matrix, forces.take(columns, axis=0))[2]
            continue
        scale = group.length * cuts.row_scale(group.length)[group.rows]
        result[group.rows] = np.linalg.lstsq(matrix * scale, forces[columns], rcond=None)[0] * scale[:, None]
    return result


def reactions(
    paths: ForcePaths, coordinates: Twists, cuts: Cuts | None, reduction: Reduction, phi: Array,
    multiplier_wrenches: Array | None = None,
) -> Reactions:  # fmt: skip
    """Return the map from body wrenches to joint wrenches.

    ``phi`` (locked rows, n): locked rows per unit joint coordinate. ``multiplier_wrenches`` (6 joints, locked rows):
    ``paths.of_locked(cuts)``, if available.
    """
    multiplier_wrenches = paths.of_locked(cuts) if multiplier_wrenches is None else multiplier_wrenches
    return Reactions(paths, coordinates, cuts, reduction, phi, multiplier_wrenches)


