"""The forces at the pose of a loaded scene, with the geometry that their work to second order asks for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from mbsvib.linalg.vectors import cross, dot, incidence_sum, moved, moved_wrench, wide

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.linalg.vectors import Field


@dataclass(frozen=True)
class Forces:
    """Forces at the pose (n,), world axes: in joints, in springs and bushings, then weights, then loads.

    ``wrench`` (n, 6) acts at ``point`` (n, 3) on the body ``second`` (n,), its opposite on ``first`` (bodies: ground),
    ``centre`` (bodies, 3) are the centres of mass. ``span`` (n, 3) leads from the start to the end of rods and line
    springs, whose force acts at their end, and is 0 elsewhere; ``axes`` (n, 2, 3) are those of joints with two
    successive rotations, 0 elsewhere; ``halves`` number the homokinetic joints, which have turned by ``angle``
    (halves, 3) [rad] since they were described. ``counts`` are the numbers of joints, springs, weights and loads,
    ``gravity`` (3,) is the acceleration of free fall. ``dead`` and ``follower`` number the loads that stay fixed in the
    world and in the body.
    """

    first: Index
    second: Index
    point: Array
    wrench: Array
    span: Array
    axes: Array
    halves: Index
    angle: Array
    centre: Array
    counts: tuple[int, int, int, int]
    gravity: Array
    dead: Index
    follower: Index

    @cached_property
    def length(self) -> Array:
        """Lengths (n,) of rods and line springs [m], infinite elsewhere."""
        length = np.linalg.norm(self.span, axis=1)
        return np.where(length > 0.0, length, np.inf)

    @cached_property
    def line(self) -> Array:
        """Directions (n, 3) of rods and line springs, 0 elsewhere."""
        return self.span / self.length[:, None]

    @cached_property
    def tension_over_length(self) -> Array:
        """T / L (n,) of rods and line springs [N/m], 0 elsewhere."""
        return np.asarray(-(self.wrench[:, :3] * self.line).sum(axis=1) / self.length)

    @cached_property
    def normal(self) -> Array:
        """Products a x b (n, 3) of two successive rotations, 0 elsewhere."""
        return np.cross(self.axes[:, 0], self.axes[:, 1])

    @cached_property
    def picks(self) -> tuple[Array, Array]:
        """Vectors (n, 3) that pick x_a and x_b out of a relative rotation, 0 elsewhere."""
        a, b = self.axes[:, 0], self.axes[:, 1]
        square = (self.normal * self.normal).sum(axis=1)[:, None]
        share = np.divide(1.0, square, out=np.zeros_like(square), where=square > 0.0)
        return share * np.cross(b, self.normal), share * np.cross(self.normal, a)

    @cached_property
    def twice(self) -> Index:
        """Numbers of the joints with two successive rotations."""
        return np.flatnonzero(self.normal.any(axis=1))

    @cached_property
    def lines(self) -> Index:
        """Numbers of the rods and line springs."""
        return np.flatnonzero(np.isfinite(self.length))

    @property
    def loads(self) -> Index:
        """Numbers of the loads, which come last."""
        return np.arange(len(self.first) - self.counts[3], len(self.first))

    @cached_property
    def bushings(self) -> Index:
        """Numbers of the bushings."""
        joints, springs, *_ = self.counts
        return np.setdiff1d(np.arange(joints, joints + springs), self.lines)

    @cached_property
    def _incidences(self) -> tuple[csr_array, csr_array]:
        """Which forces act on bodies (bodies, n), as on the second and as on the first."""
        bodies, every = len(self.centre), np.arange(len(self.first))

        def incidence(which: Index) -> csr_array:
            moves = which < bodies
            return csr_array((np.ones(moves.sum()), (which[moves], every[moves])), shape=(bodies, len(every)))

        return incidence(self.second), incidence(self.first)

    def relative_motions(self, body: Field) -> tuple[Field, Field]:
        """Return what forces see of motions of the bodies at their points (n, 6, ...): that of their first body and the
        relative one.

        ``body`` (bodies, 6, ...): motions at the centres of mass.
        """
        first, second = self._at(self.first, body), self._at(self.second, body)
        return first, second - first

    def _at(self, which: Index, body: Field) -> Field:
        moves = which < len(self.centre)
        result = np.zeros((len(which), *body.shape[1:]), dtype=body.dtype)
        result[moves] = moved(body[which[moves]], self._arms(which)[moves])
        return result

    def _arms(self, which: Index) -> Array:
        """From the centres of mass of bodies (n,) to the points of the forces (n, 3); 0 for ground."""
        centre = np.concatenate((self.centre, np.zeros((1, 3))))
        return np.where((which < len(self.centre))[:, None], self.point - centre[which], 0.0)

    @cached_property
    def couple(self) -> Array:
        """Products t . (a x b) of joints with two successive rotations, (joints, 1)."""
        return np.asarray((self.wrench[self.twice, 3:] * self.normal[self.twice]).sum(axis=1, keepdims=True))

    @cached_property
    def applied(self) -> Array:
        """Wrenches (bodies, 6) of all forces but those in joints, at the centres of mass."""
        wrench = self.wrench.copy()
        wrench[: self.counts[0]] = 0.0
        return np.asarray(self.onto_bodies(-wrench, wrench))

    def onto_bodies(self, on_first: Field, on_second: Field) -> Field:
        """Return sums (bodies, 6, ...) of wrenches (n, 6, ...) on first and second bodies, at the centres of mass."""
        second, first = self._incidences
        return self._summed(second, self.second, on_second) + self._summed(first, self.first, on_first)

    def _summed(self, incidence: csr_array, which: Index, wrench: Field) -> Field:
        flat = wrench.reshape(len(wrench), 6, prod(wrench.shape[2:]))
        total = incidence_sum(incidence, moved_wrench(flat, self._arms(which)))
        return total.reshape(len(self.centre), *wrench.shape[1:])

    def turned_axes(self, relative: Field) -> Field:
        """Return how the axes of joints turn against their first bodies (n, 3, ...), 0 of all but two kinds.

        Those of successive rotations turn about the first axis. Those of homokinetic joints turn with exp(w / 2), w
        the rotation since the joint was described: by 1/2 (r - tan(|w| / 4) (w / |w|) x r) where exp(w) goes on by r.
        """
        result = np.zeros((len(relative), 3, *relative.shape[2:]), dtype=relative.dtype)
        k, rotation = self.twice, relative[self.twice, 3:]
        result[k] = dot(wide(self.picks[0][k], rotation), rotation) * wide(self.axes[k, 0], rotation)
        rotation, size = relative[self.halves, 3:], np.linalg.norm(self.angle, axis=1, keepdims=True)
        half = self.angle * np.divide(np.tan(0.25 * size), size, out=np.zeros_like(size), where=size > 0.0)
        result[self.halves] = 0.5 * (rotation - cross(wide(half, rotation), rotation))
        return result
