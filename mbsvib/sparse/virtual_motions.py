"""Virtual displacements that release joints: the work of all other forces in them is the force in the joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements.rows import Rows
    from mbsvib.sparse.layout import Layout


@dataclass(frozen=True, slots=True)
class JointRelease:
    """A motion of some bodies as one rigid body, with the twist ``linear``, ``angular`` about ``point``.

    ``sign`` (bodies + 1,) is 1 or -1 for these bodies and 0 for the others. ``tree_motion`` (size,) is an additional
    motion over the unknowns, None for none. ``released`` is the number of the released joint, or None.
    """

    sign: Array
    linear: Array
    angular: Array
    point: Array
    released: int | None = None
    tree_motion: Array | None = None

    def of_twist(self, rows: Rows) -> Array:
        """Return the displacements of the twist along the directions of rows, (rows,)."""
        moment = rows.moment + np.cross(rows.point - self.point[:, None], rows.force, axis=0)
        return np.asarray(self.linear @ rows.force + self.angular @ moment)

    def along(self, rows: Rows) -> Array:
        """Return the relative displacements of the rigid part along rows, (rows,)."""
        return np.asarray((self.sign[rows.second] - self.sign[rows.first]) * self.of_twist(rows))

    def of_bodies(self, position: Array) -> Array:
        """Return the rigid part of displacements (bodies, 6) at centres of mass (bodies, 3)."""
        translation = np.cross(self.angular, position - self.point) + self.linear
        twists = np.concatenate((translation, np.broadcast_to(self.angular, translation.shape)), axis=1)
        return np.asarray(twists * self.sign[: len(position), None])

    def at(self, body: Index, point: Array) -> Array:
        """Return the rigid part of displacements of points (3, n) of bodies, (3, n)."""
        return np.asarray(self.sign[body] * (self.linear[:, None] + np.cross(self.angular, point.T - self.point).T))

    @property
    def rotations(self) -> Array:
        """The rigid part of the rotations of bodies and ground, (bodies + 1, 3)."""
        return np.outer(self.sign, self.angular)

    def released_in(self, joints: int) -> Array:
        """Return the translations and rotations of released joints, (6, joints)."""
        result = np.zeros((6, joints))
        if self.released is not None:
            result[:, self.released] = *self.linear, *self.angular
        return result


@dataclass(frozen=True, slots=True)
class RegionRelease:
    """A motion that releases ``joints`` (j,) of a region by ``gap`` (6, j), as ``displacements`` (bodies + 1, 6) of the
    bodies and the ground at ``centre`` (bodies + 1, 3).
    """

    displacements: Array
    centre: Array
    joints: Index
    gap: Array
    tree_motion: None = None

    def along(self, rows: Rows) -> Array:
        """Return the relative displacements along rows, (rows,)."""
        translation = self.at(rows.second, rows.point) - self.at(rows.first, rows.point)
        rotation = self.rotations[rows.second] - self.rotations[rows.first]
        return np.asarray((translation * rows.force).sum(axis=0) + (rotation.T * rows.moment).sum(axis=0))

    def of_bodies(self, position: Array) -> Array:
        """Return the displacements (bodies, 6) at centres of mass (bodies, 3)."""
        return self.displacements[: len(position)]

    def at(self, body: Index, point: Array) -> Array:
        """Return the displacements of points (3, n) of bodies, (3, n)."""
        six = self.displacements[body]
        return np.asarray((six[:, :3] + np.cross(six[:, 3:], point.T - self.centre[body])).T)

    @property
    def rotations(self) -> Array:
        """The rotations of bodies and ground, (bodies + 1, 3)."""
        return self.displacements[:, 3:]

    def released_in(self, joints: int) -> Array:
        """Return the translations and rotations of released joints, (6, joints)."""
        result = np.zeros((6, joints))
        result[:, self.joints] = self.gap
        return result


Motion = JointRelease | RegionRelease


def all_rotations(motion: Motion, layout: Layout) -> Array:
    """Return the rotations (bodies + 1, 3) of bodies and ground in a motion, with those of ``tree_motion``."""
    rotations = motion.rotations
    if motion.tree_motion is not None:
        column = layout.displacement[:, 3:]
        rotations[:-1] += np.where(column >= 0, motion.tree_motion[column], 0.0)
    return rotations
