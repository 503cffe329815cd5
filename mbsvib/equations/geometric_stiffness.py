"""Geometric stiffness: the second-order terms of the forces in joints, springs and loads, as signed rows.

With theta the rotations of bodies (coordinates of the exponential map), (f, tau) a wrench on the second body b and its
opposite on the first body a, arms r from the centres of mass, and (d, delta) what b does relative to a at the point:

1. Each force at an arm, whoever exerts it, gives its body 1/2 theta . (tr(S) 1 - sym S) theta with S = sum of f r^T:
   one symmetric form for each body, three signed rows.
2. Joints and preloaded bushings, whose forces turn with the first body, add theta_a . (d x f + 1/2 delta x tau).
   In joints only free directions move, (d, delta) = sum of q (v, w): the product of q with one rotation of a.
   Two rotations about the axes e, e' that are successive (``parts.joint``) add 1/2 tau . (e x e') q q'.
3. Line springs and rods of tension F and length L add F / (2 L) times the square of what their ends move across them.

The rows and their weights are the same for dense and for sparse equations.

Source: second derivatives of the Lagrangian V + lambda . phi in coordinates of the exponential map, for which see
Geradin & Cardona, Flexible Multibody Dynamics (2001).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements.contribution import Contribution, Weights, turns
from mbsvib.elements.rows import Rows
from mbsvib.linalg.rank import ZERO_FORM
from mbsvib.linalg.rotations import skew

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index
    from mbsvib.equations.second_order_rows import Felt
    from mbsvib.equations.wrench_pairs import Pairs
    from mbsvib.equations.wrenches import Applied

_DIAGONAL = np.arange(3)
# what forces and what torques are multiplied with: v x f + 1/2 w x tau
_PARTS = np.array((1.0, 0.5)).reshape(2, 1, 1)
# Six rotations (x, y, z, x + y, x + z, y + z), and what each of their squares gets of S_ij, in the order of S's rows.
SUMS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1]], dtype=float)
SQUARES = np.array([
    [0, 0.5, 0.5, 0.5, 1, 0, 0.5, 0, 1], [1, 0.5, 0, 0.5, 0, 0.5, 0, 0.5, 1], [1, 0, 0.5, 0, 1, 0.5, 0.5, 0.5, 0],
    [0, -0.5, 0, -0.5, 0, 0, 0, 0, 0], [0, 0, -0.5, 0, 0, 0, -0.5, 0, 0], [0, 0, 0, 0, 0, -0.5, 0, -0.5, 0],
])  # fmt: skip


def forms(pairs: Pairs, position: Array) -> tuple[Array, Array]:
    """Return tr(S) 1 - sym(S) with S = force arm^T, by the rotation of the first body and by that of the second.

    Parameters
    ----------
    pairs : Pairs
        Forces between bodies.
    position : array, shape (3, bodies + 1)
        Centres of mass [m].

    Returns
    -------
    first, second : array, shape (3, 3, n)
        Second derivatives [N m].
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
    """Geometric stiffness as far as it does not depend on the size of forces: which rows there are, and their products.

    ``rows`` and ``row`` are those of a contribution; ``first``, ``second`` and ``owner`` are its weights: six squares
    for each of ``bodies`` that a force acts on, products of ``turning`` rows with rotations, products of two successive
    rotations, squares across lines. The forces of pairs ``ends`` (e,), one body after the other and for each from
    ``start`` (bodies,) on, act at ``arms`` (3, e) with ``sign``, which is 0 for follower loads: ``load_stiffness`` has
    these. ``twist`` (k, 3, 6) times a wrench is the moment of the
    rows ``lever`` (k,), v x f + 1/2 w x tau.
    """

    felt: Felt
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
    turning: Index
    twist: Array
    lever: slice

    def contribution(self, force: Array, torque: Array) -> Contribution:
        """Return the geometric stiffness of forces.

        Parameters
        ----------
        force, torque : array, shape (3, pairs)
            Wrenches on the second bodies of all pairs [N, N m].

        Returns
        -------
        Contribution
            Rows and their weights.
        """
        felt = self.felt
        moment = self.rows.moment.copy()
        owner = felt.owner[self.turning]
        wrench = np.concatenate((force, torque)).take(owner, axis=1)
        moment[:, self.lever] = (self.twist @ wrench.T[:, :, None])[:, :, 0].T
        half = 0.5 * (torque.take(felt.two[0], axis=1) * felt.cross).sum(axis=0)
        tension = -(force.take(felt.line_owner, axis=1) * felt.line).sum(axis=0) / felt.length
        value = np.concatenate((self._of_bodies(force), np.ones(len(self.turning)), half, tension))
        rows = Rows(self.rows.first, self.rows.second, self.rows.point, self.rows.force, moment)
        return Contribution.of(rows, row=self.row, stiffness=Weights(self.first, self.second, value, self.owner))

    def _of_bodies(self, force: Array) -> Array:
        """Weights of the squares of six rotations of each body: about x, y, z, and the sums of two of these.

        With H = tr(S) 1 - sym S, theta . H theta = sum of H_xy (theta_x + theta_y)^2 and of the rest times theta_x^2.
        """
        if not len(self.bodies):
            return np.zeros(0)
        acting = force.take(self.ends, axis=1) * self.sign
        outer = (acting[:, None] * self.arms).reshape(9, -1)
        values = np.add.reduceat(outer, self.start, axis=1).T.dot(SQUARES.T)
        bound = np.maximum.reduce(np.add.reduceat(np.abs(outer), self.start, axis=1))
        values[np.abs(values) <= ZERO_FORM * bound[:, None]] = 0.0
        return np.asarray(values.reshape(-1))


def geometric_terms(pairs: Pairs, applied: Applied, felt: Felt, position: Array) -> GeometricTerms:
    """Return the rows of geometric stiffness of all forces at the pose.

    Parameters
    ----------
    pairs : Pairs
        Where all forces act: the applied ones, then those in joints.
    applied : Applied
        What loads the mechanism.
    felt : Felt
        The relative displacements that forces feel.
    position : array, shape (3, bodies + 1)
        Centres of mass [m].

    Returns
    -------
    GeometricTerms
        Rows and products; owners are numbers of pairs, and behind them of bodies.
    """
    ground, count, free = position.shape[1] - 1, len(pairs.first), len(felt.owner)
    ends = np.concatenate((pairs.first, pairs.second))
    sign = np.concatenate((-np.ones(count), np.ones(count)))
    sign.reshape(2, count)[:, : applied.loads][:, applied.follower] = 0.0
    order = np.argsort(ends, kind="stable")[: np.count_nonzero(ends < ground)]  # ground is the last
    bodies, start_of = np.unique(ends[order], return_index=True)
    six, turning = 6 * len(bodies), np.flatnonzero(felt.carrier < ground)
    swings, lines = np.flatnonzero(felt.line_carrier < ground), len(felt.line_owner)
    of_bodies = turns(bodies.repeat(6), np.tile(SUMS.T, len(bodies)), ground)
    levers = turns(felt.carrier[turning], np.zeros((3, len(turning))), ground)
    swung = turns(felt.line_carrier[swings], felt.swing[:, swings], ground)
    start = six + free + lines  # rows: of bodies, those that are felt, levers; swings add to rows across lines
    number = np.arange(six)
    across = six + free + np.arange(lines)
    parts = felt.twist[:, turning].reshape(2, 3, -1) * _PARTS
    return GeometricTerms(
        felt, Rows.join([of_bodies, felt.rows, levers, swung]),
        np.concatenate((np.arange(start + len(turning)), six + free + swings)),
        np.concatenate((number, six + turning, six + felt.two[1], across)),
        np.concatenate((number, start + np.arange(len(turning)), six + felt.two[2], across)),
        np.concatenate((count + bodies.repeat(6), felt.owner[turning], felt.two[0], felt.line_owner)),
        bodies, order % count if count else order, start_of, np.concatenate(pairs.arms(position), axis=1)[:, order],
        sign[order], turning,
        skew(parts.transpose(2, 0, 1)).swapaxes(1, 2).reshape(-1, 3, 6), slice(start, start + len(turning)),
    )  # fmt: skip
