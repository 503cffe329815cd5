"""Reactions: from wrenches on the bodies to the wrench in every joint.

A joint of the tree carries all that acts on what hangs behind it; the forces of the cut joints, which close the loops,
act there too. With Phi the locked rows of the cut joints and B' the motion of the bodies, both per joint coordinate,

    Phi^T lambda = -B'^T W

in the coordinates that depend on the loops. Where constraints are redundant many lambda hold the bodies; of all the
wrenches in joints that they bring those of least norm are taken (``self_stress``). The second-order terms are the same
with all of them.

Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), section 6.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack

from mbsvib.equations.joint_carriers import Carriers
from mbsvib.equations.self_stress import of_loops

if TYPE_CHECKING:

    from mbsvib.common.arrays import Array
    from mbsvib.equations.self_stress import SelfStress
    from mbsvib.kinematics.loops import Cuts, Reduction
    from mbsvib.kinematics.relative_motion import Twists


@dataclass(frozen=True, slots=True)
class Reactions:
    """The way from body wrenches to joint wrenches: by ``carriers``, and in loops by the locked rows ``phi``.

    ``loops`` (6 joints, locked rows) are the wrenches in all joints that one unit of each multiplier brings, ``stress``
    what redundant constraints leave open.
    """

    carriers: Carriers
    coordinates: Twists
    cuts: Cuts | None
    reduction: Reduction
    phi: Array
    loops: Array
    stress: tuple[SelfStress, ...]

    def __call__(self, wrench: Array) -> Array:
        """Return the wrenches in the joints that balance wrenches on the bodies.

        Parameters
        ----------
        wrench : array, shape (6, bodies + 1, columns)
            Forces [N] and moments about the centres of mass [N m] on the bodies, world axes, ground last.

        Returns
        -------
        array, shape (6, joints, columns)
            Force at the joint's point and moment about it, as they act on the joint's second body; its first body
            takes the opposite.
        """
        return self.closed(self.carriers.of_tree(wrench))

    def closed(self, tree: Array) -> Array:
        """Return the wrenches in all joints for those of the open tree, both (6, joints, columns)."""
        if not self.loops.shape[1]:
            return tree
        return self.least(tree + (self.loops @ self.multipliers(tree)).reshape(tree.shape))

    def least(self, wrench: Array) -> Array:
        """Return the wrenches of least norm that do the same in all joints, both (6, joints, columns)."""
        for stress in self.stress:
            wrench = stress.least(wrench)
        return wrench

    def multipliers(self, tree: Array) -> Array:
        """Return lambda (locked rows, columns) for wrenches in the joints of the open tree (6, joints, columns); any
        that will do where constraints are redundant.
        """
        assert self.cuts is not None
        twist, at = np.concatenate((self.coordinates.linear, self.coordinates.angular)), self.carriers.joint_of
        # what the open tree's joints lack along their own free directions; of floating bodies, last, nothing depends
        held = np.add.reduce(twist[:, :, None] * tree.take(at, axis=1))
        result = np.zeros((len(self.cuts.names), tree.shape[2]))
        dependent = np.ones(len(at), dtype=bool)
        dependent[self.reduction.independent] = False
        for group in self.reduction.groups:
            columns = group.columns[dependent[group.columns]]
            if not len(columns):
                continue
            matrix = self.phi.take(group.rows, axis=0).take(columns, axis=1).T
            if matrix.shape[0] == matrix.shape[1]:
                result[group.rows] = lapack.dgesv(matrix, held.take(columns, axis=0))[2]
                continue
            scale = group.length * self.cuts.row_scale(group.length)[group.rows]
            result[group.rows] = np.linalg.lstsq(matrix * scale, held[columns], rcond=None)[0] * scale[:, None]
        return result


def reactions(
    carriers: Carriers, coordinates: Twists, cuts: Cuts | None, reduction: Reduction, phi: Array,
    loops: Array | None = None,
) -> Reactions:  # fmt: skip
    """Return the way from body wrenches to joint wrenches.

    Parameters
    ----------
    carriers : Carriers
        What topology and geometry say of it.
    coordinates : Twists
        The joint coordinates.
    cuts : Cuts or None
        Locked rows of the cut joints, and couplers.
    reduction : Reduction
        The minimal coordinates.
    phi : array, shape (locked rows, n)
        Locked rows per unit joint coordinate.
    loops : array, shape (6 joints, locked rows), optional
        ``carriers.of_locked(cuts)``, where it is known already.

    Returns
    -------
    Reactions
        To be called with wrenches on the bodies.
    """
    loops = carriers.of_locked(cuts) if loops is None else loops
    stress = of_loops(carriers, cuts, reduction, phi, loops)
    return Reactions(carriers, coordinates, cuts, reduction, phi, loops, tuple(stress))


