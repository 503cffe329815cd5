"""The forces at the pose of a loaded scene, and their work H(x, y) on small motions to second order, with derivatives.

H is the geometric stiffness. Bodies move by exponentials of twists. A force f and torque t at p on a second body, that
go with the first one as those of joints and bushings do, see its motion (v, w) at p and the relative one (V, W) to
second order; between motions x, y

H = f . (w_x x V_y - W_x x v_y - W_x x V_y) / 2 + t . (w_x x W_y) / 2 + the same with x and y exchanged

and across a line e of length L that carries T, T/L V_x . (1 - e e^T) V_y more. With two successive rotations about a
and b, by x_a and x_b, half of t . (a x b) (x_a y_b + x_b y_a) is added. Weights and dead forces are forces against
ground. What has no potential is antisymmetric: t . (w_x x W_y) / 2 of dead torques, -f . (w_x x v_y - w_y x v_x) / 2 -
t . (w_x x w_y) / 2 of forces and torques that follow their body, all of their part. At rest, where the forces on every
body cancel, the sum of H is the geometric stiffness.

Source: Baker-Campbell-Hausdorff, log(exp(-x) exp(y)) = y - x - [x, y] / 2, put into the Lagrangian.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np
from scipy.sparse import csr_array

from mbsvib.common.arrays import Array, Index
from mbsvib.linalg.vectors import Field, cross, dot, incidence_sum, moved, moved_wrench, wide


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


def motion_slopes(forces: Forces, relative_motions: tuple[Field, Field], side: int = 0) -> tuple[Field, Field]:
    """Return the derivatives (n, 6, ...) of H(x, y) to what forces see of one motion, for what they see of the other:
    to that of the first body, and to the relative one.

    ``relative_motions`` (n, 6, ...): what they see of the other; ``side``: 1: that is y; -1: that is x; 0: both are the
    same motion, for which nothing antisymmetric counts.
    """
    (first, relative), like = relative_motions, relative_motions[0]
    f, t = wide(forces.wrench[:, :3], like), wide(forces.wrench[:, 3:], like)
    v, w, rv, rw = first[:, :3], first[:, 3:], relative[:, :3], relative[:, 3:]
    across = rv - wide(forces.line, like) * dot(wide(forces.line, like), rv)
    on_first = 0.5 * np.concatenate((cross(rw, f), cross(rw, t) + cross(rv, f)), axis=1)
    on_both = 0.5 * np.concatenate((cross(f, w - rw), cross(t, w) + cross(f, v + rv)), axis=1)
    on_both[:, :3] += wide(forces.tension_over_length[:, None], like) * across
    if len(forces.twice):
        on_both[forces.twice, 3:] += 0.5 * wide(forces.couple, like) * _coupled(forces, rw[forces.twice])
    k = forces.follower
    on_both[k] = 0.0
    if side:
        on_both[forces.dead, 3:] += 0.5 * side * cross(rw, t)[forces.dead]
        on_both[k, :3] = 0.5 * side * cross(f[k], rw[k])
        on_both[k, 3:] = -0.5 * side * (cross(rw[k], t[k]) + cross(rv[k], f[k]))
    return on_first, on_both


def geometric_wrenches(forces: Forces, body: Field, side: int, turned: Field | None = None) -> Field:
    """Return the wrenches (bodies, 6, ...) at the centres of mass by which forces answer motions, as springs do;
    ``side`` as of ``motion_slopes``, joints ``turned`` open (joints, 3, ...): t . (turned x W) / 2 more in H.
    """
    on_first, on_both = motion_slopes(forces, forces.relative_motions(body), side)
    if turned is not None:
        joints = forces.counts[0]
        on_both[:joints, 3:] += 0.5 * cross(wide(forces.wrench[:joints, 3:], turned), turned)
    return forces.onto_bodies(on_first - on_both, on_both)


def wrench_slopes(forces: Forces, x: tuple[Field, Field], y: tuple[Field, Field] | None) -> Field:
    """Return the derivatives of H(x, y) to the wrenches, (n, 6, ...), by which bodies give way. None: y = x."""
    same, y = y is None, x if y is None else y
    (a, r), (b, s) = x, y
    force = 0.5 * (cross(a[:, 3:], s[:, :3]) - cross(s[:, 3:], a[:, :3]) + cross(b[:, 3:], r[:, :3])
                   - cross(r[:, 3:], b[:, :3]) - cross(r[:, 3:], s[:, :3]) - cross(s[:, 3:], r[:, :3]))  # fmt: skip
    torque = 0.5 * (cross(a[:, 3:], s[:, 3:]) + cross(b[:, 3:], r[:, 3:]))
    line = wide(forces.line, force)
    across = dot(r[:, :3], s[:, :3]) - dot(line, r[:, :3]) * dot(line, s[:, :3])
    force -= line * wide(1.0 / forces.length[:, None], force) * across
    if len(k := forces.twice):
        torque[k] += 0.5 * wide(forces.normal[k], torque) * dot(_coupled(forces, r[k, 3:]), s[k, 3:])
    follower = forces.follower
    force[follower] = 0.0
    if not same:
        turned = 0.5 * cross(r[:, 3:], s[:, 3:])
        torque[forces.dead] += turned[forces.dead]
        torque[follower] = -turned[follower]
        r, s = r[follower], s[follower]
        force[follower] = 0.5 * (cross(s[:, 3:], r[:, :3]) - cross(r[:, 3:], s[:, :3]))
    return np.concatenate((force, torque), axis=1)


def point_slopes(forces: Forces, x: tuple[Field, Field], y: tuple[Field, Field] | None) -> tuple[Field, Field]:
    """Return the derivatives of H(x, y) to the points of forces and to the starts of lines, (n, 3, ...) each, while
    bodies move and are loaded as they are. None: y = x.
    """
    if y is None:
        point, y = 2.0 * _levers(motion_slopes(forces, x), x), x
    else:
        point = _levers(motion_slopes(forces, x, -1), y) + _levers(motion_slopes(forces, y, 1), x)
    r, s = x[1][:, :3], y[1][:, :3]
    line = wide(forces.line, point)
    tension_over_length = wide(forces.tension_over_length[:, None], point)
    inverse = wide(1.0 / forces.length[:, None], point)
    along, along_other = dot(line, r), dot(line, s)
    turned = r * along_other + s * along
    turned = turned - line * dot(line, turned)
    stretched = -tension_over_length * inverse * (turned + line * (dot(r, s) - along * along_other))
    return point + stretched, -stretched


def _levers(slopes: tuple[Field, Field], relative_motions: tuple[Field, Field]) -> Field:
    """What moving the points of forces does to slopes times motions."""
    (on_first, on_both), (first, relative) = slopes, relative_motions
    return np.asarray(cross(on_first[:, :3], first[:, 3:]) + cross(on_both[:, :3], relative[:, 3:]))


def turn_slopes(forces: Forces, x: tuple[Field, Field], y: tuple[Field, Field]) -> Field:
    """Return the derivatives of H(x, y) to turns of joints with two successive rotations, (joints, 3, ...)."""
    k = forces.twice
    r, s = x[1][k, 3:], y[1][k, 3:]
    on_r, on_s = _coupled(forces, s), _coupled(forces, r)
    normal = wide(np.cross(forces.normal[k], forces.wrench[k, 3:]), on_r)
    return np.asarray(0.5 * (normal * dot(on_r, r) - wide(forces.couple, on_r) * (cross(r, on_r) + cross(s, on_s))))


def work_slopes(forces: Forces, left: Field, gap: Field) -> tuple[Field, Field, Field]:
    """Return the derivatives of minus the work of the forces on relative motions ``left`` + ``gap``, to the wrenches
    (n, 6, ...), their points (n, 3, ...) and the starts of lines (n, 3, ...).

    ``left`` (n, 6, ...): what is left of the motions where bodies give way by ``gap``; 0 in joints, which allow it;
    ``gap`` (n, 6, ...): how far bodies give way, see ``wrench_slopes``.
    """
    f, line = wide(forces.wrench[:, :3], left), wide(forces.line, left)
    across = left[:, :3] - line * dot(line, left[:, :3])
    stretched = wide(forces.tension_over_length[:, None], left) * across
    return -left, stretched - cross(f, left[:, 3:] + gap[:, 3:]), -stretched


def _coupled(forces: Forces, turn: Field) -> Field:
    """The derivatives of x_a y_b + x_b y_a to the relative rotation of y, for that of x (joints, 3, ...)."""
    p, q = (wide(pick[forces.twice], turn) for pick in forces.picks)
    return np.asarray(p * dot(q, turn) + q * dot(p, turn))
