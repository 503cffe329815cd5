"""The forces at the pose of a loaded scene, collected from its equations, with the geometry that their work to second
order asks for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from mbsvib.elements import Bushing
from mbsvib.elements.load import Gravity
from mbsvib.linalg.rotations import logarithm
from mbsvib.linalg.vectors import cross, dot, incidence_sum, moved, moved_wrench, wide
from mbsvib.sensitivities.displaced_bodies import Displaced

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.common.arrays import Array, Index
    from mbsvib.elements import Body, Joint, Load, Spring
    from mbsvib.equations.equations import Equations
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
        """Return what forces see of motions of the bodies, of their first body and the relative one (n, 6, ...).

        ``body`` (bodies, 6, ...): motions at the centres of mass. Returns (n, 6, ...): at the points of the forces.
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


def forces_at_rest(
    system: Equations, bodies: Sequence[Body], joints: Sequence[Joint], springs: Sequence[Bushing | Spring],
    loads: Sequence[Load], number: dict[str, int], point: Array,
) -> Forces:  # fmt: skip
    """Return the forces at the pose of a system.

    They act in joints and springs, and come of gravity and loads; ``point`` (joints + springs, 3) are the points of the
    connections.
    """
    statics, parts = system.provenance.statics, system.provenance.parts
    gravity = next((np.array(part.acceleration) for part in parts if isinstance(part, Gravity)), np.zeros(3))
    ground, j = len(bodies), len(joints)
    connections = (*joints, *springs)
    n = len(connections) + len(bodies) + len(loads)
    wrench, points, span, axes = np.zeros((n, 6)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 2, 3))
    first, second = np.full(n, ground), np.empty(n, dtype=np.intp)
    first[: len(connections)] = [number[part.first] for part in connections]
    second[:] = [*(number[part.second] for part in connections), *range(ground), *(number[p.body] for p in loads)]
    points[: len(connections)] = point
    halves = np.array([k for k, joint in enumerate(joints) if joint.kind == "homokinetic"], dtype=np.intp)
    for k, joint in enumerate(joints):
        if statics is not None:
            at = statics.pairs.end[:, len(statics.applied.names) + k]
            wrench[k] = statics.joints[:, k]
            wrench[k, 3:] += np.cross(at - points[k], wrench[k, :3])
        if joint.end is not None:
            span[k] = np.subtract(joint.end, joint.position or np.zeros(3))
        if joint.successive:
            axes[k] = [six[3:] for _, six in joint.freedom[-2:]]
    for k, spring in enumerate(springs, j):
        if isinstance(spring, Bushing):
            preload = np.array(spring.preload or np.zeros(6)).reshape(2, 3)
            wrench[k] = (preload @ np.array(spring.orientation).T).reshape(6)
        else:
            points[k], span[k] = spring.end, np.subtract(spring.end, spring.start)
            wrench[k, :3] = -spring.tension * np.array(spring.line)
    for k, body in enumerate(bodies, len(connections)):
        points[k], wrench[k, :3] = body.position, body.mass * gravity
    for k, load in enumerate(loads, len(connections) + len(bodies)):
        points[k] = bodies[number[load.body]].position if load.position is None else load.position
        wrench[k] = *load.force, *load.torque
    follows = np.array([load.follower for load in loads], dtype=bool)
    every = np.arange(n - len(loads), n)
    angle = _angles(system, bodies, [joints[k] for k in halves])
    centre = np.array([body.position for body in bodies])
    return Forces(first, second, points, wrench, span, axes, halves, angle, centre,
                  (j, len(springs), ground, len(loads)), gravity, every[~follows], every[follows])  # fmt: skip


def _angles(system: Equations, bodies: Sequence[Body], joints: Sequence[Joint]) -> Array:
    """The rotation vectors (joints, 3) by which joints turned on the way to the equilibrium, world axes there."""
    provenance, angle = system.provenance, np.zeros((len(joints), 3))
    if provenance.moved_to_equilibrium and provenance.origin is not None:
        pose = Displaced(provenance.origin, {body.name: body for body in bodies})
        for k, joint in enumerate(joints):
            angle[k] = logarithm(pose.turn(joint.second) @ pose.turn(joint.first).T)
    return angle
