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
class Virtual:
    """A motion of the bodies: those that are ``moved`` (bodies + 1,), 1 or -1 times, follow a twist (``linear``,
    ``angular``) of one rigid body about ``point``, and the tree adds ``follows`` (size,), if other bodies follow.
    ``opens`` is the number of the released joint, or None.
    """

    moved: Array
    linear: Array
    angular: Array
    point: Array
    opens: int | None = None
    follows: Array | None = None

    def full(self, rows: Rows) -> Array:
        """Return the displacements of the twist along the directions of rows, (rows,)."""
        turning = rows.moment + np.cross(rows.point - self.point[:, None], rows.force, axis=0)
        return np.asarray(self.linear @ rows.force + self.angular @ turning)

    def along(self, rows: Rows) -> Array:
        """Return the relative displacements of the rigid part along rows, (rows,)."""
        return np.asarray((self.moved[rows.second] - self.moved[rows.first]) * self.full(rows))

    def of_bodies(self, position: Array) -> Array:
        """Return the rigid part of displacements (bodies, 6) at centres of mass (bodies, 3)."""
        translation = np.cross(self.angular, position - self.point) + self.linear
        twists = np.concatenate((translation, np.broadcast_to(self.angular, translation.shape)), axis=1)
        return np.asarray(twists * self.moved[: len(position), None])

    def at(self, body: Index, point: Array) -> Array:
        """Return the rigid part of displacements of points (3, n) of bodies, (3, n)."""
        return np.asarray(self.moved[body] * (self.linear[:, None] + np.cross(self.angular, point.T - self.point).T))

    @property
    def turns(self) -> Array:
        """The rigid part of the rotations of bodies and ground, (bodies + 1, 3)."""
        return np.outer(self.moved, self.angular)

    def opened(self, joints: int) -> Array:
        """Return the rotations of released joints, (3, joints)."""
        result = np.zeros((3, joints))
        if self.opens is not None:
            result[:, self.opens] = self.angular
        return result


@dataclass(frozen=True, slots=True)
class Yielding:
    """A motion that releases ``joints`` (j,) of a region by ``gap`` (6, j), as ``displacements`` (bodies + 1, 6) of the
    bodies and the ground at ``centre`` (bodies + 1, 3).
    """

    displacements: Array
    centre: Array
    joints: Index
    gap: Array
    follows: None = None

    def along(self, rows: Rows) -> Array:
        """Return the relative displacements along rows, (rows,)."""
        shift = self.at(rows.second, rows.point) - self.at(rows.first, rows.point)
        turn = self.turns[rows.second] - self.turns[rows.first]
        return np.asarray((shift * rows.force).sum(axis=0) + (turn.T * rows.moment).sum(axis=0))

    def of_bodies(self, position: Array) -> Array:
        """Return the displacements (bodies, 6) at centres of mass (bodies, 3)."""
        return self.displacements[: len(position)]

    def at(self, body: Index, point: Array) -> Array:
        """Return the displacements of points (3, n) of bodies, (3, n)."""
        own = self.displacements[body]
        return np.asarray((own[:, :3] + np.cross(own[:, 3:], point.T - self.centre[body])).T)

    @property
    def turns(self) -> Array:
        """The rotations of bodies and ground, (bodies + 1, 3)."""
        return self.displacements[:, 3:]

    def opened(self, joints: int) -> Array:
        """Return the rotations of released joints, (3, joints)."""
        result = np.zeros((3, joints))
        result[:, self.joints] = self.gap[3:]
        return result


Motion = Virtual | Yielding


def all_turns(motion: Motion, layout: Layout) -> Array:
    """Return the rotations of bodies and ground in a motion, including those that follow, (bodies + 1, 3).

    Parameters
    ----------
    motion : Virtual or Yielding
        The motion.
    layout : Layout
        Positions of the unknowns.

    Returns
    -------
    array
        World axes.
    """
    turns = motion.turns
    if motion.follows is not None:
        column = layout.displacement[:, 3:]
        turns[:-1] += np.where(column >= 0, motion.follows[column], 0.0)
    return turns
