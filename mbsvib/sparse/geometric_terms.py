"""Geometric stiffness: the second-order terms of the forces in joints, springs and loads, as signed rows.

With theta the rotations of bodies (coordinates of the exponential map), (f, tau) a wrench on the second body b and its
opposite on the first body a, arms r from the centres of mass, and (d, delta) the displacement of b relative to a at the
point:

1. Forces at arms give their body 1/2 theta . (tr(S) 1 - sym S) theta with S = sum of f r^T over all forces on it: one
   symmetric form for each body, six signed rows.
2. Joints and preloaded bushings, whose forces turn with the first body, add theta_a . (d x f + 1/2 delta x tau).
   In joints only free directions move, (d, delta) = sum of q (v, w): the product of q with one rotation of a.
   Two rotations about the axes e, e' that are successive (``parts.joint``) add 1/2 tau . (e x e') q q'.
3. Line springs and rods of tension F and length L add F / (2 L) times the squared relative displacement of their ends
   across the line.

The rows and their weights are the same for dense and for sparse equations.

Source: second derivatives of the Lagrangian V + lambda . phi in coordinates of the exponential map, for which see
Geradin & Cardona, Flexible Multibody Dynamics (2001).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.contribution import Contribution, Weights, rotation_rows
from mbsvib.elements.rows import Rows
from mbsvib.linalg.rank import ZERO_FORM
from mbsvib.linalg.rotations import skew

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.second_order_rows import SecondOrderRows
    from mbsvib.equations.wrench_pairs import WrenchPairs
    from mbsvib.equations.wrenches import AppliedWrenches

_DIAGONAL = np.arange(3)
# Factors of forces and of torques in v x f + 1/2 w x tau
_FACTORS = np.array((1.0, 0.5)).reshape(2, 1, 1)
# Six rotations (x, y, z, x + y, x + z, y + z), and coefficients of S_ij in the weights of their squares.
SUMS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]], dtype=float)
SQUARES = np.array([
    [0, 0.5, 0.5, 0.5, 1, 0, 0.5, 0, 1], [1, 0.5, 0, 0.5, 0, 0.5, 0, 0.5, 1], [1, 0, 0.5, 0, 1, 0.5, 0.5, 0.5, 0],
    [0, -0.5, 0, -0.5, 0, 0, 0, 0, 0], [0, 0, -0.5, 0, 0, 0, -0.5, 0, 0], [0, 0, 0, 0, 0, -0.5, 0, -0.5, 0],
])  # fmt: skip


def forms(pairs: WrenchPairs, position: Array) -> tuple[Array, Array]:
    """Return tr(S) 1 - sym(S) with S = force arm^T, by the rotation of the first body and by that of the second.

    ``position`` (3, bodies + 1): centres of mass [m]. Returns ``first, second`` (3, 3, n): second derivatives [N m].
    """
    result = []
    for arm, sign in zip(pairs.arms(position), (-1.0, 1.0), strict=True):
        half = (-0.5 * sign) * pairs.force[:, None] * arm
        form = half + half.swapaxes(0, 1)
        form[_DIAGONAL, _DIAGONAL] -= 2.0 * np.einsum("iin->n", half)
        result.append(form)
    return result[0], result[1]


@dataclass(frozen=True, slots=True)
class GeometricTerms:
    """The part of geometric stiffness that does not depend on the size of forces: rows and their products.

    ``rows`` and ``row`` are those of a contribution; ``first``, ``second`` and ``owner`` are its weights: six squares
    for each of ``bodies`` that a force acts on, products of the displacements ``on_bodies`` (whose first body is not
    ground) with rotations, products of two successive rotations, squares across lines. The forces of pairs ``ends``
    (e,), sorted by body with the first of each at ``start`` (bodies,), act at ``arms`` (3, e) with ``sign``, which is 0
    for follower loads (see ``load_stiffness``). ``twist`` (k, 3, 6) times a wrench is the moment of the rows
    ``moment_rows`` (k,), v x f + 1/2 w x tau.
    """

    second_order: SecondOrderRows
    rows: Rows
    row: Index
    first: Index
    second: Index
    owner: Index
    bodies: Index
    ends: Index
    start: Index
    arms: Array
    sign: Array
    on_bodies: Index
    twist: Array
    moment_rows: slice

    def contribution(self, force: Array, torque: Array) -> Contribution:
        """Return the geometric stiffness of forces.

        ``force``, ``torque`` (3, pairs): wrenches on the second bodies of all pairs [N, N m].
        """
        second_order = self.second_order
        moment = self.rows.moment.copy()
        owner = second_order.owner[self.on_bodies]
        wrench = np.concatenate((force, torque)).take(owner, axis=1)
        moment[:, self.moment_rows] = (self.twist @ wrench.T[:, :, None])[:, :, 0].T
        half = 0.5 * (torque.take(second_order.successive[0], axis=1) * second_order.cross).sum(axis=0)
        tension = -(force.take(second_order.line_owner, axis=1) * second_order.line).sum(axis=0) / second_order.length
        value = np.concatenate((self._of_bodies(force), np.ones(len(self.on_bodies)), half, tension))
        rows = Rows(self.rows.first, self.rows.second, self.rows.point, self.rows.force, moment)
        return Contribution.of(rows, row=self.row, stiffness=Weights(self.first, self.second, value, self.owner))

    def _of_bodies(self, force: Array) -> Array:
        """Weights of the squares of six rotations of each body: about x, y, z, and the sums of two of these.

        With H = tr(S) 1 - sym S, theta . H theta = sum of H_xy (theta_x + theta_y)^2 and of the rest times theta_x^2.
        """
        if not len(self.bodies):
            return np.zeros(0)
        force_at = force.take(self.ends, axis=1) * self.sign
        products = (force_at[:, None] * self.arms).reshape(9, -1)
        values = np.add.reduceat(products, self.start, axis=1).T.dot(SQUARES.T)
        bound = np.maximum.reduce(np.add.reduceat(np.abs(products), self.start, axis=1))
        values[np.abs(values) <= ZERO_FORM * bound[:, None]] = 0.0
        return np.asarray(values.reshape(-1))


def geometric_terms(
    pairs: WrenchPairs, applied: AppliedWrenches, second_order: SecondOrderRows, position: Array
) -> GeometricTerms:
    """Return the rows of geometric stiffness of all forces at the pose.

    ``pairs``: the applied wrenches, then those in joints; their sizes are not used. ``position`` (3, bodies + 1):
    centres of mass [m]. Owners are numbers of pairs, then of bodies.
    """
    ground, count, displacements = position.shape[1] - 1, len(pairs.first), len(second_order.owner)
    ends = np.concatenate((pairs.first, pairs.second))
    sign = np.concatenate((-np.ones(count), np.ones(count)))
    sign.reshape(2, count)[:, : applied.loads][:, applied.follower] = 0.0
    order = np.argsort(ends, kind="stable")[: np.count_nonzero(ends < ground)]  # ground is the last
    bodies, first_end = np.unique(ends[order], return_index=True)
    squares, on_bodies = 6 * len(bodies), np.flatnonzero(second_order.carrier < ground)
    swinging, lines = np.flatnonzero(second_order.line_carrier < ground), len(second_order.line_owner)
    sum_rows = rotation_rows(bodies.repeat(6), np.tile(SUMS.T, len(bodies)), ground)
    moment_rows = rotation_rows(second_order.carrier[on_bodies], np.zeros((3, len(on_bodies))), ground)
    swing_rows = rotation_rows(second_order.line_carrier[swinging], second_order.swing[:, swinging], ground)
    # rows: rotations of bodies, second-order displacements, rows across lines (to which swings add), moments
    first_across = squares + displacements
    start = first_across + lines
    number, across = np.arange(squares), first_across + np.arange(lines)
    successive = second_order.successive
    halved = second_order.twist[:, on_bodies].reshape(2, 3, -1) * _FACTORS
    return GeometricTerms(
        second_order, Rows.join([sum_rows, second_order.rows, moment_rows, swing_rows]),
        np.concatenate((np.arange(start + len(on_bodies)), first_across + swinging)),
        np.concatenate((number, squares + on_bodies, squares + successive[1], across)),
        np.concatenate((number, start + np.arange(len(on_bodies)), squares + successive[2], across)),
        np.concatenate((count + bodies.repeat(6), second_order.owner[on_bodies], successive[0],
                        second_order.line_owner)),
        bodies, order % count if count else order, first_end, np.concatenate(pairs.arms(position), axis=1)[:, order],
        sign[order], on_bodies,
        skew(halved.transpose(2, 0, 1)).swapaxes(1, 2).reshape(-1, 3, 6), slice(start, start + len(on_bodies)),
    )  # fmt: skip
